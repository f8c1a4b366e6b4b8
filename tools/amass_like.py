"""AMCs as NPZ files like those of AMASS: rotation vectors of SMPL-H, positions, betas, a rate.

    python tools/amass_like.py FOLDER_OF_AMC OUT [--float32] [--clean] [--compressed]

AMASS itself may not be passed on, so what is measured on such files is measured on these. Turns
and positions are those of the AMC, through SciPy; hands have none, and are 0. Members, their order,
names and types are those of AMASS, as ``numpy.savez`` writes them. A joint that turns about one
axis has rounding errors of some 1e-16 about the others; with --clean they are 0. --compressed
files are those of ``numpy.savez_compressed``.
"""

from __future__ import annotations

import argparse
import warnings
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

import mcz
from mcz.sources.arrays.skeletons import tree

RATE = 120.0  # of CMU's recordings
SIDES = {"left": "l", "right": "r"}
OF_SIDES = {
    "hip": "femur",
    "knee": "tibia",
    "ankle": "foot",
    "foot": "toes",
    "collar": "clavicle",
    "shoulder": "humerus",
    "elbow": "radius",
    "wrist": "hand",
}
BONES = {  # of joints of SMPL-H, the bones of CMU's ASFs
    "pelvis": "root",
    "spine1": "lowerback",
    "spine2": "upperback",
    "spine3": "thorax",
    "neck": "lowerneck",
    "head": "head",
    **{f"{s}_{j}": f"{b}{bone}" for s, b in SIDES.items() for j, bone in OF_SIDES.items()},
}


ROUNDING = 1e-12  # radians


def amass_like(path: Path, dtype: str, clean: bool = False) -> dict[str, np.ndarray]:
    """The arrays of one AMC, floats of type ``dtype``."""
    motion = mcz.read(path)
    body = tree("smplh")
    turns = mcz.rotations(motion, "matrix")
    names = list(motion.skeleton.joint_names)
    poses = np.zeros((motion.n_frames, body.n_joints, 3))
    for joint, name in enumerate(body.names):
        bone = BONES.get(name)
        if bone in names:
            matrices = turns[:, names.index(bone)]
            poses[:, joint] = Rotation.from_matrix(matrices).as_rotvec()
    if clean:
        poses[np.abs(poses) < ROUNDING] = 0
    meters = (motion.skeleton.unit_cm or 1.0) / 100
    rng = np.random.default_rng(int.from_bytes(path.stem.split("_")[0].encode(), "big"))
    return {
        "trans": (motion.values[:, :3] * meters).astype(dtype),
        "gender": np.array(rng.choice(["male", "female"])),
        "mocap_framerate": np.array(RATE),
        "betas": rng.normal(size=16).astype(dtype),
        "poses": poses.reshape(motion.n_frames, -1).astype(dtype),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("amcs", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--float32", action="store_true")
    parser.add_argument("--clean", action="store_true")
    parser.add_argument("--compressed", action="store_true")
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mcz.SkeletonWarning)
        for path in sorted(args.amcs.glob("*.amc")):
            arrays = amass_like(path, "f4" if args.float32 else "f8", args.clean)
            save = np.savez_compressed if args.compressed else np.savez
            save(args.out / f"{path.stem}_poses.npz", **arrays)


if __name__ == "__main__":
    main()
