"""The generated walk: counts, printed digits, and that it is a walk."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from mcz import Motion
from mcz.sample import UNIT_CM, acclaim_walk, bvh_walk

# A change here changes what every newcomer sees first: make it on purpose.
SHA256 = {
    "walk.asf": "a5b003043808847baa715e5fa81004882edc8f81ed5154d8e02a0160b7de584a",
    "walk.amc": "2d49b636d6f50ff1a170d403eaa665938e4b88950f3bf27e566312e164201da3",
    "walk.bvh": "a6e486a9c552992490e6bd9c5e2df769acc04ccfefdf1e86a4dc3fb35cfd913e",
    "walk.c3d": "998a58d890556986e9b0bd96728f8f94df6d014af3cc08888f818178a20bc865",
}
BVH_OF = {"head": "Head", "lfoot": "LeftFoot", "rtoes": "RightToes", "lhand": "LeftHand"}


def local_turns(tracks: dict[str, NDArray[np.float64]], n: int) -> Rotation:
    """A second derivation of the joint's rotation, by SciPy."""
    rotations = [(kind[1], track) for kind, track in tracks.items() if kind[0] == "r"]
    letters = "".join(letter for letter, _ in rotations)
    if not letters:
        return Rotation.identity(n)
    angles = np.stack([track for _, track in rotations], axis=1)
    return Rotation.from_euler(letters.upper(), angles, degrees=True)


def points(motion: Motion) -> dict[str, NDArray[np.float64]]:
    """World positions of every joint's origin, and of its last tail as ``name>``."""
    tracks = iter(motion.values.T)
    n = motion.n_frames
    turns: list[Rotation] = []
    found: dict[str, NDArray[np.float64]] = {}
    origins = []
    for joint in motion.skeleton.joints:
        own = {channel.kind: next(tracks) for channel in joint.channels}
        if motion.skeleton.intrinsic:
            turn = local_turns(own, n)
        else:
            zero = np.zeros(n)
            angles = np.stack([own.get(k, zero) for k in ("rx", "ry", "rz")], axis=1)
            frame = Rotation.from_euler("xyz", joint.axis, degrees=True)
            turn = frame * Rotation.from_euler("xyz", angles, degrees=True) * frame.inv()
        if joint.parent < 0:
            origin = np.stack([own["tx"], own["ty"], own["tz"]], axis=1)
        else:
            above = turns[joint.parent]
            origin = origins[joint.parent] + above.apply(joint.offset)
            turn = above * turn
        turns.append(turn)
        origins.append(origin)
        found[joint.name] = origin
        for tail in joint.tails:
            found[f"{joint.name}>"] = origin + turn.apply(tail)
    return found


def test_counts() -> None:
    acclaim, bvh = acclaim_walk(), bvh_walk()
    assert (acclaim.skeleton.n_joints, acclaim.skeleton.n_channels) == (31, 62)
    assert (bvh.skeleton.n_joints, bvh.skeleton.n_channels) == (31, 96)
    assert sum(len(joint.tails) for joint in acclaim.skeleton.joints) + 1 == 31
    assert sum(len(joint.tails) + 1 for joint in bvh.skeleton.joints) == 38
    assert acclaim.n_frames == bvh.n_frames == 240


@pytest.mark.parametrize(("make", "style"), [(acclaim_walk, "{:.6g}"), (bvh_walk, "{:.4f}")])
def test_values_are_what_is_printed(make: object, style: str) -> None:
    assert callable(make)
    values = make().values
    assert all(float(style.format(v)) == v for v in values.flat)
    assert not (np.signbit(values) & (values == 0)).any()


def test_it_walks() -> None:
    at = points(acclaim_walk())
    forward = np.diff(at["root"][:, 2])
    assert (forward > 0).all()
    lowest = np.min([at[name][:, 1] for name in ("lfoot>", "rfoot>", "ltoes>", "rtoes>")], axis=0)
    assert (np.abs(lowest) < 0.4).all()  # a foot is always on the ground, within 2.3 cm
    assert (at["head>"][:, 1] > 25).all()
    for side, outward in (("l", 1), ("r", -1)):
        knee, hip, ankle = (at[side + name] for name in ("tibia", "femur", "foot"))
        assert (knee[:, 1] < hip[:, 1]).all()
        assert (ankle[:, 1] < knee[:, 1]).all()
        shin, thigh = ankle - knee, knee - hip
        bend = np.cross(thigh, shin)[:, 0]  # about the axis to the left: knees bend backward
        assert (bend > -1).all()
        hand = at[side + "hand"] - at["root"]
        assert (outward * hand[:, 0] > 0).all()
    apart = at["lfoot"][:, 2] - at["rfoot"][:, 2]
    assert apart.max() > 8  # steps to both sides
    assert apart.min() < -8


def test_both_formats_tell_the_same_walk() -> None:
    acclaim, bvh = points(acclaim_walk()), points(bvh_walk())
    for name, other in BVH_OF.items():
        assert np.abs(acclaim[name] * UNIT_CM - bvh[other]).max() < 1e-3


def test_files_are_the_same_everywhere(samples: Path) -> None:
    found = {name: hashlib.sha256((samples / name).read_bytes()).hexdigest() for name in SHA256}
    assert found == SHA256


def test_files_look_like_their_kind(samples: Path) -> None:
    bvh = (samples / "walk.bvh").read_text("ascii")
    assert bvh.startswith("HIERARCHY\nROOT Hips\n")
    assert bvh.count("End Site") == 7
    assert "-0.0000 " not in bvh
    assert (samples / "walk.amc").read_text("ascii").count("root ") == 240
    assert "lfemur" in (samples / "walk.asf").read_text("ascii")
