"""Scenes: every joint where the motion has it, by the keys of the file alone."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import mcz
from mcz import Channel, Joint, Motion, MotionError, OptionError, SceneFile, Signal, Skeleton
from mcz.kinematics.points import origins_of, point_set, positions
from mcz.sources.sample import acclaim_walk, bvh_walk, marker_walk
from tests.commands import run
from tests.glb import Glb
from tests.skeletons import skeletons, values_for

ROOT = Path(__file__).parents[1]
WALKS = {
    "amc": replace(acclaim_walk(), frame_rate=Fraction(120)),
    "bvh": replace(bvh_walk(), skeleton=replace(bvh_walk().skeleton, unit_cm=1.0)),
    "c3d": marker_walk(),
}
TO_Y_UP = {
    "": np.eye(3),
    "x": np.array([(0, -1, 0), (1, 0, 0), (0, 0, 1)]),
    "y": np.eye(3),
    "z": np.array([(1, 0, 0), (0, 0, 1), (0, -1, 0)]),
    "-x": np.array([(0, 1, 0), (-1, 0, 0), (0, 0, 1)]),
    "-y": np.diag((1, -1, -1)),
    "-z": np.array([(1, 0, 0), (0, 0, -1), (0, 1, 0)]),
}


def worst(motion: Motion, data: bytes) -> float:
    """Greatest distance of a joint or point from the motion's, in meters or units."""
    rate, skeleton = motion.frame_rate, motion.skeleton
    assert rate is not None
    times = (np.arange(motion.n_frames) / float(rate)).astype(np.float32).astype(np.float64)
    found = Glb(data).places(times)
    scale = 1.0 if skeleton.unit_cm is None else skeleton.unit_cm / 100
    turn = TO_Y_UP[skeleton.up_axis].T * scale
    joints = origins_of(skeleton, np.asarray(motion.values, np.float64)) @ turn
    errors = [
        np.linalg.norm(found[name] - joints[:, number], axis=1)
        for number, name in enumerate(skeleton.addresses())
    ]
    if point_set(skeleton) == "markers":
        return float(np.nanmax(errors))
    points, nodes = positions(motion) @ turn, np.stack(list(found.values()), axis=1)
    for number in range(points.shape[1]):
        off = np.linalg.norm(nodes - points[:, number, None], axis=2).max(axis=0)
        errors.append(off.min(keepdims=True))
    return float(np.max(np.concatenate(errors), initial=0.0))


def check(motion: Motion, **options: object) -> SceneFile:
    """The file, whose errors are as it says and within the bound."""
    made = mcz.to_glb(motion, **options)  # type: ignore[arg-type]
    scale = 1000.0 if made.has_unit else 1.0
    error = worst(motion, made.data) * scale
    assert error == pytest.approx(made.max_error, rel=1e-3, abs=1e-6 * scale)
    assert made.max_error <= made.key_error or made.key_error == 0
    return made


@given(skeletons(), st.integers(0, 2**32), st.sampled_from([*TO_Y_UP]), st.booleans())
def test_any_skeleton(skeleton: Skeleton, seed: int, up: str, known: bool) -> None:
    """Scales, lengths, quaternions, axes and radians included."""
    skeleton = replace(skeleton, up_axis=up, unit_cm=2.5 if known else None)
    motion = Motion(skeleton, (Signal(values_for(skeleton, seed=seed)),), Fraction(30))
    made = check(motion)
    assert made.data == mcz.to_glb(motion).data
    assert any("unit is unknown" in note for note in made.notes) == (not known)
    assert any("points up is unknown" in note for note in made.notes) == (not up)


@given(st.integers(0, 2**32), st.sampled_from([0.0, 0.01, 1.0, 30.0]))
def test_smooth_motions_need_few_keys(seed: int, bound: float) -> None:
    """Rotations of up to many turns, along chains."""
    random = np.random.default_rng(seed)
    turning = tuple(map(Channel, ("rz", "ry", "rx")))
    root = tuple(map(Channel, ("tx", "ty", "tz"))) + turning
    joints = [
        Joint(f"j{k}", k - 1, tuple(random.uniform(-0.5, 0.5, 3)), channels=turning if k else root)
        for k in range(4)
    ]
    skeleton = Skeleton(tuple(joints), unit_cm=100.0, up_axis="y")
    time = np.linspace(0, 3, 200)[:, None]
    speeds = random.choice([0.0, 10.0, 300.0], 15) * random.uniform(-1, 1, 15)
    values = speeds * time + 20 * np.sin(time * random.uniform(0, 4, 15))
    values[:, :3] /= 100
    made = check(Motion(skeleton, (Signal(values),), Fraction(60)), key_error_mm=bound)
    assert made.n_keys < made.n_values / 2 or bound < 30


