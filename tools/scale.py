"""Time and memory of the commands on an archive of many clips.

    python tools/scale.py FOLDER WORK [--jobs 2] [-- options of mcz pack]
    python tools/scale.py --remote URL

FOLDER is one that ``tools/tiles.py`` wrote, with its index.csv; WORK an empty one for what is made.
Each row is a process of its own: seconds that passed, seconds of processors, and the most memory of
any one of its processes. ``--remote`` counts what a server is asked for: a web server that has such
an archive, its index packed with it or not.
"""

from __future__ import annotations

import argparse
import csv
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

OPEN = "import sys, mcz; file = mcz.open(sys.argv[1]); print(len(file))"
PART = (
    "import sys, mcz; file = mcz.open(sys.argv[1]); clip = list(file)[len(file) // 2]; "
    "print(clip.read((0, min(100, clip.n_frames))).shape)"
)
DATASET = (
    "import sys, mcz; "
    "data = mcz.dataset(sys.argv[1], 'root', window=16, rate=30, where=\"format == 'bvh'\"); "
)
PICKLED = "import pickle; pickle.dump(data, open(sys.argv[2], 'wb'))"
SHUFFLED = (
    "import itertools, pickle, sys; data = pickle.load(open(sys.argv[1], 'rb')); "
    "print(sum(len(b['root']) for b in itertools.islice(data.batches(64, seed=1), 32)))"
)
MCZ = [sys.executable, "-c", "from mcz.cli.main import main; main()"]
PYTHON = [sys.executable, "-c"]


def measure(what: str, command: list[str], times: int = 1) -> None:
    """Run a command, and print a row for the fastest of so many times."""
    best: tuple[float, float, float] | None = None
    for _ in range(times):
        start = time.perf_counter()
        with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE) as run:
            assert run.stderr is not None
            decoded = run.stderr.read()
            _, status, used = os.wait4(run.pid, 0)
            run.returncode = os.waitstatus_to_exitcode(status)
        if run.returncode:
            raise SystemExit(f"{what}: exit code {run.returncode}: {decoded.decode()[-500:]}")
        row = time.perf_counter() - start, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024
        best = row if best is None else min(best, row)
    assert best is not None
    print(f"{what:44} {best[0]:8.2f} s {best[1]:8.2f} s {best[2]:8.0f} MiB", flush=True)


def one_more(folder: Path, work: Path) -> Path:
    """A recording that the archive has not: the first, of a frame less, as BVH."""
    with (folder / "index.csv").open(newline="") as stream:
        name = next(row["path"] for row in csv.DictReader(stream) if row["path"].endswith(".bvh"))
    rows = (folder / name).read_bytes().rstrip().split(b"\n")
    at = next(i for i, row in enumerate(rows) if row.strip().startswith(b"Frames:"))
    rows[at] = b"Frames: %d" % (int(rows[at].split()[1]) - 1)
    more = work / "one more.bvh"
    more.write_bytes(b"\n".join(rows[:-1]) + b"\n")
    return more


def local(folder: Path, work: Path, jobs: int, options: list[str]) -> None:
    """Pack a folder, and use the archive as people do."""
    archive, table = work / "all.mcz", folder / "index.csv"
    file = str(archive)
    share = ["--jobs", str(jobs)]
    work.mkdir(parents=True, exist_ok=True)
    print(f"{'':44} {'wall':>10} {'CPU':>10} {'memory':>12}")
    measure("pack", [*MCZ, "pack", str(folder), file, *share, *options])
    take = ["--match", "{path}", "--take", "subject,session,description"]
    with_sizes(archive)
    measure("meta --from (3 keys of each clip)", [*MCZ, "meta", file, "--from", str(table), *take])
    measure("open", [*PYTHON, OPEN, file], 3)
    measure("100 frames of one clip", [*PYTHON, PART, file], 3)
    measure("list", [*MCZ, "list", file], 3)
    columns = "name,subject,description"
    measure(f"list --columns {columns}", [*MCZ, "list", file, "--columns", columns], 3)
    query = "subject == '003' and duration > 2"
    measure("list --where, of subject and duration", [*MCZ, "list", file, "--where", query], 3)
    pickled = str(work / "dataset.pickle")
    measure("mcz.dataset, of all BVH", [*PYTHON, DATASET + PICKLED, file, pickled])
    measure("the same from a pickle, 2,048 windows", [*PYTHON, SHUFFLED, pickled])
    measure("append of one", [*MCZ, "append", str(one_more(folder, work)), file])
    some = ["--where", "subject == '003'", "--force"]
    measure("unpack of 100", [*MCZ, "unpack", file, str(work / "some"), *some])
    measure("verify --quick", [*MCZ, "verify", file, "--quick"])
    measure("verify", [*MCZ, "verify", file, *share])
    measure("protect, 5 %", [*MCZ, "protect", file])
    measure("append of one, and its recovery data", append_command(folder, work, file))
    measure("delete of one", [*MCZ, "delete", file, "one more"])
    with_sizes(archive)
    shutil.rmtree(work / "some")


def append_command(folder: Path, work: Path, file: str) -> list[str]:
    again = work / "again.bvh"
    again.write_bytes(one_more(folder, work).read_bytes() + b"\n")
    return [*MCZ, "append", str(again), file]


def with_sizes(archive: Path) -> None:
    """Bytes of the archive, and what its index takes."""
    import mcz

    with mcz.open(archive) as file:
        n_segments = sum(len(row.segments) for row in file.container.directory.clips.values())
        index_bytes = file.container.directory.index_bytes
        print(
            f"{len(file):,} clips of {n_segments:,} segments, {file.size:,} bytes; "
            f"INDX {index_bytes:,} bytes, {index_bytes / len(file):.1f} a clip",
            flush=True,
        )


def remote(address: str) -> None:
    """Requests and bytes of a file on a web server."""
    import mcz

    def row(what: str, file: mcz.File, before: tuple[int, int]) -> tuple[int, int]:
        source = file.container.source
        now = source.n_requests, source.n_bytes
        counts = f"{now[0] - before[0]:6,} requests {now[1] - before[1]:12,} bytes"
        print(f"{what:44} {counts}", flush=True)
        return now

    with mcz.open(address) as file:
        at = row(f"open, {len(file):,} clips", file, (0, 0))
        clip = list(file)[len(file) // 2]
        clip.read((0, min(100, clip.n_frames)))
        stored = sum(segment.size for segment in clip._row.segments)
        at = row(f"100 frames of one clip of {stored:,} bytes", file, at)
        file.find("n_frames > 300 and duration > 3")
        at = row("find, by frames and duration", file, at)
        names = file.find("subject == '003'")
        row(f"find, by subject: {len(names)} clips", file, at)


def main() -> None:
    assert __doc__
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("folder", type=Path, nargs="?")
    parser.add_argument("work", type=Path, nargs="?")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--remote", metavar="URL")
    given, options = parser.parse_known_args()
    if given.remote is not None:
        remote(given.remote)
    elif given.folder is None or given.work is None:
        parser.error("a folder of tiles and one to work in, or --remote URL")
    else:
        local(given.folder, given.work, given.jobs, options)


if __name__ == "__main__":
    main()
