"""A walk made from nothing: the clips of ``mcz sample``, the same bytes on every machine.

The skeleton has the 31 joints and the bone names that Acclaim files commonly have, with proportions
of its own. The legs follow rounded textbook curves of level walking, at each tenth of the gait
cycle; the rest are sines. Values are rounded to the printed digits, so that the last bits of a
machine's sine have no effect. Markers sit on the same skeleton.
"""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcz.model.motion import Channel, Joint, Motion, Signal, Skeleton, Vector
from mcz.model.numbers import Grid, GridKind

Floats = NDArray[np.float64]
Angles = tuple[float | Floats, float | Floats, float | Floats]

N_FRAMES = 240
FRAME_RATE = 120
CYCLE = 1.1  # seconds from one left heel strike to the next
SPEED = 22.0  # units a second: 1.24 m/s
UNIT_CM = 2.54 / 0.45  # the unit of Acclaim files that say ``length 0.45``

# Flexion in degrees at each tenth of the cycle, from heel strike to heel strike.
HIP = (27.0, 24.0, 16.0, 6.0, -3.0, -9.0, -5.0, 10.0, 24.0, 29.0)
KNEE = (5.0, 15.0, 17.0, 11.0, 6.0, 11.0, 34.0, 59.0, 52.0, 19.0)
ANKLE = (0.0, -4.0, 3.0, 7.0, 10.0, 5.0, -14.0, -10.0, -1.0, 3.0)
TOES = (2.0, 0.0, 0.0, 0.0, 6.0, 27.0, 38.0, 16.0, 4.0, 5.0)
# Height of the root above the ground in units, so that the lower foot stays on it.
HEIGHT = (17.02, 16.98, 16.86, 17.14, 17.02, 17.02, 16.98, 16.86, 17.14, 17.02)

# Left side and spine: name, parent, vector of the bone in the rest pose, axis, degrees of freedom.
# The vectors are in units; x points to the left, y up, z ahead.
LEG = (
    ("lhipjoint", "root", (1.7, -1.1, 0.2), (0, 0, 0), ""),
    ("lfemur", "lhipjoint", (1.32, -7.48, 0), (0, 0, 10), "rx ry rz"),
    ("ltibia", "lfemur", (1.28, -7.26, 0), (0, 0, 10), "rx"),
    ("lfoot", "ltibia", (0.19, -1.08, 2.3), (-90, 0, 10), "rx rz"),
    ("ltoes", "lfoot", (0, 0, 1.15), (-90, 0, 10), "rx"),
)
SPINE = (
    ("lowerback", "root", (0, 2.35, -0.15), (0, 0, 0), "rx ry rz"),
    ("upperback", "lowerback", (0, 2.4, 0.05), (0, 0, 0), "rx ry rz"),
    ("thorax", "upperback", (0, 2.4, 0.1), (0, 0, 0), "rx ry rz"),
    ("lowerneck", "thorax", (0, 1.45, 0.15), (0, 0, 0), "rx ry rz"),
    ("upperneck", "lowerneck", (0, 1.4, 0.1), (0, 0, 0), "rx ry rz"),
    ("head", "upperneck", (0, 1.9, 0.1), (0, 0, 0), "rx ry rz"),
)
ARM = (
    ("lclavicle", "thorax", (3.15, 0.75, -0.2), (0, 0, 0), "ry rz"),
    ("lhumerus", "lclavicle", (5.1, 0, 0), (0, 0, -90), "rx ry rz"),
    ("lradius", "lhumerus", (3.9, 0, 0), (0, 0, -90), "rx"),
    ("lwrist", "lradius", (0.9, 0, 0), (0, 90, 90), "ry"),
    ("lhand", "lwrist", (0.8, 0, 0), (0, 90, 90), "rx rz"),
    ("lfingers", "lhand", (0.85, 0, 0), (0, 90, 90), "rx"),
    ("lthumb", "lwrist", (0.6, -0.1, 0.55), (-90, 45, 0), "rx rz"),
)
# Markers of the left side, then those in the middle: name, joint, place along the joint's axes.
SIDE_MARKERS = (
    ("FHD", "head", (1.2, 1.3, 1.4)),
    ("BHD", "head", (1.2, 1.3, -1.2)),
    ("SHO", "lclavicle", (3.15, 1.4, -0.2)),
    ("ELB", "lhumerus", (5.1, 0, -0.6)),
    ("WRA", "lradius", (3.9, 0.1, 0.55)),
    ("WRB", "lradius", (3.9, 0.1, -0.55)),
    ("FIN", "lhand", (0.8, 0.25, 0)),
    ("ASI", "root", (2.2, 1.2, 1.8)),
    ("PSI", "root", (0.9, 1.3, -1.9)),
    ("THI", "lfemur", (2.1, -4.1, 0.4)),
    ("KNE", "lfemur", (2.3, -7.5, 0)),
    ("TIB", "ltibia", (1.6, -3.6, 0.3)),
    ("ANK", "ltibia", (2.0, -7.2, 0)),
    ("HEE", "lfoot", (0, -0.5, -0.9)),
    ("TOE", "lfoot", (0.2, -0.8, 2.3)),
)
MIDDLE_MARKERS = (
    ("C7", "thorax", (0, 2.5, -0.9)),
    ("T10", "upperback", (0, 0.6, -1.6)),
    ("CLAV", "thorax", (0, 1.7, 1.5)),
    ("STRN", "upperback", (0, 1.3, 2.0)),
)
# Frames in which no two cameras saw a marker.
GAPS = (("RWRB", 30, 44), ("LASI", 96, 121), ("RPSI", 150, 153), ("LHEE", 203, 240))
BVH_NAMES = {
    "root": "Hips",
    "lowerback": "LowerBack",
    "upperback": "Spine",
    "thorax": "Spine1",
    "lowerneck": "Neck",
    "upperneck": "Neck1",
    "head": "Head",
}
BVH_SIDE_NAMES = {
    "hipjoint": "HipJoint",
    "femur": "UpLeg",
    "tibia": "Leg",
    "foot": "Foot",
    "toes": "Toes",
    "clavicle": "Shoulder",
    "humerus": "Arm",
    "radius": "ForeArm",
    "wrist": "Wrist",
    "hand": "Hand",
    "fingers": "Fingers",
    "thumb": "Thumb",
}