@pytest.mark.parametrize("kind", WALKS)
def test_the_walks(kind: str) -> None:
    motion = WALKS[kind]
    tight, loose = check(motion), check(motion, key_error_mm=2)
    whole = check(motion, key_error_mm=0)
    assert loose.n_keys < tight.n_keys < whole.n_keys <= whole.n_values
    assert len(loose.data) < len(tight.data)
    assert whole.max_error < 1e-3
    asset = Glb(tight.data).document["asset"]
    assert asset["generator"] == f"mcz {mcz.__version__}"
    assert (asset["extras"]["frames"], asset["extras"]["frameRate"]) == (motion.n_frames, 120)


def test_bones_are_where_joints_are() -> None:
    """Each corner of the mesh, moved by its skin, is near the joint that it follows."""
    motion = WALKS["amc"]
    glb = Glb(mcz.to_glb(motion).data)
    document = glb.document
    (primitive, *_), (skin,) = document["meshes"][0]["primitives"], document["skins"]
    attributes = primitive["attributes"]
    corners, joints = (glb.accessor(attributes[key]) for key in ("POSITION", "JOINTS_0"))
    assert (glb.accessor(attributes["WEIGHTS_0"]) == [255, 0, 0, 0]).all()
    binds = glb.accessor(skin["inverseBindMatrices"]).reshape(-1, 4, 4).transpose(0, 2, 1)
    names = [document["nodes"][number]["name"] for number in skin["joints"]]
    rest = Glb(mcz.to_glb(motion).data)
    rest.document["animations"] = []
    for source, moved in ((glb, 1.0), (rest, 0.0)):
        matrices = source.matrices(np.array([moved]))
        skinned = np.stack([matrices[n][0] for n in names]) @ binds
        homogeneous = np.append(corners, np.ones((len(corners), 1)), axis=1)
        placed = np.einsum("nij,nj->ni", skinned[joints[:, 0]], homogeneous)[:, :3]
        origins = np.stack([matrices[n][0, :3, 3] for n in names])[joints[:, 0]]
        assert np.linalg.norm(placed - origins, axis=1).max() < 0.5  # no bone is longer
        if source is rest:
            assert np.abs(placed - corners).max() < 1e-6
    materials = [material["name"] for material in document["materials"]]
    assert materials == ["middle", "left", "right"]


