"""How long commands take to start: CPU seconds of encode and decode, by every codec.

``python -m tools.startup`` prints, for the generated sample or for SOURCE, what ``mcz encode`` and
``mcz decode`` take in processes of their own: cold, with nothing compiled yet, and warm, with what
an earlier run has compiled (the least of ``--runs``).
"""

from __future__ import annotations

import argparse
import compileall
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import mcz
from mcz.codecs import CODECS

OF_POSITIONS = "lsdt-frame", "lsdt-clip", "mdtt", "pca-rdo", "online"  # no BVH or AMC holds them
CACHES = "MCZ_CACHE_DIR", "NUMBA_CACHE_DIR"  # folders of what is compiled
MAIN = sys.executable, "-m", "mcz.cli.main"


def main() -> None:
    parser = argparse.ArgumentParser(prog="tools.startup", description=__doc__)
    parser.add_argument("source", nargs="?", type=Path, help="default: the sample of 240 frames")
    parser.add_argument("--codec", action="append", help="of all codecs only these")
    parser.add_argument("--runs", type=int, default=3, help="of each warm command")
    given = parser.parse_args()
    compileall.compile_dir(Path(mcz.__file__).parent, quiet=1)  # as an installation does
    print(f"{'CPU seconds':12}{'encode cold':>12}{'warm':>7}{'decode cold':>14}{'warm':>7}")
    with tempfile.TemporaryDirectory() as work:
        source = given.source or _sample(Path(work))
        for codec in given.codec or [codec.name for codec in CODECS.values()]:
            row = _measure(source, codec, Path(work), given.runs)
            print(f"{codec:12}{row[0]:12.2f}{row[1]:7.2f}{row[2]:14.2f}{row[3]:7.2f}", flush=True)


def _sample(folder: Path) -> Path:
    _seconds(["sample", str(folder / "sample")], folder)
    return folder / "sample" / "walk.bvh"


def _measure(source: Path, codec: str, work: Path, runs: int) -> list[float]:
    """Encode cold and warm, decode cold and warm."""
    to = ["--to", "c3d"] if codec in OF_POSITIONS else []
    coded, restored = work / "coded.mcz", work / f"restored{'.c3d' if to else source.suffix}"
    encode = ["encode", str(source), "--codec", codec, "-o", str(coded), "--force"]
    decode = ["decode", str(coded), "-o", str(restored), "--force", *to]
    figures = []
    for command in (encode, decode):
        with tempfile.TemporaryDirectory(dir=work) as cache:
            figures.append(_seconds(command, Path(cache)))
            figures.append(min(_seconds(command, Path(cache)) for _ in range(runs)))
    return figures


def _seconds(command: list[str], cache: Path) -> float:
    """CPU seconds, of the user and the system, that a command takes in a process of its own."""
    before = os.times()
    variables = os.environ | dict.fromkeys(CACHES, str(cache))
    variables.pop("PYTHONDONTWRITEBYTECODE", None)
    subprocess.run([*MAIN, *command], check=True, stdout=subprocess.PIPE, env=variables)
    after = os.times()
    return sum(after[2:4]) - sum(before[2:4])


if __name__ == "__main__":
    main()
