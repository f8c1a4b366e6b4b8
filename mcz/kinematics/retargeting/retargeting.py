"""A motion on another skeleton: the same turns of joints, on bones of other lengths.

With W a joint's rotation in the world, the identity at rest, each joint of the target has the W of
the joint that stands for it. What the channels of a joint cannot make of that they make as nearly
as they can, and joints below make up for it.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np

from mcz.errors import MotionError, OptionError
from mcz.kinematics import origins_of, point_set
from mcz.kinematics.chain import IDENTITY, Chain, Floats, multiply_matrices
from mcz.kinematics.retargeting.channels import check_channels, computed, edited
from mcz.kinematics.retargeting.matching import matched, nearest_above
from mcz.kinematics.retargeting.rest_poses import rest_turns, usual_alike
from mcz.kinematics.retargeting.sizes import size_ratio
from mcz.kinematics.retargeting.travel import Travel
from mcz.kinematics.retargeting.turns import back, finite, local_turns, relative, set_local_turns
from mcz.kinematics.targets import Targets
from mcz.model.motion import Motion, Skeleton

AUTO = "auto"


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
    gives them; joints that it leaves out stay at rest, or are left out. None: the same names.

    Turns are turns from rest. Where the rest poses are unlike, one with arms down and one with
    arms out, so would be the poses. ``match_rest`` names joints of ``skeleton`` whose bones are to
    point as those of the motion do, such as upper arms and forearms; joints below them turn along.
    "auto": the arms and legs of usual skeletons (see ``mcz.joint_map``) that rest otherwise; of
    others a SkeletonWarning names the bones that do. (): none.

    The root's way is scaled by ``scale``, in length units of ``skeleton`` per length unit of the
    motion. None: by the length of the legs, from hip to foot, or of all bones where no foot has
    its name. Position channels of other joints keep what they add to the rest pose, scaled alike,
    where both joints have such; what else stretches bones of the motion is left out.

    Values are on a grid of 6 decimals. Frame rate, frame numbers, name, metadata and further
    signals are kept; there is no source.

    Raises OptionError for joints that are not there, for two that stand for one, for one of
    ``match_rest`` without a bone, for up axes that differ, for a scale that is not above 0, and
    where no joint could follow the root's way.
    Raises MotionError where one of the skeletons has no kinematics or markers alone.
    """
    check_channels(motion)
    source = motion.skeleton
    _check(source, skeleton)
    pairs = matched(source, skeleton, joint_map)
    if match_rest == AUTO:
        match_rest = usual_alike(skeleton, source, pairs)
    elif isinstance(match_rest, str):
        match_rest = (match_rest,)
    if scale is None:
        scale = size_ratio(skeleton, source, pairs)
    if not 0 < scale < math.inf:
        raise OptionError(f"retarget: a scale of {scale} is not above 0")
    values = np.asarray(motion.values, np.float64)
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        made = _Retargeted(source, skeleton, pairs, values, scale, match_rest).values()
    return edited(motion, replace(skeleton, base=None), computed(motion, made))


def _check(source: Skeleton, target: Skeleton) -> None:
    for skeleton in (source, target):
        if point_set(skeleton) == "markers":
            raise MotionError(
                f"retarget: skeleton {skeleton.name!r} has markers alone, which turn no bones"
            )
    if source.up_axis and target.up_axis and source.up_axis != target.up_axis:
        raise OptionError(
            f"retarget: {source.up_axis} points up in the motion, {target.up_axis} in the skeleton"
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
        """Values (n_frames, n_channels), NaN where what they stand for is not known."""
        missed: dict[int, Floats] = {-1: IDENTITY}  # of what is wanted, along the joint's own axes
        for joint, other in self.pairs.items():
            above = nearest_above(self.target, joint, self.pairs)
            there = self.pairs[above] if above >= 0 else -1
            turn = relative(self.theirs, there, other, self.turns)
            turn = multiply_matrices(
                multiply_matrices(back(self.rest[above]), turn), self.rest[joint]
            )
            wanted = multiply_matrices(missed[above], turn)
            made = set_local_turns(self.ours, joint, wanted, self.columns)
            missed[joint] = _known(multiply_matrices(back(made), wanted))
        self.travel.set(self.columns, self.rest)
        return np.ascontiguousarray(self.columns.T)


def _known(turn: Floats) -> Floats:
    """The same, the identity where it is not known: joints below are known by themselves."""
    known = finite(turn)
    return turn if known.all() else np.where(known, turn, IDENTITY)
