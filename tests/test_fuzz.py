"""The tools that fuzz: files taken apart and repaired, what is written down, what is compared."""

from __future__ import annotations

import random
import subprocess
import sys
from pathlib import Path

import pytest

import mcz
from mcz.container.scan import scan
from mcz.container.source import open_source
from tests.amounts import amount
from tests.repair import use
from tools.fuzz import __main__ as command
from tools.fuzz import differential, files, guard, readers
from tools.fuzz.guard import BrokenError, HangError, Record
from tools.fuzz.mutation import STEPS, WEIGHTS, Mutation, plain_change
from tools.fuzz.repair import (
    join_pieces,
    pieces_of,
    table_of,
    with_hashes,
    with_header,
    with_streams,
)
from tools.fuzz.seeds import VECTORS
from tools.fuzz.targets import TARGETS

ODD = (  # vectors that this package reads but would write otherwise, or cannot hash
    "/random/",
    "by-hand",
    "extension-INDX",
    "index-continued",
    "newer",
    "older",
    "unknown",
    "model-missing",
    "model-behind",
    "model-later",
    "appended-nothing",
    "end-not-fresh",
    "/extensions/",
    "private-codec",
)
EVERY = 23  # vectors between two that are looked at


def vectors() -> list[Path]:
    paths = sorted((VECTORS / "valid").rglob("*.mcz")) + sorted((VECTORS / "uncommon").rglob("*"))
    return [p for p in paths if p.suffix == ".mcz" and not any(odd in str(p) for odd in ODD)]


@pytest.mark.parametrize("path", vectors()[::EVERY], ids=lambda p: f"{p.parent.name}-{p.stem}")
def test_what_is_taken_apart_goes_together_again(path: Path) -> None:
    data = path.read_bytes()
    pieces = pieces_of(data)
    assert join_pieces(pieces) == data
    assert with_hashes(data) == data
    for piece in pieces:
        if piece.type == b"DATA" and piece.packets is None:
            table = table_of(piece.payload)
            assert table is not None
            assert with_streams(piece.payload, table, table.streams) == piece.payload
            assert with_header(piece.payload) == piece.payload


def test_hashes_are_those_of_what_is_decoded() -> None:
    data = (VECTORS / "valid" / "raw" / "clips.mcz").read_bytes()
    pieces = pieces_of(data)
    which = next(n for n, piece in enumerate(pieces) if piece.type == b"DATA")
    table = table_of(pieces[which].payload)
    assert table is not None
    stream = bytearray(table.streams[-1])
    stream[-1] ^= 1
    payload = with_streams(pieces[which].payload, table, [*table.streams[:-1], bytes(stream)])
    changed = join_pieces(
        [*pieces[:which], type(pieces[0])(b"DATA", 0, payload), *pieces[which + 1 :]]
    )
    with pytest.raises(mcz.ChecksumError, match="the hash of the values is"):
        use(changed)
    use(with_hashes(changed))
    assert mcz.verify(with_hashes(changed)) == []


@pytest.mark.parametrize("step", STEPS, ids=lambda step: step.__name__)
def test_steps_change_files_behind_their_checksums(step: object) -> None:
    """Mutated files fail for the mutation; headers and checksums are right."""
    changed = 0
    for seed, path in enumerate(vectors()[::11]):
        rng = random.Random(seed)
        data = path.read_bytes()
        pieces = step(Mutation(rng, plain_change(rng)), pieces_of(data))  # type: ignore[operator]
        if pieces is None or join_pieces(pieces) == data:
            continue
        changed += 1
        try:
            scan(open_source(join_pieces(pieces)))
        except mcz.ChecksumError as error:
            assert "crc of packet" in str(error)  # of a packet that is now another frame
        except mcz.MczError as error:
            assert str(error)
    assert changed > 0


def test_a_mutation_is_that_of_its_seed() -> None:
    data = vectors()[0].read_bytes()
    made = []
    for _ in range(2):
        rng = random.Random(5)
        made.append([Mutation(rng, plain_change(rng)).of(data, 4096) for _ in range(20)])
    assert made[0] == made[1]
    assert len(set(made[0])) > 10
    assert len(STEPS) == len(WEIGHTS)


# Seeds that may be refused: damaged ones, and texts of vectors that no source file has.
HARMLESS = (
    "invalid uncommon long arrays- table-marks table-no-rows table-odd table-sections".split()
)


@pytest.mark.parametrize("name", TARGETS)
def test_seeds_pass(name: str) -> None:
    target = TARGETS[name]
    seeds = target.seeds()
    decoded = 0
    for key in random.Random(1).sample(sorted(seeds), min(6, len(seeds))):
        try:
            decoded += target.check(seeds[key])
            if decoded == amount(6, 2):
                break
        except mcz.MczError:
            assert any(word in key for word in HARMLESS)
    assert decoded > 0


