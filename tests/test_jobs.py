"""Several processes: the same bytes and the same words as one, whatever happens to them."""

from __future__ import annotations

import errno
import os
import pickle
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

import mcz
from mcz.files import jobs
from mcz.files.editing import merging
from mcz.files.jobs import Pool
from mcz.files.reading.faults import validate
from mcz.sources.sample import write_samples
from tests.commands import run
from tests.worker_functions import dies, dies_once, fails, join_state


@pytest.fixture(autouse=True)
def worth_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make the smallest work worth a process."""
    monkeypatch.setattr(jobs, "LEAST_BYTES", 0)
    monkeypatch.setattr(jobs, "LEAST_STORED", 0)


@contextmanager
def here(
    function: Callable[[Any, Any], Any], items: Iterable[Any], jobs: int, state: Any = None
) -> Iterator[Iterator[Any]]:
    """Stand-in for ``mcz.files.jobs.answers``: no processes, but pickled arguments."""

    def answer(item: Any) -> Callable[[], Any] | None:
        if item is None:
            return None
        try:
            result = pickle_copy(function)(pickle_copy(state), pickle_copy(item))
        except mcz.MczError as caught:
            error = pickle_copy(caught)
            return lambda: fail(error)
        return lambda: pickle_copy(result)

    yield map(answer, list(items))  # all are asked for before the first is joined


def pickle_copy(thing: Any) -> Any:
    return pickle.loads(pickle.dumps(thing))


def fail(error: Exception) -> None:
    raise error


@pytest.fixture
def no_processes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(merging, "answers", here)
    monkeypatch.setattr(jobs, "answers", here)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Every odd case: names that are taken, the same file twice, an ASF of two AMC, faults."""
    samples, root = tmp_path_factory.mktemp("samples"), tmp_path_factory.mktemp("root")
    write_samples(samples)
    for path in samples.iterdir():  # walk.amc, walk.bvh, walk.c3d: one takes the name of the clip
        shutil.copy(path, root)
    (root / "again").mkdir()
    for name in ("walk.amc", "walk.asf", "walk.bvh"):
        shutil.copy(samples / name, root / "again")
    (root / "again/walk.txt").write_bytes(b"a text")
    (root / "again/walk2.txt").write_bytes(b"a text")
    (root / "again/broken.bvh").write_bytes(b"HIERARCHY\nROOT")
    (root / "broken.bvh").write_bytes(b"HIERARCHY\nROOT")
    (root / "again/broken.c3d").write_bytes((samples / "walk.bvh").read_bytes())
    (root / "z").mkdir()
    (root / "z/walk.bvh").write_bytes((samples / "walk.bvh").read_bytes() + b"\n")
    return root


def outcomes(report: mcz.Report) -> list[tuple[Any, ...]]:
    return [(o.path, o.result, o.size, o.message, o.notes) for o in report.outcomes]


CASES: list[dict[str, Any]] = [
    {},
    {"verbatim": True, "copies": False},
    {"keep_all": True, "profile": "large", "unit": "cm"},
    {"codec": "lsdt-clip", "up": "y", "rate": 60.0},
]


@pytest.mark.usefixtures("no_processes")
@pytest.mark.parametrize("options", CASES)
def test_pack_has_the_same_bytes(folder: Path, tmp_path: Path, options: dict[str, Any]) -> None:
    one = mcz.pack(folder, tmp_path / "1.mcz", jobs=1, **options)
    two = mcz.pack(folder, tmp_path / "2.mcz", jobs=2, **options)
    assert outcomes(two) == outcomes(one)
    assert (tmp_path / "2.mcz").read_bytes() == (tmp_path / "1.mcz").read_bytes()


@pytest.mark.usefixtures("no_processes")
def test_append_has_the_same_bytes(folder: Path, tmp_path: Path) -> None:
    reports = []
    for n in (1, 3):
        target = tmp_path / f"{n}.mcz"
        mcz.encode(folder / "walk.bvh", target)
        sources = [folder / name for name in ("walk.amc", "walk.c3d", "walk.bvh", "z")]
        reports.append(mcz.append(sources, target, root=folder, jobs=n))
    assert outcomes(reports[1]) == outcomes(reports[0])
    assert {o.result for o in reports[1].outcomes} == {"parsed", "present"}
    assert (tmp_path / "3.mcz").read_bytes() == (tmp_path / "1.mcz").read_bytes()


def contents(root: Path) -> dict[str, bytes]:
    return {p.relative_to(root).as_posix(): p.read_bytes() for p in root.rglob("*") if p.is_file()}


@pytest.mark.usefixtures("no_processes")
def test_all_comes_out_the_same(folder: Path, tmp_path: Path) -> None:
    target = tmp_path / "all.mcz"
    mcz.pack(folder, target, keep_all=True)
    for n in (1, 2):
        report = mcz.unpack(target, tmp_path / f"files{n}", jobs=n)
        assert not report.failures
        mcz.export(target, tmp_path / f"csv{n}", "csv", jobs=n)
    assert contents(tmp_path / "files2") == contents(tmp_path / "files1") == contents(folder)
    assert contents(tmp_path / "csv2") == contents(tmp_path / "csv1")
    some: dict[str, Any] = {"where": "name == 'walk'", "jobs": 2}
    found = mcz.unpack(target, tmp_path / "some", **some).outcomes
    assert {o.path for o in found} == {"walk.amc", "walk.asf", "again/walk.asf"}
    assert mcz.verify(target, jobs=2) == []


