"""Output of ``decode --to``, read by independent libraries, and the notes about losses.

GLB is read by others in ``test_scenes``, USD in ``test_usda``, C3D in ``test_adapters``.
"""

from __future__ import annotations

import io
import json
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mcz
from mcz import Channel, Joint, Motion, Signal, Skeleton
from mcz.exchange.conversion import converted_files
from mcz.files.tables import EXPORTS, table_of
from mcz.kinematics.points import origins_of
from mcz.model.motion import POSITION_KINDS
from tests.commands import run

ROOT = Path(__file__).parents[1]
REAL = [
    "cmu/bvh-blender/02_01.bvh",
    "other/btk-data/Gait.c3d",  # gaps at the end of rows
    "other/opensim-core/dataWithBlanksForMissingMarkers.trc",
    "other/opensim-core/std_subject01_walk1_ik.mot",
]
RATES = {".amc": 120}


def motion_of(path: Path) -> Motion:
    motion = mcz.read(path, rate=RATES.get(path.suffix))
    skeleton = motion.skeleton
    return replace(motion, skeleton=replace(skeleton, unit_cm=skeleton.unit_cm or 1.0))


def clips(samples: Path, data: Path | None) -> list[Motion]:
    paths = [samples / name for name in ("walk.bvh", "walk.amc", "walk.c3d")]
    if data is not None:
        paths += [data / name for name in REAL if (data / name).exists()]
    return [motion_of(path) for path in paths]


def check_tables(motion: Motion) -> None:
    """NumPy has every number, bit for bit, pandas to a unit in the last place; and no others."""
    import pandas

    table = table_of(motion)
    found = pandas.read_csv(io.BytesIO(EXPORTS["csv"](table)), index_col="frame")
    if motion.timeline is not None:
        np.testing.assert_allclose(found.pop("time"), motion.times, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.to_numpy(np.float64), motion.values, rtol=3e-16)
    assert len(found.columns) == len(table.names)
    np.testing.assert_array_equal(found.index, table.frame_numbers)
    with np.load(io.BytesIO(EXPORTS["npz"](table)), allow_pickle=False) as arrays:
        np.testing.assert_array_equal(
            np.where(arrays["mask"], arrays["values"], np.nan), motion.values
        )
        if "positions" in arrays:
            np.testing.assert_array_equal(arrays["positions"], mcz.positions(motion))


def test_tables_of_samples(samples: Path) -> None:
    pytest.importorskip("pandas")
    for motion in clips(samples, None):
        check_tables(motion)


@pytest.mark.real
def test_tables_of_real_clips(samples: Path, data: Path) -> None:
    pytest.importorskip("pandas")
    for motion in clips(samples, data):
        check_tables(motion)


def check_opensim(motion: Motion, folder: Path) -> None:
    """OpenSim has the markers of a TRC and the columns of a STO, and misses the same ones."""
    import opensim

    path = folder / "clip.trc"
    if any(channel.kind for channel in motion.skeleton.channels):
        path.write_bytes(converted_files(motion, "trc")["trc"])
        table = opensim.TimeSeriesTableVec3(str(path)).flatten()
        unit_cm = {"mm": 0.1, "cm": 1.0, "m": 100.0}[table.getTableMetaDataString("Units")]
        points = mcz.positions(motion) * motion.skeleton.unit_cm
        found = table.getMatrix().to_numpy().reshape(points.shape) * unit_cm
        np.testing.assert_allclose(found, points, atol=1e-6)  # cm
        assert table.getNumColumns() == 3 * len(mcz.point_names(motion))
        check_times(table, motion)
    path = folder / "clip.sto"
    path.write_bytes(converted_files(motion, "sto")["sto"])
    table = opensim.TimeSeriesTable(str(path))
    found = table.getMatrix().to_numpy()
    np.testing.assert_array_equal(found, motion.values[:, -found.shape[1] :])
    assert motion.values.shape[1] - found.shape[1] in (0, 1)  # the time may be a channel
    check_times(table, motion)


def check_times(table: Any, motion: Motion) -> None:
    times = np.array(table.getIndependentColumn())
    assert len(times) == motion.n_frames and motion.frame_rate is not None
    step = 1 / float(motion.frame_rate)
    np.testing.assert_allclose(np.diff(times), step, atol=1e-3)  # of a source with 3 decimals


def test_opensim_reads_samples(samples: Path, tmp_path: Path) -> None:
    opensim = pytest.importorskip("opensim")
    opensim.Logger.setLevelString("Off")
    for motion in clips(samples, None):
        check_opensim(replace(motion, source=None), tmp_path)


@pytest.mark.real
def test_opensim_reads_real_clips(samples: Path, tmp_path: Path, data: Path) -> None:
    opensim = pytest.importorskip("opensim")
    opensim.Logger.setLevelString("Off")
    for motion in clips(samples, data):
        check_opensim(replace(motion, source=None), tmp_path)


def test_gaps_at_the_end_of_a_row_of_trc_are_cells(tmp_path: Path) -> None:
    """To OpenSim blank cells at the end of a row are none: they are NaN, as OpenSim writes it."""
    values = np.arange(18.0).reshape(3, 6)
    mask = np.ones((3, 6), np.bool_)
    mask[1, 3:] = False
    joints = tuple(Joint(name, channels=tuple(map(Channel, POSITION_KINDS))) for name in "AB")
    motion = Motion(Skeleton(joints, unit_cm=0.1, angle_unit=""), (Signal(values, mask=mask),), 60)
    (path := tmp_path / "gap.trc").write_bytes(converted_files(motion, "trc")["trc"])
    rows = path.read_text().splitlines()[6:]
    assert [len(row.split("\t")) for row in rows] == [8, 8, 8] and rows[1].endswith("NaN")
    np.testing.assert_array_equal(mcz.read(path).values, motion.values)


