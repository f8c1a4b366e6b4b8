"""Random damage to a protected archive, and whether ``mcz repair`` gives every byte back.

    python tools/damages.py FILE.mcz [--redundancy 0.05] [--runs 1000] [--beyond 20] [--seed 1]

A copy of FILE is protected, and damaged in ways that recovery data promise to undo: wrong bytes
here and there, a stretch of wrong bytes, a tail or a head that is lost. Half of them go to the
limit. Each time the SHA-256 of what ``mcz.repair`` writes is compared. Then come --beyond files
with more damage than that, of which it prints what is told and how much is salvaged. Exit code 1
says that something did not come back.
"""

from __future__ import annotations

import argparse
import hashlib
import random
import shutil
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import mcz

Spoil = Callable[[bytearray, mcz.Protection, random.Random], bytes]


def length(limit: int, chance: random.Random) -> int:
    """Length of the damage: the limit as often as less."""
    return limit if chance.random() < 0.5 else chance.randint(1, limit)


def single_bytes(data: bytearray, has: mcz.Protection, chance: random.Random) -> bytes:
    for at in chance.sample(range(len(data)), length(has.n_recovery, chance)):
        data[at] ^= chance.randint(1, 255)
    return data


def burst(data: bytearray, has: mcz.Protection, chance: random.Random) -> bytes:
    n = length(has.burst, chance)
    at = chance.randint(0, len(data) - n)
    data[at : at + n] = chance.choice([bytes(n), b"\xff" * n, chance.randbytes(n)])
    return data


def lost_tail(data: bytearray, has: mcz.Protection, chance: random.Random) -> bytes:
    return data[: -length(has.burst, chance)]


def lost_head(data: bytearray, has: mcz.Protection, chance: random.Random) -> bytes:
    """Cut off, so that all else lies elsewhere, or zeros in its place."""
    n = length(has.burst, chance)
    return data[n:] if chance.random() < 0.5 else bytes(n) + data[n:]


WITHIN: tuple[Spoil, ...] = (single_bytes, burst, lost_tail, lost_head)


def bursts_beyond(data: bytearray, has: mcz.Protection, chance: random.Random) -> bytes:
    """More than there are recovery blocks, in one to four stretches, none of them in these."""
    n_bytes = int(has.n_recovery * has.block_size * chance.uniform(1.2, 3))
    parts = chance.randint(1, 4)
    for _ in range(parts):
        at = chance.randint(0, has.stop - has.cost - n_bytes)
        data[at : at + n_bytes // parts] = chance.randbytes(n_bytes // parts)
    return data


@contextmanager
def measure_time(times: list[float]) -> Iterator[None]:
    start = time.perf_counter()
    yield
    times.append(time.perf_counter() - start)


def within(whole: bytes, has: mcz.Protection, work: Path, runs: int, chance: random.Random) -> int:
    """Damage that is to be undone; returns how often it was not."""
    wanted, failed = hashlib.sha256(whole).digest(), 0
    print(f"{'damage':16} {'runs':>6} {'restored':>9} {'median':>9} {'longest':>9}")
    for kind in WITHIN:
        times: list[float] = []
        n_good = 0
        n = runs // len(WITHIN)
        for _ in range(n):
            (work / "bad.mcz").write_bytes(kind(bytearray(whole), has, chance))
            with measure_time(times):
                report = mcz.repair(work / "bad.mcz", work / "out.mcz", force=True)
            found = hashlib.sha256((work / "out.mcz").read_bytes()).digest()
            n_good += report.restored and found == wanted
        failed += n - n_good
        name = kind.__name__.replace("_", " ")
        longest, median = max(times), statistics.median(times)
        print(f"{name:16} {n:6,} {n_good:9,} {median:7.3f} s {longest:7.3f} s", flush=True)
    return failed


def beyond(whole: bytes, has: mcz.Protection, work: Path, runs: int, chance: random.Random) -> None:
    """Damage that cannot be undone: what is told, and what is saved."""
    with mcz.open(whole) as file:
        n_clips, n_frames = len(file), sum(clip.n_frames for clip in file)
    for at in range(runs):
        (work / "bad.mcz").write_bytes(bursts_beyond(bytearray(whole), has, chance))
        report = mcz.repair(work / "bad.mcz", work / "out.mcz", force=True)
        assert not report.restored
        with mcz.open(work / "out.mcz") as file:
            saved = sum(clip.n_frames for clip in file)
        sound = not mcz.verify(work / "out.mcz")
        if at == 0:
            print("told:", *report.damage[:2], *report.lost[:2], sep="\n  ")
        print(
            f"beyond: {len(report.clips):,} of {n_clips:,} clips whole, parts of "
            f"{len(report.runs):,}, {saved / n_frames:.1%} of the frames; what was written is "
            f"{'sound' if sound else 'NOT SOUND'}",
            flush=True,
        )


def main() -> None:
    assert __doc__
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("file", type=Path)
    parser.add_argument("--redundancy", type=float, default=0.05)
    parser.add_argument("--runs", type=int, default=1000)
    parser.add_argument("--beyond", type=int, default=10)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    chance = random.Random(given.seed)
    with tempfile.TemporaryDirectory() as folder:
        work, times = Path(folder), list[float]()
        shutil.copyfile(given.file, work / "whole.mcz")
        with measure_time(times):
            (has,) = mcz.protect(work / "whole.mcz", given.redundancy)
        print(f"{has}, made in {times[0]:.2f} s")
        whole = (work / "whole.mcz").read_bytes()
        failed = within(whole, has, work, given.runs, chance)
        beyond(whole, has, work, given.beyond, chance)
    sys.exit(bool(failed))


if __name__ == "__main__":
    main()