@pytest.mark.usefixtures("no_processes")
def test_the_same_faults_are_found(folder: Path, tmp_path: Path) -> None:
    target = tmp_path / "all.mcz"
    mcz.pack(folder, target, keep_all=True, copies=False)
    data = bytearray(target.read_bytes())
    with mcz.open(target) as file:
        row = file.container.directory.clips["z/walk"]
        data[row.segments[0].offset + 40] ^= 1
        part = file.container.directory.attachments["again/walk.txt"].parts[0]
        data[part.offset + part.size - 6] ^= 1
    target.write_bytes(data)
    one, two = mcz.verify(target, jobs=1), mcz.verify(target, jobs=2)
    assert two == one
    assert {problem.heading for problem in one} >= {"ATTA"}
    said = [
        [(o.path, o.result, o.message) for o in mcz.unpack(target, out, jobs=n).outcomes]
        for n, out in ((1, tmp_path / "a"), (2, tmp_path / "b"))
    ]
    assert said[0] == said[1]
    assert contents(tmp_path / "a") == contents(tmp_path / "b")


def test_what_no_other_process_can_open_is_read_here(folder: Path) -> None:
    with jobs.limit_jobs(2), (folder / "out.mcz").open("w+b") as stream:
        mcz.pack(folder / "z", stream)
        stream.seek(0)
        with mcz.open(stream) as file:
            assert validate(file) == []
    (folder / "out.mcz").unlink()


def test_processes_give_the_same(folder: Path, tmp_path: Path) -> None:
    one, two = tmp_path / "1.mcz", tmp_path / "2.mcz"
    wanted = outcomes(mcz.pack(folder, one))
    assert outcomes(mcz.pack(folder, two, jobs=2)) == wanted
    assert two.read_bytes() == one.read_bytes()
    assert run("verify", two, "--jobs", "2") == 0
    with pytest.raises(mcz.OptionError, match="jobs is 0; it must be at least 1"):
        mcz.verify(one, jobs=0)


# Processes that end -------------------------------------------------------------


@pytest.fixture
def pool() -> Iterator[Pool]:
    with Pool(2, "state") as pool:
        yield pool


def test_answers_come_in_order(pool: Pool) -> None:
    items = [0, None, 1, None, 2, 3, 4, 5, 6]
    found = [answer and answer() for answer in pool.map_in_order(join_state, items)]
    assert found == [None if item is None else ("state", item) for item in items]
    assert len(pool.pids) == 2


def test_few_items_are_taken_ahead(pool: Pool) -> None:
    taken: list[int] = []

    def items() -> Iterator[int]:
        for item in range(100):
            taken.append(item)
            yield item

    found = pool.map_in_order(join_state, items())
    assert next(found) is not None
    assert len(taken) <= 6


def test_errors_come_as_they_were(pool: Pool) -> None:
    for answer in pool.map_in_order(fails, [1, 2]):
        assert answer is not None
        with pytest.raises(mcz.TruncatedError, match="item") as caught:
            answer()
        assert caught.value.last_foot == 7


def test_what_a_dead_process_had_is_done_again(pool: Pool, tmp_path: Path) -> None:
    (answer,) = pool.map_in_order(dies_once, [tmp_path / "mark"])
    assert answer is not None
    assert answer() != os.getpid()


def test_a_process_that_dies_again_is_an_error(pool: Pool) -> None:
    (answer,) = pool.map_in_order(dies, [1])
    assert answer is not None
    with pytest.raises(mcz.WorkerError, match=r"ended unexpectedly \(signal 9\), 2 times"):
        answer()


@pytest.mark.usefixtures("no_processes")
def test_a_file_whose_process_dies_is_reported(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(merging, "encode_part", dies_on_c3d)
    report = mcz.pack(folder, tmp_path / "all.mcz", jobs=2)
    failed = {o.path: o.message for o in report.failures}
    assert failed["walk.c3d"] == "walk.c3d: it died"
    assert len(failed) == 3
    assert mcz.verify(tmp_path / "all.mcz") == []


def dies_on_c3d(profile: Any, ask: Any) -> merging.Part:
    if ask.path.name == "walk.c3d":
        raise mcz.WorkerError("it died")
    return CODED(profile, ask)


CODED = merging.encode_part


@pytest.mark.usefixtures("no_processes")
def test_full_disk_leaves_nothing(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*args: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(merging, "join_part", full)
    with pytest.raises(mcz.AccessError, match="No space"):
        mcz.pack(folder, tmp_path / "all.mcz", jobs=2)
    assert list(tmp_path.iterdir()) == []


SLOW = """
import operator, time
from mcz.files.jobs import Pool

with Pool(2) as pool:
    for answer in pool.map_in_order(operator.eq, [1, 2]):
        answer()
    print(*pool.pids, flush=True)
    time.sleep(60)
"""


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_no_process_stays_behind(number: int) -> None:
    started = subprocess.Popen(
        [sys.executable, "-c", SLOW], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    with started:
        assert started.stdout is not None
        pids = [int(word) for word in started.stdout.readline().split()]
        assert pids
        started.send_signal(number)
    deadline = time.monotonic() + 20
    while any(is_alive(pid) for pid in pids):
        assert time.monotonic() < deadline
        time.sleep(0.01)


def is_alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"


@pytest.mark.usefixtures("no_processes")
def test_an_interrupt_leaves_nothing(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def interrupt(*args: object) -> None:
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(merging, "join_part", interrupt)
    words = ["pack", str(folder), str(tmp_path / "all.mcz"), "--jobs", "2"]
    assert run(*words) == 130
    assert list(tmp_path.iterdir()) == []
    assert capfd.readouterr().err.split() == ["mcz:", "interrupted"]
