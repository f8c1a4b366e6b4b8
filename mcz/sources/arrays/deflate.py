"""The deflate stream of a member, kept as the choices that its contents do not determine.

A stream restored bit for bit needs its blocks, the codes of each, and the matches that zlib's
search would not have chosen: none if zlib wrote it. SPEC.md, "Deflated contents", is normative.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterable

import numpy as np
from construct import Int8ul, Int32ul
from numpy.typing import NDArray

from mcz.errors import FormatError
from mcz.model.schema import SIZED, UVARINT, Record, build, counted, field, one_of, parse
from mcz.sources.arrays import deflate_kernels as loops
from mcz.sources.arrays.deflate_codes import (
    DYNAMIC,
    FIXED,
    MOST_BITS,
    N_DISTANCES,
    N_LITERALS,
    SPARE,
    STORED,
    Codes,
)
from mcz.sources.arrays.deflate_kernels import WINDOW, Effort, Search

LEVELS = {  # parameters of zlib's search, by its levels
    1: Effort(4, 4, 8, 4, 1),
    2: Effort(4, 5, 16, 8, 1),
    3: Effort(4, 6, 32, 32, 1),
    4: Effort(4, 4, 16, 16, 0),
    5: Effort(8, 16, 32, 32, 0),
    6: Effort(8, 16, 128, 128, 0),
    7: Effort(8, 32, 128, 256, 0),
    8: Effort(32, 128, 258, 1024, 0),
    9: Effort(32, 258, 258, 4096, 0),
}
NO_SEARCH = 0  # in place of a level: the stream is kept
ATTEMPTS = (6, 9, 1, 5, 4, 7, 8, 3, 2)  # levels that are tried, the usual first
CODE_ORDER = (16, 17, 18, 0, 8, 7, 9, 6, 10, 5, 11, 4, 12, 3, 13, 2, 14, 1, 15)
MOST_ITEMS = 2**16  # most blocks, and most corrections, of a stream
STORED_SIZE = 2**16 - 1  # most bytes of a stored block
MOST_PER_BYTE = 2  # bytes of a stream for each of its contents: codes have 15 bits at most
FAULTS = {
    loops.BAD_BLOCK: "a stored block that is too long",
    loops.BAD_CODES: "a block whose codes are no codes",
    loops.BAD_TOKEN: "a token that its contents do not have",
    loops.NO_CODE: "a token without a code",
    loops.LEFT_OVER: "blocks that are not as long as their contents",
}


class DeflateBlock(Record):
    """A block of a deflate stream."""

    kind: int = field(
        one_of(Int8ul, (STORED, FIXED, DYNAMIC)), "BTYPE of RFC 1951: 0, 1 or 2"
    )  # ARRAY-20
    size: int = field(UVARINT, "bytes if kind is 0, else tokens without the end of the block")
    codes: bytes = field(SIZED, "bits from HLIT to the last code length; empty unless kind is 2")


class Correction(Record):
    """A token that the search does not find."""

    skip: int = field(UVARINT, "tokens since the last correction that are as found")
    length: int = field(UVARINT, "1 of a literal, else bytes of the match")
    distance: int = field(UVARINT, "0 of a literal, else the distance of the match")


class Deflated(Record):
    """The part of a DEFLATE piece in ARRAY_DETAIL."""

    crc: int = field(Int32ul, "CRC-32 of the contents")
    level: int = field(
        one_of(Int8ul, (NO_SEARCH, *LEVELS)), "level of the search; 0: stream is kept"
    )  # ARRAY-20
    stream: bytes = field(SIZED, "the deflate stream; empty unless level is 0")
    blocks: list[DeflateBlock] = field(counted(DeflateBlock, MOST_ITEMS), "none if level is 0")
    corrections: list[Correction] = field(counted(Correction, MOST_ITEMS), "none if level is 0")


def describe_stream(stream: bytes, contents: bytes) -> bytes:
    """The part of a detail from which ``restore_stream`` makes ``stream`` of its ``contents``."""
    crc = zlib.crc32(contents)
    verbatim = Deflated(crc=crc, level=NO_SEARCH, stream=stream, blocks=[], corrections=[])
    parts = [build(verbatim, "deflated member")]
    most = min(MOST_ITEMS, len(stream) // 8)
    for level in ATTEMPTS:
        split = _split(stream, contents, level, most)
        if split is None:
            continue
        blocks, corrections = split
        most = len(corrections)
        searched = Deflated(
            crc=crc, level=level, stream=b"", blocks=blocks, corrections=corrections
        )
        part = build(searched, "deflated member")
        if _join(searched, contents) == stream:
            if not corrections:
                return part
            parts.append(part)
    return min(parts, key=len)


def is_kept(part: bytes) -> bool:
    """Return True if ``describe_stream`` had to keep the stream itself."""
    level: int = part[Int32ul.sizeof()]  # which follows the CRC-32
    return level == NO_SEARCH


def restore_stream(part: bytes, contents: bytes) -> bytes:
    """The deflate stream of ``contents``, in stored blocks if they have changed.

    Raises FormatError if ``part`` does not make one.
    """
    described = parse(Deflated, part, "source detail")
    _check(described)
    if zlib.crc32(contents) != described.crc:  # ARRAY-22
        return b"".join(_stored_blocks(contents))
    return described.stream if described.level == NO_SEARCH else _join(described, contents)


def _check(described: Deflated) -> None:
    """Raise FormatError for fields that go with another level or kind."""
    items = (*described.blocks, *described.corrections)
    is_kept = described.level == NO_SEARCH
    if items if is_kept else described.stream or not described.blocks:  # ARRAY-21
        raise FormatError(f"source detail: a stream or blocks do not fit level {described.level}")
    for block in described.blocks:
        if block.codes and block.kind != DYNAMIC:  # ARRAY-21
            raise FormatError(f"source detail: a block of kind {block.kind} cannot have codes")


def _stored_blocks(contents: bytes) -> Iterable[bytes]:
    for at in range(0, max(len(contents), 1), STORED_SIZE):
        block = contents[at : at + STORED_SIZE]
        is_last = at + STORED_SIZE >= len(contents)
        sizes = len(block).to_bytes(2, "little") + (len(block) ^ 0xFFFF).to_bytes(2, "little")
        yield bytes([is_last]) + sizes + block


def _split(
    stream: bytes, contents: bytes, level: int, most: int
) -> tuple[list[DeflateBlock], list[Correction]] | None:
    """Blocks of a stream and at most ``most`` corrections of the search, or None."""
    blocks = np.zeros((min(MOST_ITEMS, 8 * len(stream)), 4), np.int64)
    corrections = np.zeros((most, 3), np.int64)
    n_blocks, n_corrections = loops.split_stream(
        _pad(stream), *_work(contents, level), blocks, corrections
    )
    if n_blocks < 0:
        return None
    bits = np.unpackbits(np.frombuffer(stream, np.uint8), bitorder="little")
    return (
        [
            DeflateBlock(
                kind=kind,
                size=size,
                codes=np.packbits(bits[start:stop], bitorder="little").tobytes()
                if kind == DYNAMIC
                else b"",
            )
            for kind, size, start, stop in blocks[:n_blocks].tolist()
        ],
        [
            Correction(skip=skip, length=length, distance=distance)
            for skip, length, distance in corrections[:n_corrections].tolist()
        ],
    )


def _join(described: Deflated, contents: bytes) -> bytes:
    """The stream of ``contents``; raises FormatError if they do not make one."""
    stops = np.cumsum([len(block.codes) for block in described.blocks], dtype=np.int64)
    blocks = np.zeros((len(stops), 4), np.int64)
    for row, block in zip(blocks, described.blocks, strict=True):
        row[:2] = block.kind, min(block.size, len(contents) + 1)
    blocks[1:, 2], blocks[:, 3] = stops[:-1], stops
    codes = b"".join(block.codes for block in described.blocks)
    tokens = np.array(
        [(c.skip, c.length, c.distance) for c in described.corrections], np.uint64
    ).reshape(-1, 3)
    corrections = np.minimum(tokens, 2**62).astype(np.int64)
    size = MOST_PER_BYTE * len(contents) + len(codes) + 8 * len(blocks) + SPARE
    out = np.zeros(size, np.uint8)
    work = _work(contents, described.level)
    written = loops.join_stream(*work, blocks, _pad(codes), corrections, out)
    if written < 0:  # ARRAY-23
        raise FormatError(f"source detail: deflate: {FAULTS[written]}")
    return out[:written].tobytes()


def _pad(data: bytes) -> NDArray[np.uint8]:
    return np.frombuffer(data + bytes(SPARE), np.uint8)


def _work(contents: bytes, level: int) -> tuple[Search, Codes]:
    """The work space of a search of ``level``."""
    latest, earlier = np.zeros((2, WINDOW), np.int64)
    search = Search(
        np.frombuffer(contents, np.uint8), latest, earlier, np.zeros(4, np.int64), LEVELS[level]
    )
    n_symbols = N_LITERALS + N_DISTANCES
    lengths, bits = np.zeros((2, n_symbols), np.int64)
    codes = Codes(
        lengths,
        np.zeros((2, MOST_BITS + 1), np.int64),
        np.zeros((2, n_symbols), np.int64),
        bits,
        np.array(CODE_ORDER, np.int64),
    )
    return search, codes
