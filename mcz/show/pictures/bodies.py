"""Bodies for drawing: nodes, bones between them, their thickness and side."""

from __future__ import annotations

import re
import warnings
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mcz.kinematics.chain import Floats
from mcz.kinematics.frames import FramePoses, frame_poses_of
from mcz.kinematics.points import listed_points
from mcz.kinematics.retargeting.sides import sides_of
from mcz.model.motion import Skeleton
from mcz.model.types import Ints

Flags = NDArray[np.bool_]

MIDDLE, LEFT, RIGHT = 0, 1, 2
_EYE = re.compile(r"eye|jaw|tongue", re.IGNORECASE)  # in a head, which is drawn as a ball
_SIDES = {"": MIDDLE, "left": LEFT, "right": RIGHT}
THICK = 0.042  # radius of a bone, of the figure's size, from a start at that distance from the tip
SHORT = 0.45  # of its length, how thick a bone may be
THIN = 0.010  # of the figure's size, which it may be in any case
TRUNK = 1.5  # thickness of the trunk relative to other bones
HEAD = 0.052  # radius of a head, of the figure's size
DOT = 0.011  # radius of a marker, of the extent of all
STEM = 0.3  # of the figure's size: a longer bone from a root to its only child is not part of it
LEAST_LENGTH = 1e-3  # of the figure's size: a shorter bone has no length
MOST_VARIATION = 0.5  # of its length: a bone that varies as much is none


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """Nodes of a skeleton and the bones between them.

    Nodes are the origins of all joints, then all tails. ``bones`` (n, 2) are nodes, start and end;
    ``sides`` (n_nodes,) MIDDLE, LEFT or RIGHT; ``joints`` (n_nodes,) the joint of each node.
    ``lone`` are the nodes drawn as dots: markers, and joints without a bone.
    """

    skeleton: Skeleton
    bones: Ints
    joints: Ints
    sides: Ints
    lone: Ints
    heads: Ints  # bones that end in a head
    points: tuple[int, ...]  # the tails, as points of the skeleton

    @property
    def drawn_nodes(self) -> Ints:
        """The nodes that are drawn."""
        return np.unique(np.concatenate([self.bones.ravel(), self.lone]))

    def places(self, values: Floats) -> Floats:
        """Positions of the nodes, (n_frames, n_nodes, 3) in length units, NaN where unknown."""
        poses: FramePoses = frame_poses_of(self.skeleton)
        joints = list(range(self.skeleton.n_joints))
        with np.errstate(all="ignore"):
            parts = [poses.origins(values, joints)]
            if self.points:
                parts.append(poses.positions(values, list(self.points)))
        return np.concatenate(parts, axis=1)


def body_of(skeleton: Skeleton) -> Body:
    """The body of a skeleton in any pose; ``remove_false_bones`` removes false bones."""
    tails = [(n, joint) for n, (joint, tail) in enumerate(listed_points(skeleton)) if tail >= 0]
    n_joints, bones = skeleton.n_joints, []
    offsets: dict[int, list[Floats]] = {}  # an Acclaim bone ends where the next ones begin
    for joint, of in enumerate(skeleton.joints):
        if of.parent >= 0:
            bones.append((of.parent, joint))
            offsets.setdefault(of.parent, []).append(np.array(of.offset))
    vectors = [tail for of in skeleton.joints for tail in of.tails]
    for number, ((_, joint), tail) in enumerate(zip(tails, vectors, strict=True)):
        near = 1e-6 + 1e-3 * float(np.linalg.norm(tail))
        if all(np.linalg.norm(each - tail) > near for each in offsets.get(joint, [])):
            bones.append((joint, n_joints + number))
    names = skeleton.addresses()
    owners = np.array([*range(n_joints), *(joint for _, joint in tails)], np.int64)
    sides = np.array([_SIDES[side] for side in sides_of(names)], np.int64)[owners]
    joined = np.array(bones, np.int64).reshape(-1, 2)
    lone = np.setdiff1d(np.arange(n_joints), joined.ravel())
    points = tuple(number for number, _ in tails)
    return Body(skeleton, joined, owners, sides, lone, np.empty(0, np.int64), points)


def _heads(skeleton: Skeleton, bones: Ints, owners: Ints) -> Ints:
    """The bones that end in a head: of a row of that name the last."""
    named = np.array(["head" in joint.name.lower() for joint in skeleton.joints], bool)[owners]
    going_on = bones[named[bones[:, 1]], 0]
    return np.flatnonzero(named[bones[:, 1]] & ~np.isin(bones[:, 1], going_on))


