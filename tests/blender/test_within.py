"""The add-on in Blender itself: ``MCZ_BPY`` lists Pythons that have ``bpy``, as in .ci/full.

The zip is unpacked, or installed, and what it bundles is all of MCZ that is there. Where
``MCZ_BPY_WHEELS`` names a folder of wheels of MCZ, the zip has their compiled kernels.
"""

from __future__ import annotations

import io
import json
import os
import subprocess
import zipfile
from pathlib import Path
from typing import Any

import pytest

import mcz
from tests.blender.clips import stretching_arm
from tools.blender import build

ROOT = Path(__file__).parents[2]
BLENDERS = list(filter(None, os.environ.get("MCZ_BPY", "").split(os.pathsep)))
WHEELS = os.environ.get("MCZ_BPY_WHEELS", "")
NEAR = 1e-4  # of a skeleton's size
pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(not BLENDERS, reason="MCZ_BPY is not set"),
    pytest.mark.parametrize("python", BLENDERS),
]


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The zip, and beside it what it holds: ``addons/mcz_blender``, its wheels in ``wheels``."""
    folder = tmp_path_factory.mktemp("addon")
    _, data = build.build_zip(build.wheels_in(Path(WHEELS)) if WHEELS else ())
    (folder / "addon.zip").write_bytes(data)
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        archive.extractall(folder / "addons/mcz_blender")
    for wheel in (folder / "addons/mcz_blender/wheels").iterdir():
        with zipfile.ZipFile(wheel) as held:
            held.extractall(folder / "wheels")
    return folder


def run_script(python: str, package: Path, script: Path, *words: Any, **more: str) -> str:
    """Return what ``script`` prints with only the bundled package on its path."""
    environment = {**os.environ, "PYTHONPATH": str(package / "wheels"), **more}
    for name in ("VIRTUAL_ENV", "MCZ_LOOPS"):
        environment.pop(name, None)
    command = [python, script, *map(str, words)]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def check(python: str, package: Path, *words: Any) -> dict[str, Any]:
    script = ROOT / "tools/blender/check_addon.py"
    out = run_script(python, package, script, *words, "--addon", package / "addons")
    document: dict[str, Any] = json.loads(out.splitlines()[-1])
    assert document["distance"] < NEAR and document["compared"] > 20, document
    return document


def options(**given: Any) -> list[str]:
    return [word for name, value in given.items() for word in ("--option", f"{name}={value}")]


KERNELS = """
import mcz, mcz.kernels
print(mcz.__file__, mcz.kernels.lacks_compiled_kernels())
"""


def test_the_kernels_that_it_has(python: str, package: Path, tmp_path: Path) -> None:
    """Compiled ones exactly where a wheel of this Python was bundled."""
    script = tmp_path / "kernels.py"
    script.write_text(KERNELS, "utf-8")
    path, lacks = run_script(python, package, script).split()
    assert path.startswith(str(package)) and lacks == str(not WHEELS)


def test_with_plain_python(python: str, samples: Path, tmp_path: Path) -> None:
    """Blender's Python, NumPy and construct are enough to read and to write."""
    with zipfile.ZipFile(io.BytesIO(build.build_zip()[1])) as archive:
        archive.extractall(tmp_path / "addons/mcz_blender")
    for _, data in build.mcz_wheel({}), build.installed_wheel("construct"):
        with zipfile.ZipFile(io.BytesIO(data)) as wheel:
            wheel.extractall(tmp_path / "wheels")
    mcz.encode(samples / "walk.bvh", tmp_path / "walk.mcz")
    words = "export", tmp_path / "walk.mcz", tmp_path / "out.mcz"
    found = check(python, tmp_path, *words)
    assert found["loaded"] == [] and found["export"]["same"] < NEAR


@pytest.mark.parametrize("name", ["walk.amc", "walk.bvh", "walk.c3d"])
def test_samples_there_and_back(
    python: str, package: Path, samples: Path, tmp_path: Path, name: str
) -> None:
    found = check(python, package, "export", samples / name, tmp_path / "out.mcz")["export"]
    assert found["same"] < NEAR and found["again"]["distance"] < NEAR
    assert found["names"] and (found["rate"], found["frames"]) == ("120", 240)
    assert found["up"] == ("z" if name == "walk.c3d" else "y")


