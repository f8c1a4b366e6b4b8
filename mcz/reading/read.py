"""``mcz.read``: the motion in a file of any format."""

from __future__ import annotations

import os
import warnings
from fractions import Fraction
from pathlib import Path

from mcz.errors import OptionError, SkeletonWarning
from mcz.motion import Motion, Skeleton
from mcz.reading.file import is_mcz, open
from mcz.reading.skeletons import take
from mcz.reading.source_files import load
from mcz.reading.source_options import SourceOptions


def read(
    path: str | os.PathLike[str],
    *,
    skeleton: str | os.PathLike[str] | Skeleton | None = None,
    rate: Fraction | float | None = None,
    unit: str | None = None,
    up: str | None = None,
    arrays: str | None = None,
    model: str | os.PathLike[str] | None = None,
    clip: str | None = None,
    max_decoded: int | None = None,
    threads: int | None = None,
    verify: bool = False,
) -> Motion:
    """The motion in a file of any source format, or in an MCZ file.

    An AMC finds its ASF beside it, or takes ``skeleton``, a path, a Skeleton or "none"; how it was
    found stands in the metadata, and a SkeletonWarning tells of one whose name or dofs do not fit.
    ``rate`` in frames a second, ``unit`` (a key of ``UNIT_CM``) and ``up``, the axis that points up
    ("x" to "-z"), say what the file does not. ``arrays`` says what the numbers of a plain NPY or
    NPZ are: "positions", "rotation-vectors", "quaternions-wxyz" or "quaternions-xyzw". ``model``
    is a model file of SMPL and its kin, which says how long the bones of such a body in an NPZ are
    ("{gender}" and "{body}" in it: those of the take). Of an MCZ file ``clip`` is read, with
    ``max_decoded``, ``threads`` and ``verify`` as in ``open``. Raises SourceError, FormatError or
    OptionError.
    """
    path = Path(path)
    if is_mcz(path):
        with open(path, max_decoded=max_decoded, threads=threads, verify=verify) as file:
            motion = file.only_clip(clip).motion()
    else:
        source_format, data = load(path)
        if source_format.is_skeleton:
            raise OptionError("a skeleton without motion (mcz.read_skeleton reads it)", path=path)
        taken = take(path, skeleton, data=data)
        if taken.remark:
            warnings.warn(f"{path}: {taken.remark}", SkeletonWarning, stacklevel=2)
        motion = taken.motion
    said = SourceOptions(rate=rate, unit=unit, up=up, arrays=arrays, model=model)
    return said.applied_to(motion)
