"""MCZ in Blender: an add-on that imports and exports ``.mcz``, and imports what MCZ converts.

``clips`` opens files, ``placing`` turns a motion into bones and keys, ``durations`` estimates how
long an export takes (all without Blender);
``armatures``, ``markers`` and ``actions`` make them in Blender; ``recording`` is the way back;
``importing``, ``exporting`` and ``panels`` are what the user sees.
"""

from __future__ import annotations


def register() -> None:
    """Called by Blender when the add-on is enabled."""
    from . import exporting, importing, panels

    for module in (importing, exporting, panels):
        module.register()


def unregister() -> None:
    """Called by Blender when the add-on is disabled."""
    from . import exporting, importing, panels

    for module in (panels, exporting, importing):
        module.unregister()
