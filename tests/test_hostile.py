"""Hostile bytes: cut, flipped, and flipped with every checksum repaired.

Whatever a reader is given, it decodes or raises an MczError, and takes memory that the bytes or
the limits have earned.
"""

from __future__ import annotations

import pytest

import mcz
from conformance.run import VECTORS
from tests.amounts import amount
from tests.motions import rich, write_bytes
from tests.repair import (
    flip_bit,
    flips,
    join_parts,
    memory_below,
    parts_of,
    replace_payload,
    use,
    with_index_content,
)

POSITIONS = amount(2000, 80)  # bits a file and kind of damage
MEMORY = 64 * 2**20


SOURCES = VECTORS / "valid" / "sources"
FILES = {
    "rich": write_bytes(rich(12), segment_frames=5),
    "bvh": (SOURCES / "bvh-odd.mcz").read_bytes(),
    "amc": (SOURCES / "amc.mcz").read_bytes(),
}


@pytest.fixture(params=FILES)
def data(request: pytest.FixtureRequest) -> bytes:
    return FILES[request.param]


def outcome(data: bytes, **how: bool) -> str:
    try:
        use(data, **how)
    except mcz.MczError as error:
        assert str(error)
        return type(error).__name__
    return "decoded"


def test_unharmed_files_are_used_whole(data: bytes) -> None:
    use(data)
    use(data, salvage=True)
    use(join_parts(parts_of(data)))


def test_every_cut_is_truncated(data: bytes) -> None:
    step = max(1, len(data) // POSITIONS)
    for size in range(0, len(data), step):
        assert outcome(data[:size]) == "TruncatedError"
        outcome(data[:size], salvage=True)


def test_verify_finds_every_flipped_bit(data: bytes) -> None:
    from mcz.files.reading.faults import validate

    for byte, bit in flips(len(data), POSITIONS, seed=2):
        try:
            with mcz.open(flip_bit(data, byte, bit)) as file:
                assert validate(file), f"bit {bit} of byte {byte}"
        except mcz.MczError:
            pass


def test_flipped_bits_behind_repaired_checksums(data: bytes) -> None:
    parts = parts_of(data)
    for which, (_chunk, payload) in enumerate(parts):
        for byte, bit in flips(len(payload), POSITIONS, seed=which):
            outcome(join_parts(replace_payload(parts, which, flip_bit(payload, byte, bit))))


def test_memory_stays_bounded(data: bytes) -> None:
    parts = parts_of(data)
    for which, (_chunk, payload) in enumerate(parts):
        bad = [flip_bit(payload, *at) for at in flips(len(payload), 40, seed=100 + which)]
        files = [join_parts(replace_payload(parts, which, changed)) for changed in bad]
        with memory_below(MEMORY):
            for file in files:
                outcome(file)


def test_cut_payloads_behind_repaired_checksums(data: bytes) -> None:
    parts = parts_of(data)
    for which, (_chunk, payload) in enumerate(parts):
        for size in range(0, len(payload), max(1, len(payload) // 40)):
            outcome(join_parts(replace_payload(parts, which, payload[:size])))
            outcome(
                join_parts(
                    replace_payload(parts, which, payload[:size] + b"\0\x01" + payload[size:])
                )
            )


def test_chunks_dropped_doubled_and_swapped(data: bytes) -> None:
    parts = parts_of(data)
    for which in range(len(parts)):
        outcome(join_parts(parts[:which] + parts[which + 1 :]))
        outcome(join_parts([*parts[:which], parts[which], *parts[which:]]))
        if which:
            before, here = parts[which - 1], parts[which]
            outcome(join_parts([*parts[: which - 1], here, before, *parts[which + 1 :]]))


def test_flipped_bits_of_the_index() -> None:
    for byte, bit in flips(600, POSITIONS, seed=3):
        flip = lambda content, at=byte, of=bit: flip_bit(content, at % len(content), of)  # noqa: E731
        outcome(with_index_content(FILES["rich"], flip))
