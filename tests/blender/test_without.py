"""The parts of the add-on that need no Blender: bones, keys, names, export, clips, the zip."""

from __future__ import annotations

import io
import tomllib
import zipfile
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import mcz
from mcz.kinematics.points import listed_points, origins_of, positions_of
from mcz.sources.sample import acclaim_walk, bvh_walk, marker_walk
from tests.blender.clips import stretching_arm
from tests.skeletons import skeletons, values_for
from tools.blender import build
from tools.blender.mcz_blender import clips, durations, placing, solving, spaces

UPS = st.sampled_from("xyz")
FACTS = solving.Facts("walk", Fraction(120), 2.5, "y", 40.0, 9, 9)


def to_blender(places: np.ndarray, up: str, scale: float) -> np.ndarray:
    """Places with z up, written out once more."""
    x, y, z = np.moveaxis(places, -1, 0) * scale
    return np.stack({"x": (-y, -z, x), "y": (x, -z, y), "z": (x, y, z)}[up], axis=-1)


def rest_axes(bones: list[placing.Bone], seed: int) -> list[np.ndarray]:
    """The matrices of bones at rest; only that y leads to the tail is Blender's, here nothing."""
    turns = Rotation.random(len(bones), np.random.default_rng(seed)).as_matrix()
    found = []
    for bone, turn in zip(bones, turns, strict=True):
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = turn, bone.head
        found.append(matrix)
    return found


def pose_matrices(
    bones: list[placing.Bone], rests: list[np.ndarray], n_frames: int
) -> list[np.ndarray]:
    """The matrices of bones in every frame, as Blender makes them of keys, scales left out."""
    found: list[np.ndarray] = []
    for bone, rest in zip(bones, rests, strict=True):
        scales = bones[bone.parent].scales if bone.parent >= 0 else None
        above = None if scales is None else (rests[bone.parent][:3, :3], scales)
        turns, shifts = placing.keys_of_bone(bone, rest[:3, :3], above)
        basis = np.tile(np.eye(4), (n_frames, 1, 1))
        if turns is not None:
            basis[:, :3, :3] = Rotation.from_quat(np.roll(turns, -1, axis=1)).as_matrix()
        if shifts is not None:
            basis[:, :3, 3] = shifts
        if bone.parent < 0:
            found.append(rest @ basis)
            continue
        local = np.linalg.inv(rests[bone.parent]) @ rest @ basis
        if scales is not None:
            local[:, 1, 3] *= scales  # it is inherited by places, and by nothing else
        found.append(found[bone.parent] @ local)
    return found


def place_of(
    bone: placing.Bone, rest: np.ndarray, matrices: np.ndarray, at: np.ndarray
) -> np.ndarray:
    """Positions of a point fixed to the bone, in every frame."""
    return (matrices @ np.linalg.inv(rest) @ np.append(at, 1.0))[:, :3]


@given(skeletons(), UPS, st.integers(0, 9))
def test_bones_are_where_the_points_are(skeleton: mcz.Skeleton, up: str, seed: int) -> None:
    values, scale = values_for(skeleton, seed=seed), 0.025
    motion = mcz.Motion(skeleton, (mcz.Signal(values),))
    bones = placing.bones_of(motion, up, scale)
    rests = rest_axes(bones, seed)
    matrices = pose_matrices(bones, rests, len(values))
    origins = to_blender(origins_of(skeleton, values), up, scale)
    points = to_blender(positions_of(skeleton, values), up, scale)
    size = np.abs(origins).max() + 1
    by_joint = [number for number, bone in enumerate(bones) if bone.end < 0]
    for joint, number in enumerate(by_joint):
        assert bones[number].joint == joint
        assert np.abs(matrices[number][:, :3, 3] - origins[:, joint]).max() < 1e-9 * size
    ends = {(bone.joint, bone.end): number for number, bone in enumerate(bones) if bone.end >= 0}
    for point, (joint, tail) in enumerate(listed_points(skeleton)):
        number = by_joint[joint]
        if bones[number].ends_at == tail >= 0:
            found = place_of(bones[number], rests[number], matrices[number], bones[number].tail)
        elif (joint, tail) in ends:
            found = matrices[ends[joint, tail]][:, :3, 3]
        else:
            continue  # an origin, or where a child begins
        assert np.abs(found - points[:, point]).max() < 1e-9 * size
    lengths = [np.linalg.norm(bone.tail - bone.head) for bone in bones]
    assert (
        min(lengths) > 1e-5 * placing.size_of(skeleton) * scale
    )  # Blender takes shorter ones away


