"""NPZ, xarray, pandas and ``mcz export``: the same numbers, readable without MCZ."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given

import mcz
from mcz import Channel, Motion, Signal, Skeleton
from mcz.cli.common import Exit
from tests.commands import run
from tests.motions import smooth
from tests.skeletons import skeletons, values_for


def read(path: Path) -> dict[str, np.ndarray]:
    with np.load(path, allow_pickle=False) as file:
        return dict(file)


def world_of(quaternions: np.ndarray) -> np.ndarray:
    """Matrices of quaternions, w first."""
    w, x, y, z = np.moveaxis(quaternions, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def places(arrays: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """World positions and rotations of joints, computed in NumPy as the text "about" states."""
    local, steps = world_of(arrays["quaternions"]), arrays["translations"]
    world, origins = np.empty_like(local), np.empty_like(steps)
    for joint, parent in enumerate(arrays["parents"]):
        if parent < 0:
            world[:, joint], origins[:, joint] = local[:, joint], steps[:, joint]
            continue
        world[:, joint] = world[:, parent] @ local[:, joint]
        step = (world[:, parent] @ steps[:, joint, :, None])[..., 0]
        origins[:, joint] = origins[:, parent] + step
    return origins, world


def check(arrays: dict[str, np.ndarray], motion: Motion, scaled: bool = False) -> None:
    origins, world = places(arrays)
    np.testing.assert_allclose(
        world, mcz.rotations(motion, "matrix", space="world"), atol=1e-9, equal_nan=True
    )
    joints, tails = arrays["point_joints"], arrays["point_tails"]
    points = origins[:, joints] + (world[:, joints] @ tails[..., None])[..., 0]
    if not scaled:
        np.testing.assert_allclose(points, arrays["positions"], atol=1e-8)
    np.testing.assert_array_equal(arrays["positions"], mcz.positions(motion))


@given(skeletons())
def test_an_npz_says_where_everything_is(skeleton: Skeleton) -> None:
    motion = Motion(skeleton, (Signal(values_for(skeleton)),))
    kinds = {channel.kind for channel in skeleton.channels}
    from mcz.files.tables import pose_arrays

    check(pose_arrays(motion), motion, bool(kinds & {"sx", "sy", "sz", "length"}))


@pytest.mark.parametrize("name", ["walk.bvh", "walk.amc"])
def test_npz_of_samples(samples: Path, tmp_path: Path, name: str) -> None:
    motion = mcz.read(samples / name, rate=120, unit="cm" if name.endswith("bvh") else None)
    mcz.to_npz(motion, tmp_path / "walk.npz")
    arrays = read(tmp_path / "walk.npz")
    check(arrays, motion)
    np.testing.assert_array_equal(arrays["values"], motion.values)
    assert tuple(arrays["joint_names"]) == motion.skeleton.joint_names
    assert arrays["frame_rate"] == 120 and arrays["unit_cm"] == motion.skeleton.unit_cm
    assert "active, column vectors" in str(arrays["about"])
    with pytest.raises(mcz.ExistsError):
        mcz.to_npz(motion, tmp_path / "walk.npz")


def test_decode_writes_the_same_npz(samples: Path, tmp_path: Path) -> None:
    motion = mcz.read(samples / "walk.bvh")
    mcz.to_npz(motion, tmp_path / "one.npz")
    mcz.write(motion, tmp_path / "walk.mcz")
    words = ["decode", str(tmp_path / "walk.mcz"), "-o", str(tmp_path / "two.npz")]
    assert run(*words) == Exit.FINE
    one, two = read(tmp_path / "one.npz"), read(tmp_path / "two.npz")
    assert one.keys() == two.keys()
    for name, array in one.items():
        np.testing.assert_array_equal(array, two[name], err_msg=name)


def test_no_kinematics_no_poses(tmp_path: Path) -> None:
    joint = replace(smooth().skeleton.joints[0], channels=(Channel("", "smile"),))
    motion = Motion(Skeleton((joint,)), (Signal(np.ones((3, 1))),))
    mcz.to_npz(motion, tmp_path / "a.npz")
    arrays = read(tmp_path / "a.npz")
    assert "positions" not in arrays and list(arrays["names"]) == ["hips.smile"]
    pytest.importorskip("xarray")
    assert list(mcz.to_xarray(motion).data_vars) == ["channels"]


def test_xarray(samples: Path) -> None:
    pytest.importorskip("xarray")
    motion = mcz.read(samples / "walk.amc", rate=120)
    data = mcz.to_xarray(motion, unit="m", form="6d")
    assert dict(data.sizes) == {
        "time": 240,
        "channel": 62,
        "point": 31,
        "axis": 3,
        "joint": 31,
        "rotation": 6,
    }
    head = data.positions.sel(point="head", axis="y").values
    np.testing.assert_array_equal(head, mcz.positions(motion, "head", unit="m")[:, 0, 1])
    np.testing.assert_array_equal(
        data.rotations.sel(joint="lfemur").values,
        mcz.rotations(motion, "6d", joints="lfemur")[:, 0],
    )
    assert data.time.values[120] == 1.0 and data.time.attrs["units"] == "s"
    assert data.positions.attrs["units"] == "m" and data.attrs["frame_rate_exact"] == "120"
    assert all(isinstance(value, (str, int, float)) for value in data.attrs.values())
    with pytest.raises(mcz.OptionError, match="'matrix'; known are quat"):
        mcz.to_xarray(motion, form="matrix")
    markers = mcz.to_xarray(mcz.read(samples / "walk.c3d"))
    assert markers.residuals.dims == ("time_residuals", "channel_residuals")
    assert np.isnan(markers.positions.values).any()


def test_pandas(samples: Path) -> None:
    pandas = pytest.importorskip("pandas")
    motion = mcz.read(samples / "walk.bvh")
    table = mcz.to_pandas(motion, joints=["Head", "LeftFoot"])
    assert isinstance(table, pandas.DataFrame) and table.shape == (240, 6)
    assert table.index.name == "time" and table.index[12] == 0.1
    np.testing.assert_array_equal(
        table["LeftFoot", "z"], mcz.positions(motion, "LeftFoot")[:, 0, 2]
    )
    turns = mcz.to_pandas(motion, "quat", joints="Head", flat=True)
    assert list(turns.columns) == ["Head.w", "Head.x", "Head.y", "Head.z"]
    channels = mcz.to_pandas(motion, "channels")
    np.testing.assert_array_equal(channels["Hips.tx"], motion.values[:, 0])
    nameless = replace(motion, frame_rate=None)
    assert mcz.to_pandas(nameless, "rotvec").index.name == "frame"
    markers = mcz.read(samples / "walk.c3d")
    assert mcz.to_pandas(markers, "residuals").shape[0] == 240
    with pytest.raises(
        mcz.OptionError, match="unknown table 'analog'; it must be one of positions"
    ):
        mcz.to_pandas(markers, "analog")


def test_clips_have_them_too(tmp_path: Path) -> None:
    pytest.importorskip("xarray")
    motion = smooth(20)
    mcz.write(motion, tmp_path / "smooth.mcz")
    with mcz.open(tmp_path / "smooth.mcz") as file:
        assert file["smooth"].to_xarray().equals(mcz.to_xarray(motion))
        assert file["smooth"].to_pandas("euler").equals(mcz.to_pandas(motion, "euler"))


def test_without_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, to in (("xarray", mcz.to_xarray), ("pandas", mcz.to_pandas)):
        monkeypatch.setitem(sys.modules, name, None)
        with pytest.raises(mcz.OptionError, match=rf"pip install 'mcz\[{name}\]'"):
            to(smooth())


@pytest.fixture(scope="module")
def archive(samples: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("archive") / "walks.mcz"
    mcz.pack(samples, path)
    return path


@pytest.mark.parametrize("to", ["npz", "csv", "bvh", "amc", "c3d", "glb", "usda"])
def test_export(archive: Path, tmp_path: Path, to: str) -> None:
    report = mcz.export(archive, tmp_path, to, rate=120, unit="cm", where="format != 'c3d'")
    names = {outcome.path for outcome in report.outcomes}
    wanted = {"walk.bvh" if to == "bvh" else f"walk.bvh.{to}", f"walk.{to}"}
    if to == "bvh":  # the second clip becomes the same file
        assert [failure.path for failure in report.failures] == ["walk.bvh"]
    else:
        assert not report.failures
        assert names == wanted | ({"walk.asf", "walk.bvh.asf"} if to == "amc" else set())
    assert {str(p.relative_to(tmp_path)) for p in tmp_path.rglob("*.*")} == names
    again = mcz.export(archive, tmp_path, to, rate=120, unit="cm", clips=["walk"])
    assert [failure.result for failure in again.failures] == ["exists"]
    if to in ("bvh", "amc"):
        with mcz.open(archive) as file:
            motion = mcz.convert(file["walk"].motion(), to, 120)
        decoded = mcz.positions(mcz.read(tmp_path / f"walk.{to}"))
        np.testing.assert_allclose(decoded, mcz.positions(motion), atol=1e-4)


def test_the_command(archive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def run_command(*words: str) -> tuple[int, str]:
        code = run("export", archive, tmp_path, *words)
        return int(code), "".join(capsys.readouterr())

    code, said = run_command("--to", "npz")
    assert code == 0 and "3 written" in said
    code, said = run_command("--to", "npz")
    assert code == Exit.USAGE and "exists" in said
    code, said = run_command("--to", "npz", "--force", "--clip", "walk")
    assert code == 0 and "1 written" in said
    code, said = run_command("--to", "bvh", "--where", "format == 'c3d'")
    assert code == Exit.BAD_INPUT and "walk.c3d" in said
    with pytest.raises(mcz.OptionError, match="unknown format 'fbx'; the formats are csv, npz"):
        mcz.export(archive, tmp_path, "fbx")


@pytest.mark.real
@pytest.mark.parametrize(
    "name", ["cmu/amc/05_01.amc", "cmu/bvh/01_01.bvh", "cmu/bvh-daz/01_01.bvh", "cmu/c3d/01_01.c3d"]
)
def test_npz_of_real_clips(data: Path, tmp_path: Path, name: str) -> None:
    paths = sorted((data / name).parent.glob(f"*{Path(name).suffix}"))
    path = data / name if (data / name).exists() else paths[0]
    motion = mcz.read(path)
    mcz.to_npz(motion, tmp_path / "clip.npz")
    check(read(tmp_path / "clip.npz"), motion)
