"""Skeletons of arrays: of robots, of body models (annex ``body_trees.json``), of callers.

Bone lengths are not included: ``body_models`` takes them from a model file, or from positions of a
data set.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from mcz.errors import MotionError, OptionError
from mcz.model.checks import check_arguments
from mcz.model.extras import annex_bytes
from mcz.model.motion import (
    ORIGIN,
    POSITION_KINDS,
    QUATERNION_KINDS,
    ROTATION_KINDS,
    VECTOR_KINDS,
    Channel,
    Joint,
    Motion,
    Skeleton,
)
from mcz.model.types import Items
from mcz.sources.arrays.columns import Array
from mcz.sources.robots import N_ROOT, NOTE, robot_layouts, with_robot_layout

JOINT_NAMES = ("joint_names", "dof_names", "skeleton_tree/node_names")
BODY_NAMES = ("body_names", "link_names", "link_body_list")
JOINTS = {  # arrays that have a column for each joint, and their units
    "joint_pos": "rad",
    "dof_pos": "rad",
    "dof": "rad",
    "joint_vel": "rad/s",
    "dof_vel": "rad/s",
}
ROOT_POSITIONS = ("root_pos", "root_trans", "root_trans_offset")
ROOT_ROTATION = "root_rot"
BODIES = ("body_", "local_body_")  # begin the names of arrays with a row for each body
LARGE_PART, SMALL_PART = 0.25, 0.02  # of the squares of a quaternion
ALIKE = 0.9  # of the joints of a robot that are named like bodies


def names_of(arrays: Sequence[Array], keys: Sequence[str]) -> tuple[str, ...]:
    """The texts of the first array that has one of the names ``keys``, () if there is none."""
    for array in arrays:
        if array.name in keys and array.words is None and len(array.head.shape) == 1:
            code = array.head.code
            size = int(code[1:]) * (4 if code[0] == "U" else 1) if code[:1] in ("U", "S") else 0
            if size and size * array.head.shape[0] <= len(array.text):
                parts = [array.text[k : k + size] for k in range(0, len(array.text), size)]
                texts = [decode_text(part, array) for part in parts[: array.head.shape[0]]]
                return tuple(text for text in texts if text) if all(texts) else ()
    return ()


def decode_text(data: bytes, array: Array) -> str | None:
    """A text of an array of texts, None if it is empty or not printable."""
    encoding = "utf-8"
    if array.head.code[0] == "U":
        encoding = "utf-32-be" if array.head.big_endian else "utf-32-le"
    try:
        text = data.decode(encoding).rstrip("\0")
    except UnicodeDecodeError:
        return None
    return text if text.isprintable() and text else None


def is_robot(array: Array) -> bool:
    """Return True for the joint angles of a robot, a column for each joint."""
    return JOINTS.get(array.name) == "rad" and len(array.head.shape) == 2


def joint_names(arrays: Sequence[Array], n_joints: int) -> tuple[tuple[str, ...], str, str]:
    """The names of ``n_joints`` joints, () if unknown, the robot layout they are of, and a note."""
    names = names_of(arrays, JOINT_NAMES)
    if len(names) == n_joints:
        return names, "", ""
    layouts = {n: each for n, each in robot_layouts().items() if len(each.joints) == n_joints}
    bodies = [body.removesuffix("_link") for body in names_of(arrays, BODY_NAMES)]
    for name, layout in layouts.items():
        stems = [joint.removesuffix("_joint") for joint in layout.joints]
        common = [body for body in bodies if body in stems]
        if len(common) >= ALIKE * n_joints and common == [s for s in stems if s in common]:
            return layout.joints, name, ""
    robots = " or ".join(layouts)
    return (), "", f"{NOTE}may be those of {robots} (the option arrays states it)" if robots else ""


def robot_channels(array: Array, arrays: Sequence[Array]) -> tuple[Channel, ...] | None:
    """The channels of an array of a robot, None of any other."""
    inner = array.head.shape[1:]
    if array.name in JOINTS and len(inner) == 1:
        names = joint_names(arrays, inner[0])[0]
        unit = JOINTS[array.name]
        return tuple(Channel("", name, unit) for name in names) if names else None
    if array.name in ROOT_POSITIONS and inner == (3,):
        return tuple(Channel("", axis, "m") for axis in "xyz")
    if array.name == ROOT_ROTATION and inner == (4,):
        return None if _has_w_first(array) else tuple(Channel("", f"q{part}") for part in "xyzw")
    return None


def _has_w_first(array: Array) -> bool:
    """Return True for quaternions that contradict the order x y z w of root rotations.

    A robot mostly stands: then x and y are small, and large numbers before two small ones are w.
    """
    with np.errstate(all="ignore"):  # of infinities
        squares = np.square(array.numbers.astype(np.float64)).sum(axis=0)
        total = squares.sum()
    return bool(squares[0] > LARGE_PART * total and squares[1:3].sum() < SMALL_PART * total)


ANNEX = "body_trees.json"
METER_CM = 100.0
TURNS = {"rotvec": VECTOR_KINDS, "quat": QUATERNION_KINDS, "euler": ROTATION_KINDS, "": ()}


@dataclass(frozen=True, slots=True)
class BodyTree:
    """The joints of a body model: parents before children, -1 is the parent of the root."""

    name: str
    title: str
    names: tuple[str, ...]
    parents: tuple[int, ...]

    @property
    def n_joints(self) -> int:
        return len(self.names)


def tree(which: str | int) -> BodyTree:
    """The tree of a name, "smpl", "smplh", "smplx" or "humanml3d", or of a number of joints.

    Raises OptionError if there is none.
    """
    trees = _trees()
    for each in trees.values():
        if which in (each.name, each.n_joints):
            return each
    known = ", ".join(f"{each.name} ({each.n_joints} joints)" for each in trees.values())
    raise OptionError(f"unknown body tree {which!r}; the body trees are {known}")


def has_tree(which: str | int) -> bool:
    """Return True if there is a tree of that name or number of joints."""
    return any(which in (each.name, each.n_joints) for each in _trees().values())


@cache
def _trees() -> dict[str, BodyTree]:
    rows = json.loads(annex_bytes(ANNEX))
    trees = (
        BodyTree(
            row["name"],
            row["title"],
            tuple(joint["name"] for joint in row["joints"]),
            tuple(joint["parent"] for joint in row["joints"]),
        )
        for row in rows
    )
    return {each.name: each for each in trees}


@check_arguments()
def body_skeleton(
    body: BodyTree | str | int,
    offsets: Items | None = None,
    *,
    turns: str = "rotvec",
    moves: bool = True,
    unit_cm: float | None = METER_CM,
    angle_unit: str = "rad",
    up_axis: str = "",
) -> Skeleton:
    """A skeleton of the joints of ``body``, a tree or what ``tree`` takes, each with its turns.

    ``offsets`` (n_joints, 3), in length units, lead from each parent to its joint; that of the
    root is where the root is while its positions are 0. Without them all bones have no length.
    ``turns`` is "rotvec", "quat", "euler" (rx ry rz) or "" for none; with ``moves`` the root has
    tx ty tz before these. Raises OptionError if ``offsets`` do not match.
    """
    body = body if isinstance(body, BodyTree) else tree(body)
    if turns not in TURNS:
        raise OptionError(
            f"unknown turns {turns!r}; they must be one of {', '.join(filter(None, TURNS))}"
        )
    if offsets is not None:
        offsets = np.asarray(offsets, np.float64)
        if offsets.shape != (body.n_joints, 3) or not np.isfinite(offsets).all():
            raise OptionError(
                f"offsets have shape {offsets.shape}; the {body.n_joints} joints of "
                f"{body.title} need ({body.n_joints}, 3) finite numbers"
            )
    joints = []
    for index, (name, parent) in enumerate(zip(body.names, body.parents, strict=True)):
        kinds = (*POSITION_KINDS, *TURNS[turns]) if moves and parent < 0 else TURNS[turns]
        offset = ORIGIN if offsets is None else tuple(offsets[index].tolist())
        joints.append(Joint(name, parent, offset, channels=tuple(map(Channel, kinds))))
    return Skeleton(
        tuple(joints), body.title, unit_cm=unit_cm, angle_unit=angle_unit, up_axis=up_axis
    )


skeleton_of = body_skeleton


KINDS = {
    "positions": ("tx", "ty", "tz"),
    "rotation-vectors": ("vx", "vy", "vz"),
    "quaternions-wxyz": ("qw", "qx", "qy", "qz"),
    "quaternions-xyzw": ("qx", "qy", "qz", "qw"),
}


def kinds_of(name: str) -> tuple[str, ...]:
    """The channel kinds of a joint, () of a robot; raises OptionError for an unknown name."""
    if name not in KINDS and name not in robot_layouts():
        raise OptionError(
            f"arrays is {name!r}; it must be one of {', '.join((*KINDS, *robot_layouts()))}"
        )
    return KINDS.get(name, ())


def with_kinds(motion: Motion, name: str) -> Motion:
    """``motion``, one of plain numbers, as joints of what ``name`` says, named by their number.

    A robot layout names the columns of tables, too.

    A motion of anything else is returned as it is. Raises OptionError for an unknown name, and
    MotionError if the numbers of a frame are no such joints.
    """
    kinds = kinds_of(name)
    source, skeleton = motion.source, motion.skeleton
    if source is None or source.format not in ("npy", "npz", "pickle", "torch", "csv"):
        return motion
    if any(channel.kind for channel in skeleton.channels):
        return motion
    if not kinds:
        return _as_robot(motion, name)
    if source.format == "csv":
        return motion
    n_joints, rest = divmod(skeleton.n_channels, len(kinds))
    odd = {len(joint.channels) for joint in skeleton.joints} - {1, len(kinds)}
    if rest or odd:
        each = odd.pop() if odd else skeleton.n_channels
        raise MotionError(f"{name} have {len(kinds)} numbers a joint, but the array has {each}")
    channels = tuple(map(Channel, kinds))
    joints = tuple(Joint(str(number), channels=channels) for number in range(n_joints))
    angle_unit = "rad" if name == "rotation-vectors" else skeleton.angle_unit
    named = Skeleton(
        joints,
        skeleton.name,
        unit_cm=skeleton.unit_cm,
        angle_unit=angle_unit,
        up_axis=skeleton.up_axis,
        forward_axis=skeleton.forward_axis,
        handedness=skeleton.handedness,
    )
    return replace(motion, skeleton=named)


def _as_robot(motion: Motion, name: str) -> Motion:
    robot = with_robot_layout(motion, name)
    if robot is None:
        n = len(robot_layouts()[name].joints)
        raise MotionError(
            f"{name} has {n} columns, or {n + N_ROOT} with the root, but the array has "
            f"{motion.skeleton.n_channels}"
        )
    return robot