def write_samples(folder: Path) -> list[Path]:
    """Write the sample files into ``folder``, replacing what is there."""
    paths = []
    for name, data in sample_files().items():
        (folder / name).write_bytes(data)
        paths.append(folder / name)
    return paths


def sample_files() -> dict[str, bytes]:
    """The bytes of the sample files by name."""
    from mcz.sources.c3d import c3d
    from mcz.sources.text import amc, asf, bvh

    walk = acclaim_walk()
    return {
        "walk.asf": asf.write(walk.skeleton),
        "walk.amc": amc.write(walk),
        "walk.bvh": bvh.write(bvh_walk()),
        "walk.c3d": c3d.write(marker_walk()),
    }


def acclaim_walk() -> Motion:
    """The walk on 31 Acclaim joints: 240 frames at 120 Hz, 62 channels, 6 significant digits."""
    skeleton = _acclaim_skeleton()
    angles = _angles(_times())
    columns = list(_root_position().T)
    for joint in skeleton.joints:
        rotation = dict(zip(("rx", "ry", "rz"), angles[joint.name], strict=True))
        columns += [rotation[c.kind] for c in joint.channels if c.kind in rotation]
    values = np.stack(columns, axis=1) + _slow_drift(len(columns))
    digits = [float(f"{value:.6g}") for value in values.flat]
    signal = _signal(np.array(digits).reshape(values.shape), Grid(GridKind.GENERAL, 6))
    return Motion(skeleton, (signal,), Fraction(FRAME_RATE), name="walk")


