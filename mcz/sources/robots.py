"""Robot layouts: names and units for the columns of tables and arrays of robot motion.

A row of such a file is the position of the root in meters, its rotation as a quaternion and the
angles of the joints in radians, without a header. ``robot_layouts.json`` has the joints of known
robots in the order of their columns, and the public description that they come from.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from mcz.model.motion import Channel, Joint, Motion, Skeleton
from mcz.model.types import Values

N_POSITION, N_ROOT = 3, 7  # columns of the root: its position, then a quaternion
NOTE, SEPARATOR = "the columns ", "; "
NORM_ERROR = 2e-3  # of a printed unit quaternion


@dataclass(frozen=True, slots=True)
class RobotLayout:
    """Columns of a robot: ``quaternion`` is "xyzw", "wxyz" or "" if no source states it."""

    source: str
    quaternion: str
    joints: tuple[str, ...]


@cache
def robot_layouts() -> dict[str, RobotLayout]:
    """The known layouts, by names such as "unitree-g1-29"."""
    text = Path(__file__).with_name("robot_layouts.json").read_text("utf-8")
    rows = json.loads(text).items()
    return {
        name: RobotLayout(row["source"], row["quaternion"], tuple(row["joints"]))
        for name, row in rows
    }


def with_robot_layout(motion: Motion, name: str) -> Motion | None:
    """``motion`` with the column names of a layout; None if the number of columns is another.

    The columns are the joints alone, or the root and the joints.
    """
    layout = robot_layouts()[name]
    n_root = motion.skeleton.n_channels - len(layout.joints)
    if n_root not in (0, N_ROOT):
        return None
    order = (layout.quaternion or _quaternion_order(motion.values)) if n_root else ""
    metadata = without_robot(motion.metadata) | {"x-robot": name}
    return replace(motion, skeleton=_skeleton(layout.joints, order), metadata=metadata)


def without_robot(metadata: Mapping[str, str]) -> dict[str, str]:
    """``metadata`` without the layout that was recognized, if another source names columns."""
    notes = metadata.get("source-note", "").split(SEPARATOR)
    note = SEPARATOR.join(note for note in notes if not note.startswith(NOTE))
    others = {k: text for k, text in metadata.items() if k not in ("source-note", "x-robot")}
    return others | ({"source-note": note} if note else {})


def recognize_robot(motion: Motion) -> Motion:
    """``motion``, of columns without names, as that of the one layout that it fits, with a note.

    A layout fits by the number of columns, of which four are a unit quaternion in every row.
    """
    n_joints = motion.skeleton.n_channels - N_ROOT
    fitting = {n: each for n, each in robot_layouts().items() if len(each.joints) == n_joints}
    order = _quaternion_order(motion.values) if fitting else ""
    names = [name for name, each in fitting.items() if order and each.quaternion in ("", order)]
    if not names:
        return motion
    named = with_robot_layout(motion, names[0]) if len(names) == 1 else None
    note = f"{NOTE}are those of {names[0]}: {n_joints} joints and a unit quaternion"
    if named is None:
        note = f"{NOTE}may be those of {' or '.join(names)} (the option arrays states it)"
    notes = filter(None, (motion.metadata.get("source-note", ""), note))
    motion = named or motion
    return replace(motion, metadata=dict(motion.metadata) | {"source-note": SEPARATOR.join(notes)})


def _quaternion_order(values: Values) -> str:
    """Order of the quaternion in the columns of the root, "xyzw" or "wxyz"; "" without one.

    A robot mostly stands upright, and then two of x, y, z and w are near 0: x and y.
    """
    parts = values[:, N_POSITION:N_ROOT]
    if parts.shape[1] < N_ROOT - N_POSITION or not len(parts):
        return ""
    if not (np.abs(np.linalg.norm(parts, axis=1) - 1) <= NORM_ERROR).all():  # NaN is none
        return ""
    first, _, third, _ = (parts**2).sum(axis=0)
    return "xyzw" if first <= third else "wxyz"


def _skeleton(joints: Sequence[str], order: str) -> Skeleton:
    """Plain scalars: a joint for each part of the root, if there is one, and for each joint."""
    root = [("root x", "m"), ("root y", "m"), ("root z", "m")] if order else []
    root += [(f"root q{part}", "") for part in order]
    columns = [*root, *((name, "rad") for name in joints)]
    scalars = (Joint(name, channels=(Channel("", "value", unit),)) for name, unit in columns)
    return Skeleton(tuple(scalars), angle_unit="")
