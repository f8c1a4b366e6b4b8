"""The browser of the user, where there is one."""

from __future__ import annotations

import os
import sys


def show(url: str) -> bool:
    """Open ``url`` in the browser; False where there is none, or only one within the terminal."""
    import webbrowser

    graphic = ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER")
    if sys.platform.startswith("linux") and not any(os.environ.get(name) for name in graphic):
        return False
    try:
        return webbrowser.open(url)
    except webbrowser.Error:
        return False
