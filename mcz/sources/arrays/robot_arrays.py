"""Arrays of robots: joint angles, names of joints and bodies, the root."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mcz.model.motion import Channel
from mcz.sources.arrays.columns import Array
from mcz.sources.robots import NOTE, robot_layouts

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
    """The texts of the first array that has one of the names ``keys``, () where there is none."""
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
    """A text of an array of texts, None where it is empty or not printable."""
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
