"""Checks which figures of two motions can be compared; differences become notes."""

from __future__ import annotations

import numpy as np

from mcz.errors import MczError, MotionError
from mcz.hints import Hint, Remark
from mcz.kinematics import point_names, point_set, positions_of
from mcz.kinematics.metrics.sums import Number
from mcz.kinematics.rest_pose import NO_LENGTHS, has_no_lengths
from mcz.model.motion import POSITION_KINDS, Motion, Signal, Skeleton
from mcz.model.types import Floats


def frames_text(signal: Signal) -> str:
    rate = signal.samples_per_frame
    return f"{signal.n_frames} frames" + (f" of {rate} rows" if rate > 1 else "")


def common_unit(a: Skeleton, b: Skeleton, notes: list[str]) -> tuple[Number, float]:
    """Unit of distances in cm, and the factor from lengths of ``b`` to it."""
    if a.unit_cm is not None and b.unit_cm is not None:
        return a.unit_cm, b.unit_cm / a.unit_cm
    if a.unit_cm is None and b.unit_cm is None:
        notes.append(Remark("the length unit is unknown: no figures in cm", Hint.UNIT))
    else:
        notes.append(
            Remark(
                "one side does not state its length unit; that of the other is used, "
                "and there are no figures in cm",
                Hint.UNIT,
            )
        )
    return None, 1.0


def _kinds(motion: Motion) -> list[tuple[str, str]]:
    own = motion.signals[0].channels
    return [(c.kind, c.name) for c in (motion.skeleton.channels if own is None else own)]


def same_channels(original: Motion, decoded: Motion, notes: list[str]) -> bool:
    a, b = original.skeleton, decoded.skeleton
    kinds = _kinds(original)
    if kinds != _kinds(decoded):
        notes.append(
            f"other channels ({len(kinds)} and {len(_kinds(decoded))}): no errors of channels"
        )
        return False
    if a.angle_unit != b.angle_unit:
        notes.append(
            f"angles in {a.angle_unit or '?'} and {b.angle_unit or '?'}: no errors of channels"
        )
        return False
    lengths = {*POSITION_KINDS, "length"}
    apart = a.unit_cm is not None and b.unit_cm is not None and a.unit_cm != b.unit_cm
    if apart and any(kind in lengths for kind, _ in kinds):
        notes.append(f"units of {a.unit_cm:.6g} and {b.unit_cm:.6g} cm: no errors of channels")
        return False
    return True


def same_points(original: Motion, decoded: Motion, notes: list[str]) -> bool:
    """Return True if both have kinematics and the same number of points."""
    counts = []
    for motion in (original, decoded):
        signal, skeleton = motion.signals[0], motion.skeleton
        try:
            if not signal.has_poses:
                raise MotionError("its channels differ from those of the skeleton")
            positions_of(skeleton, rows_of(signal, 0, min(1, signal.n_frames)))
            counts.append(len(point_names(skeleton)))
        except MczError as error:
            notes.append(f"no positions of {motion.name!r}: {error}")
            return False
    alike = counts[0] == counts[1] or has_markers_of(original.skeleton, decoded.skeleton)
    if not (alike and counts[0]):
        sets = f"{point_set(original.skeleton)}, {point_set(decoded.skeleton)}"
        notes.append(f"{counts[0]} and {counts[1]} points ({sets}): no errors of positions")
        return False
    without = [m for m in (original, decoded) if has_no_lengths(m.skeleton)]
    if len(without) == 1:
        notes.append(f"{without[0].name!r}: {NO_LENGTHS}, unlike on the other side: no positions")
        return False
    pairs = zip(point_names(original.skeleton), point_names(decoded.skeleton), strict=False)
    apart = [pair for pair in pairs if pair[0] != pair[1]]
    if apart:
        first = " and ".join(map(repr, apart[0]))
        notes.append(
            f"points are compared in order; {len(apart)} of {counts[0]} have other "
            f"names on the other side, first {first}"
        )
    return True


def same_axes(a: Skeleton, b: Skeleton, notes: list[str]) -> bool:
    """Return True if both have the same number of joints with axes: turning ones or markers.

    Also if the other has virtual markers as markers.
    """
    if has_markers_of(a, b):
        return True
    sets = point_set(a), point_set(b)
    if "markers" in sets and sets[0] != sets[1]:
        notes.append(f"points of {sets[0]} and {sets[1]}: no errors of virtual markers and shells")
        return False
    if a.n_joints != b.n_joints:
        counts = f"{a.n_joints} and {b.n_joints} joints"
        notes.append(f"{counts}: no errors of virtual markers and shells")
        return False
    return True


def has_markers_of(a: Skeleton, b: Skeleton) -> bool:
    """Return True if ``b`` has the points of ``a``, then its virtual markers."""
    if point_set(b) != "markers" or point_set(a) == "markers":
        return False
    return b.n_joints == len(point_names(a)) + 3 * a.n_joints


def rows_of(signal: Signal, start: int, stop: int) -> Floats:
    """Frames start <= f < stop as binary64, NaN where invalid."""
    return signal.cut(start, stop).masked().astype(np.float64, copy=False)
