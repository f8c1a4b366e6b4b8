"""Display of motions in notebooks: the one call from a lower layer to a higher one.

By its name, and only when somebody asks: a Motion knows nothing of pages.
"""

from __future__ import annotations

from importlib import import_module


def html_of(moving: object) -> str:
    """Small player of a Motion or Clip: at most 300 kB of HTML, by ``mcz.show.viewing.player``."""
    text: str = import_module("mcz.show.viewing.player").player(moving)
    return text