def bvh_walk() -> Motion:
    """The walk in BVH: 31 joints and 7 end sites in cm, 96 channels, 4 decimals."""
    walk = acclaim_walk()
    tracks = iter(walk.values.T)
    leaves = {j.name for j in walk.skeleton.joints} - {
        walk.skeleton.joints[j.parent].name for j in walk.skeleton.joints if j.parent >= 0
    }
    joints: list[Joint] = []
    columns: list[Floats] = []
    for joint in walk.skeleton.joints:
        track = {channel.kind: next(tracks) for channel in joint.channels}
        positions = [track.pop(k) * UNIT_CM for k in ("tx", "ty", "tz") if k in track]
        # Arms in another order than the rest: files that mix two orders are common.
        order = "zxy" if joint.name[1:] in {bone[0][1:] for bone in ARM} else "zyx"
        columns += positions + _euler(_local_rotation(joint, track), order)
        kinds = ("tx", "ty", "tz")[: len(positions)] + tuple("r" + letter for letter in order)
        joints.append(
            Joint(
                _bvh_name(joint.name),
                joint.parent,
                _centimeters(joint.offset),
                tuple(_centimeters(tail) for tail in joint.tails if joint.name in leaves),
                channels=tuple(Channel(kind) for kind in kinds),
            )
        )
    # Values halfway between two decimals are common, and the last bit of a sine, which differs from
    # machine to machine, would decide them: that bit is rounded away first.
    values = np.rint(np.round(np.stack(columns, axis=1), 9) * 1e4) / 1e4
    skeleton = Skeleton(tuple(joints), name="walk")
    signal = _signal(values, Grid(GridKind.FIXED, 4))
    return Motion(skeleton, (signal,), Fraction(FRAME_RATE), name="walk")


def marker_walk() -> Motion:
    """The walk as 34 markers in mm, to 0.01 mm; x ahead, y to the left, z up, with gaps."""
    walk = acclaim_walk()
    placed = _place_joints(walk)
    labels, columns = [], []
    for label, joint, (x, y, z) in _markers():
        origin, turn = placed[joint]
        point = origin + turn @ np.array((x, y, z))
        labels.append(label)
        columns += [point[:, 2], point[:, 0], point[:, 1]]
    values = np.rint(np.stack(columns, axis=1) * (UNIT_CM * 1000)) / 100
    mask = np.ones(values.shape, np.bool_)
    for label, start, stop in GAPS:
        first = 3 * labels.index(label)
        mask[start:stop, first : first + 3] = False
    values[~mask] = 0.0  # as cameras' programs write what they did not see
    channels = tuple(Channel(kind) for kind in ("tx", "ty", "tz"))
    joints = tuple(Joint(label, channels=channels) for label in labels)
    skeleton = Skeleton(joints, name="walk", unit_cm=0.1, angle_unit="", up_axis="z")
    grid = Grid(GridKind.BINARY32)
    values = grid.values(grid.ordinals(values + 0.0)[0])
    signal = Signal(values, (grid,) * values.shape[1], mask=mask)
    return Motion(skeleton, (signal,), Fraction(FRAME_RATE), name="walk")


def _markers() -> Iterator[tuple[str, str, Vector]]:
    """All markers, the right side mirrored from the left."""
    for side, mirror in (("L", 1), ("R", -1)):
        for name, joint, (x, y, z) in SIDE_MARKERS:
            if side == "R" and joint.startswith("l") and joint != "lowerneck":
                joint = "r" + joint[1:]
            yield side + name, joint, (mirror * x, y, z)
    yield from MIDDLE_MARKERS


def _place_joints(walk: Motion) -> dict[str, tuple[Floats, Floats]]:
    """Origin (n_frames, 3) and turn (n_frames, 3, 3) of every joint in the world."""
    tracks = iter(walk.values.T)
    joints = walk.skeleton.joints
    placed: dict[str, tuple[Floats, Floats]] = {}
    for joint in joints:
        track = {channel.kind: next(tracks) for channel in joint.channels}
        turn = _local_rotation(joint, track)
        if joint.parent < 0:
            origin = np.stack([track[kind] for kind in ("tx", "ty", "tz")], axis=1)
        else:
            start, above = placed[joints[joint.parent].name]
            origin, turn = start + above @ np.array(joint.offset), above @ turn
        placed[joint.name] = origin, turn
    return placed


def _signal(values: Floats, grid: Grid) -> Signal:
    return Signal(values + 0.0, (grid,) * values.shape[1])  # + 0.0 turns -0 into 0


