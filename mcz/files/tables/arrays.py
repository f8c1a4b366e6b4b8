"""Arrays of an NPZ beside a motion's channels, for use without MCZ."""

from __future__ import annotations

import numpy as np

from mcz.errors import MotionError
from mcz.kinematics.frames import frame_poses_of
from mcz.kinematics.poses import point_names, positions, rotations
from mcz.model.motion import Motion
from mcz.model.types import Items

ABOUT = (
    "MCZ arrays 1. World rotation of joint j in frame f: W[f, j] = W[f, parents[j]] R(quaternions"
    "[f, j]), w first, active, column vectors; the identity in the rest pose. Its place: o[f, j] = "
    "o[f, parents[j]] + W[f, parents[j]] translations[f, j]; for parents[j] = -1 without the first "
    "term and W. Places of points are in positions, those of joint point_joints[p] at o[f, j] + "
    "W[f, j] point_tails[p] where nothing is scaled. Lengths in units of unit_cm centimeters. "
    "values are the channels as the file has them, called names; invalid where mask is False, and "
    "what depends on them is NaN."
)


def pose_arrays(motion: Motion) -> dict[str, Items]:
    """Skeleton, rotations, translations and positions of a motion, by name; see ``ABOUT``.

    Rotations and places are left out where the skeleton has no kinematics.
    """
    skeleton = motion.skeleton
    known: dict[str, Items] = {
        "about": np.array(ABOUT),
        "name": np.array(motion.name),
        "joint_names": np.array(skeleton.joint_names, np.str_),
        "parents": skeleton.parents,
        "offsets": skeleton.offsets,
        "unit_cm": np.array(np.nan if skeleton.unit_cm is None else skeleton.unit_cm),
        "up_axis": np.array(skeleton.up_axis),
        "forward_axis": np.array(skeleton.forward_axis),
        "handedness": np.array(skeleton.handedness),
        "angle_unit": np.array(skeleton.angle_unit),
        "metadata_keys": np.array(list(motion.metadata), np.str_),
        "metadata_values": np.array(list(motion.metadata.values()), np.str_),
    }
    try:
        return known | _poses(motion)
    except MotionError:  # plain scalars, or angles of an unknown unit
        return known


def _poses(motion: Motion) -> dict[str, Items]:
    skeleton = motion.skeleton
    poses = frame_poses_of(skeleton)
    points = positions(motion)
    joints = range(skeleton.n_joints)
    values = np.asarray(motion.values, np.float64)
    origins, world = poses.origins(values, joints), poses.world(values, joints)
    translations = origins.copy()
    for joint, parent in enumerate(skeleton.parents):
        if parent >= 0:
            step = origins[:, joint] - origins[:, parent]
            translations[:, joint] = np.einsum("fji,fj->fi", world[:, parent], step)
    return {
        "quaternions": rotations(motion, "quat"),
        "translations": translations,
        "positions": points,
        "point_names": np.array(point_names(skeleton), np.str_),
        "point_joints": np.array(poses.joints_of(range(points.shape[1])), np.int64),
        "point_tails": poses.tails(),
    }
