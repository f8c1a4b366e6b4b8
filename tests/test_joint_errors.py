"""Joints of the same names in skeletons of different kinds: an AMC and what was made from it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import mcz
from mcz import MotionError
from mcz.kinematics.metrics.diff_document import joint_errors
from mcz.kinematics.points import origins_of
from tests.commands import run


@pytest.fixture(scope="module")
def converted_path(tmp_path_factory: pytest.TempPathFactory, samples: Path) -> Path:
    """The walk's AMC, as BVH."""
    path = tmp_path_factory.mktemp("converted") / "walk.bvh"
    motion = mcz.convert(mcz.read(samples / "walk.amc", rate=120), "bvh")
    mcz.write(motion, path.with_suffix(".mcz"))
    code = ["decode", str(path.with_suffix(".mcz")), "--to", "bvh", "-o", str(path)]
    assert run(*code) == 0
    return path


def test_an_amc_and_its_bvh_are_compared(
    samples: Path, converted_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    amc = str(samples / "walk.amc")
    capsys.readouterr()
    assert run("diff", amc, converted_path, "--unit", "cm") == 0
    text = capsys.readouterr().out
    assert "31 joints of the same name: mean " in text and "alone" not in text
    assert run("diff", amc, converted_path, "--json") == 0
    output = json.loads(capsys.readouterr().out)["clips"][0]["joints"]
    assert len(output["joints"]) == 31 and output["greatest"] < 1e-3
    assert output["greatest_cm"] is None and output["only_in_a"] == output["only_in_b"] == []


def test_names_that_one_has_alone_are_told(
    samples: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    amc, bvh = str(samples / "walk.amc"), str(samples / "walk.bvh")
    assert run("diff", amc, bvh) == 0
    text = capsys.readouterr().out
    assert "joints of the same name: mean" in text or "joint of the same name: mean" in text
    assert f"joints only in {amc}: root, " in text
    assert f"joints only in {bvh}: Hips, " in text


def test_like_skeletons_need_no_names(samples: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bvh = str(samples / "walk.bvh")
    assert run("diff", bvh, bvh, "--json") == 0
    assert json.loads(capsys.readouterr().out)["clips"][0]["joints"] is None


def test_distances_are_those_of_origins(samples: Path) -> None:
    motion = mcz.read(samples / "walk.bvh", unit="cm")
    joints = list(motion.skeleton.joints)
    joints[5] = replace(joints[5], name="other")
    moved = motion.values.copy()
    moved[7, 0] += 3.0
    other = replace(
        motion.with_values(moved),
        source=None,
        skeleton=replace(motion.skeleton, joints=tuple(joints), unit_cm=1.0),
    )
    found = joint_errors(motion, other)
    assert found.only_in_a == ("LeftToes",) and found.only_in_b == ("other",)
    assert len(found.joints) == 30 and found.frame == 7
    assert found.greatest == pytest.approx(3.0)
    assert found.mean == pytest.approx(3.0 / motion.n_frames)
    assert found.document()["greatest_cm"] == pytest.approx(3.0)
    in_mm = replace(other, skeleton=replace(other.skeleton, unit_cm=0.1))
    assert joint_errors(motion, in_mm).mean != found.mean
    origins = origins_of(motion.skeleton, motion.values)
    assert origins.shape == (motion.n_frames, 31, 3)
    np.testing.assert_allclose(origins[:, 0], motion.values[:, :3], atol=1e-9)
    with pytest.raises(MotionError, match="the numbers of frames differ: 240 and 239"):
        cut = tuple(signal.cut(0, 239) for signal in motion.signals)
        joint_errors(motion, replace(motion, signals=cut, source=None))


def test_no_name_in_common(samples: Path) -> None:
    a, b = mcz.read(samples / "walk.amc"), mcz.read(samples / "walk.c3d")
    found = joint_errors(a, b)
    assert (found.joints, found.mean) == ((), None) and len(found.only_in_b) == 34
