"""Plain scalars: quaternions among them keep their norm, and what a lossy codec does is said."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

import mcz
from mcz import Channel, Joint, Motion, OptionError, Signal, Skeleton
from tests.commands import run

NAMES = ("x", "y", "z", "base_qx", "base_qy", "base_qz", "base_qw", "hip", "knee")


def turning_quaternions(n_frames: int = 40) -> np.ndarray:
    """Unit quaternions that turn on by a third of a turn a frame, every third of the other sign."""
    angles = np.arange(n_frames) / 3 * np.pi / 2
    axis = np.array([0.36, 0.48, 0.8])
    found = np.column_stack([np.sin(angles)[:, None] * axis, np.cos(angles)])
    found[::3] *= -1
    return found


def robot(names: Sequence[str] = NAMES, quaternion: np.ndarray | None = None) -> Motion:
    random = np.random.default_rng(4)
    four = turning_quaternions() if quaternion is None else quaternion
    rest = random.normal(0, 0.2, (len(four), 5)).cumsum(axis=0)
    values = np.concatenate([rest[:, :3] + [0, 0, 2], four, rest[:, 3:]], axis=1)
    joints = tuple(Joint(name, channels=(Channel("", "value"),)) for name in names)
    return Motion(Skeleton(joints), (Signal(values),), Fraction(30), name="robot")


def norms(motion: Motion, at: int = 3) -> np.ndarray:
    return np.linalg.norm(motion.values[:, at : at + 4], axis=1)


@pytest.mark.parametrize("names", [NAMES, [f"column {n}" for n in range(9)]])
@pytest.mark.parametrize("rate", [50, 120, 24.5, 10])
def test_four_columns_of_unit_norm_turn(names: Sequence[str], rate: float) -> None:
    motion = robot(names)
    resampled = mcz.resample(motion, rate)
    np.testing.assert_allclose(norms(resampled), 1, atol=1e-12)
    if rate != 10:  # of which every third frame is an old one
        assert resampled.metadata["source-note"] == "columns 4 to 7 were resampled as quaternions"
    angles = resampled.times * 30 / 3 * np.pi / 2
    axis = np.array([0.36, 0.48, 0.8])
    wanted = np.column_stack([np.sin(angles)[:, None] * axis, np.cos(angles)])
    same = np.abs((resampled.values[:, 3:7] * wanted).sum(axis=1))
    np.testing.assert_allclose(same, 1, atol=1e-9)  # whichever sign
    plain = mcz.resample(motion, rate, components=True)
    others = [0, 1, 2, 7, 8]
    np.testing.assert_array_equal(resampled.values[:, others], plain.values[:, others])
    assert "source-note" not in plain.metadata
    if rate != 10:
        assert norms(plain).min() < 0.9


def test_numbers_of_few_decimals_and_gaps() -> None:
    four = turning_quaternions().round(3)
    four[7] = np.nan
    resampled = mcz.resample(robot(quaternion=four), 50)
    known = norms(resampled)[~np.isnan(norms(resampled))]
    np.testing.assert_allclose(known, 1, atol=2e-3)
    assert len(known) < resampled.n_frames


def test_what_is_not_clear_is_refused() -> None:
    four = turning_quaternions() * 1.5
    with pytest.raises(OptionError, match="named like a quaternion, .* components=True"):
        mcz.resample(robot(quaternion=four), 50)
    mcz.resample(robot(quaternion=four), 50, components=True)
    mcz.resample(robot([f"c{n}" for n in range(9)], four), 50)  # nothing says that it is one
    motion = robot([f"c{n}" for n in range(9)], turning_quaternions() * [0, 0, 1, 1] / [[1]])
    values = motion.values.copy()
    angles = np.arange(40) / 7
    values[:, 3:7] = np.column_stack([0 * angles, 0 * angles, np.sin(angles), np.cos(angles)])
    values[:, 7] = 0.0
    with pytest.raises(OptionError, match="may be a quaternion or independent columns"):
        mcz.resample(motion.with_values(values), 50)
    named = robot().with_values(values)
    np.testing.assert_allclose(norms(mcz.resample(named, 50)), 1, atol=1e-12)


def test_windows_of_a_data_set_keep_the_norm(tmp_path: Path) -> None:
    mcz.write(robot(), tmp_path / "robot.mcz")
    dataset = mcz.dataset(tmp_path / "robot.mcz", fields="channels", window=16, rate=50)
    assert len(dataset) > 0
    for number in range(len(dataset)):
        values = np.asarray(dataset[number]["channels"])
        np.testing.assert_allclose(np.linalg.norm(values[:, 3:7], axis=1), 1, atol=1e-6)


def test_a_table_and_an_array_file(tmp_path: Path) -> None:
    values = robot().values
    np.savez(tmp_path / "a.npz", fps=30, rot=turning_quaternions())
    lines = "\n".join(",".join(f"{v:.6f}" for v in row) for row in values.tolist())
    (tmp_path / "a.csv").write_text(lines + "\n")
    for name, at in (("a.npz", 0), ("a.csv", 3)):
        decoded = mcz.resample(mcz.read(tmp_path / name, rate=30), 50)
        np.testing.assert_allclose(norms(decoded, at), 1, atol=1e-4)
        assert "as quaternions" in decoded.metadata["source-note"]


def test_the_greatest_error_of_scalars_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Their channels place no point, and no codec keeps a bound for them."""
    slope = np.arange(240)[:, None] * [0.02, 0.11]
    (tmp_path / "a.csv").write_text("".join(f"{a:.6f},{b:.6f}\n" for a, b in slope.tolist()))
    source, path = str(tmp_path / "a.csv"), str(tmp_path / "a.mcz")
    options = ["--rate", "30", "--codec", "posewave", "--param", "step=0.001", "-o", path]
    assert run("encode", source, *options) == 0
    output = capsys.readouterr().out
    with mcz.open(path) as file:
        clip = file.only_clip()
        errors = np.abs(clip.values[:] - mcz.read(source).values)
        assert not any(key.startswith("max_channel_error") for key in clip.quality or {})
    frame, column = divmod(int(errors.argmax()), 2)
    where = f"(frame {frame}, column {column + 1}.value)"
    assert f"greatest error {errors.max():.6g} {where}; no bound is kept for channels" in output
