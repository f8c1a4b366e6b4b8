"""``pip install mcz`` is enough for README; what needs an extra says so in one line, and ends."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import mcz
from mcz.show.pictures.canvases import EXTRAS
from tests.installed import PYPROJECT, required_modules

ROOT = PYPROJECT.parent

# What users do with motions beyond README: rotations, other rates, an encoder's own wavelets.
MORE = """
import numpy as np
from mcz.kinematics.poses.conversions import FORMS

for form, shape in FORMS.items():
    rotations = mcz.rotations(motion, form)
    assert rotations.shape[2:] == shape and np.isfinite(rotations).all()
assert mcz.resample(motion, 50).n_frames == 100
mcz.write(motion, "wavelet.mcz", codec="mrdwt")
assert mcz.verify("wavelet.mcz") == []
"""


def run_installed(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "tests.installed", *words],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )


def blocks(language: str) -> list[str]:
    text = (ROOT / "README.md").read_text("utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```$", text, re.M | re.S)


def test_readme_runs(tmp_path: Path) -> None:
    """Its first commands, and its Python."""
    commands = re.sub(r" && (cmp|echo).*", "", blocks("sh")[0]).splitlines()[1:]
    assert [line.split()[0] for line in commands] == ["mcz", "mcz", "mcz-info", "mcz"]
    for line in [*commands, "mcz decode samples/walk.mcz --to glb -o walk.glb"]:
        done = run_installed(tmp_path, *line.split())
        assert done.returncode == 0, done.stderr
    assert (tmp_path / "restored.bvh").read_bytes() == (tmp_path / "samples/walk.bvh").read_bytes()
    (python,) = blocks("python")
    (tmp_path / "readme.py").write_text(python + MORE, "utf-8")
    done = run_installed(tmp_path, "readme.py")
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize(
    ("command", "extra"),
    [
        ("info s3://takes/walk.mcz", "remote"),
        ("decode memory://walk.mcz", "remote"),
        ("encode walk.bvh -o memory://walk.mcz", "remote"),
        ("plot walk.bvh -o walk.png", "plot"),
        ("render walk.bvh -o walk.mp4", "render"),
        ("view walk.bvh -o walk.rrd", "rerun"),
        ("pack . takes.mcz --scheduler tcp://127.0.0.1:9", "dask"),
    ],
)
def test_what_needs_an_extra_names_it(
    samples: Path, tmp_path: Path, command: str, extra: str
) -> None:
    (tmp_path / "walk.bvh").write_bytes((samples / "walk.bvh").read_bytes())
    done = run_installed(tmp_path, "mcz", *command.split())
    assert done.returncode == 2, done.stderr
    assert done.stdout == ""
    assert re.fullmatch(rf"mcz: .*not installed \(pip install 'mcz\[{extra}\]'\)\n", done.stderr), (
        done.stderr
    )
    assert [path.name for path in tmp_path.iterdir()] == ["walk.bvh"]


def test_every_extra_that_a_message_names_is_one() -> None:
    extras = tomllib.loads(PYPROJECT.read_text("utf-8"))["project"]["optional-dependencies"]
    text = "".join(path.read_text("utf-8") for path in Path(mcz.__file__).parent.rglob("*.py"))
    named = {*re.findall(r'import_extra\(\s*"[\w.]+", "(\w+)"', text), *EXTRAS.values()}
    named |= set(re.findall(r"mcz\[(\w+)\]", text))
    assert {"remote", "dask", "xarray"} <= named <= extras.keys()


def test_an_installation_is_small() -> None:
    """pyproject.toml says what each costs; together they are to stay below 120 MB."""
    assert required_modules() <= {"numpy", "construct", "pywt", "click"}
