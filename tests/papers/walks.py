"""The generated walk under names of the papers' clips."""

from __future__ import annotations

import shutil
from pathlib import Path


def put_walk(samples: Path, folder: Path, name: str, n_frames: int) -> None:
    """The first frames of the walk as ``name``.amc, beside the skeleton of its subject."""
    subject = name.partition("_")[0]
    shutil.copy(samples / "walk.asf", folder / f"{subject}.asf")
    text = (samples / "walk.amc").read_bytes()
    end = text.index(b"\n%d" % (n_frames + 1) + (b"\r\n" if b"\r\n" in text else b"\n")) + 1
    (folder / f"{name}.amc").write_bytes(text[:end])
