"""The stream of a group of best: heads as lossless has them, echoes, links, then bits.

SPEC.md, "Codec 2: best", is normative; the names below are its field names.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, partial
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.lossless.best_choices import choose_links
from mcz.codecs.lossless.echoes import Echo, build_echoes, find_echoes, read_echoes, table_of
from mcz.coding.ordinals import streams
from mcz.coding.ordinals.heads import CODED, read_heads
from mcz.coding.ordinals.streams import Own, Seen, plan_stream, powers
from mcz.coding.start import start_states
from mcz.errors import FormatError
from mcz.numbers import Grid
from mcz.schema import read_varint, varint

Ints = NDArray[np.int64]

AS_CODEC_1, LINKED, ECHOED = range(3)  # method
HEADS = 1  # the version of lossless that has them
MAX_UNIT = 44
MAX_SEEN = 8
MAX_LINKS = 4096  # in a stream, so that what is learned takes little memory


@dataclass(frozen=True, slots=True)
class Link:
    """What a coded channel is counted in, and which coded channels before it it looks at."""

    unit: int
    reach: int
    seen: tuple[int, ...]

    def head(self) -> bytes:
        first = bytes((self.unit, len(self.seen) | self.reach - self.unit << 4))
        return first + b"".join(map(varint, self.seen))


def build_stream(ordinals: Ints, grids: Sequence[Own], group: int, seen: Seen | None) -> bytes:
    """One stream, as ``mcz.coding.ordinals.streams.build_stream``: the shortest of all methods."""
    seen_before = None if seen is None else dict(seen)
    heads, plans, coded = plan_stream(ordinals, grids, group, seen, HEADS, fitted=False)
    simple = streams.build_stream(ordinals, grids, group, seen_before, HEADS)
    if not plans:
        return bytes((AS_CODEC_1,)) + simple
    links = [Link(*link) for link in choose_links(coded, plans, MAX_LINKS)]
    link_heads = b"".join(link.head() for link in links)
    linked = bytes((LINKED,)) + heads + link_heads + code(coded, plans, links)
    found = [bytes((AS_CODEC_1,)) + simple, linked]
    own = _may_echo(heads, [grid for _, grid in grids])
    echoes = find_echoes(coded[:, : len(own)], own)
    if echoes:
        bits = code(coded, plans, links, echoes)
        found.append(bytes((ECHOED,)) + heads + build_echoes(echoes) + link_heads + bits)
    return min(found, key=len)


def _may_echo(stream: bytes, grids: Sequence[Grid]) -> list[bool]:
    """Of each coded channel, but for rests, whether its numbers are ordinals."""
    heads, _ = read_heads(stream, grids, HEADS)
    return [found[1] is None for kind, found, _ in heads if kind == CODED]


def parse_stream(
    stream: bytes, grids: Sequence[Grid], n_rows: int
) -> tuple[Ints, dict[int, tuple[int, int]]]:
    """The ordinals of a group, (n_rows, channels), and which channels are copies of which."""
    if not stream or stream[0] > ECHOED:  # BEST-02
        raise FormatError(f"best: method {stream[:1].hex() or 'missing'}")
    method, stream = stream[0], stream[1:]
    if method == AS_CODEC_1:
        return streams.parse_stream(stream, grids, n_rows, version=HEADS)
    may_echo = _may_echo(stream, grids) if method == ECHOED else None
    uncode = partial(_uncode, may_echo=may_echo)
    return streams.parse_stream(stream, grids, n_rows, uncode, version=HEADS)


def _uncode(data: bytes, plans: Sequence[Ints], n_rows: int, may_echo: list[bool] | None) -> Ints:
    """The numbers of the coded channels, (n_rows, len(plans)); None: there are no echoes."""
    if not plans:  # BEST-03
        raise FormatError("best: no channel is coded, and yet there are links")
    echoes: list[Echo] = []
    if may_echo is not None:
        rests = [False] * (len(plans) - len(may_echo))
        echoes, end = read_echoes(data, n_rows, may_echo + rests)
        data = data[end:]
    links, end = read_links(data, len(plans))
    bits = np.frombuffer(data[end:], np.uint8).copy()
    _, coding = loops()
    state = start_states("best")[0].copy()  # BEST-08
    rows = np.zeros((n_rows, len(plans)), np.int64)
    coding.start(state, bits, 0)
    fault = run(state, bits, rows, plans, links, echoes)
    if fault >= 0:
        raise FormatError(f"best: row {fault} cannot be decoded")
    if coding.coded_size(state) != len(bits):  # BEST-09, RANGE-04
        raise FormatError(f"best: {len(bits)} bytes, of which {coding.coded_size(state)} belong")
    return rows


def read_links(data: bytes, n_coded: int) -> tuple[list[Link], int]:
    """The links of the coded channels and the offset after them."""
    links, at, total = [], 0, 0
    for channel in range(n_coded):
        if at + 2 > len(data):
            raise FormatError(f"best: the stream ends in the links, channel {channel}")
        unit, n_seen, reach = data[at], data[at + 1] & 15, data[at + 1] >> 4
        at += 2
        if unit > MAX_UNIT:  # BEST-04
            raise FormatError(f"best: a unit of 2^{unit}")
        if n_seen > MAX_SEEN:  # BEST-05
            raise FormatError(f"best: {n_seen} links of one channel")
        seen = []
        for _ in range(n_seen):
            other, at = read_varint(data, at)
            seen.append(other)
        if any(other >= channel for other in seen):  # BEST-06
            raise FormatError(f"best: coded channel {channel} looks at {seen}")
        total += n_seen
        links.append(Link(unit, unit + reach, tuple(seen)))
    if total > MAX_LINKS:  # BEST-07
        raise FormatError(f"best: {total} links, more than {MAX_LINKS}")
    return links, at


@cache
def loops() -> tuple[ModuleType, ModuleType]:
    from mcz.codecs.lossless import best_kernels
    from mcz.coding import mixing

    return best_kernels, mixing


def code(
    coded: Ints, plans: Sequence[Ints], links: Sequence[Link], echoes: Sequence[Echo] = ()
) -> bytes:
    """The bits of the coded channels, at least one."""
    _, coding = loops()
    size = 4 * coded.size + 1024
    while True:
        data = np.zeros(size, np.uint8)
        state = start_states("best")[0].copy()
        coding.start(state, data, 1)
        fault = run(state, data, coded.copy(), plans, links, echoes)
        used = coding.finish(state, data)
        if fault >= 0:
            raise AssertionError(f"best: row {fault} has no code")
        if used <= size:
            return data[:used].tobytes()
        size = used + 1024


def run(
    state: Ints,
    data: NDArray[np.uint8],
    rows: Ints,
    plans: Sequence[Ints],
    links: Sequence[Link],
    echoes: Sequence[Echo],
) -> int:
    """Code ``rows`` in place; return the row of a fault or -1."""
    own, _ = loops()
    table = np.zeros((len(links), own.LINKS_SIZE), np.int64)
    end = 0
    for row, link in zip(table, links, strict=True):
        near, bent = own.sizes_of(len(link.seen))
        row[: own.SEEN] = link.unit, link.reach, end, end + near, len(link.seen)
        row[own.SEEN : own.SEEN + len(link.seen)] = link.seen
        end += near + bent
    repeats = table_of(echoes, *rows.shape)
    with np.errstate(all="ignore"):  # what is no number is no estimate
        return int(own.code_rows(state, data, rows, np.stack(plans), powers(), table, end, repeats))