def test_a_bone_that_stretches_ends_at_its_child() -> None:
    """A corner of it follows the child; triangles look outwards."""
    joints = (
        Joint("a", channels=(Channel("sx"),)),
        Joint("b", 0, (1.0, 0, 0), ((0.0, 1, 0),)),
    )
    skeleton = Skeleton(joints, unit_cm=100.0)
    values = np.array([[1.0], [2.0], [4.0]])
    motion = Motion(skeleton, (Signal(values),), Fraction(1))
    glb = Glb(check(motion).data)
    primitive = glb.document["meshes"][0]["primitives"][0]
    followed = glb.accessor(primitive["attributes"]["JOINTS_0"])[:, 0]
    assert followed.tolist() == [0] * 5 + [1] + [1] * 6
    corners = glb.accessor(primitive["attributes"]["POSITION"]).astype(np.float64)
    triangles = glb.accessor(primitive["indices"]).reshape(-1, 3).astype(int)
    for number, (a, b, c) in enumerate(corners[triangles]):
        middle = corners[6 * (number // 8) : 6 * (number // 8) + 6].mean(axis=0)
        assert np.cross(b - a, c - a) @ (a - middle) > 0


def test_missing_markers_are_scaled_to_nothing() -> None:
    walk = WALKS["c3d"]
    mask = np.ones(walk.values.shape, bool)
    mask[10:20, :3] = mask[0:5, 3:6] = False
    mask[:, 6:9] = False
    gappy = replace(walk, signals=(replace(walk.signals[0], mask=mask), *walk.signals[1:]))
    made = check(gappy)
    times = np.arange(walk.n_frames) / 120
    matrices = Glb(made.data).matrices(times.astype(np.float32).astype(np.float64))
    for number, name in enumerate(walk.skeleton.addresses()):
        sizes = np.linalg.norm(matrices[name][:, :3, 0], axis=1)
        assert np.array_equal(sizes > 0.5, mask[:, 3 * number])
        assert np.isfinite(matrices[name]).all()


def test_what_cannot_be_said() -> None:
    walk, timeless = WALKS["bvh"], replace(WALKS["amc"], frame_rate=None)
    with pytest.raises(OptionError, match="its frame rate is unknown, but GLB must state times"):
        mcz.to_glb(timeless)
    assert mcz.to_glb(timeless, rate=120).data == mcz.to_glb(WALKS["amc"]).data
    values = walk.values.copy()
    values[3, 7] = np.nan
    with pytest.raises(MotionError, match="a scene cannot omit joints in some frames, but"):
        mcz.to_glb(walk.with_values(values))
    unknown = replace(walk, skeleton=replace(walk.skeleton, unit_cm=None))
    with pytest.raises(OptionError, match="length unit is unknown, so a key error of 1 mm"):
        mcz.to_glb(unknown, key_error_mm=1)
    assert mcz.to_glb(unknown, key_error_mm=1, unit="cm").key_error == 1
    with pytest.raises(OptionError, match="key error is -1 mm; it must be at least 0"):
        mcz.to_glb(walk, key_error_mm=-1)
    with pytest.raises(OptionError, match="mcz.to_glb writes scenes"):
        mcz.convert(walk, "glb")
    far = walk.values + 0.0
    far[:, :3] += 1e9
    with pytest.raises(OptionError, match=r"rounding to float32 alone causes an error of"):
        mcz.to_glb(walk.with_values(far), unit="m")
    far[:, :3] = 1e300
    with pytest.raises(MotionError, match="is too far away for float32"):
        mcz.to_glb(walk.with_values(far))
    with pytest.raises(MotionError, match="float32 cannot distinguish the times of"):
        mcz.to_glb(walk, rate=1e60)
    with pytest.raises(MotionError, match="a scene needs at least one joint"):
        mcz.to_glb(Motion(Skeleton(()), (Signal(np.zeros((1, 0))),), Fraction(1)))


@pytest.mark.parametrize("n_frames", [0, 1, 2])
@pytest.mark.parametrize("kind", WALKS)
def test_short_clips(kind: str, n_frames: int) -> None:
    walk = WALKS[kind]
    short = replace(walk, signals=tuple(signal.cut(0, n_frames) for signal in walk.signals))
    if n_frames:
        check(short)
    moves = n_frames > (kind == "c3d")  # a single frame of markers is the rest
    assert ("animations" in Glb(mcz.to_glb(short).data).document) == moves


def test_odd_names_are_text() -> None:
    with pytest.raises(mcz.MotionError, match="must be text that UTF-8 can hold"):
        Joint("\ud800")
    joint = Joint('a"\\\n\x00é')
    motion = Motion(Skeleton((joint,)), (Signal(np.zeros((2, 0))),), Fraction(1), name="</script>")
    nodes = Glb(mcz.to_glb(motion).data).document["nodes"]
    assert [node["name"] for node in nodes] == ["</script>", 'a"\\\n\x00é', "bones"]


Call = Callable[..., tuple[int, str, str]]


@pytest.fixture
def call(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Call:
    monkeypatch.chdir(tmp_path)

    def call(*words: str) -> tuple[int, str, str]:
        code = int(run(*words))
        return code, *capsys.readouterr()

    call("sample", ".")
    call("encode", "walk.amc", "-o", "amc.mcz")
    call("encode", "walk.bvh", "-o", "bvh.mcz")
    return call


def test_decode_says_what_it_reached(call: Call) -> None:
    code, out, err = call("decode", "amc.mcz", "-o", "a.glb", "--rate", "120", "--key-error", "1")
    assert code == 0 and "a.glb" in out and err.count("\n") == 2
    assert re.search(r"keys: [\d,]+ of 7,200; at most 0\.\d+ mm off \(frame \d+, [\w ]+\)", err)
    assert "points up is unknown: taken for y" in err
    motion = mcz.read("walk.amc", rate=120)
    expected = mcz.to_glb(replace(motion, source=None), key_error_mm=1)
    data = Path("a.glb").read_bytes()
    assert len(data) == pytest.approx(len(expected.data), abs=100)  # the name of the source
    code, out, _ = call("decode", "bvh.mcz", "--to", "glb", "--frames", "9:19", "--json")
    scene = json.loads(out)["scene"]
    assert code == 0 and scene["max_error"] <= scene["key_error"]
    assert scene["n_values"] == 10 * 32 and len(scene["notes"]) == 3  # units, axis, numbers
    assert "max_error_mm" not in scene  # its unit is unknown


def test_decode_refuses(call: Call) -> None:
    for words, wanted, message in (
        (("amc.mcz", "-o", "a.glb"), 2, "its frame rate is unknown, but GLB must state times"),
        (("bvh.mcz", "-o", "b.glb", "--key-error", "1"), 2, "set the unit (--unit)"),
        (("bvh.mcz", "--to", "csv", "--key-error", "1"), 2, "--key-error needs --to glb"),
        (("bvh.mcz", "--to", "csv", "--unit", "cm"), 2, "--unit needs --to bvh or amc or c3d"),
        (("bvh.mcz", "--to", "csv", "--up", "z"), 2, "--up needs --to c3d or glb or usda"),
        (("bvh.mcz", "-o", "x.usda", "--key-error", "1"), 2, "--key-error needs --to glb"),
        (("bvh.mcz", "-o", "x.usd"), 2, "--to usda writes USD as text"),
        (("bvh.mcz", "--to", "glb", "--joints", "Hips"), 2, "--joints needs --to csv"),
    ):
        code, out, err = call("decode", *words)
        assert (code, out, err.count("\n")) == (wanted, "", 1), err
        assert message in err
    assert not list(Path().glob("*.glb"))


def test_several_clips_are_several_files(call: Call) -> None:
    call("pack", ".", "all.mcz", "--rate", "120")
    code, _, err = call("decode", "all.mcz", "--clip", "walk", "--clip", "walk.bvh", "-o", "x.glb")
    assert code == 2 and "x.glb is one file, for 2 clips" in err
    code, out, err = call("export", "all.mcz", "scenes", "--to", "glb", "--key-error", "5")
    assert code == 1 and "its length unit is unknown" in err and "2 written" in out
    words = ("--unit", "cm", "--clip", "walk.bvh", "--json")
    code, out, _ = call("export", "all.mcz", "scenes", "--to", "glb", "--key-error", "5", *words)
    (file,) = json.loads(out)["files"]
    assert code == 0 and file["notes"] == ["the axis that points up is unknown: taken for y"]


def validator() -> dict[str, str] | None:
    """The environment in which node finds npm's gltf-validator, None where it does not."""
    folders = [os.environ.get("NODE_PATH", ""), str(ROOT / "tools/viewer/node_modules")]
    environment = {**os.environ, "NODE_PATH": os.pathsep.join(filter(None, folders))}
    if shutil.which("node") is None:
        return None
    asked = subprocess.run(
        ["node", "-e", "require('gltf-validator')"],
        env=environment,
        capture_output=True,
        check=False,
    )
    return environment if asked.returncode == 0 else None


VALIDATE = """
const validator = require('gltf-validator'), fs = require('fs')
const read = (path) => validator.validateBytes(new Uint8Array(fs.readFileSync(path)))
Promise.all(process.argv.slice(1).map(read)).then((reports) => {
  console.log(JSON.stringify(reports.map((report) => report.issues)))
})
"""


def validate(folder: Path, files: dict[str, bytes]) -> None:
    """Ask Khronos's validator, which finds not even a hint."""
    environment = validator()
    if environment is None:
        pytest.skip("node does not find gltf-validator")
    for name, data in files.items():
        (folder / name).write_bytes(data)
    paths = [str(folder / name) for name in files]
    command = ["node", "-e", VALIDATE, *paths]
    ran = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    reports = json.loads(ran.stdout)
    assert len(reports) == len(files)
    assert [report["messages"] for report in reports] == [[]] * len(files)


def test_khronos_finds_no_fault(tmp_path: Path) -> None:
    gaps = np.ones(WALKS["c3d"].values.shape, bool)
    gaps[5:9, :3] = gaps[:, 3:6] = False
    walk = WALKS["c3d"]
    gappy = replace(walk, signals=(replace(walk.signals[0], mask=gaps), *walk.signals[1:]))
    still = Motion(Skeleton((Joint("still"),)), (Signal(np.zeros((0, 0))),), Fraction(1))
    motions = {**WALKS, "gappy": gappy, "still": still}
    motions["z"] = replace(WALKS["bvh"], skeleton=replace(WALKS["bvh"].skeleton, up_axis="z"))
    validate(tmp_path, {f"{name}.glb": mcz.to_glb(m).data for name, m in motions.items()})


@pytest.mark.parametrize("kind", WALKS)
def test_others_read_it(tmp_path: Path, kind: str) -> None:
    """pygltflib and trimesh: all parts, and the nodes at rest."""
    import pygltflib
    import trimesh

    path, motion = tmp_path / "walk.glb", WALKS[kind]
    path.write_bytes(mcz.to_glb(motion).data)
    own = Glb(path.read_bytes())
    read = pygltflib.GLTF2().load(str(path))
    assert [node.name for node in read.nodes] == [n["name"] for n in own.document["nodes"]]
    assert len(read.animations[0].channels) == len(own.document["animations"][0]["channels"])
    assert read.accessors[-1].count == own.document["accessors"][-1]["count"]
    scene = trimesh.load_scene(path)
    own.document["animations"] = []
    for name, matrix in own.matrices(np.zeros(1)).items():
        if name in scene.graph.nodes:
            assert np.abs(scene.graph.get(name)[0] - matrix[0]).max() < 1e-6
    n_meshes = len(own.document["materials"]) if kind != "c3d" else motion.skeleton.n_joints
    assert len(scene.dump()) == n_meshes


@pytest.mark.long
@pytest.mark.parametrize("kind", ["amc", "bvh"])
def test_blender_puts_the_bones_there(tmp_path: Path, kind: str) -> None:
    """Blender interpolates the parts of quaternions, so that it may be a little farther off."""
    if shutil.which("blender") is None:
        pytest.skip("there is no Blender")
    motion = WALKS[kind]
    skeleton, clip, expected = motion.skeleton, tmp_path / "walk.glb", tmp_path / "walk.npz"
    clip.write_bytes(mcz.to_glb(motion).data)
    places = origins_of(skeleton, motion.values) * ((skeleton.unit_cm or 0) / 100)
    np.savez(expected, names=skeleton.addresses(), places=places, rate=120.0)
    script = ROOT / "tools/blender/check_import.py"
    command = ["blender", "--background", "--python", script, "--", clip, expected]
    python = ("PYTHONPATH", "PYTHONHOME", "VIRTUAL_ENV")  # Blender has a Python of its own
    environment = {key: value for key, value in os.environ.items() if key not in python}
    ran = subprocess.run(command, capture_output=True, text=True, env=environment, check=True)
    (line,) = (line for line in ran.stdout.splitlines() if line.startswith("{"))
    document = json.loads(line)
    assert (document["bones"], document["frames"]) == (skeleton.n_joints, motion.n_frames)
    assert document["distance"] < 2e-4


REAL = [
    "cmu/amc-variants/01_09-first200.amc",
    "cmu/bvh-3dsmax/131_01.bvh",
    "other/bandai-namco/dataset-2_run_normal_016.bvh",
    "other/makehuman/walk1.bvh",
    "other/pybvh/rotation_first_root.bvh",
    "other/c3d.org/sample_00/Walk1.c3d",
]
LONG = [
    "cmu/amc/01_01.amc",
    "cmu/amc/17_10.amc",
    "cmu/bvh/01_01.bvh",
    "cmu/bvh-daz/01_01.bvh",
    "cmu/bvh-blender/01-01 v01.bvh",
    "cmu/c3d/01_01.c3d",
    "other/c3d.org/sample_00/arthuman-sample.c3d",
]


@pytest.mark.real
@pytest.mark.parametrize(
    "name", [*REAL, *(pytest.param(name, marks=pytest.mark.long) for name in LONG)]
)
def test_real_clips(data: Path, tmp_path: Path, name: str) -> None:
    motion = mcz.read(data / name, rate=120 if name.endswith(".amc") else None)
    if motion.skeleton.unit_cm is None:
        motion = replace(motion, skeleton=replace(motion.skeleton, unit_cm=1.0))
    files = {f"{bound}.glb": check(motion, key_error_mm=bound).data for bound in (0.1, 1)}
    assert len(files["1.glb"]) < 1.05 * len(files["0.1.glb"])
    validate(tmp_path, files)
