"""Motions whose joints turn by rotation vectors or quaternions, made of others with SciPy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

import mcz
from mcz import Channel, Joint, Motion, Signal
from mcz.kinematics.rotations import continuous
from mcz.model.motion import POSITION_KINDS, QUATERNION_KINDS, TURNING_KINDS, VECTOR_KINDS

NO_AXIS = (0.0, 0.0, 0.0)


def turned_by(motion: Motion, form: str, dtype: type = np.float64, radians: bool = True) -> Motion:
    """``motion`` with all turns as ``form``, "rotvec" or "quat"; no joint has an ``axis``.

    Vectors follow each other; ``dtype`` is what the numbers are rounded to.
    """
    matrices = mcz.rotations(motion, "matrix")
    skeleton = motion.skeleton
    joints: list[Joint] = []
    columns: list[np.ndarray] = []
    for index, joint in enumerate(skeleton.joints):
        own = dict(zip((c.kind for c in joint.channels), skeleton.columns(index), strict=True))
        moves = [kind for kind in POSITION_KINDS if kind in own]
        kinds = (*moves, *_kinds(joint, form))
        columns += [motion.values[:, own[kind]] for kind in moves]
        turns = Rotation.from_matrix(matrices[:, index])
        if len(kinds) > len(moves):
            if form == "quat":
                columns += list(turns.as_quat(scalar_first=True).T)
            else:
                columns += list(continuous(turns.as_rotvec().T) * (1 if radians else 180 / np.pi))
        channels = tuple(map(Channel, kinds))
        joints.append(replace(joint, axis=NO_AXIS, channels=channels))
    values = np.stack(columns, axis=1).astype(dtype).astype(np.float64)
    made = replace(
        skeleton,
        joints=tuple(joints),
        angle_unit="rad" if radians else "deg",
        base=None,
        source=None,
    )
    return replace(motion, skeleton=made, signals=(Signal(values),), source=None)


def _kinds(joint: Joint, form: str) -> tuple[str, ...]:
    if not any(channel.kind in TURNING_KINDS for channel in joint.channels):
        return ()
    return QUATERNION_KINDS if form == "quat" else VECTOR_KINDS
