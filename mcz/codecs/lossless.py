"""Codec 1, ``lossless``: predicted ordinals, entropy coded with mixed adaptive contexts.

SPEC.md, "Codec 1: lossless", is normative; the names below are its field names.

Exactness: lossless and bit-exact; integers only, coder state in u32, products below 2^53 but for
ordinals themselves. A stream holds one group of one segment and needs no other, but for channels
that are copies of another group's.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcz.codecs._lossless_plan import (
    MAX_TAP,
    Lattice,
    base_and_digits,
    choose_predictor,
    fixed_point,
    lattice,
    max_top,
)
from mcz.codecs._lossless_units import find_unit, of_multiples
from mcz.codecs.base import (
    Codec,
    Encoded,
    Fetch,
    Layout,
    Parameter,
    Request,
    Segment,
    SignalSource,
    Span,
    gather,
    integer,
    refuse_extras,
)
from mcz.coding.logistic import rate_table, squash_table, stretch_table
from mcz.errors import FormatError
from mcz.numbers import Grid, GridKind
from mcz.schema import read_varint, varint

Ints = NDArray[np.int64]
Bytes = NDArray[np.uint8]

TARGET_BYTES = 62_000  # of a segment: under the 64 KiB that DATA should have, table included
MAX_ROWS = 2**16
START_TABLE = Path(__file__).with_name("lossless_start.json")

CODED, CONSTANT, COPY = range(3)  # bits 0 and 1 of a channel's first byte

# The head of each channel of a stream, as SPEC.md's table has it: (name, type, meaning).
LOSSLESS_FIELDS = (
    ("kind", "u8", "bits 0-1: 0 coded, 1 constant, 2 copy; the others by kind"),
    ("ordinal", "bytes", "constant: the ordinal, zigzag, in as many bytes as bits 2-5 of kind say"),
    ("group", "varint", "copy: group of the channel that this one repeats"),
    ("channel", "varint", "copy: that channel, counted within its group"),
    (
        "form",
        "u8",
        "coded, bit 7 of kind: 0 plain, 32 multiples, others classes",
    ),
    ("drop", "u8", "coded, bit 7 of kind: low bits of an ordinal or magnitude that are apart"),
    ("unit", "binary64", "coded, form 32: what the coded integers are multiplied by"),
    ("top", "varint", "coded, form neither 0 nor 32: the greatest class"),
    ("scale", "u8", "coded: first scale, in quarters of an octave"),
    ("taps", "zigzag varint each", "coded: as many as bits 3-6 of kind say; bit 2: from_last"),
)
MAX_DROP = 19
MAX_SCALE = 172  # 2^43
MAX_TAPS = 8
PLAIN = Grid(GridKind.INTEGER)
OWN_FORM = 128  # in kind: form and drop are in the stream
MULTIPLES = 32  # form: integers that are multiplied by a unit


def encode(source: SignalSource, params: Mapping[str, Any]) -> Encoded:
    """Code the ordinals of ``source``; ``segment_frames`` 0 lets the size decide."""
    return Encoded(header=b"", segments=_segments(source, params["segment_frames"]))


def _segments(source: SignalSource, fixed: int) -> Iterator[Segment]:
    layout = source.layout
    ends = sorted({*source.breaks, layout.n_frames})
    most = min(layout.most_frames, max(1, MAX_ROWS // layout.samples_per_frame))
    per_frame = max(1, layout.n_channels) * layout.samples_per_frame
    guess = fixed or max(1, TARGET_BYTES // (2 * per_frame))
    first = 0
    while first < layout.n_frames:
        end = next(e for e in ends if e > first)
        n_frames = min(guess, end - first, most)
        streams = _build_segment(source, first, first + n_frames)
        size = sum(map(len, streams)) + 1
        if size > TARGET_BYTES and n_frames > 1 and not fixed:
            guess = max(1, n_frames * TARGET_BYTES * 95 // (size * 100))
            continue
        yield Segment(first, n_frames, streams)
        first += n_frames
        if not fixed:
            guess = max(1, min(4 * n_frames, n_frames * TARGET_BYTES * 95 // (size * 100)))


def _build_segment(source: SignalSource, start: int, stop: int) -> tuple[bytes, ...]:
    ordinals = source.ordinals(start, stop)
    grids = source.grids(start)
    seen: dict[bytes, tuple[int, int]] = {}
    streams = []
    for index, group in enumerate(source.layout.groups):
        columns = ordinals[:, list(group)]
        own = [(grids[c], source.layout.grids[c]) for c in group]
        streams.append(_build(columns, own, index, seen))
    return tuple(streams)


def _build(
    ordinals: Ints,
    grids: Sequence[tuple[Grid, Grid]],
    group: int,
    seen: dict[bytes, tuple[int, int]],
) -> bytes:
    """One stream: ``ordinals`` of one group, (rows, channels); grids in force and of the clip."""
    heads, plans, coded = [], [], []
    for channel, column in enumerate(ordinals.T):
        column = np.ascontiguousarray(column)
        key = column.tobytes()
        if (column == column[0]).all():
            heads.append(_constant_head(int(column[0])))
        elif key in seen:
            heads.append(bytes((COPY,)) + b"".join(map(varint, seen[key])))
        else:
            seen[key] = group, channel
            head, plan, numbers = _coded_head(column, *grids[channel])
            heads.append(head)
            plans.append(plan)
            coded.append(numbers)
    return b"".join(heads) + (_code(np.stack(coded, axis=1), plans) if plans else b"")


def _constant_head(ordinal: int) -> bytes:
    folded = 2 * ordinal if ordinal >= 0 else -2 * ordinal - 1
    size = (folded.bit_length() + 7) // 8
    return bytes((CONSTANT | size << 2,)) + folded.to_bytes(size, "little")


def _coded_head(column: Ints, grid: Grid, clip_grid: Grid) -> tuple[bytes, Ints, Ints]:
    """The head of a coded channel, its plan for the compiled loop, and the integers to code."""
    found = find_unit(column) if grid.kind == GridKind.BINARY32 else None
    unit, column = found if found is not None else (0.0, column)
    shape = lattice(grid if found is None else PLAIN, column)
    if shape.base and shape.top > max_top(shape):
        shape = lattice(PLAIN, column)
    from_last, taps, error = choose_predictor(fixed_point(column, shape))
    scale = next((q for q in range(MAX_SCALE) if scale_of(q) >= error), MAX_SCALE)
    form = form_of(shape) if found is None else MULTIPLES
    own_form = shape.drop > 0 or form != form_of_grid(clip_grid)
    kind = CODED | from_last << 2 | len(taps) << 3 | OWN_FORM * own_form
    head = [bytes((kind,)), bytes((form, shape.drop)) if own_form else b""]
    head += [struct.pack("<d", unit)] if form == MULTIPLES else []
    head += [varint(shape.top)] if shape.base else []
    head += [bytes((scale,)), *(varint(2 * t if t >= 0 else -2 * t - 1) for t in taps)]
    return b"".join(head), _plan(shape, scale, from_last, taps), column


def form_of(shape: Lattice) -> int:
    """The byte ``form``: 0 plain, digits of base 10, or 64 + digits of base 2, drop included."""
    return {0: 0, 10: shape.digits, 2: 64 + shape.digits + shape.drop}[shape.base]


def form_of_grid(grid: Grid) -> int:
    base, digits = base_and_digits(grid)
    return form_of(Lattice(base, digits))


def scale_of(quarters: int) -> int:
    """The scale that a byte stands for: about 2^(q / 4)."""
    return 4 + (quarters & 3) << (quarters >> 2) >> 2


def _plan(shape: Lattice, scale: int, from_last: int, taps: Sequence[int]) -> Ints:
    plan = np.zeros(7 + MAX_TAPS, np.int64)
    fields = (shape.base, shape.digits, shape.drop, shape.top, scale_of(scale) << 4)
    plan[:7] = *fields, from_last, len(taps)
    plan[7 : 7 + len(taps)] = taps
    return plan


@cache
def _kernels() -> tuple[Any, Any]:
    from mcz.codecs import _lossless_kernels
    from mcz.coding import kernels

    return _lossless_kernels, kernels


@cache
def _start_state() -> Ints:
    """The state of a coder before its first bit; SPEC.md's annex has the numbers."""
    import json

    loops, coding = _kernels()
    table = json.loads(START_TABLE.read_text())
    state = np.zeros(coding.MODELS + 2 * loops.N_CONTEXTS, np.int64)
    state[coding.SQUASH : coding.SQUASH + 4096] = squash_table()
    state[coding.STRETCH : coding.STRETCH + 4096] = stretch_table()
    rates = rate_table()
    state[coding.RATES : coding.RATES + len(rates)] = rates
    state[coding.WEIGHTS : coding.WEIGHTS + len(table["weights"])] = table["weights"]
    probabilities = np.frombuffer(bytes.fromhex("".join(table["probabilities"])), "u1")
    state[coding.MODELS :: 2] = probabilities.astype(np.int64) * 256 + 128
    state[coding.MODELS + 1 :: 2] = np.frombuffer(bytes.fromhex("".join(table["counts"])), "u1")
    return state


