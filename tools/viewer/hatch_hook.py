"""Put the page of ``mcz view`` into wheels and sdists; the build fails where it is not built.

``MCZ_BUILD_WITHOUT_VIEWER=1`` in the environment makes a wheel without it, whose ``mcz view`` opens
the small player.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

BUILT = "tools/viewer/dist/viewer.html"
PLACES = {"wheel": "mcz/viewing/viewer.html", "sdist": BUILT}
WITHOUT = "MCZ_BUILD_WITHOUT_VIEWER"


class PageHook(BuildHookInterface):  # type: ignore[type-arg]
    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Add the page; an editable install finds it where it is. Raise SystemExit without one."""
        page = Path(self.root, BUILT)
        if version == "editable" or os.environ.get(WITHOUT):
            return
        if not page.is_file():
            raise SystemExit(
                f"{BUILT} is not built: (cd tools/viewer && npm ci && npm run build), "
                f"or set {WITHOUT}=1 to leave the viewer out"
            )
        build_data["force_include"][str(page)] = PLACES[self.target_name]
