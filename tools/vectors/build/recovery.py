"""Files with recovery data, as our writer makes them."""

from __future__ import annotations

import tempfile
from pathlib import Path

from mcz.files.editing.archive import append
from mcz.files.editing.recovering import protect


def protect_file(data: bytes, redundancy: float, behind: bytes = b"") -> bytes:
    """The file of ``data`` with a RECV; ``behind``, another file, appended, gets its own."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "protected.mcz"
        path.write_bytes(data)
        protect(path, redundancy)
        if behind:
            other = path.with_name("behind.mcz")
            other.write_bytes(behind)
            append([other], path)
        return path.read_bytes()
