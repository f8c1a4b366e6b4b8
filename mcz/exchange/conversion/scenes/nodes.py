"""A motion as a scene: a tree of nodes, turned and moved over time, in meters.

Nodes are the joints and, below them, the ends of bones without a joint. Stretching of a bone moves
the nodes at its other end, so that no node is scaled: scales of glTF and USD would be inherited,
and those of a motion are not.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from itertools import accumulate

import numpy as np
from numpy.typing import NDArray

from mcz.errors import MotionError
from mcz.exchange.conversion.hierarchy import is_moving, is_stretching, loose_tails
from mcz.exchange.conversion.losses import conversion_losses, first_gap
from mcz.hints import Hint
from mcz.kinematics.chain import Chain, Floats, multiply_matrices
from mcz.kinematics.frames import frame_poses_of
from mcz.kinematics.joint_names import sides_of
from mcz.kinematics.points import point_set
from mcz.kinematics.poses.conversions import from_matrices
from mcz.model.clock import Timeline
from mcz.model.motion import TURNING_KINDS, Motion, check_poses
from mcz.model.types import Ints

CM_PER_M = 100.0
WHOLE_CODE = 1e-6  # frames: a time code that is off by less is a whole number
SAMPLED_FRAMES = 500  # for the size of a set of markers
UNSIZED = 1.0  # m, the size of a scene without one


@dataclass(frozen=True, slots=True, eq=False)
class Node:
    """A joint, the end of a bone, or a marker.

    ``parent`` is an index of nodes, -1: none. ``rest`` (3,) is its offset at rest from its parent.
    ``turns`` (n_frames, 4) are unit quaternions, x y z w, from its parent, neighbors near each
    other; None: never turned. ``shifts`` (n_frames, 3) is its offset from its parent; None: at
    ``rest``. ``places`` (n_frames, 3) is its position in the world, NaN if unknown. ``side`` is
    "left", "right" or "" by its name.
    """

    name: str
    parent: int
    rest: Floats
    turns: Floats | None
    shifts: Floats | None
    places: Floats
    side: str

    @property
    def is_visible(self) -> NDArray[np.bool_]:
        """Mask of the frames in which its position is known, (n_frames,)."""
        return ~np.isnan(self.places[:, 0])


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """The nodes, parents before children; lengths in meters, or units if these are unknown.

    ``up_axis`` is "x" to "-z"; ``size`` the figure's; ``times`` (n_frames,) in seconds from the
    first frame on, float32 numbers as float64; ``start``: the time of the first frame; ``codes``
    (n_frames,): the times on the clock of the recording, in frames of ``rate``. ``notes`` list
    unknown facts and omissions.
    """

    name: str
    nodes: tuple[Node, ...]
    times: Floats
    start: float
    codes: Floats
    rate: Fraction
    up_axis: str
    size: float
    has_unit: bool
    is_markers: bool
    notes: tuple[str, ...]

    @property
    def rest_places(self) -> Floats:
        """Positions of the nodes at rest in the world, (n_nodes, 3)."""
        places = np.zeros((len(self.nodes), 3))
        for number, node in enumerate(self.nodes):
            places[number] = node.rest
            if node.parent >= 0:
                places[number] += places[node.parent]
        return places

    @property
    def children(self) -> list[list[int]]:
        """Children of every node."""
        below: list[list[int]] = [[] for _ in self.nodes]
        for number, node in enumerate(self.nodes):
            if node.parent >= 0:
                below[node.parent].append(number)
        return below


def scene_of(motion: Motion) -> Scene:
    """The scene of ``motion``, whose times are known.

    Raises MotionError for a skeleton without kinematics, for a joint that is missing in a frame,
    and if float32 times of frames would be equal.
    """
    skeleton, timeline = motion.skeleton, motion.timeline
    assert timeline is not None
    rate = _rate(motion, timeline)
    check_poses(motion.name, motion.signals[0])
    if not skeleton.joints:
        raise MotionError("a scene needs at least one joint", clip=motion.name)
    scale = 1.0 if skeleton.unit_cm is None else skeleton.unit_cm / CM_PER_M
    is_markers = point_set(skeleton) == "markers"
    nodes = tuple(_markers(motion, scale) if is_markers else _joints(motion, scale))
    return Scene(
        motion.name,
        nodes,
        _times(motion.name, timeline, rate),
        float(timeline.regular_times[0]) if motion.n_frames else 0.0,
        _codes(timeline, rate),
        rate,
        skeleton.up_axis or "y",
        _marker_size(nodes) if is_markers else _size(nodes),
        skeleton.unit_cm is not None,
        is_markers,
        tuple(_notes(motion)),
    )


def _rate(motion: Motion, timeline: Timeline) -> Fraction:
    if motion.frame_rate is not None:
        return motion.frame_rate
    default = 1.0 / timeline.period if timeline.period else 1.0
    return Fraction(default).limit_denominator(1000) or Fraction(1)


def _times(name: str, timeline: Timeline, rate: Fraction) -> Floats:
    even = timeline.regular_times
    seconds = (even - even[:1]).astype(np.float32).astype(np.float64)
    if (np.diff(seconds) <= 0).any() or not np.isfinite(seconds).all():
        raise MotionError(
            f"float32 cannot distinguish the times of {len(seconds)} frames at "
            f"{float(rate):g} a second",
            clip=name,
            hint=Hint.FRAMES,
        )
    return seconds


def _codes(timeline: Timeline, rate: Fraction) -> Floats:
    codes = timeline.regular_times * float(rate)
    near = np.rint(codes)
    return np.where(np.abs(codes - near) < WHOLE_CODE, near, codes)


def _notes(motion: Motion) -> Iterator[str]:
    skeleton = motion.skeleton
    if skeleton.unit_cm is None:
        yield "its length unit is unknown; one unit becomes a meter"
    if not skeleton.up_axis:
        yield "the axis that points up is unknown: taken for y"
    yield from conversion_losses(motion, "glb")


def _markers(motion: Motion, scale: float) -> Iterator[Node]:
    """A node a marker, interpolated while it is missing."""
    values = np.asarray(motion.values, np.float64).reshape(
        motion.n_frames, motion.skeleton.n_joints, 3
    )
    kinds = [channel.kind for channel in motion.skeleton.channels]
    names = motion.skeleton.addresses()
    for number, (name, side) in enumerate(zip(names, sides_of(names), strict=True)):
        order = np.argsort(kinds[3 * number : 3 * number + 3])  # tx, ty, tz
        joint = motion.skeleton.joints[number]
        places = values[:, number, order] * scale
        if joint.adds_to_offset:
            places += np.array(joint.offset) * scale
        places[~np.isfinite(places).all(axis=1)] = np.nan
        visible = np.flatnonzero(~np.isnan(places[:, 0]))
        if not len(visible):
            yield Node(name, -1, np.zeros(3), None, None, places, side)
            continue
        frames = np.arange(len(places))
        way = np.stack(
            [np.interp(frames, visible, places[visible, axis]) for axis in range(3)], axis=1
        )
        yield Node(name, -1, way[0], None, way, places, side)


def _joints(motion: Motion, scale: float) -> Iterator[Node]:
    """The joints in their order, each followed by the ends of its bones."""
    skeleton, values = motion.skeleton, np.asarray(motion.values, np.float64)
    used = [column for column, channel in enumerate(skeleton.channels) if channel.kind]
    if gap := first_gap(motion, used):
        raise MotionError(f"a scene cannot omit joints in some frames, but {gap}", clip=motion.name)
    placed = _Placements(motion, values, scale)
    names = skeleton.addresses()
    starts = accumulate((1 + len(tails) for tails in placed.tails), initial=0)
    numbers = list(starts)  # of each joint among the nodes
    for index, (name, side) in enumerate(zip(names, sides_of(names), strict=True)):
        joint = skeleton.joints[index]
        parent = numbers[joint.parent] if joint.parent >= 0 else -1
        shifts = placed.shifts.get((index, -1))
        rest = np.array(joint.offset) * scale
        if parent >= 0 and shifts is not None and len(shifts) and not rest.any():
            rest = shifts[0]  # at rest it would lie on its parent, and its bone would be invisible
        turns, places = _turns(motion, values, index), placed.places[index, -1]
        yield Node(name, parent, rest, turns, shifts, places, side)
        for number, tail in placed.tails[index]:
            end = f"{name} end" + (f" {number + 1}" if number else "")
            key = index, number
            at = np.array(tail) * scale
            yield Node(
                end, numbers[index], at, None, placed.shifts.get(key), placed.places[key], side
            )


class _Placements:
    """Positions of joints (tail -1) and of bone tips without a joint, (n_frames, 3) in meters.

    ``shifts`` has those that move relative to their parent, along its axes.
    """

    def __init__(self, motion: Motion, values: Floats, scale: float) -> None:
        self.chain = Chain(motion.skeleton)
        skeleton = motion.skeleton
        self.tails = [
            [(joint.tails.index(tail), tail) for tail in loose_tails(skeleton, index)]
            for index, joint in enumerate(skeleton.joints)
        ]
        keys = [(j, t) for j, tails in enumerate(self.tails) for t in (-1, *(k for k, _ in tails))]
        loose = [
            (j, t)
            for j, t in keys
            if (is_moving(skeleton, j) if t < 0 else is_stretching(skeleton.joints[j]))
        ]
        self.places = {key: np.empty((motion.n_frames, 3)) for key in keys}
        self.shifts = {key: np.empty((motion.n_frames, 3)) for key in loose}
        for rows, columns, pose in self.chain.poses(values):
            for j, t in keys:
                place = pose.origins[j] if t < 0 else self.chain.tail(j, t, columns, pose)
                self.places[j, t][rows] = place.T * scale
            for j, t in loose:
                arm = pose.arms[j] if t < 0 else self.chain.links[j].tails[t][:, None]
                self.shifts[j, t][rows] = self._shift(j, t, arm, columns).T * scale

    def _shift(self, joint: int, tail: int, arm: Floats, columns: Floats) -> Floats:
        """``arm``, along the local axes of the joint it begins at, along its axes at rest."""
        holder = self.chain.links[joint].parent if tail < 0 else joint
        if holder < 0:
            return arm
        link = self.chain.links[holder]
        if tail >= 0:
            arm = self.chain.apply_lengths(link, arm, columns)
        arm = self.chain.apply_scales(link, arm, columns)
        own = self.chain.turned[holder]
        return arm if own is None else multiply_matrices(own[:, :, None], arm[:, None])[:, 0]


def _turns(motion: Motion, values: Floats, index: int) -> Floats | None:
    """Turns of a joint from its parent, x y z w; None if nothing turns it."""
    if not any(channel.kind in TURNING_KINDS for channel in motion.skeleton.joints[index].channels):
        return None
    matrices = frame_poses_of(motion.skeleton).local(values, [index])
    if not np.isfinite(matrices).all():
        name = motion.skeleton.addresses()[index]
        raise MotionError(f"joint {name!r}: a quaternion of length 0 is no rotation")
    return np.roll(from_matrices(matrices, "quat")[:, 0], -1, axis=1)


def _size(nodes: tuple[Node, ...]) -> float:
    """The greatest distance of a node from its root at rest."""
    rests = np.zeros((len(nodes), 3))
    for number, node in enumerate(nodes):
        if node.parent >= 0:
            rests[number] = rests[node.parent] + node.rest
    return float(np.sqrt((rests**2).sum(axis=1).max(initial=0.0))) or UNSIZED


def _marker_size(nodes: tuple[Node, ...]) -> float:
    """The diagonal of the box around all markers of a frame, the median of it."""
    step = max(1, len(nodes[0].places) // SAMPLED_FRAMES)
    places = np.stack([node.places[::step] for node in nodes], axis=1)
    places = places[~np.isnan(places).all(axis=(1, 2))]
    if not len(places):
        return UNSIZED
    boxes = np.nanmax(places, axis=1) - np.nanmin(places, axis=1)
    return float(np.median(np.sqrt((boxes**2).sum(axis=1)))) or UNSIZED


SIDES = ("", "left", "right")
COLORS = {"": (0.6, 0.6, 0.62), "left": (0.05, 0.25, 0.7), "right": (0.75, 0.2, 0.05)}  # linear
WIDEST_AT, WIDTH = 0.15, 0.12  # of the bone, from its start, and from its middle
LEAST_WIDTH, GREATEST_WIDTH = 0.007, 0.03  # of the figure
KNOB, MARKER = 0.012, 0.008  # radius relative to the figure, and to the markers' box
LEAST_BONE = 1e-4  # of the figure; shorter ones are invisible

# Corners: one end, four around, the other end; triangles counterclockwise from outside.
OCTAHEDRON = np.array(
    [(0, 2, 1), (0, 3, 2), (0, 4, 3), (0, 1, 4), (5, 1, 2), (5, 2, 3), (5, 3, 4), (5, 4, 1)]
)


@dataclass(frozen=True, slots=True, eq=False)
class Solid:
    """All bones at rest.

    ``corners`` (n, 3) in the world, in meters; ``nodes`` (n,) the node of each; ``triangles`` (m,
    3) of each side with any.
    """

    corners: Floats
    nodes: Ints
    triangles: dict[str, Ints]


def solid_of(scene: Scene) -> Solid:
    """The bones of ``scene``."""
    corners: list[Floats] = []
    nodes: list[int] = []
    triangles: dict[str, list[Ints]] = {side: [] for side in SIDES}
    for shape, start, end in _bones(scene):
        triangles[scene.nodes[start].side].append(OCTAHEDRON + 6 * len(corners))
        corners.append(shape)
        nodes += [start] * 5 + [end]
    by_side = {side: np.concatenate(parts) for side, parts in triangles.items() if parts}
    return Solid(np.concatenate(corners), np.array(nodes, np.int64), by_side)


def _bones(scene: Scene) -> Iterator[tuple[Floats, int, int]]:
    """The corners of each bone, (6, 3), and the nodes of its start and its far end."""
    places = scene.rest_places
    for number, below in enumerate(scene.children):
        drawn = False
        for child in below:
            bone = places[child] - places[number]
            if float(bone @ bone) > (LEAST_BONE * scene.size) ** 2:
                drawn = True
                end = number if scene.nodes[child].shifts is None else child
                yield _bone(places[number], bone, scene.size), number, end
        if not drawn and not (_is_reached(scene, number) and not below):
            yield places[number] + marker_corners(KNOB * scene.size), number, number


def _is_reached(scene: Scene, number: int) -> bool:
    rest = scene.nodes[number].rest
    return scene.nodes[number].parent >= 0 and float(rest @ rest) > (LEAST_BONE * scene.size) ** 2


def _bone(start: Floats, bone: Floats, size: float) -> Floats:
    length = float(np.sqrt(bone @ bone))
    along = bone / length
    aside = np.cross(along, np.eye(3)[np.abs(along).argmin()])
    aside /= np.sqrt(aside @ aside)
    wide = min(max(WIDTH * length, LEAST_WIDTH * size), GREATEST_WIDTH * size)
    ring = [aside, np.cross(along, aside), -aside, -np.cross(along, aside)]
    middle = start + WIDEST_AT * bone
    return np.stack([start, *(middle + wide * arm for arm in ring), start + bone])


def marker_corners(radius: float) -> Floats:
    """The corners of an octahedron around the origin, (6, 3)."""
    x, y, z = np.eye(3) * radius
    return np.stack([-z, x, y, -x, -y, z])