def remove_false_bones(body: Body, places: Floats) -> Body:
    """``body`` without false bones in these frames: stems from a root, varying or zero lengths.

    ``places`` (n_frames, n_nodes, 3), at least one frame.
    """
    if not len(body.bones):
        return body
    low, usual, high = (_quantile(bone_lengths(body, places), q) for q in (0.1, 0.5, 0.9))
    parents = body.skeleton.parents
    n_joints = len(parents)
    counts = np.bincount(parents[parents >= 0], minlength=n_joints)
    starts, ends = body.bones.T
    only = (parents[starts] < 0) & (counts[starts] == 1) & (ends < n_joints)
    size = figure_size(np.delete(places, starts[only], axis=1))
    with np.errstate(invalid="ignore"):
        rubber = (high - low > MOST_VARIATION * usual) & (usual > 0.1 * size)
        kept = ~rubber & (usual > LEAST_LENGTH * size)
        stem = only & (usual > STEM * size)
    if (kept & ~stem).any():
        kept &= ~stem
    eyes = [_EYE.search(joint.name) is not None for joint in body.skeleton.joints]
    kept &= ~np.array(eyes, bool)[body.joints[ends]]
    bones = body.bones[kept]
    lone = body.lone if len(bones) else np.arange(n_joints)
    return replace(body, bones=bones, lone=lone, heads=_heads(body.skeleton, bones, body.joints))


def _quantile(values: Floats, q: float) -> Floats:
    """Quantile of the known values of every column; NaN without any."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        result: Floats = np.nanquantile(values, q, axis=0)
    return result


def bone_lengths(body: Body, places: Floats) -> Floats:
    """Lengths of the bones, (n_frames, n_bones), NaN where unknown."""
    with np.errstate(all="ignore"):
        apart = places[:, body.bones[:, 1]] - places[:, body.bones[:, 0]]
        lengths: Floats = np.sqrt((apart**2).sum(axis=2))
    return np.where(np.isfinite(lengths), lengths, np.nan)


def figure_size(places: Floats) -> float:
    """The usual extent of all nodes of a frame, along its greatest axis; 1.0 without nodes.

    Nodes that are ten times as far from the middle as others do not count.
    """
    extents = []
    for frame in places:
        known = frame[near_others(frame)]
        if len(known) > 1:
            extents.append(float((known.max(axis=0) - known.min(axis=0)).max()))
    usual = float(np.median(extents)) if extents else 1.0
    return usual if usual > 0 else 1.0


def near_others(nodes: Floats) -> Flags:
    """Flags of the nodes of a frame, (n, 3), that are known and not far from all others."""
    known = are_known(nodes)
    if not known.any():
        return known
    with np.errstate(all="ignore"):
        apart = np.abs(nodes - np.median(nodes[known], axis=0)).max(axis=1)
        usual = float(np.median(apart[known]))
        return known & np.asarray(apart <= 10 * usual) if usual > 0 else known


def are_known(places: Floats) -> Flags:
    """Flags of the places, (..., 3), with all coordinates known, bool (...)."""
    return np.asarray(np.isfinite(places).all(axis=-1))


def radii(body: Body, places: Floats, size: float) -> Floats:
    """Radii of each bone at its start and end, (n_bones, 2), in the unit of ``places``.

    As branches of a tree: proportional to the root of the distance to the farthest tip.
    """
    lengths = np.nan_to_num(_quantile(bone_lengths(body, places), 0.5))
    reach = np.zeros(len(body.joints))
    for bone in np.argsort(-_depths(body), kind="stable"):  # from the tips on
        start, end = body.bones[bone]
        reach[start] = max(reach[start], reach[end] + lengths[bone])
    ahead = reach[body.bones[:, 1]]
    result: Floats = THICK * np.sqrt(np.stack([ahead + lengths, ahead], axis=1) * size)
    result[_trunk(body, ahead, size)] *= TRUNK
    result = np.minimum(result, (SHORT * lengths + THIN * size)[:, None])
    result[:, 1] = np.maximum(result[:, 1], 0.45 * result[:, 0])
    return np.maximum(result, 0.5 * THIN * size)


def _trunk(body: Body, ahead: Floats, size: float) -> Flags:
    """Flags of the trunk's bones: between the sides, before arms or further bones."""
    sides = body.sides[body.bones[:, 1]]
    return np.asarray((sides == MIDDLE) & (ahead > 0.28 * size) & bool((sides == LEFT).any()))


def _depths(body: Body) -> Ints:
    """Number of bones from the root to the end of each bone."""
    depth = np.zeros(len(body.joints), np.int64)
    n_joints = body.skeleton.n_joints
    for joint, parent in enumerate(body.skeleton.parents):
        depth[joint] = depth[parent] + 1 if parent >= 0 else 0
    depth[n_joints:] = depth[body.joints[n_joints:]] + 1
    return depth[body.bones[:, 1]]