def test_properties_can_break(monkeypatch: pytest.MonkeyPatch) -> None:
    paths = [path for path in vectors()[:400:20] if "long" not in path.stem]  # decoded sizes
    some = [path.read_bytes() for path in paths if path.stat().st_size < 1000]
    assert all(map(files.check_file, some))
    whole = files._whole

    def wrong(clip: mcz.Clip, signal: int, resolution: int) -> files.Arrays:
        values, mask = whole(clip, signal, resolution)
        return values + 1, mask

    monkeypatch.setattr(files, "_whole", wrong)
    monkeypatch.setattr(files, "_check_salvage", lambda *_: None)  # it would break for some of them
    with pytest.raises(BrokenError, match="a part differs"):
        for data in some:  # which part is drawn from the bytes
            files.check_decoder(data)


def test_readers_properties_can_break(monkeypatch: pytest.MonkeyPatch) -> None:
    data = readers.seeds("bvh")["bvh-sample"]
    assert readers.check_bvh(data)
    monkeypatch.setattr(readers, "same", lambda one, other: False)
    with pytest.raises(BrokenError, match="read twice"):
        readers.check_bvh(data)


def raise_error(error: BaseException) -> object:
    def check(data: bytes) -> bool:
        raise error

    return check


def test_findings_are_kept_and_refusals_counted(tmp_path: Path) -> None:
    record = Record("bvh", tmp_path, tmp_path / "figures.json")
    record.run(lambda data: True, b"fine")
    record.run(raise_error(mcz.SourceError("bad")), b"refused")  # type: ignore[arg-type]
    for n in range(5):
        record.run(raise_error(BrokenError("it differs")), bytes((n,)))  # type: ignore[arg-type]
    record.run(raise_error(MemoryError()), b"large")  # type: ignore[arg-type]
    assert (record.executions, record.decoded) == (8, 1)
    assert record.refused == {"SourceError": 1}
    assert sorted(record.findings.values()) == [1, 5]
    kept = [path for path in tmp_path.iterdir() if not path.suffix]
    assert len(kept) == guard.MOST_OF_A_KIND + 1
    assert b"large" in [path.read_bytes() for path in kept]


def test_a_hang_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(guard, "SECONDS", 0.05)
    guard.limit_time()
    record = Record("bvh", tmp_path, tmp_path / "figures.json")

    def forever(data: bytes) -> bool:
        while True:
            pass

    record.run(forever, b"slow")
    ((finding, count),) = record.findings.items()
    assert finding.startswith("HangError")
    assert count == 1
    with pytest.raises(HangError):
        guard.call_in_time(forever, b"")


def test_memory_is_limited() -> None:
    code = (
        "from tools.fuzz.guard import limit_memory\nlimit_memory(2**26)\n"
        "small = bytearray(2**24)\ntry:\n    bytearray(2**28)\n"
        "except MemoryError:\n    print('limited')"
    )
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert told.stdout == "limited\n"


def test_command(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    assert command.main(["--list"]) == 0
    assert all(f"{name} " in capsys.readouterr().out for name in ("bvh",))
    monkeypatch.setattr(command, "find_spec", lambda name: None)
    assert command.main(["bvh"]) == 0
    assert "SKIPPED" in capsys.readouterr().err
    monkeypatch.setattr(command, "find_spec", lambda name: object())
    assert command.main(["nothing"]) == 2


class Told:
    """Another decoder, of one answer."""

    def __init__(self, answer: differential.Answer) -> None:
        self.told = answer

    def answer(self, data: bytes, request: list[str]) -> differential.Answer:
        return self.told


@pytest.mark.parametrize(
    ("change", "agreed"),
    [
        (lambda own: own, True),
        (lambda own: differential.Answer(0, own.output.replace(b": ", b":", 1)), True),
        (lambda own: differential.Answer(0, own.output[:-1] + b"\x01"), False),
        (lambda own: differential.Answer(1, message="byte 7: no"), False),
        (lambda own: differential.Answer(2, message="TypeError"), False),
    ],
)
def test_answers_are_compared(tmp_path: Path, change: object, agreed: bool) -> None:
    data = (VECTORS / "valid" / "raw" / "clips.mcz").read_bytes()
    other = Told(change(differential.ours(data, [])))  # type: ignore[operator]
    found = differential.Comparison(tmp_path)
    assert found.compare(1, "segments", data, [], other) == agreed  # type: ignore[arg-type]
    assert bool(found.differences) != agreed
    assert len(list(tmp_path.iterdir())) == (0 if agreed else 2)


def test_refusals_differ_by_their_kind(tmp_path: Path) -> None:
    found = differential.Comparison(tmp_path)
    for code in (1, 3):
        other = Told(differential.Answer(code, message="no"))
        assert not found.compare(1, "none", b"none", [], other)  # type: ignore[arg-type]
    assert found.agreed == {1: 1}
    assert (found.choices.total(), found.differences.total()) == (1, 0)
    cut = (VECTORS / "valid" / "qbc" / "cut-frames-21-30.mcz").read_bytes()
    other = Told(differential.Answer(1, message="no"))
    assert not found.compare(1, "cut", cut, [], other)  # type: ignore[arg-type]
    assert (found.choices.total(), found.differences.total()) == (2, 0)


def test_requests_are_answerable() -> None:
    data = (VECTORS / "valid" / "mrdwt" / "empty-between.mcz").read_bytes()
    for seed in range(10):
        for request in differential.requests(data, random.Random(seed)):
            assert differential.ours(data, request).exit == 0