@cache
def _powers() -> Ints:
    """Powers of 2, then of 10, up to where they stand for "too large", (2, 64)."""
    twos = [min(2**k, 2**62) for k in range(64)]
    return np.array([twos, [min(10**k, 10**18) for k in range(64)]], np.int64)


def _code(ordinals: Ints, plans: Sequence[Ints]) -> bytes:
    """The bits of the coded channels, at least one."""
    loops, coding = _kernels()
    rows = np.ascontiguousarray(ordinals)
    size = 4 * rows.size + 1024
    while True:
        data = np.zeros(size, np.uint8)
        state = _start_state().copy()
        coding.start(state, data, 1)
        fault = loops.code_rows(state, data, rows.copy(), np.stack(plans), _powers())
        used = coding.finish(state, data)
        if fault >= 0:
            raise AssertionError(f"lossless: row {fault} has no code")
        if used <= size:
            return data[:used].tobytes()
        size = used + 1024


def decode(
    header: bytes, layout: Layout, spans: Sequence[Span], request: Request, fetch: Fetch
) -> Ints:
    """Return the ordinals, int64 (rows, channels of the groups); raise FormatError on bad bytes."""
    refuse_extras("lossless", header, layout)
    readers = {
        index: _Segment(layout, span.n_frames * layout.samples_per_frame, partial(fetch, index, 0))
        for index, span in enumerate(spans)
        if span.first < request.stop and request.start < span.stop
    }
    return gather(layout, spans, request, lambda index, group: readers[index].group(group))