@given(skeletons(), UPS, st.integers(0, 9))
def test_the_way_back(skeleton: mcz.Skeleton, up: str, seed: int) -> None:
    """Bones as recorded make a motion whose joints and ends are where the bones are."""
    values, scale = values_for(skeleton, seed=seed), 0.025
    bones = placing.bones_of(mcz.Motion(skeleton, (mcz.Signal(values),)), up, scale)
    rests = rest_axes(bones, seed)
    matrices = pose_matrices(bones, rests, len(values))
    parts = [
        solving.Part(b.name, b.parent, r, b.tail, m, b.ends_at >= 0, b.end >= 0)
        for b, r, m in zip(bones, rests, matrices, strict=True)
    ]
    again = solving.motion_of_bones(parts, replace(FACTS, up=up, scale=1 / scale))
    before = {b.name: m[:, :3, 3] for b, m in zip(bones, matrices, strict=True)}
    places = to_blender(origins_of(again.skeleton, again.values), up, scale)
    size = max(np.abs(m).max() for m in before.values()) + 1
    for number, joint in enumerate(again.skeleton.joints):
        assert np.abs(places[:, number] - before[joint.name]).max() < 1e-5 * size
    held = {joint.name for joint in again.skeleton.joints}
    assert {bone.name for bone in bones if bone.end < 0} <= held
    n_points = sum(1 + len(joint.tails) for joint in again.skeleton.joints)
    n_tails = sum(bone.ends_at >= 0 for bone in bones)
    assert n_points <= len(bones) + n_tails


def test_a_bone_that_stretches() -> None:
    """It is scaled, so that it ends where its tail is, and its child is not."""
    motion = stretching_arm()
    arm, *_ = bones = placing.bones_of(motion, "y", 0.01)[1:]
    lengths = np.linalg.norm(mcz.positions(motion)[:, 1] - mcz.positions(motion)[:, 0], axis=1)
    assert arm.scales is not None and np.allclose(arm.scales, lengths / 10) and lengths.max() > 12
    assert all(bone.scales is None for bone in bones[1:])


def test_what_does_not_move_has_no_channels() -> None:
    skeleton = mcz.Skeleton((mcz.Joint("a"), mcz.Joint("b", 0, (0.0, 1.0, 0.0))))
    bones = placing.bones_of(mcz.Motion(skeleton, (mcz.Signal(np.zeros((3, 0))),)), "y", 1.0)
    rests = rest_axes(bones, 1)
    matrices = pose_matrices(bones, rests, 3)
    parts = [
        solving.Part(b.name, b.parent, r, b.tail, m, False, False)
        for b, r, m in zip(bones, rests, matrices, strict=True)
    ]
    again = solving.motion_of_bones(parts, FACTS)
    kinds = [[channel.kind for channel in joint.channels] for joint in again.skeleton.joints]
    assert kinds == [["tx", "ty", "tz"], []]


def test_markers_there_and_back() -> None:
    walk = marker_walk()
    places = placing.markers_of(walk, walk.skeleton.up_axis, 0.001)
    names = list(walk.skeleton.joint_names)
    facts = replace(FACTS, up="z", scale=1000.0, length_decimals=2)
    again = solving.motion_of_markers(names, places, facts)
    assert np.allclose(mcz.positions(again), mcz.positions(walk), 0, 1e-3, equal_nan=True)
    assert again.signals[0].mask is not None and not again.signals[0].mask.all()


@given(st.integers(0, 2**32 - 1))
def test_quaternions(seed: int) -> None:
    random = np.random.default_rng(seed)
    turns = Rotation.random(20, random)
    half = Rotation.from_rotvec(np.pi * np.eye(3))  # no part but one
    matrices = np.concatenate([turns.as_matrix(), half.as_matrix(), np.full((1, 3, 3), np.nan)])
    found = spaces.to_quaternions(matrices)
    assert np.isnan(found[-1]).all()
    back = Rotation.from_quat(np.roll(found[:-1], -1, axis=1)).as_matrix()
    assert np.abs(back - matrices[:-1]).max() < 1e-12
    way = spaces.continuous(found[:20])
    assert (np.sum(way[1:] * way[:-1], axis=1) >= 0).all() and way[0, 0] >= 0


