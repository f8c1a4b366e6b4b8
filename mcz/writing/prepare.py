"""Preparation of a motion for its codec: its channels, or the positions of its points."""

from __future__ import annotations

from dataclasses import dataclass

from mcz.codecs.contract import Codec
from mcz.errors import OptionError
from mcz.kinematics import point_set
from mcz.kinematics.marker_motion import in_positions
from mcz.kinematics.rest import NO_LENGTHS, has_no_lengths
from mcz.motion import Motion, Skeleton
from mcz.types import Params
from mcz.units import axes_of


@dataclass(frozen=True, slots=True)
class StoredSkeleton:
    """A skeleton that a file stores.

    Where it ``derives``, its base is the one before it. ``path`` names its own file, which the MCZ
    file restores; empty: it restores none.
    """

    skeleton: Skeleton
    derives: bool = False
    path: str = ""


@dataclass(frozen=True, slots=True)
class Prepared:
    """A motion as a codec takes it, and the skeletons that are stored before its own.

    Where its skeleton ``derives``, its base is the last of ``bases``.
    """

    motion: Motion
    bases: tuple[StoredSkeleton, ...] = ()
    derives: bool = False


def prepare(
    motion: Motion,
    codec: Codec,
    params: Params,
    bases: tuple[StoredSkeleton, ...] = (),
    *,
    derives: bool = False,
) -> Prepared:
    """``motion``, or the positions of its points where ``codec`` codes those.

    ``bases`` and ``derives`` are those of ``Prepared``, of the skeleton as it is given. Raises
    OptionError where positions have no meaning, MotionError where there are none.
    """
    options, own = codec.options(params), motion.skeleton
    if not wants_positions(codec, options, motion.skeleton):
        return Prepared(motion, bases, derives)
    check_bones(motion.skeleton, f"codec {codec.name}, of positions,")
    made = in_positions(motion, virtual_markers=bool(options.get("virtual_markers")))
    if made is motion:
        return Prepared(motion, bases, derives)
    return Prepared(made, (*bases, StoredSkeleton(own, derives)), derives=True)


def read_with(skeleton: Skeleton, base: Skeleton | None) -> tuple[tuple[StoredSkeleton, ...], bool]:
    """The fields ``bases`` and ``derives`` of a skeleton that was read with ``base``, if any."""
    if base is None:
        return (), False
    return (under_its_path(base),), derived_from(skeleton, base)


def derived_from(skeleton: Skeleton, base: Skeleton) -> bool:
    """Whether a skeleton read with ``base`` differs from it, whose file stays as it is."""
    return skeleton.base is not None or axes_of(skeleton) != axes_of(base)


def under_its_path(skeleton: Skeleton) -> StoredSkeleton:
    """``skeleton``, stored with the path of its own file where it has one."""
    path = skeleton.source.path if skeleton.source is not None else ""
    return StoredSkeleton(skeleton, path=path)


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
