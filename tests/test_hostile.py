"""Hostile bytes: cut, flipped, and flipped with every checksum repaired.

Whatever a reader is given, it decodes or raises an MczError, and takes memory that the bytes or
the limits have earned.
"""

from __future__ import annotations

import io
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import mcz
from mcz.motion import Exceptions
from tests.motions import smooth
from tests.repair import (
    flipped,
    flips,
    joined,
    memory_below,
    parts_of,
    replaced,
    use,
    with_index_content,
)

POSITIONS = 2000 if os.environ.get("MCZ_LONG") else 80  # bits a file and kind of damage
MEMORY = 64 * 2**20


def rich() -> bytes:
    """Notes, masks, exceptions, a second signal, an attachment, metadata."""
    motion = smooth(12, metadata={"subject": "7"})
    mask = np.ones((12, 10), bool)
    mask[4:6, 3] = False
    exceptions = Exceptions(np.array([2, 7]), np.array([0, 9]), (b"1e3", b"nan"))
    values = motion.values.copy()
    values[2, 0], values[7, 9] = 1000, np.nan
    signal = replace(motion.signals[0], values=values, mask=mask, exceptions=exceptions)
    analog = mcz.Signal(
        np.arange(24, dtype=np.int64).reshape(24, 1),
        name="analog",
        role="analog",
        samples_per_frame=2,
        channels=(mcz.Channel("", "emg", "V"),),
    )
    out = io.BytesIO()
    mcz.write(replace(motion, signals=(signal, analog)), out, segment_frames=5)
    return out.getvalue()


def of_text(path: Path) -> bytes:
    out = io.BytesIO()
    mcz.encode(path, out)
    return out.getvalue()


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    folder = tmp_path_factory.mktemp("hostile")
    bvh = folder / "a.bvh"
    bvh.write_bytes(
        b"HIERARCHY\nROOT hips\n{\n  OFFSET 0 0 0\n  CHANNELS 2 Xrotation Yrotation\n  End Site\n"
        b"  {\n    OFFSET 0 1 0\n  }\n}\nMOTION\nFrames: 4\nFrame Time: .0083333\n"
        b"1.25 -0.00\r\n1.50 x3\n 2.25\t4.00\n1e-3 7.25".replace(b"x3", b"3.00")
    )
    asf = folder / "b.asf"
    asf.write_bytes(
        b":version 1.10\n:name VICON\n:units\n  length 0.45\n  angle deg\n:root\n"
        b"  order TX TY TZ RX RY RZ\n  axis XYZ\n  position 0 0 0\n  orientation 0 0 0\n"
        b":bonedata\n  begin\n    id 1\n    name knee\n    direction 0 1 0\n    length 2\n"
        b"    axis 0 0 20 XYZ\n    dof rx\n    limits (-10 170)\n  end\n:hierarchy\n  begin\n"
        b"    root knee\n  end\n"
    )
    amc = folder / "b.amc"
    amc.write_bytes(
        b":FULLY-SPECIFIED\n:DEGREES\n3\nroot 1 2 3 4 5 6\nknee 1.5e-014\n"
        b"4\nknee 2\nroot 1 2 3 4 5 -0\n9\nroot 1 2 3 4 5 6\n"
    )
    return {"rich": rich(), "bvh": of_text(bvh), "amc": of_text(amc)}


@pytest.fixture(params=["rich", "bvh", "amc"])
def data(files: dict[str, bytes], request: pytest.FixtureRequest) -> bytes:
    return files[request.param]


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
    use(joined(parts_of(data)))


def test_every_cut_is_truncated(data: bytes) -> None:
    step = max(1, len(data) // POSITIONS)
    for size in range(0, len(data), step):
        assert outcome(data[:size]) == "TruncatedError"
        outcome(data[:size], salvage=True)


def test_verify_finds_every_flipped_bit(data: bytes) -> None:
    from mcz.reading.report import validate

    for byte, bit in flips(len(data), POSITIONS, seed=2):
        try:
            with mcz.open(flipped(data, byte, bit)) as file:
                assert validate(file), f"bit {bit} of byte {byte}"
        except mcz.MczError:
            pass


def test_flipped_bits_behind_repaired_checksums(data: bytes) -> None:
    parts = parts_of(data)
    for which, (_chunk, payload) in enumerate(parts):
        for byte, bit in flips(len(payload), POSITIONS, seed=which):
            outcome(joined(replaced(parts, which, flipped(payload, byte, bit))))


def test_memory_stays_bounded(data: bytes) -> None:
    parts = parts_of(data)
    for which, (_chunk, payload) in enumerate(parts):
        bad = [flipped(payload, *at) for at in flips(len(payload), 40, seed=100 + which)]
        files = [joined(replaced(parts, which, changed)) for changed in bad]
        with memory_below(MEMORY):
            for file in files:
                outcome(file)


def test_cut_payloads_behind_repaired_checksums(data: bytes) -> None:
    parts = parts_of(data)
    for which, (_chunk, payload) in enumerate(parts):
        for size in range(0, len(payload), max(1, len(payload) // 40)):
            outcome(joined(replaced(parts, which, payload[:size])))
            outcome(joined(replaced(parts, which, payload[:size] + b"\0\x01" + payload[size:])))


def test_chunks_dropped_doubled_and_swapped(data: bytes) -> None:
    parts = parts_of(data)
    for which in range(len(parts)):
        outcome(joined(parts[:which] + parts[which + 1 :]))
        outcome(joined([*parts[:which], parts[which], *parts[which:]]))
        if which:
            before, here = parts[which - 1], parts[which]
            outcome(joined([*parts[: which - 1], here, before, *parts[which + 1 :]]))


def test_flipped_bits_of_the_index(files: dict[str, bytes]) -> None:
    for byte, bit in flips(600, POSITIONS, seed=3):
        flip = lambda content, at=byte, of=bit: flipped(content, at % len(content), of)  # noqa: E731
        outcome(with_index_content(files["rich"], flip))
