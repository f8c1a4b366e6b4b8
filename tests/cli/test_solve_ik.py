"""Positions in a file, and ``mcz decode --solve-ik``, which makes them a motion again."""

from __future__ import annotations

import io
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import mcz
from mcz import Channel, Joint, Motion, MotionError, OptionError, Signal, Skeleton
from mcz.codecs import codec_by_name
from mcz.container.limits import BASE
from mcz.container.writer import Writer
from mcz.files.writing.clip_writer import write_plan
from mcz.files.writing.planning import Prepared, StoredSkeleton, plan_clip
from mcz.kinematics.points import NOTE, in_positions, point_names, points_and_markers_of
from mcz.sources.sample import bvh_walk, marker_walk
from tests.commands import Call


def write_positions(path: Path, motion: Motion, *, virtual_markers: bool = False) -> Path:
    """A file of ``motion`` as positions, and of its skeleton."""
    stream = io.BytesIO()
    writer = Writer(stream, profile=BASE)
    made = in_positions(motion, virtual_markers=virtual_markers)
    own = StoredSkeleton(motion.skeleton)
    derived = () if made is motion else (StoredSkeleton(made.skeleton, derives=True),)
    prepared = Prepared(made, (own, *derived))
    write_plan(writer, plan_clip(prepared, codec_by_name("fast"), {}, BASE))
    writer.finish()
    path.write_bytes(stream.getvalue())
    return path


@pytest.fixture
def walk(samples: Path) -> Motion:
    motion = mcz.read(samples / "walk.amc")
    return replace(motion, signals=(motion.signals[0].cut(0, 30),), source=None)


@pytest.mark.parametrize("virtual_markers", [False, True])
def test_amc_from_positions(
    walk: Motion,
    samples: Path,
    tmp_path: Path,
    call: Call,
    virtual_markers: bool,
) -> None:
    file = write_positions(tmp_path / "walk.mcz", walk, virtual_markers=virtual_markers)
    arguments = ("decode", file, "--to", "amc", "--solve-ik", "--with-skeleton")
    code, out, err = call(*arguments)
    assert code == 0, err
    assert "inverse kinematics: 31 points" in err
    assert "cm off on average" in err
    assert ("93 virtual markers" in err) == virtual_markers
    asf = next(path for path in tmp_path.iterdir() if path.suffix == ".asf")
    assert asf.read_bytes() == (samples / "walk.asf").read_bytes()
    again = mcz.read(next(path for path in tmp_path.iterdir() if path.suffix == ".amc"))
    assert np.abs(mcz.positions(again) - mcz.positions(walk)).max() < 1e-3
    if virtual_markers:
        assert np.abs(again.values - walk.values).max() < 0.01
    code, out, err = call(*arguments, "--force", "--json")
    fit = json.loads(out)["fit"]
    assert (code, fit["n_points"], fit["n_markers"]) == (0, 31, 93 * virtual_markers)
    assert 0 <= fit["mean_error_cm"] <= fit["max_error_cm"] < 1e-3
    assert fit["unsolved"] == []
    assert (fit["marker_mean_error"] is not None) == virtual_markers


def test_bvh_from_positions(tmp_path: Path, call: Call) -> None:
    walk = bvh_walk()
    walk = replace(walk, signals=(walk.signals[0].cut(0, 30),), source=None)
    file = write_positions(tmp_path / "walk.mcz", walk)
    code, _, err = call("decode", file, "--to", "bvh", "--solve-ik")
    assert (code, " units off" in err) == (0, walk.skeleton.unit_cm is None), err
    again = mcz.read(tmp_path / f"{walk.name}.bvh")
    assert np.abs(mcz.positions(again) - mcz.positions(walk)).max() < 1e-2
    code, _, err = call("decode", file, "--to", "amc", "--solve-ik", "--with-skeleton")
    assert code == 0, err
    assert mcz.read(tmp_path / f"{walk.name}.amc").n_frames == walk.n_frames


def test_what_the_command_refuses(walk: Motion, samples: Path, tmp_path: Path, call: Call) -> None:
    file = write_positions(tmp_path / "walk.mcz", walk)
    code, _, err = call("decode", file, "--to", "amc")
    assert (code, "holds positions; --solve-ik" in err) == (2, True)
    code, _, err = call("decode", file, "--to", "csv", "--solve-ik")
    assert (code, "--solve-ik needs --to amc or --to bvh" in err) == (2, True)
    assert call("encode", samples / "walk.c3d", "-o", tmp_path / "points.mcz")[0] == 0
    points = tmp_path / "points.mcz"
    code, _, err = call("decode", points, "--to", "amc", "--solve-ik")
    assert (code, "names no skeleton" in err) == (2, True)
    small = tmp_path / "small.mcz"
    assert call("extract", file, small, "--joints", "root,head")[0] == 0
    code, _, err = call("decode", small, "--to", "amc", "--solve-ik")
    assert (code, "no positions to fit" in err) == (1, True)


