"""A motion in the domain that a codec wants: its channels, or the positions of its points."""

from __future__ import annotations

from dataclasses import replace

from mcz.codecs.contract import Codec
from mcz.container.writer import Writer
from mcz.errors import OptionError
from mcz.kinematics import point_set
from mcz.kinematics.marker_motion import in_positions
from mcz.kinematics.rest import NO_LENGTHS, has_no_lengths
from mcz.motion import Motion, Skeleton
from mcz.types import Params
from mcz.writing.clip_writer import write_skeleton


def wants_positions(codec: Codec, options: Params, skeleton: Skeleton) -> bool:
    """Whether a codec is to be given the positions of points instead of the channels of a clip."""
    if not codec.positions or options.get("domain") == "channels" or not skeleton.joints:
        return False
    return point_set(skeleton) != "markers"


def check_bones(skeleton: Skeleton, what: str) -> None:
    """Raise OptionError where rotations move no point, since no bone has a length.

    Arrays of body models are such: ``what`` would then be about the root alone.
    """
    if has_no_lengths(skeleton):
        raise OptionError(
            f"{what} has no meaning: {NO_LENGTHS}, so that rotations move no point; "
            "rest offsets give them one"
        )


def as_codec_wants(writer: Writer, motion: Motion, codec: Codec, options: Params) -> Motion:
    """``motion``, or the positions of its points where that is what the codec codes."""
    if not wants_positions(codec, options, motion.skeleton):
        return motion
    check_bones(motion.skeleton, f"codec {codec.name}, of positions,")
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
