"""Skeletons of every kind for tests, and forward kinematics by other means."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from mcz import Channel, Joint, Skeleton

KINDS = "tx ty tz rx ry rz sx sy sz length".split()
QUATERNION = "qw qx qy qz".split()
VECTOR = "vx vy vz".split()
COORDINATES = st.floats(-5, 5).map(lambda x: round(x, 3) + 0.0)
VECTORS = st.tuples(COORDINATES, COORDINATES, COORDINATES)


@st.composite
def joints(draw: st.DrawFn, number: int) -> Joint:
    kinds = draw(st.lists(st.sampled_from(KINDS), max_size=6))
    if draw(st.integers(0, 3)) == 0:
        place = draw(st.integers(0, len(kinds)))
        kinds[place:place] = draw(st.permutations(QUATERNION))
    if draw(st.integers(0, 3)) == 0:
        place = draw(st.integers(0, len(kinds)))
        kinds[place:place] = draw(st.permutations(VECTOR))
    names = [Channel(kind) for kind in kinds]
    if draw(st.booleans()):
        names.insert(draw(st.integers(0, len(names))), Channel("", "smile"))
    return Joint(
        f"joint {number}",
        draw(st.integers(-1, number - 1)),
        draw(VECTORS),
        tuple(draw(st.lists(VECTORS, max_size=2))),
        draw(st.sampled_from([(0.0, 0.0, 0.0), (10.0, -70.0, 35.0)])),
        draw(st.sampled_from(["XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX"])),
        tuple(names),
        draw(st.booleans()),
    )


@st.composite
def skeletons(draw: st.DrawFn) -> Skeleton:
    made = [draw(joints(number)) for number in range(draw(st.integers(1, 6)))]
    made.append(Joint("known", channels=(Channel("rx"),)))  # one kind at least
    return Skeleton(
        tuple(made),
        unit_cm=2.5,
        angle_unit=draw(st.sampled_from(["deg", "rad"])),
        intrinsic=draw(st.booleans()),
    )


def values_for(skeleton: Skeleton, n_frames: int = 7, seed: int = 0) -> np.ndarray:
    """Values in a natural range of every kind."""
    random = np.random.default_rng(seed)
    turn = 170.0 if skeleton.angle_unit == "deg" else 3.0
    spread = {"r": turn, "v": turn, "t": 20.0, "s": 0.4, "l": 0.5, "q": 0.5, "": 1.0}
    middle = {"s": 1.2, "q": 0.6}
    columns = [
        middle.get(c.kind[:1], 0.0) + spread[c.kind[:1]] * random.uniform(-1, 1, n_frames)
        for c in skeleton.channels
    ]
    return np.stack(columns, axis=1) if columns else np.zeros((n_frames, 0))


def reference_points(skeleton: Skeleton, values: np.ndarray) -> np.ndarray:
    """Point positions after SPEC.md, with SciPy's rotations, joint by joint."""
    degrees = skeleton.angle_unit == "deg"
    none = Rotation.identity(len(values))
    placed: list[tuple[np.ndarray, Rotation]] = []  # origin and W of every joint
    points: list[np.ndarray] = []
    for index, joint in enumerate(skeleton.joints):
        tracks = [
            (c.kind, values[:, k])
            for c, k in zip(joint.channels, skeleton.columns(index), strict=True)
        ]
        v = np.tile(joint.offset, (len(values), 1))
        moves = [(kind[1], track) for kind, track in tracks if kind[:1] == "t"]
        if not joint.adds_to_offset:
            v[:, ["xyz".index(axis) for axis, _ in moves]] = 0
        for axis, track in moves:
            v[:, "xyz".index(axis)] += track
        origin, above = v, none
        if joint.parent >= 0:
            origin, above = placed[joint.parent]
            origin = origin + above.apply(_arm(skeleton, values, joint.parent, v))
        turn = _rotation(skeleton, joint, tracks)
        frame = _frame(joint, degrees)
        placed.append((origin, above * frame * turn * frame.inv()))
        tails = [
            origin + placed[-1][1].apply(_arm(skeleton, values, index, np.tile(t, (len(v), 1))))
            for t in joint.tails
        ]
        points += [origin, *tails] if skeleton.intrinsic else tails or [origin]
    return np.stack(points, axis=1)


def _frame(joint: Joint, degrees: bool) -> Rotation:
    by_letter = dict(zip("XYZ", joint.axis, strict=True))
    angles = [by_letter[letter] for letter in joint.axis_order]
    return Rotation.from_euler(joint.axis_order.lower(), angles, degrees=degrees)


def _rotation(skeleton: Skeleton, joint: Joint, tracks: list[tuple[str, np.ndarray]]) -> Rotation:
    first = dict(reversed(tracks))
    degrees = skeleton.angle_unit == "deg"
    whole = {kind[0] for kind in first if kind} & {
        kinds[0][0] for kinds in (QUATERNION, VECTOR) if all(kind in first for kind in kinds)
    }
    turn = Rotation.identity(len(tracks[0][1]) if tracks else 1)
    for kind, track in tracks:
        if kind[:1] == "r":
            step = Rotation.from_euler(kind[1], track[:, None], degrees=degrees)
        elif kind[:1] == "q" and "q" in whole:
            whole.remove("q")
            step = Rotation.from_quat(np.stack([first[q] for q in ("qx", "qy", "qz", "qw")], 1))
        elif kind[:1] == "v" and "v" in whole:
            whole.remove("v")
            vectors = np.stack([first[kind] for kind in VECTOR], 1)
            step = Rotation.from_rotvec(vectors, degrees=degrees)
        else:
            continue
        turn = turn * step if skeleton.intrinsic else step * turn
    return turn


def _arm(skeleton: Skeleton, values: np.ndarray, index: int, v: np.ndarray) -> np.ndarray:
    joint = skeleton.joints[index]
    columns = skeleton.columns(index)
    scales = np.ones(v.shape)
    done = set()
    for channel, k in zip(joint.channels, columns, strict=True):
        if channel.kind == "length" and joint.tails and np.linalg.norm(joint.tails[0]):
            unit = np.array(joint.tails[0]) / np.linalg.norm(joint.tails[0])
            v = v + values[:, k, None] * unit
        if channel.kind[:1] == "s" and channel.kind not in done:
            done.add(channel.kind)
            scales[:, "xyz".index(channel.kind[1])] = values[:, k]
    frame = _frame(joint, skeleton.angle_unit == "deg")
    return frame.apply(scales * frame.apply(v, inverse=True))
