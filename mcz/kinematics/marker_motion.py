"""Positions as a domain: a motion as the positions of its points, markers that name their skeleton.

SPEC.md, "Kinematics", has the points, and "Positions" there what a clip of them says. The way back
is in ``mcz/exchange/conversion/marker_fit.py``.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from mcz.errors import MotionError
from mcz.kinematics.points import point_names, point_set, points_and_markers_of, positions_of
from mcz.model.motion import POSITION_KINDS, Channel, Joint, Motion, Signal, Skeleton
from mcz.model.types import Floats

NOTE = "positions by forward kinematics"  # begins the source-note of what was computed
SEPARATOR = "; "


def in_positions(motion: Motion, *, virtual_markers: bool = False) -> Motion:
    """``motion`` as markers at its points; with ``virtual_markers`` three more for every joint.

    The markers are in the length unit and up axis of the skeleton, ``skeleton.base`` is left to
    whoever writes it (see ``Prepared``), and there is no source, for it could not be restored. A
    position that is not known is 0 under a mask. A motion of markers is returned as it is.

    Raises MotionError where the skeleton has no kinematics, OptionError for virtual markers where
    its length unit is unknown.
    """
    skeleton, first = motion.skeleton, motion.signals[0]
    if point_set(skeleton) == "markers":
        return motion
    if not first.has_poses:
        raise MotionError("its channels are not those of its skeleton", clip=motion.name)
    channels = np.asarray(motion.values, np.float64)
    values = marker_values(skeleton, channels, virtual_markers=virtual_markers)
    valid = ~np.isnan(values)
    signal = Signal(
        np.where(valid, values, 0.0),
        name=first.name,
        samples_per_frame=first.samples_per_frame,
        mask=None if valid.all() else valid,
    )
    markers = replace(
        motion,
        skeleton=marker_skeleton(skeleton, virtual_markers=virtual_markers),
        signals=(signal, *motion.signals[1:]),
        metadata=dict(motion.metadata) | {"source-note": _note(motion)},
        source=None,
    )
    return markers.at_times(motion.timeline)


def marker_skeleton(
    skeleton: Skeleton, base: bytes | None = None, *, virtual_markers: bool = False
) -> Skeleton:
    """A marker for each point of ``skeleton``, whose id is ``base``, then its virtual markers."""
    names = list(point_names(skeleton))
    if virtual_markers:
        names += virtual_marker_names(skeleton)
    channels = tuple(map(Channel, POSITION_KINDS))
    return Skeleton(
        tuple(Joint(name, channels=channels) for name in names),
        skeleton.name,
        skeleton.unit_cm,
        "",
        skeleton.up_axis,
        skeleton.forward_axis,
        skeleton.handedness,
        base=base,
    )


def marker_values(skeleton: Skeleton, values: Floats, *, virtual_markers: bool = False) -> Floats:
    """The values of ``marker_skeleton``, (n_frames, n_channels), NaN where a position is unknown.

    ``values`` are those of ``skeleton``, (n_frames, its channels). Raises as ``in_positions`` does.
    """
    if virtual_markers:
        positions = np.concatenate(points_and_markers_of(skeleton, values), axis=1)
    else:
        positions = positions_of(skeleton, values)
    return positions.reshape(len(positions), 3 * positions.shape[1])


def virtual_marker_names(skeleton: Skeleton) -> list[str]:
    """The names of the virtual markers of a skeleton, in order: ``JOINT+x``, ``JOINT+y``, ..."""
    return [f"{address}+{axis}" for address in skeleton.addresses() for axis in "xyz"]


def _note(motion: Motion) -> str:
    parts = [NOTE if motion.source is None else f"{NOTE} of {motion.source.format.upper()}"]
    return SEPARATOR.join([*parts, *_notes(motion)])


def _notes(motion: Motion) -> Iterator[str]:
    if note := motion.metadata.get("source-note", ""):
        yield note


def without_note(motion: Motion) -> dict[str, str]:
    """The metadata of ``motion`` before ``in_positions`` spoke in them."""
    metadata = dict(motion.metadata)
    note = metadata.pop("source-note", "")
    if note.startswith(NOTE):
        note = note.partition(SEPARATOR)[2]
    return metadata | ({"source-note": note} if note else {})
