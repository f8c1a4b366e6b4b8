"""Positions as a domain: a motion as the places of its points, markers that name their skeleton.

Part of the joint between motion, codec and container (see ``file.py``). SPEC.md, "Kinematics", has
the points, and "Positions" there what a clip of them says. The way back is in
``conversion/solved.py``.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.base import Codec
from mcz.container.writer import Writer
from mcz.errors import MotionError
from mcz.files.encoding import write_skeleton
from mcz.kinematics import point_names, point_set, points_and_markers_of, positions_of
from mcz.motion import POSITION_KINDS, Channel, Joint, Motion, Signal, Skeleton

Floats = NDArray[np.float64]

NOTE = "positions by forward kinematics"  # begins the source-note of what was computed
SEPARATOR = "; "


def wants_positions(codec: Codec, options: Mapping[str, Any], skeleton: Skeleton) -> bool:
    """Whether a codec is to be given the places of points instead of the channels of a clip."""
    if not codec.places or options.get("domain") == "channels" or not skeleton.joints:
        return False
    return point_set(skeleton) != "markers"


def as_codec_wants(
    writer: Writer, motion: Motion, codec: Codec, options: Mapping[str, Any]
) -> Motion:
    """``motion``, or the places of its points where that is what the codec codes."""
    if not wants_positions(codec, options, motion.skeleton):
        return motion
    return as_domain(writer, motion, bool(options.get("virtual_markers")))


def as_domain(writer: Writer, motion: Motion, virtual_markers: bool = False) -> Motion:
    """``in_positions(motion)``, whose base is the skeleton of ``motion``, which is written first.

    A motion of markers is returned as it is. Raises as ``in_positions`` does.
    """
    made = in_positions(motion, virtual_markers=virtual_markers)
    if made is motion:
        return motion
    base = write_skeleton(writer, motion.skeleton)
    return replace(made, skeleton=replace(made.skeleton, base=base))


def in_positions(motion: Motion, *, virtual_markers: bool = False) -> Motion:
    """``motion`` as markers at its points; with ``virtual_markers`` three more for every joint.

    The markers are in the length unit and up axis of the skeleton, ``skeleton.base`` is left to
    whoever writes it (see ``as_domain``), and there is no source, for it could not be restored. A
    place that is not known is 0 under a mask. A motion of markers is returned as it is.

    Raises MotionError where the skeleton has no kinematics, OptionError for virtual markers where
    its length unit is unknown.
    """
    skeleton, first = motion.skeleton, motion.signals[0]
    if point_set(skeleton) == "markers":
        return motion
    if first.channels is not None:
        raise MotionError(f"motion {motion.name!r}: its channels are not those of its skeleton")
    channels = np.asarray(motion.values, np.float64)
    values = places_of(skeleton, channels, virtual_markers=virtual_markers)
    valid = ~np.isnan(values)
    signal = Signal(
        np.where(valid, values, 0.0),
        name=first.name,
        samples_per_frame=first.samples_per_frame,
        mask=None if valid.all() else valid,
    )
    return replace(
        motion,
        skeleton=marker_skeleton(skeleton, virtual_markers=virtual_markers),
        signals=(signal, *motion.signals[1:]),
        metadata=dict(motion.metadata) | {"source-note": _note(motion)},
        source=None,
    )


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
        base=base,
    )


def places_of(skeleton: Skeleton, values: Floats, *, virtual_markers: bool = False) -> Floats:
    """The values of ``marker_skeleton``, (n_frames, n_channels), NaN where a place is unknown.

    ``values`` are those of ``skeleton``, (n_frames, its channels). Raises as ``in_positions`` does.
    """
    if virtual_markers:
        places = np.concatenate(points_and_markers_of(skeleton, values), axis=1)
    else:
        places = positions_of(skeleton, values)
    return places.reshape(len(places), 3 * places.shape[1])


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
