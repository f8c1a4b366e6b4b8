"""From places back to channels: what inverse kinematics makes of places, exact and coded."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

import mcz
from mcz.bench.cases import Case, load
from mcz.bench.measure import Record, coded_part, write_file
from mcz.errors import MotionError
from mcz.exchange.conversion import from_positions
from mcz.files.reading.sizes import clip_sizes
from mcz.kinematics.chain import chain_of
from mcz.kinematics.points import in_positions
from mcz.model.motion import ROTATION_KINDS, Motion, Skeleton

Floats = NDArray[np.float64]

CODEC = "lsdt-clip"


def way_back(case: Case, step_cm: float | None, virtual_markers: bool) -> Record:
    """Errors of angles and points of the way there and back; ``step_cm`` None: nothing is coded.

    Raises MotionError where the length unit or the angle unit is unknown.
    """
    motion = coded_part(load(case).motion, CODEC)
    unit = motion.skeleton.unit_cm
    if unit is None:
        raise MotionError(f"{case.name}: its length unit is unknown")
    coded: dict[str, Any] = {"coded_bytes": None}
    places = in_positions(motion, virtual_markers=virtual_markers)
    seen = places
    if step_cm is not None:
        data = write_file(places, CODEC, {"step": step_cm / unit})
        with mcz.open(data, max_decoded=2**53) as file:
            clip = file.only_clip()
            sizes, seen = clip_sizes(file.container, clip), clip.motion()
        coded["coded_bytes"] = sizes.payload + sizes.overhead + sizes.models
    solved, _ = from_positions(seen, motion.skeleton)
    comparison = mcz.compare(motion, solved)
    angles = angle_errors(motion.skeleton, floats_of(motion), floats_of(solved))
    return coded | {
        "seen_cm": _seen_error(places, seen) * unit,
        "cm": comparison.mean_position_error_cm,
        "max_cm": comparison.max_position_error_cm,
        "markers_cm": comparison.virtual_marker_mean_cm,
        "channel_deg": float(np.abs(angles).mean()),
        "turn_deg": _turn_error(motion, solved),
    }


def floats_of(motion: Motion) -> Floats:
    """Values of a motion as binary64."""
    return np.asarray(motion.values, np.float64)


def _seen_error(places: Motion, seen: Motion) -> float:
    """The mean distance of what is fitted from what was there, in length units."""
    apart = mcz.positions(places) - mcz.positions(seen)
    return float(np.nanmean(np.sqrt((apart**2).sum(axis=2))))


def _turn_error(motion: Motion, solved: Motion) -> float:
    """The mean angle between the joints' orientations in the world, in degrees."""
    chain = chain_of(motion.skeleton)
    turning = [i for i, link in enumerate(chain.links) if link.turns]
    sums, count = 0.0, 0
    both = zip(chain.poses(floats_of(motion)), chain.poses(floats_of(solved)), strict=True)
    for (_, _, left), (_, _, right) in both:
        for joint in turning:
            angles = _angles(left.axes[joint], right.axes[joint])
            sums, count = sums + float(angles.sum()), count + angles.size
    return float(np.degrees(sums / max(1, count)))


def _angles(a: Floats, b: Floats) -> Floats:
    """Angles of the rotations from ``a`` to ``b``, (3, 3, F), by chords, exact for small ones."""
    chord = np.sqrt(((a - b) ** 2).sum(axis=(0, 1)))
    angles: Floats = 2 * np.arcsin(np.minimum(1.0, chord / np.sqrt(8.0)))
    return angles


def angle_errors(skeleton: Skeleton, before: Floats, after: Floats) -> Floats:
    """Errors of the rotation channels in degrees, (n_frames, n_rotations), modulo whole turns.

    Where three channels of a joint turn about different axes, of the other three angles that make
    the same turn wherever those are nearer.
    """
    turn = 360.0 if skeleton.angle_unit == "deg" else 2 * np.pi
    errors = [np.zeros((len(before), 0))]
    for index, joint in enumerate(skeleton.joints):
        pairs = zip(joint.channels, skeleton.columns(index), strict=True)
        found = [(channel.kind, c) for channel, c in pairs if channel.kind in ROTATION_KINDS]
        columns = [column for _, column in found]
        error = _modulo(after[:, columns] - before[:, columns], turn)
        if len(found) == 3 and len({kind for kind, _ in found}) == 3:
            other = after[:, columns] * [1, -1, 1] + turn / 2
            other_error = _modulo(other - before[:, columns], turn)
            nearer = (other_error**2).sum(axis=1) < (error**2).sum(axis=1)
            error = np.where(nearer[:, None], other_error, error)
        errors.append(error)
    return np.concatenate(errors, axis=1) * (360.0 / turn)


def _modulo(difference: Floats, turn: float) -> Floats:
    return difference - turn * np.rint(difference / turn)
