"""The core decoder in C, on some vectors of every group of its class."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from conformance import run

ROOT = Path(run.__file__).parent.parent
COMPILER = shutil.which("cc")
CFLAGS = ["-std=c11", "-O1", "-Wall", "-Wextra", "-Werror", "-ffp-contract=off"]


@pytest.mark.skipif(COMPILER is None, reason="there is no C compiler")
def test_core_decoder_passes_vectors_of_its_class(tmp_path: Path) -> None:
    sources = [str(ROOT / "tools/c" / name) for name in ("mcz_core.c", "main.c")]
    program = tmp_path / "mcz_core"
    subprocess.run([str(COMPILER), *CFLAGS, *sources, "-o", str(program)], check=True)
    decoder = f"{program} --words {ROOT / 'conformance/annex/words.bin'}"
    command = [sys.executable, "-m", "conformance.run", "--serve", "--decoder", decoder]
    command += ["--class", "core", "--every", "24"]
    asked = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert asked.returncode == 0, asked.stdout + asked.stderr
    assert ", 0 failed" in asked.stdout
