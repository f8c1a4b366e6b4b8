"""Fields of data sets beyond poses: signals, feet, HumanML3D; statistics, and windows by them."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

import mcz
from mcz.exchange.datasets.feature_blocks import _moments_of
from tests.motions import rich, smooth

Make = Callable[[mcz.Motion], mcz.Dataset]


@pytest.fixture
def data_of(tmp_path: Path) -> Callable[..., mcz.Dataset]:
    """A data set of motions, written one a file."""

    def make(*motions: mcz.Motion, **arguments: object) -> mcz.Dataset:
        for number, motion in enumerate(motions):
            mcz.write(motion, tmp_path / f"{number}.mcz", force=True)
        return mcz.dataset(tmp_path, **{"dtype": "float64"} | arguments)

    return make


def walker(n_frames: int = 200, **changes: object) -> mcz.Motion:
    """A motion of a skeleton with a foot, which stands in some frames."""
    motion = smooth(n_frames, **changes)
    values = motion.values.copy()
    standing = slice(n_frames // 3, n_frames // 2)
    values[standing] = values[n_frames // 3]
    values[standing, 1] = -60.0
    return mcz.rename(replace(motion, signals=(mcz.Signal(values),)), {"knee": "LeftFoot"})


def robot(n_frames: int = 120, n_joints: int = 3) -> mcz.Motion:
    """A motion with joint positions beside it, and a signal that has the name of a field."""
    motion = smooth(n_frames)
    names = tuple(mcz.Channel("", f"joint {n}", "rad") for n in range(n_joints))
    values = np.sin(np.arange(n_frames)[:, None] * 0.1 + np.arange(n_joints))
    others = (
        mcz.Signal(values, name="joint_pos", channels=names),
        mcz.Signal(2 * values, name="velocities", channels=names),
    )
    return replace(motion, signals=(*motion.signals, *others))


def test_a_signal_is_a_field(data_of: Make) -> None:
    motion = robot()
    data = data_of(motion, fields="joint_pos,signal:velocities,velocities,motion", window=20)
    values = motion.signals[1].values
    for index in (0, 3, len(data) - 1):
        rows = slice(20 * index, 20 * index + 20)
        np.testing.assert_array_equal(data[index]["joint_pos"], values[rows])
        np.testing.assert_array_equal(data[index]["signal:velocities"], 2 * values[rows])
        np.testing.assert_array_equal(data[index]["motion"], motion.values[rows])
        np.testing.assert_allclose(data[index]["velocities"], mcz.velocities(motion)[rows])
    assert data.names["joint_pos"] == ("joint 0", "joint 1", "joint 2")
    assert data.shapes["joint_pos"] == (3,) and data.names["motion"][0] == "hips.tx"
    assert pickle.loads(pickle.dumps(data))[1].keys() == data[1].keys()


def test_signals_are_resampled_along_splines(data_of: Make) -> None:
    motion = robot()
    data = data_of(motion, fields="joint_pos", rate=90)
    frames = np.arange(data.n_frames)[:, None] / 90 * 120
    expected = np.sin(frames * 0.1 + np.arange(3))
    np.testing.assert_allclose(data[0]["joint_pos"], expected, atol=1e-2)
    np.testing.assert_array_equal(data[0]["joint_pos"][::3], motion.signals[1].values[::4])


def test_samples_of_a_frame_stay_together(data_of: Make) -> None:
    motion = rich(40)
    data = data_of(motion, fields="analog", window=10, across_gaps=True)
    assert data.shapes["analog"] == (2, 1) and data.names["analog"] == ("emg",)
    samples = motion.signals[1].values.reshape(40, 2, 1)
    np.testing.assert_array_equal(data[1]["analog"], samples[10:20])
    with pytest.raises(mcz.OptionError, match="'analog' has several samples a frame"):
        data_of(fields="analog", rate=50)[0]


def test_clips_with_other_signals(data_of: Make) -> None:
    with pytest.raises(mcz.OptionError, match=r"signals differ; choose clips with where="):
        data_of(robot(), robot(n_joints=2), fields="joint_pos")
    with pytest.raises(mcz.OptionError, match="no field or signal 'joint_poz'.*'joint_pos'"):
        data_of(fields="joint_poz")


@pytest.mark.parametrize("rate", [None, 60])
def test_feet(data_of: Make, rate: int | None) -> None:
    data = data_of(walker(), fields="foot_speed,contacts", rate=rate, unit="cm")
    motion = walker() if rate is None else mcz.resample(walker(), rate)
    assert data.names == {"foot_speed": ("LeftFoot",), "contacts": ("LeftFoot",)}
    speeds = np.linalg.norm(mcz.velocities(motion, ["LeftFoot"], unit="cm"), axis=-1)
    np.testing.assert_allclose(data[0]["foot_speed"], speeds, atol=1e-9)
    standing = mcz.contacts(motion).frames("LeftFoot")
    assert 0 < standing.sum() < motion.n_frames
    np.testing.assert_array_equal(data[0]["contacts"][:, 0], standing)


def test_windows_of_contacts_are_parts_of_a_clip(data_of: Make) -> None:
    data = data_of(walker(), walker(300), fields="contacts", window=16, stride=7)
    standing = [mcz.contacts(walker(n)).frames("LeftFoot") for n in (200, 300)]
    for index in data.order(3).tolist():
        window = data.window(index)
        expected = standing[window.target.endswith("1.mcz")][window.start : window.stop]
        np.testing.assert_array_equal(data[index]["contacts"][:, 0], expected)


def test_fields_that_a_skeleton_cannot_have(data_of: Make) -> None:
    with pytest.raises(mcz.OptionError, match="no chosen joint is named like a foot"):
        data_of(smooth(), fields="contacts")
    with pytest.raises(mcz.OptionError, match="choose 22 with joints=, in the order"):
        data_of(fields="humanml3d")[0]
    motion = smooth()
    flat = replace(motion, skeleton=replace(motion.skeleton, up_axis=""))
    with pytest.raises(
        mcz.OptionError, match="the up axis of skeleton .* is unknown; set the up axis"
    ):
        data_of(flat, fields="heading")[0]
    given, known = data_of(flat, fields="heading_rot6d", up="y"), data_of(motion, fields="quat")
    assert given[0]["heading_rot6d"].shape == (50, 4, 6) and len(known) == 1


def test_statistics_are_of_all_frames_once(data_of: Make, tmp_path: Path) -> None:
    motions = [smooth(70), smooth(300), rich(90)]
    fields = "channels,positions,root"
    data = data_of(*motions, fields=fields, window=32, stride=5, across_gaps=True)
    whole = mcz.dataset(tmp_path, fields, dtype="float64", across_gaps=True)
    statistics = data.statistics()
    for name in data.fields:
        frames = np.concatenate([clip[name] for clip in whole])
        np.testing.assert_allclose(statistics[name].mean, np.nanmean(frames, axis=0), atol=1e-9)
        np.testing.assert_allclose(statistics[name].std, np.nanstd(frames, axis=0), atol=1e-9)
    normal = data.normalized()
    plain, scaled = data[[3, 0]], normal[[3, 0]]
    for name in data.fields:
        std = np.where(statistics[name].std > 0, statistics[name].std, 1)
        expected = (plain[name] - statistics[name].mean) / std
        np.testing.assert_allclose(scaled[name], expected, atol=1e-12)
        np.testing.assert_array_equal(normal[3][name], scaled[name][0])


def test_test_windows_are_normalized_as_training_ones(data_of: Make, tmp_path: Path) -> None:
    data = data_of(smooth(80, name="a"), smooth(200, name="b"), fields="root", window=16)
    parts = data.split({"train": 0.5, "test": 0.5}, by="clip")
    statistics = parts["train"].statistics()
    test = parts["test"].normalized(statistics)
    expected = (parts["test"][2]["root"] - statistics["root"].mean) / statistics["root"].std
    np.testing.assert_allclose(test[2]["root"], expected)
    assert test.normalized(statistics).members == test.members and test.skipped == ()
    again = pickle.loads(pickle.dumps(test))
    np.testing.assert_array_equal(again[2]["root"], test[2]["root"])
    with pytest.raises(mcz.OptionError, match="the statistics lack root"):
        data.normalized({})
    whole = mcz.dataset(tmp_path, "root", normalize=True, dtype="float64")
    frames = np.concatenate([clip["root"] for clip in whole])
    np.testing.assert_allclose(
        [frames.mean(axis=0), frames.std(axis=0)], [[0] * 3, [1] * 3], atol=1e-9
    )


def test_statistics_are_kept_in_a_folder(
    data_of: Make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept = {"cache": "5 MB", "folder": tmp_path / "kept"}
    first = data_of(robot(), fields="joint_pos,root", **kept).statistics()
    (tmp_path / "0.mcz").rename(tmp_path / "moved.mcz")
    monkeypatch.setattr("mcz.exchange.datasets.feature_blocks._compute", None)
    again = mcz.dataset(tmp_path / "moved.mcz", "joint_pos,root", dtype="float64", **kept)
    for name, each in again.statistics().items():
        np.testing.assert_array_equal(each.mean, first[name].mean)
        np.testing.assert_array_equal(each.std, first[name].std)


@given(
    arrays(
        np.float32,
        array_shapes(min_dims=2, max_dims=2, max_side=12),
        elements=st.floats(-1000, 1000, width=32) | st.just(np.nan),
    ),
    st.integers(0, 12),
)
def test_moments_are_joined(values: np.ndarray, cut: int) -> None:
    cut = min(cut, len(values))
    joined = (_moments_of(values[:cut]) + _moments_of(values[cut:])).statistics
    known = ~np.isnan(values).all(axis=0)
    exact = values.astype(np.float64)[:, known]
    np.testing.assert_allclose(joined.mean[known], np.nanmean(exact, axis=0), atol=1e-9)
    np.testing.assert_allclose(joined.std[known], np.nanstd(exact, axis=0), atol=1e-5)
    assert np.isnan(joined.mean[~known]).all() and np.isnan(joined.std[~known]).all()