def test_bones_that_stretch(python: str, package: Path, tmp_path: Path) -> None:
    mcz.write(stretching_arm(), tmp_path / "arm.mcz")
    found = check(python, package, "export", tmp_path / "arm.mcz", tmp_path / "out.mcz")["export"]
    assert found["same"] < NEAR and found["again"]["distance"] < NEAR


@pytest.mark.parametrize(
    "given",
    [
        {"first": 20, "stop": 200, "step": 3, "start": -7},
        {"unit": "in", "up": "x"},
        {"sets_rate": "false"},  # keys between frames of the scene
    ],
)
def test_options(python: str, package: Path, samples: Path, given: dict[str, Any]) -> None:
    check(python, package, "import", samples / "walk.bvh", *options(**given))


@pytest.mark.skipif(not WHEELS, reason="without compiled kernels these take minutes")
@pytest.mark.parametrize("codec", ["best", "lossy"])
def test_codecs(python: str, package: Path, samples: Path, tmp_path: Path, codec: str) -> None:
    """A lossy file is as near as was asked for: 0.3 cm of 1 m."""
    words = ["--out", f"codec={codec}", "--out", "max_error_cm=0.3"]
    found = check(python, package, "export", samples / "walk.bvh", tmp_path / "out.mcz", *words)
    same = found["export"]["same"]
    assert same < NEAR if codec == "best" else 1e-4 < same < 3.1e-3


SESSION = """
import sys, bpy
bpy.ops.wm.read_factory_settings(use_empty=True)
zip_path, samples, archive, cut, out = sys.argv[1:]
done = bpy.ops.extensions.package_install_files(
    filepath=zip_path, repo="user_default", enable_on_install=True)
assert done == {"FINISHED"}, done
import mcz
assert "extensions" in mcz.__file__, mcz.__file__
manager = bpy.context.window_manager
manager.mcz_archive.path, manager.mcz_archive.text = archive, "n_channels == 96"
bpy.ops.mcz.search()
assert [clip.name for clip in manager.mcz_archive.clips] == ["walk.bvh"]
bpy.ops.mcz.bring()
bpy.ops.import_anim.mcz(filepath=archive, where="format in ('amc', 'c3d')")
bpy.ops.import_anim.mcz(directory=samples, files=[{"name": "walk.bvh"}, {"name": "walk.amc"}])
tops = [thing.name for thing in bpy.data.objects if thing.parent is None]
assert tops == ["walk", "walk.001", "walk.002", "walk.bvh", "walk.c3d"], tops

def refused(**words):
    try:
        bpy.ops.import_anim.mcz(**words)
    except RuntimeError as error:
        return str(error).strip().splitlines()
    raise AssertionError("not refused")

(line,) = refused(filepath=archive)
assert line.endswith("all.mcz: the file has 3 clips; choose one: walk, walk.bvh, walk.c3d"), line
(line,) = refused(filepath=cut)
assert "cut.mcz" in line, line
before = set(bpy.data.objects)
bpy.ops.import_anim.mcz(filepath=cut, salvage=True, every_clip=True)
assert set(bpy.data.objects) > before

def export(name, **words):
    bpy.ops.object.select_all(action="DESELECT")
    bpy.data.objects[name].select_set(True)
    bpy.ops.export_anim.mcz(filepath=out, **words)

export("walk", clip_name="one")
export("walk.c3d", clip_name="two", adds=True)
with mcz.open(out) as file:
    assert [(clip.name, clip.n_frames) for clip in file] == [("one", 240), ("two", 240)]
bpy.ops.object.select_all(action="SELECT")
try:
    bpy.ops.export_anim.mcz(filepath=out, clip_name="three")
except RuntimeError as error:
    assert "cannot all be 'three'" in str(error), error

from bl_ext.user_default.mcz_blender import durations
bpy.context.scene.frame_end = 10**6
try:
    bpy.ops.export_anim.mcz(filepath=out, codec="lossy")
except RuntimeError as error:
    assert "hours, and Blender waits for it" in str(error), error
    assert "tick Export Anyway (accepts_slow) to export" in str(error), error
else:
    raise AssertionError("not warned")
bpy.context.scene.frame_end = 240
durations.SHORT = 0.0  # every export is a slow one
try:
    export("walk")
except RuntimeError as error:
    assert "Export Anyway" in str(error), error
else:
    raise AssertionError("not warned")
export("walk", clip_name="slow", accepts_slow=True)
with mcz.open(out) as file:
    assert [clip.name for clip in file] == ["slow"]
bpy.ops.object.select_all(action="SELECT")

# What is drawn: without a window, onto a layout that only remembers.
from unittest.mock import MagicMock
from bl_ext.user_default.mcz_blender import exporting, importing, panels

def drawn(thing, **more):
    layout = MagicMock()
    thing.draw(MagicMock(layout=layout, **more), bpy.context)
    calls = layout.prop.call_args_list + layout.box.return_value.prop.call_args_list
    return {call.args[1] for call in calls}

hidden = {"filename_ext", "filter_glob", "directory", "files"}
asked = drawn(importing.ImportMCZ)
assert asked == set(importing.ImportMCZ.__annotations__) - hidden, asked
asked = drawn(exporting.ExportMCZ, codec="lossy")
assert asked == set(exporting.ExportMCZ.__annotations__) - hidden, asked
assert drawn(panels.MCZ_PT_archive) == {"path"}
panels.MCZ_UL_clips.draw_item(*[MagicMock() for _ in range(9)])
panels.import_line(MagicMock(), None), panels.export_line(MagicMock(), None)
one = MagicMock(**{"paths.return_value": [archive]})
assert [name for name, _ in importing.clips_like(one, None, "walk c3d")] == ["walk.c3d"]
assert importing.clips_like(MagicMock(**{"paths.return_value": ["no.mcz"]}), None, "") == []
bpy.ops.preferences.addon_disable(module="bl_ext.user_default.mcz_blender")
assert not hasattr(bpy.types, "IMPORT_ANIM_OT_mcz")
print("all well")
"""


