"""One archive of a folder of takes, beside archivers of files."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

from tools.figures.table import Table, table

MCZ = sys.executable, "-m", "mcz"


def tables(data: Path, jobs: int) -> Iterator[Table]:
    """Bytes and CPU seconds of archives of one folder."""
    rows = list[list[str]]()
    with tempfile.TemporaryDirectory() as name:
        work = Path(name)
        takes = work / "takes"
        for folder in ("cmu/amc", "cmu/asf"):
            shutil.copytree(data / folder, takes, dirs_exist_ok=True)
        plain = sum(path.stat().st_size for path in takes.rglob("*") if path.is_file())
        for label, target, pack, unpack in _programs(jobs):
            if not shutil.which(pack[0]):
                continue
            packing = cpu_seconds_of(pack, work)
            size = (work / target).stat().st_size
            unpacking = cpu_seconds_of(unpack, work)
            cells = [f"{size:,}", f"{plain / size:.2f}", f"{packing:.1f}", f"{unpacking:.1f}"]
            rows.append([label, *cells])
            shutil.rmtree(work / "out", ignore_errors=True)
    head = [f"the AMCs and their ASFs, {plain / 1e6:.1f} MB", "bytes", "ratio"]
    yield table("packing", [*head, "pack, CPU s", "unpack, CPU s"], rows)


def _programs(jobs: int) -> list[tuple[str, str, Sequence[str], Sequence[str]]]:
    """Name, archive, command that packs ``takes`` and command that unpacks into ``out``."""
    rows = list[tuple[str, str, Sequence[str], Sequence[str]]]()
    for effort in ("fast", "best"):
        target = f"{effort}.mcz"
        pack = *MCZ, "pack", "takes", target, "--effort", effort, "--jobs", str(jobs)
        rows.append((f"`mcz pack`, `{effort}`", target, pack, (*MCZ, "unpack", target, "out")))
    into = "mkdir -p out && cd out && "
    shell = "sh", "-c"
    rows += [
        (
            "tar, xz -9e",
            "t.xz",
            (*shell, "tar c takes | xz -9e > t.xz"),
            (*shell, f"{into}tar xJf ../t.xz"),
        ),
        (
            "tar, zstd -19",
            "t.zst",
            (*shell, "tar c takes | zstd -q -19 > t.zst"),
            (*shell, f"{into}zstd -dqc ../t.zst | tar x"),
        ),
        (
            "7z -mx=9",
            "t.7z",
            ("7z", "a", "-mx=9", "-bso0", "-bsp0", "t.7z", "takes"),
            ("7z", "x", "-oout", "-bso0", "-bsp0", "t.7z"),
        ),
    ]
    return rows


def cpu_seconds_of(command: Sequence[str], folder: Path) -> float:
    """CPU seconds of a command and of the processes that it waits for."""
    before = os.times()
    subprocess.run(
        command, cwd=folder, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    after = os.times()
    return (
        after.children_user + after.children_system - before.children_user - before.children_system
    )
