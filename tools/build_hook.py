"""Build hook of hatchling: checks for the page of ``mcz view`` and compiles kernels.

The page has to be built before; a build without it fails, but for ``MCZ_BUILD_WITHOUT_VIEWER=1``.

``MCZ_BUILD`` says how kernels are built: ``compiled``, ``checked`` and ``sanitized`` as
``mcz.kernels`` has them, and the build fails where that cannot be done; ``interpreted``, not at
all. By default they are compiled, by the compiler of Zig where there is no other, and left out
where none can be had: the package then works, and says how slow it is. An editable installation
has them in the tree; a wheel is built without writing there, if the tree is read only.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

PAGE = "tools/viewer/dist/viewer.html"
PLACES = {"wheel": "mcz/show/viewing/viewer.html", "sdist": PAGE}
WITHOUT = "MCZ_BUILD_WITHOUT_VIEWER"
MODES = ("compiled", "checked", "sanitized", "interpreted")
MODE = os.environ.get("MCZ_BUILD", "")
if MODE and MODE not in MODES:
    raise SystemExit(f"MCZ_BUILD={MODE}: one of {', '.join(MODES)}")
SLOW = "kernels are not compiled and run 50 to 500 times slower"


class Hook(BuildHookInterface):  # type: ignore[type-arg]
    temporary: tempfile.TemporaryDirectory[str] | None = None

    def dependencies(self) -> list[str]:
        """Zig, where there is no compiler and Zig can be fetched."""
        if self.target_name != "wheel" or MODE == "interpreted":
            return []
        compiling = self._import_compiling()
        if compiling.compiler() or not compiling.has_headers():
            return []
        return ["ziglang>=0.13"] if MODE or can_fetch("ziglang") else []

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Add the page and the kernels. Raises SystemExit without the page."""
        if version != "editable" and not os.environ.get(WITHOUT):
            if not Path(self.root, PAGE).is_file():
                raise SystemExit(
                    f"{PAGE} is not built: (cd tools/viewer && npm ci && npm run build), "
                    f"or set {WITHOUT}=1 to leave the viewer out"
                )
            build_data["force_include"][PAGE] = PLACES[self.target_name]
        if self.target_name == "wheel" and MODE != "interpreted":
            self._add_kernels(version, build_data)

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Remove what is in the wheel by now."""
        if self.temporary:
            self.temporary.cleanup()

    def _add_kernels(self, version: str, build_data: dict[str, Any]) -> None:
        mode = MODE or "compiled"
        inside = f"mcz/kernels/{mode}"
        compiling = self._import_compiling()
        folder, kept = Path(self.root, inside), compiling.KEPT
        if version != "editable":
            self.temporary = tempfile.TemporaryDirectory()
            folder = Path(self.temporary.name, "made")
            kept = kept if os.access(self.root, os.W_OK) else Path(self.temporary.name, "kept")
        try:
            made = compiling.build(folder, mode, kept=kept)
        except (OSError, subprocess.CalledProcessError) as fault:
            if MODE:
                raise
            self.app.display_warning(f"{SLOW}: {fault}")
            return
        build_data["pure_python"], build_data["infer_tag"] = False, True
        if version != "editable":
            build_data["force_include"].update({str(p): f"{inside}/{p.name}" for p in made})

    def _import_compiling(self) -> Any:
        if self.root not in sys.path:
            sys.path.insert(0, self.root)
        from tools.kernels import compiling

        return compiling


def can_fetch(name: str) -> bool:
    """True if pip finds a package or is not the installer; installs nothing."""
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}  # pip's own is outside
    pip = [sys.executable, "-m", "pip"]
    asked = ["index", "versions", name, "--retries", "1", "--timeout", "15"]

    def succeeds(*words: str) -> bool:
        words = (*pip, *words)
        done = subprocess.run(words, env=environment, capture_output=True, timeout=60, check=False)
        return done.returncode == 0

    try:
        return not succeeds("--version") or succeeds(*asked)
    except (OSError, subprocess.TimeoutExpired):
        return False
