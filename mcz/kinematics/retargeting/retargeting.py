"""A motion on another skeleton: the same turns of joints, on bones of other lengths.

With W a joint's rotation in the world, the identity at rest, each joint of the target has the W of
its counterpart. If its channels cannot, it comes as near as they can, and joints below correct the
rest.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from mcz.errors import MotionError, OptionError
from mcz.kinematics.chain import IDENTITY, Chain, multiply_matrices, to_world
from mcz.kinematics.joint_names import is_foot
from mcz.kinematics.points import origins_of, point_set, reach
from mcz.kinematics.rest_pose import rest_positions
from mcz.kinematics.retargeting.joint_maps import (
    check_channels,
    computed_signal,
    is_moving,
    match_joints,
    nearest_above,
    replace_motion,
)
from mcz.kinematics.retargeting.turns import (
    finite_frames,
    inverse_turns,
    local_turns,
    relative_turns,
    rest_turns,
    set_local_turns,
    usual_alike,
)
from mcz.kinematics.targets import Targets
from mcz.model.checks import check_arguments
from mcz.model.motion import A_MOTION, A_SKELETON, POSITION_KINDS, Motion, Skeleton
from mcz.model.text_format import named
from mcz.model.types import Floats

AUTO = "auto"


@check_arguments(motion=A_MOTION, skeleton=A_SKELETON)
def retarget(
    motion: Motion,
    skeleton: Skeleton,
    joint_map: Mapping[str, str] | None = None,
    *,
    scale: float | None = None,
    match_rest: Collection[str] = AUTO,
) -> Motion:
    """``motion`` on ``skeleton``: its joints turn as the same joints of the motion do.

    ``joint_map`` maps names of the motion's joints to names of ``skeleton``, as ``mcz.joint_map``
    returns them; joints without an entry stay at rest, or are left out. None: the same names.

    Turns are turns from rest. If the rest poses differ, one with arms down and one with arms out,
    the poses would differ too. ``match_rest`` names joints of ``skeleton`` whose bones shall point
    as the motion's do, such as upper arms and forearms; joints below them turn along. "auto": the
    arms and legs of usual skeletons (see ``mcz.joint_map``) that rest otherwise; for other
    skeletons a SkeletonWarning names such bones. (): none.

    The root's path is scaled by ``scale``, in length units of ``skeleton`` per length unit of the
    motion. None: by the length of the legs, from hip to foot, or of all bones if no foot is found
    by name. Position channels of other joints keep their difference from the rest pose, scaled
    alike, if both joints have them; other stretching of bones is left out.

    Values are on a grid of 6 decimals. Frame rate, frame numbers, name, metadata and further
    signals are kept; there is no source.

    Raises OptionError for unknown joints, for two with one counterpart, for one of ``match_rest``
    without a bone, for up axes that differ, for a scale that is not above 0, and if no joint could
    follow the root's path. Raises MotionError if one of the skeletons has no kinematics or
    markers alone.
    """
    check_channels(motion)
    source = motion.skeleton
    _check(source, skeleton)
    pairs = match_joints(source, skeleton, joint_map)
    if match_rest == AUTO:
        match_rest = usual_alike(skeleton, source, pairs)
    elif isinstance(match_rest, str):
        match_rest = (match_rest,)
    if scale is None:
        scale = size_ratio(skeleton, source, pairs)
    if not 0 < scale < math.inf:
        raise OptionError(f"retarget: scale is {scale}; it must be above 0")
    values = np.asarray(motion.values, np.float64)
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        retargeted = _Retargeted(source, skeleton, pairs, values, scale, match_rest).values()
    return replace_motion(motion, replace(skeleton, base=None), computed_signal(motion, retargeted))


def _check(source: Skeleton, target: Skeleton) -> None:
    for skeleton in (source, target):
        if point_set(skeleton) == "markers":
            raise MotionError(
                f"retarget: {named('skeleton', skeleton.name)} has only markers, "
                "which rotate no bones"
            )
    if source.up_axis and target.up_axis and source.up_axis != target.up_axis:
        raise OptionError(
            f"retarget: the up axes differ: {source.up_axis} in the motion, {target.up_axis} "
            "in the skeleton"
        )


class _Retargeted:
    """Values of the target, (n_channels, F), set joint by joint from the roots down."""

    def __init__(
        self,
        source: Skeleton,
        target: Skeleton,
        pairs: Mapping[int, int],
        values: Floats,
        scale: float,
        match_rest: Collection[str],
    ) -> None:
        self.target, self.pairs = target, pairs
        self.theirs, self.ours = Chain(source), Chain(target)
        columns = np.ascontiguousarray(values.T)
        self.turns = {k: local_turns(self.theirs, k, columns) for k in range(source.n_joints)}
        self.rest = rest_turns(target, source, pairs, match_rest)
        self.columns = Targets(target, markers=False).neutral(len(values))
        self.travel = Travel(source, target, pairs, scale, values, origins_of(source, values))

    def values(self) -> Floats:
        """Values (n_frames, n_channels), NaN if their source is unknown."""
        # rotations still missing, along the joint's own axes
        missed: dict[int, Floats] = {-1: IDENTITY}
        for joint, other in self.pairs.items():
            above = nearest_above(self.target, joint, self.pairs)
            pair = self.pairs[above] if above >= 0 else -1
            turn = relative_turns(self.theirs, pair, other, self.turns)
            turn = multiply_matrices(
                multiply_matrices(inverse_turns(self.rest[above]), turn), self.rest[joint]
            )
            target = multiply_matrices(missed[above], turn)
            turned = set_local_turns(self.ours, joint, target, self.columns)
            missed[joint] = _fill_unknown(multiply_matrices(inverse_turns(turned), target))
        self.travel.set(self.columns, self.rest)
        return np.ascontiguousarray(self.columns.T)


def _fill_unknown(turn: Floats) -> Floats:
    """Rotations with the identity if unknown: joints below are known independently."""
    known = finite_frames(turn)
    return turn if known.all() else np.where(known, turn, IDENTITY)


def size_ratio(ours: Skeleton, theirs: Skeleton, pairs: Mapping[int, int]) -> float:
    """Our size for each unit of theirs, each in its own length units.

    ``pairs`` has joints of theirs by joints of ours. Heights are from the feet up to the joint
    where the legs part, see ``_height``; a foot is the first joint of a leg that is a part of a
    foot by its name, in either skeleton. Without feet or heights the length of all bones between
    joints of ``pairs`` counts; 1 without these too.
    """
    feet = {
        one: other
        for one, other in pairs.items()
        if is_foot(ours.joints[one].name) or is_foot(theirs.joints[other].name)
    }
    first = [one for one in feet if not feet.keys() & set(_line(ours, one)[:-1])]
    heights = _height(ours, first), _height(theirs, [feet[one] for one in first])
    if min(heights) <= 0:
        heights = _bones(ours, pairs), _bones(theirs, pairs.values())
    return heights[0] / heights[1] if all(heights) else 1.0


def _height(skeleton: Skeleton, feet: list[int]) -> float:
    """The height of the joint where the legs part above the feet, with legs straight.

    Up is away from the feet in the rest pose; a single leg parts at its root. A leg begins below
    the first bone with a length; only the descent of that bone counts. The mean of all legs; 0 if
    there is none.
    """
    if not feet:
        return 0.0
    lines = [_line(skeleton, foot) for foot in feet]
    shared = [joint for joint in lines[0] if all(joint in line for line in lines[1:])]
    fork = shared[-1] if shared and len(lines) > 1 else lines[0][0]
    rest, lengths = rest_positions(skeleton), _lengths(skeleton)
    down = np.sum([rest[foot] - rest[fork] for foot in feet], axis=0)
    down /= np.linalg.norm(down) or 1.0
    heights = []
    for line in lines:
        bones = [joint for joint in line[line.index(fork) + 1 :] if lengths[joint] > 0]
        leg = sum(float(lengths[joint]) for joint in bones[1:])
        heights.append(leg + float((rest[bones[0]] - rest[fork]) @ down) if bones else 0.0)
    return sum(heights) / len(heights)


def _bones(skeleton: Skeleton, joints: Iterable[int]) -> float:
    """The length of all bones on the lines between these joints."""
    chosen = set(joints)
    lengths, total = _lengths(skeleton), 0.0
    for joint in chosen:
        *above, _ = _line(skeleton, joint)
        begun = [number for number, other in enumerate(above) if other in chosen]
        if begun:
            total += float(lengths[[*above[begun[-1] + 1 :], joint]].sum())
    return total


def _line(skeleton: Skeleton, joint: int) -> list[int]:
    """The joints from a root down to ``joint``."""
    line = [joint]
    while (parent := skeleton.joints[line[-1]].parent) >= 0:
        line.append(parent)
    return line[::-1]


def _lengths(skeleton: Skeleton) -> Floats:
    """Length of every joint's offset, (n_joints,)."""
    return np.asarray(np.sqrt((skeleton.offsets**2).sum(axis=1)))


