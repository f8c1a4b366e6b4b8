"""Invalid: one flipped byte in each part of a segment, and requests for parts beside it.

A reader that takes from a segment only what is asked for finds nothing wrong.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np

import mcz
from mcz.codecs import raw
from mcz.codecs.wavelet import mrdwt
from mcz.container.segments import StreamTable
from mcz.motion import Exceptions, Motion
from tools.vectors.build.edits import at
from tools.vectors.build.files import Broken, Crafter, Vector, finished
from tools.vectors.build.motions import dance

LEVELS = 2
NOTED, OTHER = 4, 5  # groups, one channel each, of the second joint
Arguments = tuple[str, ...]
JOINT, FRAMES, COARSE = ("--joints", "0"), ("--frames", "0:8"), ("--resolution", str(LEVELS))


def vectors() -> Iterable[Vector]:
    shelf = Broken("invalid/parts")
    _flips(shelf, "", "mrdwt", _waves(packets=False))
    _flips(shelf, "packet-", "mrdwt in an open DATA", _waves(packets=True))
    _flips(shelf, "raw-", "raw", _plain())
    return shelf.vectors


def _noted() -> Motion:
    """Frames with masks, and with an exception in each group."""
    motion = dance(96)
    signal = motion.signals[0]
    mask = np.ones(signal.values.shape, np.bool_)
    mask[3:5, 1] = mask[6:9, 5] = False
    values = signal.values.copy()
    values[12, [0, 4]] = 7.5
    exceptions = Exceptions(np.array([12, 12]), np.array([0, 4]), (b"7.500", b"7.5000"))
    return replace(
        motion, signals=(replace(signal, values=values, mask=mask, exceptions=exceptions),)
    )


def _waves(*, packets: bool) -> bytes:
    crafter = Crafter(packets=packets)
    crafter.clip(_noted(), grouping="channel", codec=mrdwt.CODEC, N=LEVELS)
    return finished(crafter)


def _plain() -> bytes:
    crafter = Crafter()
    crafter.clip(_noted(), grouping="channel", codec=raw.CODEC)
    return finished(crafter)


def _flips(shelf: Broken, prefix: str, said: str, data: bytes) -> None:
    with mcz.open(data) as file:
        (signal,) = file.clips["dance"].signals
        row = signal.rows[0]
        table = file.container.table(row, signal.counts)
    for name, offset, what, requests in _places(table, row.size):
        purpose = f"A flipped bit in {what}, of {said}."
        flipped = at(row.offset + offset, bytes((data[row.offset + offset] ^ 0x20,)))(data)
        parts: Any = tuple((request, ()) for request in requests)
        shelf.add(prefix + name, "Chunks; DATA", purpose, flipped, parts=parts)


def _places(table: StreamTable, size: int) -> Iterable[tuple[str, int, str, list[Arguments]]]:
    """Name, offset in the segment, what is there, and requests that the byte does not bear upon."""
    notes, mask, stream = table.group_notes(NOTED), table.mask(OTHER), table.codec(0, OTHER)
    if notes is not None:  # of a codec without exceptions there are none
        yield "notes", table.offsets[notes], "the notes of another joint", [JOINT]
    assert mask is not None
    yield "mask", table.offsets[mask], "the mask of another joint", [JOINT]
    yield "stream", table.offsets[stream], "a stream of another joint", [JOINT]
    n_details = table.counts.n_resolutions - 1
    if n_details:
        finest = table.codec(n_details, 0)
        end = table.offsets[finest] + table.lengths[finest] - 1
        yield "finest", end, "the end of the finest details", [COARSE, FRAMES]
    coarse = [COARSE] if n_details else []
    yield "crc", size, "the checksum behind the segment", [JOINT, FRAMES, *coarse]
