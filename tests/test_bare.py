"""Reading takes nothing but Python and NumPy."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import mcz
from mcz.codecs import CODECS, bitstream_name
from mcz.sources.sample import write_samples
from tests import bare


def test_nothing_else_is_needed(tmp_path: Path) -> None:
    """Vectors of every codec, and a file that is read in every way: see ``bare``."""
    write_samples(tmp_path)
    mcz.encode(tmp_path / "walk.amc", tmp_path / "walk.mcz", codec="fast", rate=120)
    (tmp_path / "walk.source").write_bytes((tmp_path / "walk.amc").read_bytes())
    done = subprocess.run(
        [sys.executable, "-m", "tests.bare", "2", str(tmp_path / "walk.mcz")],
        cwd=Path(__file__).parents[1],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    report = json.loads(done.stdout)
    assert report["vectors"] == len(bare.choose_vectors(2)) > 100
    assert report["loaded"] == ["conformance", "construct", "mcz", "numpy", "tests"]
    assert report["slow"] == []


def test_every_codec_is_among_the_vectors() -> None:
    from tests.broken import answers

    codecs = {
        name for v in bare.choose_vectors(2) for name in answers.vectors()[v].get("codecs", [])
    }
    assert {bitstream_name(codec.id) for codec in CODECS.values()} <= codecs