class _Segment:
    """The groups of one segment, decoded as they are asked for."""

    def __init__(self, layout: Layout, n_rows: int, stream: Callable[[int], bytes]) -> None:
        self.layout, self.n_rows, self.stream = layout, n_rows, stream
        self._done: dict[int, tuple[Ints, dict[int, tuple[int, int]]]] = {}

    def group(self, group: int) -> Ints:
        """The ordinals of one group, (n_rows, channels), its copies filled in."""
        columns, copies = self._own(group)
        for channel, (other, place) in copies.items():
            if not other < len(self.layout.groups) or not place < len(self.layout.groups[other]):
                raise FormatError(f"lossless: a copy of channel {place} of group {other}")
            source, others = self._own(other)
            if place in others:
                raise FormatError(f"lossless: a copy of a copy, channel {place} of group {other}")
            columns[:, channel] = source[:, place]
        return columns

    def _own(self, group: int) -> tuple[Ints, dict[int, tuple[int, int]]]:
        """The columns of a group that are no copies, and which are."""
        if group not in self._done:
            grids = [self.layout.grids[c] for c in self.layout.groups[group]]
            self._done[group] = _parse(self.stream(group), grids, self.n_rows)
        return self._done[group]


def _parse(
    stream: bytes, grids: Sequence[Grid], n_rows: int
) -> tuple[Ints, dict[int, tuple[int, int]]]:
    columns = np.zeros((n_rows, len(grids)), np.int64)
    copies: dict[int, tuple[int, int]] = {}
    plans, coded, units, at = [], [], {}, 0
    for channel, grid in enumerate(grids):
        kind, at = _byte(stream, at)
        if kind & 3 == CODED:
            plan, unit, at = _parse_coded(stream, at, kind, grid)
            if unit is not None:
                units[channel] = unit
            plans.append(plan)
            coded.append(channel)
        elif kind & 3 == CONSTANT:
            columns[:, channel], at = _parse_constant(stream, at, kind)
        elif kind == COPY:
            group, at = read_varint(stream, at)
            place, at = read_varint(stream, at)
            copies[channel] = group, place
        else:
            raise FormatError(f"lossless: channel {channel} is of kind {kind:#04x}")
    columns[:, coded] = _uncode(stream[at:], plans, n_rows)
    for channel, unit in units.items():
        columns[:, channel] = of_multiples(columns[:, channel], unit)
    return columns, copies