def test_a_clip_of_positions(walk: Motion, tmp_path: Path) -> None:
    file = write_positions(tmp_path / "walk.mcz", walk, virtual_markers=True)
    points, markers = points_and_markers_of(walk.skeleton, walk.values)
    with mcz.open(file) as reader:
        clip = reader.clips[walk.name]
        motion, base = clip.motion(), clip.base_skeleton
        assert base == walk.skeleton
        assert base is not None
        assert base.source is not None
        assert clip.source is None
        assert [joint.name for joint in motion.skeleton.joints][:31] == list(
            point_names(walk.skeleton)
        )
        assert motion.skeleton.joints[31].name == "root+x"
        assert motion.skeleton.unit_cm == walk.skeleton.unit_cm
        assert motion.metadata["source-note"].startswith(NOTE)
    both = np.concatenate([points, markers], axis=1)
    assert (motion.values.reshape(both.shape) == both).all()
    with mcz.open(tmp_path / "walk.mcz") as reader:
        assert reader.clips[walk.name].skeleton.base is not None
    mcz.write(walk, tmp_path / "plain.mcz")
    with mcz.open(tmp_path / "plain.mcz") as reader:
        assert reader.clips[walk.name].base_skeleton is None


def test_there_and_back_keeps_the_rest(walk: Motion) -> None:
    numbers = np.arange(5, 35)
    analog = Signal(np.zeros((30, 1)), name="analog", role="analog", channels=(Channel("", "emg"),))
    motion = replace(
        walk,
        metadata={"subject": "17", "source-note": "odd"},
        frame_numbers=numbers,
        signals=(*walk.signals, analog),
    )
    there = mcz.in_positions(motion)
    assert there.metadata["source-note"] == f"{NOTE}; odd"
    assert there.signals[1] is analog
    back, fit = mcz.from_positions(there, walk.skeleton)
    assert back.metadata == motion.metadata
    assert back.signals[1] is analog
    assert back.frame_numbers is numbers
    assert back.skeleton is walk.skeleton
    assert (fit.n_points, fit.n_markers, fit.marker_mean_error) == (31, 0, None)
    assert mcz.in_positions(there) is there


def test_missing_values_are_missing_places(walk: Motion) -> None:
    values = walk.values.copy()
    values[3, 0] = np.nan
    values[4, -1] = np.nan
    there = mcz.in_positions(walk.with_values(values))
    mask = there.signals[0].mask
    assert mask is not None
    assert not mask[3].any()
    assert mask[4].any()
    assert not mask[4].all()
    assert np.isfinite(there.signals[0].values).all()
    back, fit = mcz.from_positions(there, walk.skeleton)
    assert np.isfinite(back.values).all()
    assert fit.mean_error is not None
    assert fit.mean_error < 1e-3


def test_what_does_not_fit(walk: Motion) -> None:
    skeleton = walk.skeleton
    there = mcz.in_positions(walk, virtual_markers=True)
    assert there.skeleton.n_joints == 31 + 93
    few = mcz.in_positions(replace(walk, skeleton=skeleton))
    with pytest.raises(MotionError, match=r"38 points, or 131 with its virtual markers|points, or"):
        mcz.from_positions(few, bvh_walk().skeleton)
    with pytest.raises(MotionError, match="no positions to fit"):
        mcz.from_positions(walk, skeleton)
    with pytest.raises(MotionError, match="has only markers, so it cannot be fitted"):
        mcz.from_positions(few, marker_walk().skeleton)
    with pytest.raises(OptionError, match="length unit .*is unknown"):
        unknown = replace(walk, skeleton=replace(skeleton, unit_cm=None))
        mcz.in_positions(unknown, virtual_markers=True)
    scalars = Skeleton((Joint("root", channels=(Channel("", "1"),)),))
    with pytest.raises(MotionError, match="plain scalars"):
        mcz.in_positions(Motion(scalars, (Signal(np.zeros((1, 1))),)))


def test_units_are_converted_and_scalars_reported() -> None:
    channels = (*map(Channel, ("tx", "ty", "tz")), Channel("", "smile"))
    skeleton = Skeleton((Joint("root", channels=channels),), unit_cm=2.0)
    there = mcz.in_positions(Motion(skeleton, (Signal(np.array([[1.0, 2.0, 3.0, 4.0]])),)))
    back, fit = mcz.from_positions(there, replace(skeleton, unit_cm=1.0))
    assert back.values.tolist() == [[2.0, 4.0, 6.0, 0.0]]
    assert fit.unsolved == ("root.smile",)
    assert fit.mean_error_cm == 0.0
