"""Size of an installation, and the time to the first result."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from tools.figures.packing import cpu_seconds_of
from tools.figures.table import Table, table

ROOT = Path(__file__).parents[2]
RUNS = 3


def tables(data: Path, jobs: int) -> Iterator[Table]:
    """A fresh environment with a wheel of this tree: bytes, and seconds of its first commands."""
    del data, jobs
    rows = list[list[str]]()
    with tempfile.TemporaryDirectory() as name:
        work = Path(name)
        environment = os.environ | {
            "PIP_DISABLE_PIP_VERSION_CHECK": "1",
            "MCZ_BUILD_WITHOUT_VIEWER": "1",
        }

        def run(*command: str | Path) -> float:
            start = time.perf_counter()
            subprocess.run(
                command, cwd=work, check=True, env=environment, stdout=subprocess.DEVNULL
            )
            return time.perf_counter() - start

        run(sys.executable, "-m", "venv", "venv")
        python = work / "venv" / "bin" / "python"
        built = run(python, "-m", "pip", "wheel", "-q", "--no-deps", "-w", "wheels", ROOT)
        (wheel,) = (work / "wheels").iterdir()
        before = _bytes_below(work / "venv")
        installed = run(python, "-m", "pip", "install", "-q", wheel)
        size = _bytes_below(work / "venv") - before
        own = sum(_bytes_below(path) for path in (work / "venv").rglob("site-packages/mcz"))
        mcz = str(work / "venv" / "bin" / "mcz")
        run(mcz, "sample", "samples")
        rows += [
            ["wheel", f"{wheel.stat().st_size / 1e6:.1f} MB"],
            ["installed, with numpy, construct, PyWavelets and click", f"{size / 1e6:.0f} MB"],
            ["of these the package itself", f"{own / 1e6:.1f} MB"],
            ["build of the wheel, by the clock", f"{built:.0f} s"],
            ["installation of the wheel, by the clock", f"{installed:.0f} s"],
        ]
        commands = {
            "`mcz --version`": ("--version",),
            "`mcz encode samples/walk.bvh --unit cm`": (
                "encode",
                "samples/walk.bvh",
                "--unit",
                "cm",
                "--force",
            ),
            "`mcz info samples/walk.mcz`": ("info", "samples/walk.mcz"),
            "`mcz decode samples/walk.mcz`": (
                "decode",
                "samples/walk.mcz",
                "-o",
                "walk.bvh",
                "--force",
            ),
        }
        for label, arguments in commands.items():
            seconds = min(cpu_seconds_of((mcz, *arguments), work) for _ in range(RUNS))
            rows.append([f"{label}, CPU", f"{seconds:.2f} s"])
    yield table("first-result", ["a fresh environment", "measured"], rows)


def _bytes_below(folder: Path) -> int:
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
