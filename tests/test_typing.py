"""The types that a checker sees of the public names."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import mcz

ROOT = Path(mcz.__file__).parent.parent
SCRIPT = """
import mcz
with mcz.open("a.mcz") as file:
    clip = file.clips["walk"]
    reveal_type(clip)
    reveal_type(clip.values[0:3])
    reveal_type(clip.positions())
    reveal_type(clip.motion()[1:2])
    clip.positons()
    mcz.positons(clip)
    data = mcz.dataset("a.mcz", "rot6d")
    reveal_type(data[0])
    rate: int = clip.frame_rate
"""
SEEN = """
5: Revealed type is "mcz.files.reading.clip.Clip"
6: Revealed type is "numpy.ndarray[tuple[Any, ...], numpy.dtype[numpy.float64 | numpy.int64]]"
7: Revealed type is "numpy.ndarray[tuple[Any, ...], numpy.dtype[numpy.floating[Any]]]"
8: Revealed type is "mcz.model.motion.Motion"
9: "Clip" has no attribute "positons"; maybe "positions"?
10: Module has no attribute "positons"; maybe "positions"?
12: Revealed type is "dict[str, numpy.ndarray[tuple[Any, ...], numpy.dtype[numpy.floating[Any]]]]"
13: Incompatible types in assignment
"""


def test_a_checker_sees_types_and_finds_mistakes(tmp_path: Path) -> None:
    assert (ROOT / "mcz/py.typed").exists()
    (tmp_path / "script.py").write_text(SCRIPT)
    command = [sys.executable, "-m", "mypy", "--no-error-summary", tmp_path / "script.py"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    lines = [line for line in done.stdout.splitlines() if "script.py:" in line]
    found = [
        re.sub(r".*script\.py:(\d+): \w+: (.*?)(  \[.*\])?$", r"\1: \2", line) for line in lines
    ]
    found[-1] = found[-1].partition(" (")[0]
    text = "\n".join(found).replace("builtins.", "").replace("typing.", "")
    text = text.replace("numpy.signedinteger[numpy.__nbit_base._64Bit]", "numpy.int64")
    assert text == SEEN.strip(), done.stdout + done.stderr


def test_the_script_of_a_user_runs_and_is_sound(tmp_path: Path) -> None:
    """.ci/full checks it against the installed wheel, by pyright as well."""
    script = Path(__file__).parent / "typing/user_script.py"
    (tmp_path / "walks").mkdir()
    checked = [sys.executable, "-m", "mypy", "--strict", "--no-error-summary", script]
    for command in (checked, [sys.executable, script, tmp_path / "walks"]):
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
    assert (tmp_path / "walks.mcz").stat().st_size > 0
