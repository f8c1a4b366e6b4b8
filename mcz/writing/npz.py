"""``to_npz``: a motion as arrays that NumPy alone can read."""

from __future__ import annotations

from mcz.motion import Motion
from mcz.tables.files import table_of
from mcz.tables.files import to_npz as npz_of
from mcz.types import Target
from mcz.writing.atomic import replacing


def to_npz(motion: Motion, target: Target, *, force: bool = False) -> None:
    """Write channels, skeleton, rotations and positions of ``motion`` as an NPZ without pickles.

    docs/tables.md lists the arrays; "about" in the file says in words how they hang together.
    ``target`` is a path, an fsspec target or a binary stream. Raises ExistsError where it exists
    and not ``force``, and AccessError.
    """
    data = npz_of(table_of(motion))
    with replacing(target, force=force) as stream:
        stream.write(data)
