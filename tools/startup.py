"""CPU seconds of ``mcz encode`` and ``mcz decode`` by every codec, each in a process of its own.

``python -m tools.startup`` prints the least of ``--runs``, for the generated sample or for SOURCE.
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
MAIN = sys.executable, "-m", "mcz"


def main() -> None:
    parser = argparse.ArgumentParser(prog="tools.startup", description=__doc__)
    parser.add_argument("source", nargs="?", type=Path, help="default: the sample of 240 frames")
    parser.add_argument("--codec", action="append", help="of all codecs only these")
    parser.add_argument("--runs", type=int, default=3, help="of each command")
    given = parser.parse_args()
    compileall.compile_dir(Path(mcz.__file__).parent, quiet=1)  # as an installation does
    print(f"{'CPU seconds':12}{'encode':>8}{'decode':>8}")
    with tempfile.TemporaryDirectory() as work:
        source = given.source or _sample(Path(work))
        for codec in given.codec or [codec.name for codec in CODECS.values()]:
            row = _measure(source, codec, Path(work), given.runs)
            print(f"{codec:12}{row[0]:8.2f}{row[1]:8.2f}", flush=True)


def _sample(folder: Path) -> Path:
    _seconds(["sample", str(folder / "sample")])
    return folder / "sample" / "walk.bvh"


def _measure(source: Path, codec: str, work: Path, runs: int) -> list[float]:
    """Encode and decode, the least of ``runs`` each."""
    to = ["--to", "c3d"] if codec in OF_POSITIONS else []
    coded, restored = work / "coded.mcz", work / f"restored{'.c3d' if to else source.suffix}"
    encode = ["encode", str(source), "--codec", codec, "-o", str(coded), "--force"]
    decode = ["decode", str(coded), "-o", str(restored), "--force", *to]
    return [min(_seconds(command) for _ in range(runs)) for command in (encode, decode)]


def _seconds(command: list[str]) -> float:
    """CPU seconds, of the user and the system, that a command takes in a process of its own."""
    before = os.times()
    variables = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    subprocess.run([*MAIN, *command], check=True, stdout=subprocess.PIPE, env=variables)
    after = os.times()
    return sum(after[2:4]) - sum(before[2:4])


if __name__ == "__main__":
    main()