def test_installed(python: str, package: Path, samples: Path, tmp_path: Path) -> None:
    """The installed zip searches archives, refuses bad files and adds clips."""
    archive, cut, script = tmp_path / "all.mcz", tmp_path / "cut.mcz", tmp_path / "session.py"
    mcz.pack(samples, archive, rate=120)
    cut.write_bytes(archive.read_bytes()[:-200])
    script.write_text(SESSION, "utf-8")
    environment = {"PYTHONPATH": "", "BLENDER_USER_RESOURCES": str(tmp_path / "user")}
    words = package / "addon.zip", samples, archive, cut, tmp_path / "out.mcz"
    assert "all well" in run_script(python, package, script, *words, **environment)


def test_blender_finds_no_fault_in_the_manifest(python: str, package: Path) -> None:
    asked = run_script(
        python, package, Path("-c"), "import bpy; print(bpy.utils.resource_path('LOCAL'))"
    )
    script = Path(asked.splitlines()[-1]) / "scripts/addons_core/bl_pkg/cli/blender_ext.py"
    words = "validate", package / "addon.zip", "--valid-tags", ""
    assert "Success" in run_script(python, package, script, *words)


REAL = [
    "cmu/amc/17_10.amc",
    "cmu/bvh/01_01.bvh",
    "cmu/bvh-blender/01-01 v01.bvh",
    "cmu/bvh-daz/01_01.bvh",
    "other/bandai-namco/dataset-2_run_normal_016.bvh",
    "other/bvh-viewer/Matt_Happy2.bvh",
    "other/makehuman/benchmark.bvh",
    "other/pybvh/rotation_first_root.bvh",
    "other/tiny/noroot.bvh",
    "other/c3d.org/sample_00/Walk1.c3d",
    "cmu/c3d/01_01.c3d",
    "other/trc/Gait.trc",
    "other/opensim-core/dataWithBlanksForMissingMarkers.trc",
]


@pytest.mark.real
@pytest.mark.parametrize("name", REAL)
def test_real_clips(python: str, package: Path, data: Path, tmp_path: Path, name: str) -> None:
    found = check(python, package, "export", data / name, tmp_path / "out.mcz")["export"]
    assert found["same"] < NEAR and found["again"]["distance"] < NEAR and found["names"]


@pytest.mark.real
def test_a_clip_of_a_real_archive(python: str, package: Path, data: Path, tmp_path: Path) -> None:
    archive = tmp_path / "runs.mcz"
    mcz.pack(data / "other/bandai-namco", archive)
    chosen = options(clip="dataset-2_run_normal_016", step=2)
    assert check(python, package, "import", archive, *chosen)["loaded"] == []