def _times() -> Floats:
    """Seconds of every frame."""
    return np.arange(N_FRAMES) / FRAME_RATE


def _acclaim_skeleton() -> Skeleton:
    root_channels = tuple(Channel(kind) for kind in ("tx", "ty", "tz", "rx", "ry", "rz"))
    joints = [Joint("root", channels=root_channels)]
    for name, parent, vector, axis, dof in _bones():
        index = next(i for i, joint in enumerate(joints) if joint.name == parent)
        offset = joints[index].tails[0] if joints[index].tails else (0.0, 0.0, 0.0)
        channels = tuple(Channel(kind) for kind in dof.split())
        joints.append(Joint(name, index, offset, (vector,), axis, channels=channels))
    return Skeleton(tuple(joints), name="walk", unit_cm=UNIT_CM, intrinsic=False)


def _bones() -> Iterator[tuple[str, str, Vector, Vector, str]]:
    """All bones, parents first, the right side mirrored from the left."""
    for group, sides in ((LEG, "lr"), (SPINE, " "), (ARM, "lr")):
        for side in sides:
            for name, parent, (x, y, z), (ax, ay, az), dof in group:
                if side == "r":
                    parent = "r" + parent[1:] if parent.startswith("l") else parent
                    yield "r" + name[1:], parent, (-x, y, z), (ax, -ay, -az), dof
                else:
                    yield name, parent, (x, y, z), (ax, ay, az), dof


def _root_position() -> Floats:
    """Position of the root in units, shape (n_frames, 3)."""
    seconds = _times()
    phase = seconds / CYCLE
    sway = 0.35 * np.sin(2 * np.pi * (phase - 0.05))
    surge = 0.12 * np.sin(4 * np.pi * (phase + 0.1))
    return np.stack([sway, _curve(HEIGHT, phase), SPEED * seconds + surge], axis=1)


def _angles(seconds: Floats) -> dict[str, Angles]:
    """Rotations rx, ry, rz in degrees of every joint, about its local axes."""
    phase = seconds / CYCLE
    wave = np.sin(2 * np.pi * (phase + 0.2))
    bob = np.cos(4 * np.pi * phase)
    angles: dict[str, Angles] = {
        "root": (2.0 + 0.8 * bob, -4.0 * wave, 1.8 * np.sin(2 * np.pi * (phase - 0.03))),
        "lowerback": (1.0 + 0.5 * bob, 2.0 * wave, -1.0 * wave),
        "upperback": (1.5 - 0.3 * bob, 2.5 * wave, -0.6 * wave),
        "thorax": (0.5, 2.5 * wave, 0.3 * wave),
        "lowerneck": (4.0 + 0.6 * bob, -1.2 * wave, 0.2 * wave),
        "upperneck": (-3.0 - 0.4 * bob, -1.0 * wave, 0.1 * wave),
        "head": (-2.0, -0.8 * wave, 0.2 * wave),
    }
    angles |= _side(phase)
    for name, (rx, ry, rz) in _side(phase + 0.5).items():
        angles["r" + name[1:]] = (rx, -1 * ry, -1 * rz)
    zero = np.zeros_like(seconds)
    return {name: (x + zero, y + zero, z + zero) for name, (x, y, z) in angles.items()}


def _side(phase: Floats) -> dict[str, Angles]:
    """Rotations of the left leg and arm, whose heel strikes at whole ``phase``."""
    step = np.cos(2 * np.pi * phase)
    return {
        "lhipjoint": (0.0, 0.0, 0.0),
        "lfemur": (-_curve(HIP, phase), 3.0 * step, -9.0 - 1.5 * step),
        "ltibia": (_curve(KNEE, phase), 0.0, 0.0),
        "lfoot": (-_curve(ANKLE, phase), 0.0, 6.0 + 2.0 * step),
        "ltoes": (-_curve(TOES, phase), 0.0, 0.0),
        "lclavicle": (0.0, 1.5 * step, -4.0 + 0.6 * step),
        "lhumerus": (2.0 - 17.0 * step, 5.0 + 2.0 * step, -74.0 + 1.5 * step),
        "lradius": (24.0 - 11.0 * np.cos(2 * np.pi * (phase - 0.06)), 0.0, 0.0),
        "lwrist": (0.0, 8.0 + 2.0 * step, 0.0),
        "lhand": (6.0 - 3.0 * step, 0.0, 2.0 + 1.0 * step),
        "lfingers": (18.0 - 2.0 * step, 0.0, 0.0),
        "lthumb": (10.0 + 1.0 * step, 0.0, -6.0),
    }


