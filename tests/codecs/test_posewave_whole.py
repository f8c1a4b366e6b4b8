"""Codec posewave on joints that turn by rotation vectors and quaternions: version 1."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import mcz
from mcz.model.motion import Channel, Motion, Signal
from mcz.sources.sample import acclaim_walk
from tests.bodies import turned_by

WALK = acclaim_walk()
FORMS = ("rotvec", "quat")


def write_and_read(motion: Motion, path: Path, **options: object) -> Motion:
    mcz.write(motion, path, codec="posewave", force=True, **options)
    with mcz.open(path) as file:
        return file.clips[motion.name].motion()


def version(path: Path) -> int:
    with mcz.open(path) as file:
        (clip,) = file.clips.values()
        return int(clip.signals[0].codec_version)


@pytest.mark.parametrize(
    ("form", "target", "limit"), [("rotvec", "max_error_cm", 0.5), ("quat", "mean_error_cm", 0.05)]
)
def test_targets_in_cm_are_met(form: str, target: str, limit: float, tmp_path: Path) -> None:
    motion = turned_by(WALK, form, np.float32)
    path = tmp_path / "walk.mcz"
    decoded = mcz.compare(motion, write_and_read(motion, path, **{target: limit}))
    reached = decoded.max_position_error_cm if "max" in target else decoded.mean_position_error_cm
    assert reached is not None and limit / 2 < reached <= limit
    assert version(path) == 1
    # About as small as the same walk by angles.
    other = tmp_path / "angles.mcz"
    write_and_read(WALK, other, **{target: limit})
    assert version(other) == 0
    assert path.stat().st_size < 1.15 * other.stat().st_size


@pytest.mark.parametrize("form", FORMS)
def test_parts_and_live_frames(form: str, tmp_path: Path) -> None:
    motion = turned_by(WALK, form)
    path = tmp_path / "walk.mcz"
    whole = write_and_read(motion, path, step=0.2, segment_frames=64)
    with mcz.open(path) as file:
        clip = file.clips[motion.name]
        part = clip.read(frames=(70, 90), joints=["head"])
        columns = motion.skeleton.columns(motion.skeleton.find("head"))
        np.testing.assert_array_equal(part, whole.values[70:90, list(columns)])
        coarse = clip.motion(resolution=1)
    assert mcz.compare(motion, coarse).max_position_error_cm < 20
    live = tmp_path / "live.mcz"
    with (
        live.open("wb") as sink,
        mcz.LiveWriter(sink, motion.skeleton, "posewave", frame_rate=Fraction(120)) as writer,
    ):
        for row in motion.values[:50]:
            writer.push(row)
    assert version(live) == 1
    with mcz.open(live) as file:
        decoded = file.clips["live"].motion()
    first = replace(motion, signals=(Signal(motion.values[:50]),))
    assert mcz.compare(first, decoded).max_position_error_cm <= 0.5


def test_vectors_that_jump_are_coded_as_if_they_did_not(tmp_path: Path) -> None:
    """A walker who turns to and fro beyond half a turn; as most data sets have it, within it."""
    motion = turned_by(WALK, "rotvec")
    values = motion.values.copy()
    time = np.linspace(0, 6, len(values))
    root = [c for c, channel in enumerate(motion.skeleton.channels[:6]) if channel.kind[0] == "v"]
    heading = Rotation.from_rotvec((np.pi + 0.4 * np.sin(5 * time))[:, None] * [[0, 1, 0]])
    turned = (heading * Rotation.from_rotvec(values[:, root])).as_rotvec()
    assert np.abs(np.diff(turned, axis=0)).max() > 5
    values[:, root] = turned
    jumping = replace(motion, signals=(Signal(values),))
    path = tmp_path / "jumping.mcz"
    decoded = write_and_read(jumping, path, max_error_cm=0.5)
    assert mcz.compare(jumping, decoded).max_position_error_cm <= 0.5
    still = tmp_path / "still.mcz"
    write_and_read(motion, still, max_error_cm=0.5)
    assert path.stat().st_size < 1.5 * still.stat().st_size


def test_parts_alone_turn_nothing(tmp_path: Path) -> None:
    joints = list(WALK.skeleton.joints)
    joints[1] = replace(joints[1], channels=(Channel("vx"), Channel("qw")))
    skeleton = replace(WALK.skeleton, joints=tuple(joints), source=None)
    values = np.insert(WALK.values, 6, [[1.0], [2.0]], axis=1)
    motion = replace(WALK, skeleton=skeleton, signals=(Signal(values),), source=None)
    path = tmp_path / "parts.mcz"
    decoded = write_and_read(motion, path)
    assert version(path) == 0
    np.testing.assert_allclose(decoded.values[:, 6:8], values[:, 6:8], atol=0.1)
