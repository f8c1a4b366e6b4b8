"""Bodies for drawing, and their tracks.

A body has nodes, bones between them, their thickness and side. A track is the frames of a motion as
nodes in one frame of reference: forward x, left y, up z, in cm if known. Only bounds of the whole
are kept: positions are read again, block after block.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcz.errors import MotionError
from mcz.kinematics.chain import Floats
from mcz.kinematics.frames import FramePoses, MotionLike, frame_poses_of, values_of
from mcz.kinematics.joint_names import find_feet, sides_of
from mcz.kinematics.points import listed_points, point_set
from mcz.model.motion import Skeleton
from mcz.model.skeleton import signs_of
from mcz.model.types import Ints
from mcz.model.units import unit_cm_of

Flags = NDArray[np.bool_]

MIDDLE, LEFT, RIGHT = 0, 1, 2
_EYE = re.compile(r"eye|jaw|tongue", re.IGNORECASE)  # in a head, which is drawn as a ball
_SIDES = {"": MIDDLE, "left": LEFT, "right": RIGHT}
THICK = 0.042  # radius of a bone, of the figure's size, from a start at that distance from the tip
SHORT = 0.45  # of its length, how thick a bone may be
THIN = 0.010  # of the figure's size, which it may be in any case
TRUNK = 1.5  # thickness of the trunk relative to other bones
HEAD = 0.052  # radius of a head, as a share of the figure's size
DOT = 0.011  # radius of a marker, as a share of the extent
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
    """Mask of the bones that end in a head: the last of a chain of joints with that name."""
    is_head = np.array(["head" in joint.name.lower() for joint in skeleton.joints], bool)[owners]
    going_on = bones[is_head[bones[:, 1]], 0]
    return np.flatnonzero(is_head[bones[:, 1]] & ~np.isin(bones[:, 1], going_on))


def remove_false_bones(body: Body, places: Floats) -> Body:
    """``body`` without false bones in these frames: stems from a root, varying or zero lengths.

    ``places`` (n_frames, n_nodes, 3), at least one frame.
    """
    if not len(body.bones):
        return body
    low, median, high = (_quantile(bone_lengths(body, places), q) for q in (0.1, 0.5, 0.9))
    parents = body.skeleton.parents
    n_joints = len(parents)
    counts = np.bincount(parents[parents >= 0], minlength=n_joints)
    starts, ends = body.bones.T
    only = (parents[starts] < 0) & (counts[starts] == 1) & (ends < n_joints)
    size = figure_size(np.delete(places, starts[only], axis=1))
    with np.errstate(invalid="ignore"):
        rubber = (high - low > MOST_VARIATION * median) & (median > 0.1 * size)
        is_bone = ~rubber & (median > LEAST_LENGTH * size)
        stem = only & (median > STEM * size)
    if (is_bone & ~stem).any():
        is_bone &= ~stem
    eyes = [_EYE.search(joint.name) is not None for joint in body.skeleton.joints]
    is_bone &= ~np.array(eyes, bool)[body.joints[ends]]
    bones = body.bones[is_bone]
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
        known = frame[are_near_others(frame)]
        if len(known) > 1:
            extents.append(float((known.max(axis=0) - known.min(axis=0)).max()))
    median = float(np.median(extents)) if extents else 1.0
    return median if median > 0 else 1.0


def are_near_others(nodes: Floats) -> Flags:
    """Flags of the nodes of a frame, (n, 3), that are known and not far from all others."""
    known = are_known(nodes)
    if not known.any():
        return known
    with np.errstate(all="ignore"):
        apart = np.abs(nodes - np.median(nodes[known], axis=0)).max(axis=1)
        median = float(np.median(apart[known]))
        return known & np.asarray(apart <= 10 * median) if median > 0 else known


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
    result[_trunk_bones(body, ahead, size)] *= TRUNK
    result = np.minimum(result, (SHORT * lengths + THIN * size)[:, None])
    result[:, 1] = np.maximum(result[:, 1], 0.45 * result[:, 0])
    return np.maximum(result, 0.5 * THIN * size)


def _trunk_bones(body: Body, ahead: Floats, size: float) -> Flags:
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


BLOCK = 2**19  # numbers a block, which bounds the memory
SAMPLES = 64  # frames that determine sizes and facing
MOST_LEAD = 2**14  # greatest number of frames that are read, but not drawn, between two drawn ones
TURNS = {"x": (1, 2, 0), "y": (2, 0, 1), "z": (0, 1, 2)}  # the axes of the file that are x, y, z
FARTHEST = 1e12  # cm or units from the origin: farther points are unknown
MOST_SIZES = 300  # sizes of the figure from its usual place: farther points are faults
STEADY = 0.5  # of 1: how much of the time it faces one way, or the first frame counts


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """Some frames of a motion, in order, and their common facts.

    ``size`` is the figure's, ``radii`` (n_bones, 2) the thickness of its bones, ``floor`` the
    height of the floor, ``forward`` (3,) its facing; all in ``unit``, "cm" or "units". ``centers``
    (n_frames, 3) is its position, NaN where unknown; ``up`` the axis of the file.
    """

    moving: MotionLike
    body: Body
    frames: Ints
    up: str
    up_assumed: bool
    scale: float
    unit: str
    size: float
    radii: Floats
    floor: float
    forward: Floats
    centers: Floats

    def __iter__(self) -> Iterator[tuple[int, Floats]]:
        """Every frame, counted as in the file, and its nodes (n_nodes, 3), NaN where unknown."""
        for frames, places in _blocks(self.moving, self.body, self.frames, self.up, self.scale):
            yield from zip(frames.tolist(), places, strict=True)

    def blocks(self) -> Iterator[tuple[Ints, Floats]]:
        """Yield the places by blocks: frames (n,), nodes (n, n_nodes, 3)."""
        return _blocks(self.moving, self.body, self.frames, self.up, self.scale)


def track_of(motion: MotionLike, frames: Ints, unit: str | None, up: str | None) -> Track:
    """The track of ascending frames; ``unit`` and ``up`` count if the skeleton states none.

    Raises MotionError if the motion has no kinematics, no joint, no frame, or no known position.
    """
    skeleton = motion.skeleton
    if not skeleton.joints or not len(frames):
        noun = "joint" if not skeleton.joints else "frame"
        raise MotionError(f"{motion.name!r} has no {noun}: nothing to draw")
    body = body_of(skeleton)
    chosen = frames[np.unique(np.linspace(0, len(frames) - 1, SAMPLES).astype(np.int64))]
    unit_cm = skeleton.unit_cm or (unit and unit_cm_of(unit))
    scale = unit_cm or 1.0
    visible = np.concatenate([p for _, p in _blocks(motion, body, chosen, "z", scale)])
    if not are_known(visible).any():
        raise unknown(motion)
    axis = skeleton.up_axis or up or guess_up_axis(body, visible)
    visible = _turn_upright(visible, axis)
    body = remove_false_bones(body, visible)
    size = figure_size(visible[:, body.drawn_nodes])
    track = Track(
        moving=motion,
        body=body,
        frames=frames,
        up=axis,
        up_assumed=not (skeleton.up_axis or up),
        scale=scale,
        unit="cm" if unit_cm else "units",
        size=size,
        radii=radii(body, visible, size),
        floor=0.0,
        forward=facing(body, visible),
        centers=np.empty((0, 3)),
    )
    return _measure_track(track)


def unknown(motion: MotionLike) -> MotionError:
    return MotionError("no position is known in these frames: nothing to draw", clip=motion.name)


def _measure_track(track: Track) -> Track:
    """``track`` with its floor and its centers, from one pass over all frames."""
    drawn = track.body.drawn_nodes
    lows, centers = [], []
    for _, places in track.blocks():
        for nodes in places[:, drawn]:
            known = nodes[are_near_others(nodes)]
            lows.append(known[:, 2].min() if len(known) else np.nan)
            centers.append(
                (known.min(axis=0) + known.max(axis=0)) / 2 if len(known) else np.full(3, np.nan)
            )
    heights = np.array(lows)
    heights = heights[np.isfinite(heights)]
    low = float(np.quantile(heights, 0.02)) if len(heights) else 0.0
    low = 0.0 if 0 <= low < 0.06 * track.size else low - 0.004 * track.size
    middles = np.array(centers).reshape(-1, 3)
    if not are_known(middles).any():
        raise unknown(track.moving)
    center = np.median(middles[are_known(middles)], axis=0)
    with np.errstate(invalid="ignore"):
        middles[~(np.abs(middles - center).max(axis=1) <= MOST_SIZES * track.size)] = np.nan
    return replace(track, floor=low, centers=middles)


def _blocks(
    motion: MotionLike, body: Body, frames: Ints, up: str, scale: float
) -> Iterator[tuple[Ints, Floats]]:
    skeleton = motion.skeleton
    width = max(1, skeleton.n_channels + 12 * skeleton.n_joints)
    longest = max(1, min(MOST_LEAD, BLOCK // width))
    every = range(skeleton.n_joints)
    per_frame = _samples_per_frame(motion)
    at = 0
    while at < len(frames):
        stop = max(at + 1, int(np.searchsorted(frames, frames[at] + longest)))
        first, last = int(frames[at]), int(frames[stop - 1]) + 1
        values = values_of(motion, (first, last), every)[::per_frame][frames[at:stop] - first]
        places = _turn_upright(body.places(values), up)
        with np.errstate(all="ignore"):
            places *= scale
            unseen = ~(np.abs(places) < FARTHEST)
        places[unseen] = np.nan
        yield frames[at:stop], places
        at = stop


def _turn_upright(places: Floats, up: str) -> Floats:
    turned_places: Floats = (places * signs_of(up))[:, :, TURNS[up[-1]]]
    return turned_places


def _samples_per_frame(motion: MotionLike) -> int:
    signal: Any = motion.signals[0]  # of a Motion, or the facts of a Clip
    return int(getattr(signal, "samples_per_frame", 0) or signal.layout.samples_per_frame)


def guess_up_axis(body: Body, places: Floats) -> str:
    """The axis along which points are farthest from the feet; without feet y, for markers z."""
    feet = find_feet(body.skeleton)
    if feet:
        with np.errstate(all="ignore"):
            known = are_known(places)
            sums = np.where(known[..., None], places, 0.0)
            middle = sums.sum(axis=(0, 1)) / max(1, known.sum())
            low = sums[:, feet].sum(axis=(0, 1)) / max(1, known[:, feet].sum())
        apart = np.abs(middle - low)
        if known[:, feet].any() and apart.max() > 0:
            return "xyz"[int(apart.argmax())]
    return "z" if point_set(body.skeleton) == "markers" else "y"


def facing(body: Body, places: Floats) -> Floats:
    """Facing of the figure, a horizontal unit vector: across its left and its right.

    The facing of most frames, or if it turns much of the first; x if no name shows sides.
    """
    across = np.zeros((len(places), 3))
    for side, sign in ((LEFT, 1.0), (RIGHT, -1.0)):
        nodes = places[:, body.sides == side]
        known = are_known(nodes)
        count = known.sum(axis=1)
        if not len(nodes) or not nodes.shape[1]:
            return np.array([1.0, 0.0, 0.0])
        with np.errstate(all="ignore"):
            mean = np.where(known[..., None], nodes, 0.0).sum(axis=1) / count[:, None]
        across += sign * mean
    across[:, 2] = 0.0
    with np.errstate(all="ignore"):
        across /= np.sqrt((across**2).sum(axis=1))[:, None]
    across = across[are_known(across)]
    if not len(across):
        return np.array([1.0, 0.0, 0.0])
    mean = across.mean(axis=0)
    left = mean if np.linalg.norm(mean) > STEADY else across[0]
    left = left / np.linalg.norm(left)
    return np.array([left[1], -left[0], 0.0])  # left x up