def _curve(tenths: tuple[float, ...], phase: Floats) -> Floats:
    """The smooth periodic curve through ten values a cycle (its harmonics 0 to 4)."""
    table = np.array(tenths)
    at = np.arange(10) / 10
    total = np.full_like(phase, table.mean())
    for k in range(1, 5):
        cosine = table @ np.cos(2 * np.pi * k * at) / 5
        sine = table @ np.sin(2 * np.pi * k * at) / 5
        total += cosine * np.cos(2 * np.pi * k * phase) + sine * np.sin(2 * np.pi * k * phase)
    return total


def _slow_drift(n_channels: int) -> Floats:
    """Slow drift that keeps two cycles from being equal, (n_frames, n_channels)."""
    number = np.arange(n_channels)
    rate = 0.23 + 0.41 * np.modf(number * 0.618)[0]  # Hz, spread by the golden ratio
    size = np.where(number < 3, 0.03, 0.35)  # units for the root's position, else degrees
    drift: Floats = size * np.sin(2 * np.pi * rate * _times()[:, None] + number)
    return drift


def _local_rotation(joint: Joint, angles: dict[str, Floats]) -> Floats:
    """Rotation of an Acclaim joint along the axes of its parent, (n_frames, 3, 3)."""
    frame = _rotate_fixed(*(np.full(1, np.deg2rad(angle)) for angle in joint.axis))[0]
    zero = np.zeros(N_FRAMES)
    turn = _rotate_fixed(*(np.deg2rad(angles.get(kind, zero)) for kind in ("rx", "ry", "rz")))
    local: Floats = frame @ turn @ frame.T
    return local


def _rotate_fixed(x: Floats, y: Floats, z: Floats) -> Floats:
    """Rotation about the fixed axes x, then y, then z, angles in radians, (n, 3, 3)."""
    turn: Floats = _axis_rotation("z", z) @ _axis_rotation("y", y) @ _axis_rotation("x", x)
    return turn


def _axis_rotation(axis: str, angle: Floats) -> Floats:
    """Rotation about one axis, (n, 3, 3)."""
    i = "xyz".index(axis)
    j, k = (i + 1) % 3, (i + 2) % 3
    turn = np.zeros((len(angle), 3, 3))
    turn[:, i, i] = 1
    turn[:, j, j] = turn[:, k, k] = np.cos(angle)
    turn[:, k, j] = np.sin(angle)
    turn[:, j, k] = -turn[:, k, j]
    return turn


def _euler(turn: Floats, order: str) -> list[Floats]:
    """Angles in degrees, in the order given, whose intrinsic rotation is ``turn``."""
    if order == "zyx":
        z = np.arctan2(turn[:, 1, 0], turn[:, 0, 0])
        y = np.arcsin(np.clip(-turn[:, 2, 0], -1, 1))
        x = np.arctan2(turn[:, 2, 1], turn[:, 2, 2])
    else:
        z = np.arctan2(-turn[:, 0, 1], turn[:, 1, 1])
        x = np.arcsin(np.clip(turn[:, 2, 1], -1, 1))
        y = np.arctan2(-turn[:, 2, 0], turn[:, 2, 2])
    angles = {"x": x, "y": y, "z": z}
    return [np.rad2deg(angles[letter]) for letter in order]


def _bvh_name(name: str) -> str:
    if name in BVH_NAMES:
        return BVH_NAMES[name]
    return {"l": "Left", "r": "Right"}[name[0]] + BVH_SIDE_NAMES[name[1:]]


def _centimeters(vector: Vector) -> Vector:
    """``vector`` in centimeters, to the 5 decimals that BVH files print."""
    x, y, z = (round(component * UNIT_CM, 5) + 0.0 for component in vector)
    return x, y, z
