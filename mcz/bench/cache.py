"""Results kept by what they depend on, so that a rerun does not measure again."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import sys
import tempfile
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import Any

import mcz

# Of this part; of cli/ no measured figure depends on any file.
MEASURING = ("cases.py", "ladder.py", "measure.py", "peers.py", "tasks.py")


def default_folder() -> Path:
    """Below the user's cache folder; RuntimeError where there is no home."""
    home = Path.home()
    if sys.platform == "win32":
        base = os.environ.get("LOCALAPPDATA") or str(home / "AppData" / "Local")
    elif sys.platform == "darwin":
        base = str(home / "Library" / "Caches")
    else:
        base = os.environ.get("XDG_CACHE_HOME") or str(home / ".cache")
    return Path(base) / "mcz" / "bench"


@cache
def code_digest() -> str:
    """Digest of every file of the package that a figure may depend on."""
    folder = Path(mcz.__file__).parent
    digest = hashlib.sha256(mcz.__version__.encode())
    for path in sorted([*folder.rglob("*.py"), *folder.rglob("*.json"), *folder.rglob("*.bin")]):
        part = path.relative_to(folder).parts[0]
        if part not in ("bench", "cli") or (part == "bench" and path.name in MEASURING):
            digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()


class Cache:
    """Results as JSON files named by the hash of their key; without a folder nothing is kept.

    ``code`` are files that results depend on beside those of the package.
    """

    def __init__(self, folder: Path | None, code: Iterable[Path] = ()) -> None:
        self.folder = folder
        digest = hashlib.sha256()
        for path in sorted(code):
            digest.update(path.name.encode() + path.read_bytes())
        self._code = digest.hexdigest()

    def _path(self, key: str) -> Path:
        assert self.folder is not None
        name = hashlib.sha256(f"{code_digest()} {self._code} {key}".encode()).hexdigest()
        return self.folder / name[:2] / f"{name}.json"

    def get(self, key: str) -> Any:
        """Return the entry of ``key``, None if absent or unreadable."""
        if self.folder is None:
            return None
        try:
            held = json.loads(self._path(key).read_text("utf-8"))
        except (OSError, ValueError):
            return None
        return held.get("result") if isinstance(held, dict) else None

    def put(self, key: str, result: object) -> None:
        """Keep ``result``; a folder that takes nothing is no error."""
        if self.folder is None:
            return
        path = self._path(key)
        with contextlib.suppress(OSError):
            path.parent.mkdir(parents=True, exist_ok=True)
            with tempfile.NamedTemporaryFile("w", dir=path.parent, delete=False) as stream:
                json.dump({"key": key, "result": result}, stream)
            os.replace(stream.name, path)