def _byte(stream: bytes, at: int) -> tuple[int, int]:
    if at >= len(stream):
        raise FormatError(f"lossless: the stream ends at {at}, in the head of a channel")
    return stream[at], at + 1


def _parse_constant(stream: bytes, at: int, kind: int) -> tuple[int, int]:
    size = kind >> 2
    if size > 8 or at + size > len(stream):
        raise FormatError(f"lossless: a constant of {size} bytes at {at}")
    folded = int.from_bytes(stream[at : at + size], "little")
    if size and stream[at + size - 1] == 0:
        raise FormatError(f"lossless: a constant of {size} bytes, the last of which is 0")
    return (folded >> 1) ^ -(folded & 1), at + size


def _parse_coded(stream: bytes, at: int, kind: int, grid: Grid) -> tuple[Ints, float | None, int]:
    """The plan of a coded channel, its unit if it has one, and the offset after its head."""
    form, drop, unit = form_of_grid(grid), 0, None
    if kind & OWN_FORM:
        form, at = _byte(stream, at)
        drop, at = _byte(stream, at)
    if form == MULTIPLES:
        unit, at = _parse_unit(stream, at)
    shape = _shape(form, drop)
    top = 0
    if shape.base:
        top, at = read_varint(stream, at)
    scale, at = _byte(stream, at)
    taps = []
    for _ in range(kind >> 3 & 15):
        folded, at = read_varint(stream, at)
        taps.append((folded >> 1) ^ -(folded & 1))
    if (
        (shape.base and top > max_top(shape))
        or len(taps) > MAX_TAPS
        or any(abs(t) > MAX_TAP for t in taps)
    ):
        raise FormatError(f"lossless: greatest class {top}, taps {taps}")
    if scale > MAX_SCALE:
        raise FormatError(f"lossless: scale {scale}")
    shape = Lattice(shape.base, shape.digits, drop, top)
    return _plan(shape, scale, kind >> 2 & 1, taps), unit, at


def _parse_unit(stream: bytes, at: int) -> tuple[float, int]:
    if at + 8 > len(stream):
        raise FormatError(f"lossless: the stream ends at {len(stream)}, in a unit")
    (unit,) = struct.unpack_from("<d", stream, at)
    if not 2.0**-200 <= unit <= 2.0**80:
        raise FormatError(f"lossless: a unit of {unit!r}")
    return unit, at + 8


def _shape(form: int, drop: int) -> Lattice:
    if (form == 0 and drop <= MAX_DROP) or (form == MULTIPLES and drop == 0):
        return Lattice(0, 0, drop)
    if 1 <= form <= 15 and drop == 0:
        return Lattice(10, form)
    if form in (64 + 24, 64 + 53) and drop <= form - 64 - 2:
        return Lattice(2, form - 64 - drop, drop)
    raise FormatError(f"lossless: form {form}, drop {drop}")


def _uncode(data: bytes, plans: Sequence[Ints], n_rows: int) -> Ints:
    """The ordinals of the coded channels, (n_rows, len(plans))."""
    if not plans:
        if data:
            raise FormatError(f"lossless: {len(data)} bytes follow the last channel")
        return np.empty((n_rows, 0), np.int64)
    loops, coding = _kernels()
    bits = np.frombuffer(data, np.uint8).copy()  # one kind of array, one compiled loop
    state = _start_state().copy()
    rows = np.zeros((n_rows, len(plans)), np.int64)
    coding.start(state, bits, 0)
    fault = loops.code_rows(state, bits, rows, np.stack(plans), _powers())
    if fault >= 0:
        raise FormatError(f"lossless: row {fault} cannot be decoded")
    if coding.coded_size(state) != len(bits):
        raise FormatError(
            f"lossless: {len(bits)} bytes, of which {coding.coded_size(state)} belong"
        )
    return rows


CODEC = Codec(
    id=1,
    name="lossless",
    version=0,
    domain="ordinals",
    lossless=True,
    encode=encode,
    decode=decode,
    delay=0,
    parameters=(
        Parameter(
            "segment_frames",
            0,
            "frames a segment; 0: as many as make about 62,000 bytes",
            integer("segment_frames", 0, MAX_ROWS),
        ),
    ),
)
