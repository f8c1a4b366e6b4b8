"""In-memory objects of other libraries: round trips with the real packages, bit for bit."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import mcz
from mcz import Channel, Joint, Motion, Signal, Skeleton
from mcz.model.motion import POSITION_KINDS
from mcz.model.numbers import GridKind
from tests.commands import run

POSITION = tuple(map(Channel, POSITION_KINDS))


def same(one: Motion, other: Motion) -> bool:
    """True if two motions have the same signals, bit for bit, and the same names and rate."""
    return (
        one.skeleton.joint_names == other.skeleton.joint_names
        and one.frame_rate == other.frame_rate
        and [signal.name for signal in one.signals] == [signal.name for signal in other.signals]
        and all(
            np.array_equal(a.masked(), b.masked(), equal_nan=True)
            for a, b in zip(one.signals, other.signals, strict=True)
        )
    )


def markers(seed: int, names: tuple[str, ...] = ("LFHD", "RFHD", "C7")) -> Motion:
    """Markers with gaps, in numbers that binary32 does not have."""
    random = np.random.default_rng(seed)
    joints = tuple(Joint(name, channels=POSITION) for name in names)
    values = random.normal(0, 1000, (9, 3 * len(names)))
    mask = np.repeat(random.random((9, len(names))) > 0.3, 3, axis=1)
    return Motion(
        Skeleton(joints, unit_cm=0.1, angle_unit="", up_axis="z"),
        (Signal(np.where(mask, values, 0.0), mask=mask),),
        100,
    )


# pybvh ----------------------------------------------------------------------------------


def bvh_of(path: Path) -> Any:
    import pybvh

    return pybvh.read_bvh_file(path, warn_on_world_up_disagreement=False)


def test_pybvh_comes_back(samples: Path) -> None:
    bvh = bvh_of(samples / "walk.bvh")
    motion = mcz.from_pybvh(bvh, unit="cm", up="y")
    assert motion.skeleton.angle_unit == "rad" and motion.name == "walk"
    assert (motion.skeleton.unit_cm, motion.skeleton.up_axis) == (1.0, "y")
    np.testing.assert_array_equal(
        motion.values, np.hstack([bvh.root_pos, bvh.joint_angles.reshape(240, -1)])
    )
    again = mcz.to_pybvh(motion)
    np.testing.assert_array_equal(again.root_pos, bvh.root_pos)
    np.testing.assert_array_equal(again.joint_angles, bvh.joint_angles)
    assert again.matches_hierarchy(bvh) and again.frame_time == bvh.frame_time
    assert again.world_up == "+y"


def test_a_motion_for_pybvh_is_what_pybvh_reads(samples: Path) -> None:
    made, read = mcz.to_pybvh(mcz.read(samples / "walk.bvh")), bvh_of(samples / "walk.bvh")
    assert made.matches_hierarchy(read)
    np.testing.assert_array_equal(made.joint_angles, read.joint_angles)
    np.testing.assert_array_equal(made.node_positions(), read.node_positions())


def test_acclaim_for_pybvh_is_where_it_was(samples: Path) -> None:
    motion = mcz.read(samples / "walk.amc", rate=120)
    made = mcz.to_pybvh(motion)
    points = mcz.positions(mcz.convert(motion, "bvh"))
    np.testing.assert_allclose(made.node_positions(), points, atol=1e-9)


def test_joints_for_pybvh_are_put_in_its_order(tmp_path: Path) -> None:
    """Joints by depth, with fewer angles, positions that stay: the same places, and in a file."""
    joints = (
        Joint("hips", -1, (0.0, 1.0, 0.0), channels=(*POSITION, Channel("rx"))),
        Joint("left", 0, (1.0, 0.0, 0.0), channels=(Channel("rz"), Channel("ry"))),
        Joint("right", 0, (-1.0, 0.0, 0.0), channels=(Channel("tx"), Channel("ry"))),
        Joint("foot", 1, (0.0, -1.0, 0.0), ((0.0, 0.0, 1.0),), channels=(Channel("rx"),)),
    )
    values = np.random.default_rng(1).normal(0, 20, (5, 9))
    values[:, 6] = 0.5  # tx of "right"
    motion = Motion(Skeleton(joints), (Signal(values),), 60)
    made = mcz.to_pybvh(motion)
    assert made.joint_names == ["hips", "left", "foot", "right"]
    places = made.node_positions()
    for name in motion.skeleton.joint_names:
        wanted = mcz.positions(motion, name)[:, 0]
        np.testing.assert_allclose(places[:, made.node_index[name]], wanted, atol=1e-12)
    made.write(tmp_path / "a.bvh")
    again = mcz.positions(mcz.read(tmp_path / "a.bvh"))
    np.testing.assert_allclose(again, places, atol=1e-4)


def test_what_pybvh_cannot_hold_is_refused(samples: Path) -> None:
    walk = mcz.read(samples / "walk.bvh")
    with pytest.raises(mcz.MotionError, match="markers have no skeleton"):
        mcz.to_pybvh(replace(markers(0), signals=(Signal(np.zeros((1, 9))),)))
    with pytest.raises(
        mcz.MotionError, match="some values are missing, which pybvh does not support"
    ):
        mcz.to_pybvh(markers(0))
    values = walk.values.copy()
    moving = replace(
        walk.skeleton.joints[1], channels=(*POSITION, *walk.skeleton.joints[1].channels)
    )
    joints = (walk.skeleton.joints[0], moving, *walk.skeleton.joints[2:])
    more = np.insert(values, 6, np.arange(240.0), axis=1)
    more = np.insert(more, 7, 0.0, axis=1)
    more = np.insert(more, 8, 0.0, axis=1)
    skeleton = replace(walk.skeleton, joints=joints)
    with pytest.raises(
        mcz.MotionError,
        match="moves relative to its parent, which pybvh supports only for the root",
    ):
        mcz.to_pybvh(Motion(skeleton, (Signal(more),), 60))
    two = replace(skeleton, joints=(Joint("a"), Joint("b")))
    with pytest.raises(mcz.MotionError, match="one root"):
        mcz.to_pybvh(Motion(two, (Signal(np.zeros((1, 0))),), 60))


# ezc3d and c3d --------------------------------------------------------------------------


@settings(max_examples=20)
@given(st.integers(0, 2**32))
def test_ezc3d_holds_binary64(seed: int) -> None:
    motion = markers(seed)
    held = mcz.to_ezc3d(motion)
    places = motion.values.reshape(9, 3, 3)
    np.testing.assert_array_equal(held["data"]["points"][:3], places.transpose(2, 1, 0))
    again = mcz.from_ezc3d(held)
    np.testing.assert_array_equal(again.values, motion.values)
    assert again.skeleton.unit_cm == 0.1 and again.frame_rate == 100


def test_ezc3d_of_a_file_keeps_its_source(samples: Path, tmp_path: Path) -> None:
    import ezc3d

    motion = mcz.read(samples / "walk.c3d")
    again = mcz.from_ezc3d(ezc3d.c3d(str(samples / "walk.c3d")), name="walk")
    assert same(again, motion) and again.source is not None and again.name == "walk"
    mcz.write(again, tmp_path / "walk.mcz")
    decoded = mcz.to_ezc3d(mcz.read(tmp_path / "walk.mcz"))
    labels = decoded["parameters"]["POINT"]["LABELS"]["value"]
    assert tuple(labels) == motion.skeleton.joint_names
    decoded["data"]["points"][0, 0, 0] += 1e-9  # what no C3D can hold
    changed = mcz.from_ezc3d(decoded)
    assert changed.values[0, 0] == decoded["data"]["points"][0, 0, 0] != motion.values[0, 0]
    assert changed.source is None and "binary32" in changed.metadata["source-note"]
    mcz.write(changed, tmp_path / "changed.mcz")
    assert same(mcz.read(tmp_path / "changed.mcz"), changed)


def test_what_ezc3d_cannot_write_is_refused(samples: Path) -> None:
    import ezc3d

    held = ezc3d.c3d(str(samples / "walk.c3d"))
    held["parameters"]["POINT"]["LABELS"]["value"] = ["one"]
    with pytest.raises(mcz.OptionError, match="ezc3d cannot write"):
        mcz.from_ezc3d(held)


@pytest.mark.filterwarnings("ignore::UserWarning:c3d")  # a file without analog data
def test_c3d_comes_back_byte_for_byte(samples: Path) -> None:
    import c3d

    motion = mcz.read(samples / "walk.c3d")
    with (samples / "walk.c3d").open("rb") as file:
        reader = c3d.Reader(file)
        read = mcz.from_c3d(reader, name="walk")
        next(iter(reader.read_frames()))  # it can still be used
    with pytest.raises(mcz.OptionError, match="must be open"):
        mcz.from_c3d(reader)
    assert same(read, motion) and read.source is not None and motion.source is not None
    assert read.source.sha256 == motion.source.sha256
    made = mcz.to_c3d(motion)
    frames = [points[:, :3] for _, points, _ in made.read_frames()]
    known = ~np.isnan(motion.values)
    found = np.array(frames).reshape(240, -1)
    np.testing.assert_array_equal(found[known], motion.values[known])
    assert mcz.from_c3d(made).source.sha256 == motion.source.sha256
    written = io.BytesIO()
    writer = made.to_writer("copy")
    writer.write(written)
    assert same(mcz.from_c3d(writer, name="walk"), motion)
    with pytest.raises(mcz.OptionError, match="list is neither"):
        mcz.from_c3d([])


@pytest.mark.filterwarnings("ignore::UserWarning:c3d")
def test_joints_become_markers_of_c3d(samples: Path) -> None:
    motion = mcz.read(samples / "walk.bvh", unit="cm")
    made = mcz.from_c3d(mcz.to_c3d(motion))
    assert made.skeleton.joint_names == mcz.point_names(motion)
    np.testing.assert_allclose(mcz.positions(made, unit="cm"), mcz.positions(motion), atol=1e-4)
    exact = mcz.to_ezc3d(motion)["data"]["points"][:3].transpose(2, 1, 0)
    np.testing.assert_allclose(exact / 10, mcz.positions(motion), rtol=1e-12, atol=1e-12)


@pytest.mark.real
@pytest.mark.parametrize(
    "name", ["btk-data/Gait.c3d", "btk-data/Analysis.c3d", "c3d.org/sample_01/Eb015pr.c3d"]
)
def test_real_c3d_in_ezc3d(data: Path, name: str) -> None:
    """Outputs of models, integers, analog: the numbers of ezc3d are ours."""
    motion = mcz.read(data / "other" / name)
    held = mcz.to_ezc3d(motion)
    for signal in motion.signals:
        if signal.name == "analog":
            np.testing.assert_array_equal(held["data"]["analogs"][0].T, signal.masked())
    try:
        again = mcz.from_ezc3d(held)
    except mcz.OptionError as error:
        assert "ezc3d cannot write" in str(error) and "LABELSX" in str(error)
        return
    for one, other in zip(motion.signals, again.signals, strict=True):
        if one.name != "residuals":
            np.testing.assert_array_equal(one.masked(), other.masked())


# movement -------------------------------------------------------------------------------


@settings(max_examples=20)
@given(st.integers(0, 2**32))
def test_movement_comes_back(seed: int) -> None:
    pytest.importorskip("xarray")
    numbers = np.array([3, 4, 5, 6, 8, 9, 10, 11, 12])
    motion = replace(markers(seed), frame_numbers=numbers)
    data = mcz.to_movement(motion)
    assert data.position.dims == ("time", "space", "keypoints", "individuals")
    np.testing.assert_array_equal(data.time.values, (numbers - 1) / 100.0)
    np.testing.assert_array_equal(
        data.position.sel(keypoints="C7", individuals="motion").values, motion.values[:, 6:]
    )
    known = ~np.isnan(motion.values[:, ::3])
    np.testing.assert_array_equal(data.confidence.values[:, :, 0], known)
    again = mcz.from_movement(data)
    np.testing.assert_array_equal(again.values, motion.values)
    np.testing.assert_array_equal(again.frame_numbers, numbers)
    assert again.skeleton.joint_names == motion.skeleton.joint_names
    assert (again.skeleton.unit_cm, again.skeleton.up_axis) == (0.1, "z")
    assert mcz.to_movement(again).drop_vars("individuals").equals(data.drop_vars("individuals"))


def test_individuals_of_movement(tmp_path: Path) -> None:
    xarray = pytest.importorskip("xarray")
    names = ("mouse:nose", "mouse:tail", "rat:nose", "rat:tail")
    data = mcz.to_movement(markers(5, names))
    assert data.individuals.values.tolist() == ["mouse", "rat"]
    assert data.keypoints.values.tolist() == ["nose", "tail"]
    assert mcz.from_movement(data).skeleton.joint_names == names
    assert mcz.to_movement(markers(5, names[:3])).sizes["individuals"] == 1
    flat = xarray.Dataset(
        {
            "position": (
                ("individual", "time", "keypoint", "space"),
                np.arange(12, dtype=np.float32).reshape(1, 3, 2, 2) / 3,
            ),
            "confidence": (("time", "keypoint", "individual"), np.full((3, 2, 1), 0.25)),
        },
        {"time": [0, 1, 2], "space": ["x", "y"], "keypoint": ["a", "b"], "individual": ["id_0"]},
        {"time_unit": "frames"},
    )
    motion = mcz.from_movement(flat)
    assert motion.frame_rate is None and motion.frame_numbers is None
    assert motion.signals[0].grids[0].kind == GridKind.BINARY32
    assert mcz.positions(motion).shape == (3, 2, 3)
    mcz.write(motion, tmp_path / "flat.mcz")
    again = mcz.to_movement(mcz.read(tmp_path / "flat.mcz"))
    np.testing.assert_array_equal(
        again.position.values[..., 0], flat.position.values[0].transpose(0, 2, 1)
    )
    assert (again.confidence == 0.25).all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda data: data.rename(position="place"), "no variable 'position'"),
        (lambda data: data.isel(individuals=0), "along time, space, keypoints, not"),
        (
            lambda data: data.assign_coords(space=["x", "z", "y"]),
            "positions are along x, z, y, not x, y or x, y, z",
        ),
        (
            lambda data: data.assign_coords(time=data.time * 1.5),
            "times do not match 100.0 frames a second",
        ),
        (
            lambda data: data.drop_attrs().assign_attrs(time_unit="seconds"),
            "times are in seconds, but the attribute 'fps' is missing",
        ),
        (lambda data: data.drop_vars("space"), "no coordinates along space"),
    ],
)
def test_other_layouts_are_refused(change: Any, message: str) -> None:
    pytest.importorskip("xarray")
    with pytest.raises(mcz.OptionError, match=message):
        mcz.from_movement(change(mcz.to_movement(markers(1))))


@pytest.mark.filterwarnings("ignore")
def test_movement_takes_it_for_its_own(samples: Path, tmp_path: Path) -> None:
    pytest.importorskip("movement")
    from movement.filtering import filter_by_confidence
    from movement.io import load_poses, save_poses
    from movement.kinematics import compute_speed
    from movement.validators.datasets import ValidPosesInputs

    motion = mcz.read(samples / "walk.c3d")
    data = mcz.to_movement(motion, unit="m")
    ValidPosesInputs.validate(data)
    own = load_poses.from_numpy(
        data.position.values,
        data.confidence.values,
        data.individuals.values.tolist(),
        data.keypoints.values.tolist(),
        120.0,
        "mcz",
    )
    assert own.identical(data.drop_attrs().assign_attrs(own.attrs))
    assert own.attrs.items() <= data.attrs.items()
    speeds = compute_speed(data.position).sel(keypoints="LFHD").values[:, 0]
    ours = np.linalg.norm(mcz.velocities(motion, "LFHD", unit="m")[:, 0], axis=1)
    known = np.isfinite(speeds) & np.isfinite(ours)
    assert known.sum() > 200
    np.testing.assert_allclose(speeds[known], ours[known], rtol=1e-9)
    filtered = filter_by_confidence(data.position, data.confidence, threshold=0.5)
    np.testing.assert_array_equal(filtered.values, data.position.values)
    flat = data.isel(space=slice(2))
    save_poses.to_dlc_file(flat, tmp_path / "flat.csv", split_individuals=False)
    loaded = load_poses.from_file(tmp_path / "flat.csv", "DeepLabCut", fps=120)
    back = mcz.from_movement(loaded)
    np.testing.assert_allclose(
        mcz.positions(back)[..., :2], mcz.positions(motion, unit="m")[..., :2], atol=1e-12
    )


# rerun ----------------------------------------------------------------------------------


def read_log(path: Path) -> dict[str, list[Any]]:
    """By the path of each entity, the chunks of an .rrd as rerun reads it."""
    from rerun.chunk import RrdReader

    found: dict[str, list[Any]] = {}
    for chunk in RrdReader(path).stream():
        found.setdefault(str(chunk.entity_path), []).append(chunk)
    return found


def columns(chunks: list[Any], name: str) -> dict[int, Any]:
    """The component of a name by frame number."""
    found = {}
    for chunk in chunks:
        rows = chunk.to_record_batch().to_pydict()
        key = next((key for key in rows if key.endswith(name)), None)
        if key is not None and "frame" in rows:
            found |= dict(zip(rows["frame"], rows[key], strict=True))
    return dict(sorted(found.items()))


@pytest.fixture
def take(samples: Path, tmp_path: Path) -> Path:
    pytest.importorskip("rerun")
    return tmp_path / "take.rrd"


def view(*words: object) -> int:
    return int(run("view", *map(str, words)))


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", ["walk.bvh", "walk.amc", "walk.c3d"])
def test_rerun_has_the_points(samples: Path, take: Path, name: str) -> None:
    facts = {} if name == "walk.c3d" else {"rate": 120.0, "up": "y"}
    facts |= {"unit": "cm"} if name == "walk.bvh" else {}
    motion = mcz.read(samples / name, **facts)
    words = [word for key, fact in facts.items() for word in (f"--{key}", fact)]
    assert view(samples / name, "-o", take, *words) == 0
    found = read_log(take)
    points, names = mcz.positions(motion, unit="m"), mcz.point_names(motion)
    clip = (
        "/walk"
        if name != "walk.c3d"
        else next(p for p in found if "/points/" in p).split("/points")[0]
    )
    for point, of in enumerate(names):
        places = columns(found[f"{clip}/points/{escape_name(of)}"], ":positions")
        assert list(places) == list(range(1, 241))
        for frame, place in places.items():
            wanted = points[frame - 1, point]
            if np.isnan(wanted).any():
                assert not place  # a gap is no point
            else:
                np.testing.assert_allclose(place[0], wanted, rtol=1e-6, atol=1e-7)
    assert (f"{clip}/bones/left" in found) == (name != "walk.c3d")
    if name == "walk.c3d":
        assert len(columns(found[f"{clip}/residuals/LFHD"], ":scalars")) == 240


def escape_name(name: str) -> str:
    import rerun

    return str(rerun.new_entity_path([name])).removeprefix("/")


@pytest.mark.filterwarnings("ignore")
def test_rerun_has_samples_between_frames(take: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import rerun

    from mcz.show import rerun as adapter

    motion = replace(markers(3), frame_numbers=np.arange(5, 14))
    samples = np.random.default_rng(3).normal(size=(36, 2))
    mask = np.ones((36, 2), np.bool_)
    mask[7, 1] = False
    names = (Channel("", "EMG 1", "V"), Channel("", "b/c"))
    analog = Signal(
        samples, name="analog", role="analog", samples_per_frame=4, mask=mask, channels=names
    )
    motion = replace(motion, signals=(*motion.signals, analog))
    monkeypatch.setattr(adapter, "BLOCK", 40)  # frames by twos
    recording = rerun.RecordingStream("test", recording_id="a")
    recording.save(take)
    assert mcz.to_rerun(motion, recording, entity="day 1/take") is recording
    recording.disconnect()
    found = read_log(take)
    values, times = [], []
    for chunk in found["/day\\ 1/take/analog/b\\/c"]:
        rows = chunk.to_record_batch().to_pydict()
        key = next((key for key in rows if key.endswith(":scalars")), None)
        values += rows[key] if key else []
        times += [time.total_seconds() for time in rows["time"]] if key else []
    wanted = np.where(mask, samples, np.nan)[:, 1]
    held = [row[0] if row else np.nan for row in values]
    order = np.argsort(times)
    np.testing.assert_array_equal(np.array(held)[order], wanted)
    np.testing.assert_allclose(np.array(times)[order], 0.04 + np.arange(36) / 400, atol=1e-9)
    assert "/day\\ 1/take" in found  # the axes


@pytest.mark.filterwarnings("ignore")
def test_view_logs_several_clips(samples: Path, take: Path, capsys: Any) -> None:
    archive = take.with_name("all.mcz")
    mcz.pack(samples, archive, rate=120)
    assert view(archive, samples / "walk.bvh", "-o", take, "--json") == 0
    shown = capsys.readouterr().out
    assert '"n_frames": 240' in shown
    found = read_log(take)
    assert any(path.startswith("/all.mcz/walk.c3d/points") for path in found)
    assert any(path.startswith("/walk.bvh/walk/points") for path in found)
    assert view(archive, "-o", take) == 2  # it exists
    assert view(archive, "-o", take, "--force", "--codec", "fast") == 2
    assert view(archive, "--rerun", "-o", take.with_suffix(".html")) == 2
    assert view(archive, "-o", take, "--force", "--clip", "nothing") == 2
    assert read_log(take).keys() == found.keys()  # a failure leaves what was there
    assert view(archive, "-o", take, "--force", "--clip", "walk.c3d") == 0
    assert any(path.startswith("/walk.c3d/points") for path in read_log(take))


def test_the_viewer_of_rerun_needs_a_screen(
    samples: Path, take: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setattr("sys.platform", "linux")
    assert view(samples / "walk.bvh", "--rerun") == 1
    assert "no screen" in capsys.readouterr().err


@pytest.mark.parametrize("make", [mcz.from_pybvh, mcz.from_ezc3d, mcz.from_c3d, mcz.from_movement])
def test_a_path_is_none_of_these(make: Any) -> None:
    with pytest.raises(
        mcz.OptionError, match=r"not a pybvh|not an ezc3d|neither|not a poses dataset"
    ):
        make("walk")


def test_a_library_that_is_missing_is_named(
    samples: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    import sys

    motion = mcz.read(samples / "walk.c3d")
    libraries = {"pybvh": mcz.to_pybvh, "ezc3d": mcz.to_ezc3d, "c3d": mcz.to_c3d}
    libraries |= {"xarray": mcz.to_movement, "rerun": mcz.to_rerun}
    for name, make in libraries.items():
        monkeypatch.setitem(sys.modules, name, None)
        with pytest.raises(mcz.OptionError, match=rf"{name} is not installed .*'mcz\[{name}\]'"):
            make(motion)
    assert view(samples / "walk.c3d", "--rerun") == 2
    assert "rerun is not installed" in capsys.readouterr().err
