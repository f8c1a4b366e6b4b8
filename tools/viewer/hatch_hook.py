"""Puts the page of ``mcz view`` into a wheel or an sdist, where it was built before.

Without it they are made all the same; ``mcz view`` then says what is missing.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

BUILT = "tools/viewer/dist/viewer.html"
PLACES = {"wheel": "mcz/viewing/viewer.html", "sdist": BUILT}


class PageHook(BuildHookInterface):  # type: ignore[type-arg]
    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Add the page; an editable install finds it where it is."""
        page = Path(self.root, BUILT)
        if version != "editable" and page.is_file():
            build_data["force_include"][str(page)] = PLACES[self.target_name]
