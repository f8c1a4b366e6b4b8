"""Display of motions in notebooks: the one call from a lower layer to a higher one.

By its name, and only when somebody asks: a Motion knows nothing of pages.
"""

from __future__ import annotations

from importlib import import_module


def html_of(moving: object) -> str:
    """A small player of a Motion or Clip: HTML of at most 300 kB, see ``mcz.viewing.player``."""
    text: str = import_module("mcz.viewing.player").player(moving)
    return text