@pytest.mark.long
@pytest.mark.parametrize("name", ["walk.bvh", "walk.amc"])
def test_blender_puts_the_joints_of_a_bvh_there(samples: Path, tmp_path: Path, name: str) -> None:
    if shutil.which("blender") is None:
        pytest.skip("there is no Blender")
    (clip := tmp_path / "clip.bvh").write_bytes(
        converted_files(motion_of(samples / name), "bvh")["bvh"]
    )
    motion = mcz.read(clip)
    places = origins_of(motion.skeleton, np.asarray(motion.values, np.float64))[:60]
    np.savez(
        expected := tmp_path / "expected.npz",
        names=np.array(motion.skeleton.joint_names),
        places=places,
        rate=float(motion.frame_rate or 0),
    )
    script = ROOT / "tools/blender/check_import.py"
    command = ["blender", "--background", "--python", script, "--", clip, expected]
    out = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    document = json.loads([line for line in out.splitlines() if line.startswith("{")][-1])
    assert document["bones"] == motion.skeleton.n_joints and document["frames"] == 60
    assert 0 <= document["distance"] < 1e-5 * np.ptp(places, axis=(0, 1)).max()


# What is left out -----------------------------------------------------------------------


def losses_text(motion: Motion, to: str) -> str:
    return "; ".join(mcz.conversion_losses(motion, to))


def test_other_signals_are_named(samples: Path) -> None:
    motion = mcz.read(samples / "walk.c3d")
    for to in ("csv", "npz", "trc", "sto", "mot", "glb", "usda"):
        assert "left out: signal residuals" in losses_text(motion, to)
    assert losses_text(motion, "c3d") == ""
    assert losses_text(mcz.read(samples / "walk.bvh"), "trc") == ""


def test_plain_scalars_frame_numbers_and_names_are_named(samples: Path) -> None:
    motion = mcz.read(samples / "walk.bvh")
    hips = motion.skeleton.joints[0]
    hips = replace(hips, channels=(*hips.channels, Channel("", "smile")))
    skeleton = replace(motion.skeleton, joints=(hips, *motion.skeleton.joints[1:]))
    values = np.insert(motion.values, 6, 1.0, axis=1)
    odd = Motion(skeleton, (Signal(values),), 60)
    assert "left out: smile, which move nothing" in losses_text(odd, "trc")
    assert "left out: smile, which move nothing" in losses_text(odd, "glb")
    assert losses_text(odd, "bvh") == losses_text(odd, "sto") == ""
    later = replace(motion, frame_numbers=np.arange(5, 245))
    start = "the time of the first frame, 0.0333333 s: BVH begins at 0 s"
    assert (
        losses_text(later, "bvh")
        == f"left out: frame numbers, which begin with 5; left out: {start}"
    )
    assert losses_text(later, "c3d") == losses_text(later, "trc") == ""
    with_a_hole = np.arange(5, 245) + (np.arange(240) > 99)
    holed = replace(motion, frame_numbers=with_a_hole)
    assert "frame numbers but the first, 5" in losses_text(holed, "c3d")
    assert "'Hips' is called root" in losses_text(motion, "amc")
    renamed = mcz.rename(motion, {"Head": "the head"})
    assert "cannot hold the joint names 'the head'" in losses_text(renamed, "amc")


@pytest.mark.real
def test_events_and_platforms_are_named(data: Path) -> None:
    motion = mcz.read(data / "other/btk-data/Analysis.c3d")
    for to in ("npz", "trc", "c3d"):
        assert "left out: 6 events" in losses_text(motion, to)


@pytest.mark.parametrize("name", ["", " LFHD", "RFHD "])
@pytest.mark.parametrize("to", ["trc", "c3d"])
def test_names_that_would_come_back_otherwise_are_refused(name: str, to: str) -> None:
    joints = tuple(
        Joint(each, channels=tuple(map(Channel, POSITION_KINDS))) for each in (name, "C7")
    )
    skeleton = Skeleton(joints, unit_cm=0.1, angle_unit="")
    motion = Motion(skeleton, (Signal(np.zeros((2, 6))),), 60)
    with pytest.raises(mcz.MotionError, match="cannot hold the name"):
        converted_files(motion, to)


def test_commands_say_what_is_left_out(
    samples: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    archive, out = tmp_path / "walk.mcz", tmp_path / "out"
    mcz.encode(samples / "walk.c3d", archive)
    for words in (["-o", f"{out}.trc"], ["--to", "csv", "-o", f"{out}.csv"]):
        assert run("decode", archive, *words) == 0
        assert "left out: signal residuals" in capsys.readouterr().err
    words = ["decode", str(archive), "--to", "csv", "-o", f"{out}2.csv", "--signal", "residuals"]
    assert run(*words) == 0 and "left out" not in capsys.readouterr().err
    words = ["decode", str(archive), "-o", f"{out}.sto", "--json"]
    assert run(*words) == 0
    assert json.loads(capsys.readouterr().out)["left_out"] == {
        "walk": ["left out: signal residuals"]
    }
    report = mcz.export(archive, out, "trc")
    assert report.outcomes[0].notes == ("left out: signal residuals",)
