"""Loops give the same bits where nothing is compiled."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import mcz
from tests.codecs.lossy import saved
from tests.motions import smooth


def canonical_sha256(path: Path) -> str:
    with mcz.open(path) as file:
        values = file.only_clip().read()
    return hashlib.sha256(values.astype("<f8").tobytes()).hexdigest()


def test_interpreted(tmp_path: Path) -> None:
    path = tmp_path / "clip.mcz"
    path.write_bytes(saved("mrdwt", smooth(60), T_g=0.3, segment_frames=32))
    program = (
        "import sys; from pathlib import Path\n"
        "from tests.codecs.test_interpreted import canonical_sha256\n"
        "print(canonical_sha256(Path(sys.argv[1])))"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, str(path)],
        cwd=Path(__file__).parents[2],
        env={**os.environ, "MCZ_LOOPS": "interpreted"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.strip() == canonical_sha256(path)