@given(st.lists(st.text(max_size=80), max_size=8))
def test_names_of_bones(names: list[str]) -> None:
    found = spaces.blender_names(names)
    assert len(set(found)) == len(found) == len(names)
    assert all(0 < len(name.encode()) <= 63 for name in found)
    assert spaces.blender_names(found) == found


def test_where_a_bone_ends() -> None:
    """The spine goes on to the spine, a leaf to its end site, a point as the bone above."""
    bones = {bone.name: bone for bone in placing.bones_of(bvh_walk(), "y", 0.01)}
    assert np.allclose(bones["LowerBack"].tail, bones["Spine"].head)
    assert np.allclose(bones["Spine1"].tail, bones["Neck"].head)
    assert bones["Hips"].tail[2] > 0 == bones["Hips"].tail[0]  # LowerBack begins where it does
    assert bones["Head"].ends_at == 0 and bones["Hips"].ends_at == -1
    acclaim = placing.bones_of(acclaim_walk(), "y", 0.05)
    assert sum(bone.ends_at == 0 for bone in acclaim) == 30 and acclaim[0].ends_at == -1


@pytest.fixture(scope="module")
def archive(samples: Path, tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("blender") / "all.mcz"
    mcz.pack(samples, path, rate=120)
    return str(path)


def test_clips_are_found(archive: str) -> None:
    assert [name for name, _ in clips.found(archive, "")] == ["walk", "walk.bvh", "walk.c3d"]
    assert [name for name, _ in clips.found(archive, "n_channels == 62")] == ["walk"]
    assert [name for name, _ in clips.found(archive, "WALK bvh")] == ["walk.bvh"]
    assert clips.found(archive, "nowhere") == []
    assert clips.found(archive, "walk.bvh")[0][1].startswith("240 frames at 120 Hz, fast")
    with pytest.raises(mcz.MczError):
        clips.found("nothing.mcz", "")


def test_clips_are_loaded(archive: str, samples: Path) -> None:
    wanted = clips.Wanted(clip="walk.bvh", first=10, stop=100, step=7)
    ((count, loaded),) = clips.loaded(archive, wanted)
    assert (count, loaded.rate) == (1, 120)
    assert loaded.numbers.tolist() == list(range(10, 100, 7))
    assert np.array_equal(loaded.motion.values, bvh_walk().values[10:100:7])
    (source,) = clips.loaded(str(samples / "walk.bvh"), wanted)
    assert np.array_equal(source[1].motion.values, loaded.motion.values)
    assert [n for n, _ in clips.loaded(archive, clips.Wanted(where="n_frames == 240"))] == [3] * 3
    assert [n for n, _ in clips.loaded(archive, clips.Wanted(every=True))] == [3] * 3
    with pytest.raises(mcz.OptionError, match="the file has 3 clips; choose one"):
        list(clips.loaded(archive, clips.Wanted()))
    with pytest.raises(mcz.OptionError, match="has 240 frames, not 5:1000"):
        list(clips.loaded(archive, clips.Wanted(clip="walk", first=5, stop=1000)))


def test_coarse_clips(tmp_path: Path) -> None:
    """Every second frame a resolution; of a clip without, all, which is said."""
    path = str(tmp_path / "walk.mcz")
    mcz.write(replace(acclaim_walk()), path, "mrdwt", T_g=0.4)
    ((_, coarse),) = clips.loaded(path, clips.Wanted(resolution=1, first=8))
    assert coarse.numbers.tolist() == list(range(8, 240, 2)) and coarse.rate == 120
    assert len(coarse.motion.values) == 116 and not coarse.notes
    mcz.write(acclaim_walk(), path, force=True)
    ((_, fine),) = clips.loaded(path, clips.Wanted(resolution=3))
    assert len(fine.numbers) == 240 and fine.notes == ("clip 'walk' has resolutions 0 to 0",)


def zip_members(data: bytes) -> dict[str, bytes]:
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def test_the_zip() -> None:
    """The same bytes twice, a manifest that names what is there, and the version of the package."""
    name, data = build.build_zip()
    assert (name, data) == build.build_zip()
    assert name == f"mcz-blender-{mcz.__version__}.zip"
    members = zip_members(data)
    manifest = tomllib.loads(members["blender_manifest.toml"].decode())
    assert {"__init__.py", "importing.py", "LICENSE"} <= set(members)
    assert manifest["version"] == mcz.__version__ and "platforms" not in manifest
    assert manifest["wheels"] == [f"./{name}" for name in members if name.endswith(".whl")]
    assert len(manifest["tagline"]) <= 64 and manifest["permissions"]
    package = zip_members(members[f"wheels/mcz-{mcz.__version__}-py3-none-any.whl"])
    assert {"mcz/__init__.py", "mcz/annex/registry.json"} <= set(package)
    unwanted = (".pyc", ".html", ".so", ".pyd")
    assert not [name for name in package if name.endswith(unwanted)]


def wheel_with(path: Path, *modules: str, **sources: bytes) -> Path:
    """A wheel of this tree with compiled modules of these names, and with changed sources."""
    files = zip_members(build.mcz_wheel({name: name.encode() for name in modules})[1])
    files |= {f"mcz/{name}.py": data for name, data in sources.items()}
    path.write_bytes(build.zip_files(files))
    return path


def test_compiled_kernels_of_several_platforms_are_in_one_wheel(tmp_path: Path) -> None:
    """Each Python finds its own by the suffix; only kernels come of the wheels."""
    linux = "mcz/kernels/compiled/fast.cpython-311-x86_64-linux-gnu.so"
    windows = "mcz/kernels/compiled/fast.cp311-win_amd64.pyd"
    checked = "mcz/kernels/checked/fast.cp311-win_amd64.pyd"
    wheel_with(tmp_path / "mcz-1.0.0-cp311-cp311-linux_x86_64.whl", linux)
    wheel_with(tmp_path / "mcz-1.0.0-cp311-cp311-win_amd64.whl", windows, checked)
    (tmp_path / "numpy-1.24.4-cp311-cp311-win_amd64.whl").write_bytes(b"")
    members = zip_members(build.build_zip(build.wheels_in(tmp_path))[1])
    (wheel,) = (data for name, data in members.items() if name.startswith("wheels/mcz-"))
    package = zip_members(wheel)
    assert package[linux] == linux.encode() and package[windows] == windows.encode()
    assert checked not in package
    record = package[f"mcz-{mcz.__version__}.dist-info/RECORD"].decode()
    assert f"{linux},sha256=" in record and f"{windows},sha256=" in record


def test_wheels_that_cannot_be_bundled(tmp_path: Path) -> None:
    module = "mcz/kernels/compiled/fast.cpython-311-darwin.so"
    first = wheel_with(tmp_path / "mcz-1.whl", module)
    second = wheel_with(tmp_path / "mcz-2.whl", module)
    with pytest.raises(
        build.WheelError, match=f"mcz-2.whl and a wheel before it both have {module}"
    ):
        build.build_zip([first, second])
    with pytest.raises(build.WheelError, match="mcz-3.whl has no compiled kernels"):
        build.build_zip([wheel_with(tmp_path / "mcz-3.whl")])
    other = wheel_with(tmp_path / "mcz-4.whl", module, version=b"VERSION = '0.1'")
    with pytest.raises(
        build.WheelError, match=r"mcz-4.whl was not built .*: mcz/version.py differs"
    ):
        build.build_zip([other])
    (tmp_path / "empty").mkdir()
    with pytest.raises(build.WheelError, match="empty has no wheels of mcz"):
        build.wheels_in(tmp_path / "empty")


@pytest.mark.parametrize("lacking", [False, True])
def test_a_slow_export_is_announced(monkeypatch: pytest.MonkeyPatch, lacking: bool) -> None:
    """With how long it may take, in words, where that is over a minute."""
    monkeypatch.setattr(durations, "lacks_compiled_kernels", lambda: lacking)
    n_values = 2783 * 62
    assert durations.slow_warning("fast", n_values) == ""
    assert durations.slow_warning("lossy", 0) == ""
    warning = durations.slow_warning("lossy", n_values if lacking else 100 * n_values)
    assert warning == (
        "Without compiled kernels this export takes up to 12 minutes, and Blender waits for it; "
        "with codec Fast, 4 seconds"
        if lacking
        else "This export takes up to 21 minutes, and Blender waits for it; "
        "with codec Fast, 13 seconds"
    )
    assert bool(durations.slow_warning("best", n_values)) == lacking
    assert durations.slow_warning("fast", 10**9).endswith("Blender waits for it")


def test_durations_in_words() -> None:
    given = [0.0, 1.0, 1.5, 120.0, 121.0, 7200.0, 7201.0]
    assert [durations.in_words(seconds) for seconds in given] == [
        *("1 second", "1 second", "2 seconds", "120 seconds"),
        *("3 minutes", "120 minutes", "3 hours"),
    ]
