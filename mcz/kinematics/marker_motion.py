"""Motions of markers: one marker at each point of a skeleton, for codecs of positions.

SPEC.md, "Kinematics", defines the points; its section "Positions" defines the fields of such a
clip. ``mcz/exchange/conversion/marker_fit.py`` is the inverse.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mcz.errors import MotionError
from mcz.kinematics.points import point_names, point_set, points_and_markers_of, positions_of
from mcz.model.motion import POSITION_KINDS, Channel, Joint, Motion, Signal, Skeleton
from mcz.model.types import Floats

NOTE = "positions by forward kinematics"  # the source-note of a computed motion begins with it
SEPARATOR = "; "


def in_positions(motion: Motion, *, virtual_markers: bool = False) -> Motion:
    """Markers at the points of ``motion``; with ``virtual_markers`` three more for every joint.

    The markers have the length unit and up axis of the skeleton. ``skeleton.base`` is not set: the
    writer sets it. There is no source, since it could not be restored. An unknown position is 0
    under a mask. A motion of markers is returned unchanged.

    Raises MotionError where the skeleton has no kinematics, OptionError for virtual markers where
    its length unit is unknown.
    """
    skeleton, first = motion.skeleton, motion.signals[0]
    if point_set(skeleton) == "markers":
        return motion
    if not first.has_poses:
        raise MotionError(
            "the channels of its motion signal differ from those of its skeleton", clip=motion.name
        )
    values = np.asarray(motion.values, np.float64)
    positions = marker_values(skeleton, values, virtual_markers=virtual_markers)
    valid = ~np.isnan(positions)
    signal = Signal(
        np.where(valid, positions, 0.0),
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

    ``values`` are the values of ``skeleton``, (n_frames, its channels). Raises as ``in_positions``.
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
    note = NOTE if motion.source is None else f"{NOTE} of {motion.source.format.upper()}"
    return SEPARATOR.join(filter(None, [note, motion.metadata.get("source-note")]))


def without_note(motion: Motion) -> dict[str, str]:
    """The metadata of ``motion`` without the note that ``in_positions`` adds."""
    metadata = dict(motion.metadata)
    note = metadata.pop("source-note", "")
    if note.startswith(NOTE):
        note = note.partition(SEPARATOR)[2]
    return metadata | ({"source-note": note} if note else {})