ROUNDING = 1e-9  # of the skeleton's reach: shorter paths count as none


@dataclass(frozen=True, slots=True)
class Travel:
    """``values`` (n_frames, n_channels) of ``source`` and ``origins`` of its joints, for a target.

    ``pairs`` has joints of the source by joints of the target, ``scale`` is in length units of the
    target per length unit of the source.
    """

    source: Skeleton
    target: Skeleton
    pairs: Mapping[int, int]
    scale: float
    values: Floats
    origins: Floats

    def set(self, columns: Floats, rest: Mapping[int, Floats]) -> None:
        """Write all position channels of the target into ``columns``, (n_channels, F).

        ``rest`` has the turn of the rest pose of each joint of ``pairs`` and of -1.
        """
        ways: dict[int, Floats] = {}  # of joints, from their rest position on their parent
        for joint, other in self.pairs.items():
            above = nearest_above(self.target, joint, self.pairs)
            if above < 0:
                carrier = self._carrier(joint, other)
                if carrier >= 0 and carrier not in ways:
                    ways[carrier] = self._shift_from_rest(joint, other)
            elif is_moving(self.target.joints[joint].channels):
                step = self.scale * self._step(other)
                ways[joint] = to_world(inverse_turns(rest[above]), step)
        for joint, way in ways.items():
            self._check(joint, way)
        for joint in range(self.target.n_joints):
            self._write(joint, ways.get(joint), columns)

    def _carrier(self, joint: int, other: int) -> int:
        """The joint whose position channels move ``joint``: itself or the nearest above it.

        -1 if none has any, and none is needed. Raises OptionError.
        """
        carrier = joint
        while carrier >= 0 and not is_moving(self.target.joints[carrier].channels):
            carrier = self.target.joints[carrier].parent
        place = self.origins[:, other]
        known = place[np.isfinite(place).all(axis=1)]
        if carrier < 0 and len(known) and (known != known[0]).any():
            raise OptionError(
                f"retarget: joint {self.source.joint_names[other]!r} translates, but neither "
                f"{self.target.joint_names[joint]!r} of the skeleton nor a joint above it has "
                "position channels"
            )
        return carrier

    def _check(self, joint: int, way: Floats) -> None:
        """Raise OptionError for a joint that must move but has no position channel."""
        kinds = {channel.kind for channel in self.target.joints[joint].channels}
        least = ROUNDING * reach(self.target)
        for kind, track in zip(POSITION_KINDS, way, strict=True):
            if kind not in kinds and (np.abs(track) > least).any():
                raise OptionError(
                    f"retarget: joint {self.target.joint_names[joint]!r} of the skeleton "
                    f"lacks channel {kind}, along which the motion moves it"
                )

    def _shift_from_rest(self, joint: int, other: int) -> Floats:
        """Shift of ``joint`` from its rest, (3, F), with all joints above it at rest."""
        rest = rest_positions(self.target)[joint]
        result: Floats = self.scale * self.origins[:, other].T - rest[:, None]
        return result

    def _step(self, other: int) -> Floats:
        """Shift that position channels of the source's joint add to its offset, (3, F)."""
        joint = self.source.joints[other]
        step = np.zeros((3, len(self.values)))
        for channel, column in zip(joint.channels, self.source.columns(other), strict=True):
            if channel.kind in POSITION_KINDS:
                component = POSITION_KINDS.index(channel.kind)
                step[component] = self.values[:, column]
                if not joint.adds_to_offset:
                    step[component] -= joint.offset[component]
        return step

    def _write(self, index: int, way: Floats | None, columns: Floats) -> None:
        joint = self.target.joints[index]
        for channel, column in zip(joint.channels, self.target.columns(index), strict=True):
            if channel.kind in POSITION_KINDS:
                component = POSITION_KINDS.index(channel.kind)
                columns[column] = 0.0 if way is None else way[component]
                if not joint.adds_to_offset:
                    columns[column] += joint.offset[component]
