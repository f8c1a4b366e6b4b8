"""The annexes of SPEC.md, which are part of it: tables that codecs start with, well-known bases.

They lie once, in the folder ``annex`` beside this file, to which ``conformance/annex`` is a link.
SPEC.md names each with its SHA-256.
"""

from __future__ import annotations

from pathlib import Path

FOLDER = Path(__file__).parents[1] / "annex"


def annex_bytes(name: str) -> bytes:
    """The annex with this file name."""
    return (FOLDER / name).read_bytes()


def annex_names(pattern: str) -> list[str]:
    """The file names that fit a pattern such as ``bases_*.bin``, sorted."""
    return sorted(path.name for path in FOLDER.glob(pattern))
