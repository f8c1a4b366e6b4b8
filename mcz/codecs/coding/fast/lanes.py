"""The coded channels of segments, decoded by kernels or, if none are compiled, by numpy.

SPEC.md, "Codec 1: fast", is normative. numpy decodes the streams of several segments together, row
by row, so that each operation works on all of them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.coding.fast import residual_kernels as residual
from mcz.codecs.coding.fast import residual_kernels as tail
from mcz.codecs.coding.fast.residual_kernels import Predictors
from mcz.errors import FormatError
from mcz.kernels import lacks_compiled_kernels
from mcz.model.types import Bools, Ints

Words = NDArray[np.uint64]

ONE = np.uint64(1)
ZEROS = np.array([8, *((n & -n).bit_length() - 1 for n in range(1, 256))])  # below the lowest 1
MASKS = np.array([(1 << n) - 1 for n in range(64)], np.uint64)
POWERS = np.array(tail.POWERS)
FEWEST_BITS, FIRST_LONG, LONGER = map(np.array, (tail.FEWEST_BITS, tail.FIRST_LONG, tail.LONGER))
NEVER = 1 << 62  # a least long tail, if there are none


@dataclass(frozen=True, slots=True)
class Lanes:
    """The coded channels of a segment, or of its first rows, ready to be decoded.

    ``starts``: the first lane of each group whose residuals are read, and the number of all;
    ``columns``: the channels of lanes. Tails are of groups that are read whole.
    """

    data: NDArray[np.uint8]
    residuals: Ints  # (groups, 2): the first bit, and the one after the last
    tails: Ints
    starts: Ints
    columns: Ints
    predictors: Predictors
    lattices: Ints
    leads: NDArray[np.int32]  # (BEHIND + rows, lanes), filled by the decoder
    out: Ints  # (rows, channels), so are the columns of lanes
    is_whole: bool  # these are all rows of the segment


def read_all(segments: Sequence[Lanes]) -> None:
    """Fill the columns of the lanes of segments; raises FormatError for bad bytes."""
    if not lacks_compiled_kernels():
        for lanes in segments:
            _read_compiled(lanes)
    elif batch := [lanes for lanes in segments if len(lanes.columns)]:
        _read_leads(batch)
        _read_tails(batch)


def _read_compiled(lanes: Lanes) -> None:
    """Fill the columns of the lanes of one segment; raises FormatError."""
    bits, ends = np.ascontiguousarray(lanes.residuals.T)
    fault = residual.read_leads(lanes.data, bits, ends, lanes.starts, lanes.predictors, lanes.leads)
    if fault >= 0 or (fault < -1 and lanes.is_whole):
        raise fault_of("residuals", "row", fault)
    bits, ends = np.ascontiguousarray(lanes.tails.T)
    tails = tail.Tails(lanes.data, bits, ends, lanes.starts, lanes.columns)
    fault = tail.read_ordinals(tails, lanes.lattices, lanes.leads[residual.BEHIND :], lanes.out)
    if fault >= 0 or (fault < -1 and lanes.is_whole):
        raise fault_of("tails", "lane", fault)


def fault_of(part: str, unit: str, fault: int) -> FormatError:
    """The error of ``read_leads`` or ``read_ordinals``."""
    if fault < -1:
        return FormatError(f"fast: unused bits in the {part}, group {-2 - fault} of those read")
    return FormatError(f"fast: {unit} {fault} of the {part} is not a valid code")


@dataclass(slots=True)
class Streams:
    """Bits of many streams, those of most lanes first.

    ``data`` has the eight bytes from each offset on; ``rows``: those of their segments; ``lanes``:
    the first, the second and so on of their streams, of all segments.
    """

    data: Words
    bits: Ints
    ends: Ints
    rows: Ints
    lanes: list[Ints]

    def words(self, n: int) -> Words:
        """The next bits of the first ``n`` streams."""
        bits = self.bits[:n]
        words = self.data[np.minimum(bits >> 3, len(self.data) - 1)]
        return _shift_words(words, bits & 7)

    def check(self, part: str) -> None:
        """Raise FormatError if bits are left or missing."""
        left = self.ends - self.bits
        rest = self.words(len(left)) & MASKS[np.clip(left, 0, 63)]
        if ((left < 0) | (left > 7) | (rest != 0)).any():  # FAST-20
            raise FormatError(f"fast: unused or missing bits in the {part}")

    def with_more_rows(self, n_rows: int) -> Streams:
        """Streams of segments with more rows."""
        kept = self.rows > n_rows
        lanes = [own[kept[: len(own)]] for own in self.lanes]
        lanes = [own for own in lanes if len(own)]
        return Streams(self.data, self.bits[kept], self.ends[kept], self.rows[kept], lanes)

    def with_rows(self, n_rows: int) -> Streams:
        """Streams of segments with this many rows."""
        own = self.rows == n_rows
        return Streams(self.data, self.bits[own], self.ends[own], self.rows[own], [])


def _streams(batch: Sequence[Lanes], parts: Callable[[Lanes], Ints], mask: Bools) -> Streams:
    """The streams of a part of all groups, and their lanes in ``mask``."""
    bits, ends, rows, own = [], [], [], []
    at = first = 0
    for lanes in batch:
        for group, (bit, end) in enumerate(parts(lanes).tolist()):
            lane = np.arange(first + lanes.starts[group], first + lanes.starts[group + 1])
            bits.append(8 * at + bit)
            ends.append(8 * at + end)
            rows.append(len(lanes.out))
            own.append(lane[mask[lane]])
        at += len(lanes.data)
        first += len(lanes.columns)
    order = sorted(range(len(own)), key=lambda n: -len(own[n]))
    data = np.concatenate([lanes.data for lanes in batch])
    windows = np.ndarray((len(data) - 7,), "<u8", data, strides=(1,)).astype(np.uint64)
    most = len(own[order[0]])
    nth = [np.array([own[n][at] for n in order if len(own[n]) > at]) for at in range(most)]
    begins, stops, n_rows = (np.array(items)[order] for items in (bits, ends, rows))
    return Streams(windows, begins, stops, n_rows, nth)


def _concatenate(
    batch: Sequence[Lanes], field: Callable[[Lanes], NDArray[np.signedinteger]]
) -> Ints:
    return np.concatenate([field(lanes).astype(np.int64) for lanes in batch], axis=-1)


def _read_leads(batch: Sequence[Lanes]) -> None:
    lengths = {len(lanes.out) for lanes in batch}
    sizes = [len(lanes.columns) for lanes in batch]
    every = np.ones(sum(sizes), np.bool_)
    streams = _streams(batch, lambda lanes: lanes.residuals, every)
    scales = _concatenate(batch, lambda lanes: lanes.predictors.scales)
    behind = _concatenate(batch, lambda lanes: lanes.predictors.behind)[::-1]
    weights = _concatenate(batch, lambda lanes: lanes.predictors.weights)
    firsts = np.repeat(np.cumsum([0, *sizes[:-1]]), sizes)
    parents = _concatenate(batch, lambda lanes: lanes.predictors.parents)
    weights[parents < 0] = 0
    parents = np.where(parents < 0, 0, parents + firsts)
    leads = np.empty((residual.BEHIND + max(lengths), len(scales)), np.int64)
    leads[: residual.BEHIND + 1] = _concatenate(batch, lambda lanes: lanes.predictors.first)
    residuals = np.zeros(len(scales), np.int64)
    for row in range(residual.BEHIND + 1, len(leads)):
        # present values of lanes of these segments are not used
        if row - residual.BEHIND in lengths:
            streams.with_rows(row - residual.BEHIND).check("residuals")
            streams = streams.with_more_rows(row - residual.BEHIND)
        for lanes in streams.lanes:
            residuals[lanes], scales[lanes] = _read_codes(streams, scales[lanes])
        if (streams.bits > streams.ends).any():
            raise fault_of("residuals", "row", row - residual.BEHIND)
        sums = (leads[row - residual.BEHIND : row] * behind).sum(axis=0) + 16
        crossed = (128 + weights * residuals[parents]).astype(np.int32) >> 8
        lead = leads[row - 1] + (sums.astype(np.int32) >> 5) + residuals + crossed
        leads[row] = lead.astype(np.int32)
    streams.check("residuals")
    first = 0
    for own in batch:
        own.leads[:] = leads[: len(own.leads), first : first + len(own.columns)]
        first += len(own.columns)


def _read_codes(streams: Streams, scales: Ints) -> tuple[Ints, Ints]:
    """One residual of each of the first streams, and their scales after it."""
    words = streams.words(len(scales))
    k = np.frexp((scales >> 4).astype(np.float64))[1].astype(np.int64)
    zeros = ZEROS[(words & np.uint64(255)).astype(np.int64)]
    folded = (zeros << k) | (_shift_words(words, zeros + 1) & MASKS[k]).astype(np.int64)
    sizes = zeros + 1 + k
    for at in np.flatnonzero(zeros == residual.PLAIN + 1).tolist():  # they are rare
        folded[at], sizes[at] = _read_long(streams, at, int(words[at]), int(k[at]))
    streams.bits[: len(scales)] += sizes
    half, odd = folded >> 1, folded & 1
    growth = (16 * np.minimum(half + odd, residual.MOST_SIZE) - scales) >> 2
    return (half ^ -odd).astype(np.int32).astype(np.int64), scales + growth


def _shift_words(words: Words, n: Ints) -> Words:
    return np.right_shift(words, n.astype(np.uint64))


def _read_long(streams: Streams, at: int, word: int, k: int) -> tuple[int, int]:
    """The number of a code with more zeros, and the bits of the code."""
    zeros = (word & -word).bit_length() - 1 if word else 64
    more = k + zeros - residual.PLAIN
    if more > residual.MOST_BITS:  # FAST-40
        raise fault_of("residuals", "stream", at)
    bit = int(streams.bits[at]) + zeros + 1
    behind = int(streams.data[min(bit >> 3, len(streams.data) - 1)]) >> (bit & 7)
    folded = (6 + (1 << (zeros - residual.PLAIN)) << k) + (behind & (1 << more) - 1)
    if folded >> 32:  # FAST-40, FAST-41
        raise fault_of("residuals", "stream", at)
    return folded, zeros + 1 + more


def _read_tails(batch: Sequence[Lanes]) -> None:
    """Fill the columns of lanes; groups with other tails than digits are decoded as by kernels."""
    for lanes in batch:
        for lane in range(len(lanes.lattices)):
            tail.derive_fields(lanes.lattices, lane)
    lattices = np.concatenate([lanes.lattices for lanes in batch])
    is_odd = (lattices[:, tail.DIGITS] > 9) & (lattices[:, tail.BASE] == 10)
    is_odd |= (lattices[:, tail.TINY] > 0) | (lattices[:, tail.REST] >= 0)
    first = 0
    for lanes in batch:
        for group in range(len(lanes.tails)):
            own = slice(*(first + lanes.starts[group : group + 2]).tolist())
            if is_odd[own].any():
                is_odd[own] = True
                _read_as_kernel(lanes, group)
        is_odd[first + lanes.starts[len(lanes.tails)] : first + len(lanes.columns)] = True
        first += len(lanes.columns)
    if is_odd.all():
        return
    ordinals = _read_digits(batch, lattices, ~is_odd)
    first = 0
    for lanes in batch:
        usual = np.flatnonzero(~is_odd[first : first + len(lanes.columns)])
        lanes.out[:, lanes.columns[usual]] = ordinals[: len(lanes.out), first + usual]
        first += len(lanes.columns)


def _read_as_kernel(lanes: Lanes, group: int) -> None:
    bits, ends = np.ascontiguousarray(lanes.tails[group : group + 1].T)
    tails = tail.Tails(lanes.data, bits, ends, lanes.starts[group : group + 2], lanes.columns)
    leads = lanes.leads[residual.BEHIND :]
    fault = tail.read_ordinals(tails, lanes.lattices, leads, lanes.out)
    if fault != -1:
        raise fault_of("tails", "lane", fault)


def _read_digits(batch: Sequence[Lanes], lattices: Ints, usual: Bools) -> Ints:
    """The ordinals of lanes whose tails are digits of one base, ``usual``: (rows, lanes)."""
    leads = np.zeros((max(len(lanes.out) for lanes in batch), len(lattices)), np.int64)
    wanted = np.zeros(leads.shape, np.bool_)
    first = 0
    for lanes in batch:
        rows, own = len(lanes.out), slice(first, first + len(lanes.columns))
        leads[:rows, own], wanted[:rows, own] = lanes.leads[residual.BEHIND :], usual[own]
        first += len(lanes.columns)
    base, leading = lattices[:, tail.BASE], lattices[:, tail.LEADING]
    minus = np.where(base > 0, leads >> 31, 0)
    sizes = leads ^ minus
    decimal = np.searchsorted(POWERS, sizes, "right")
    digits = np.where(base == 10, decimal, np.frexp(sizes.astype(np.float64))[1])
    numbers = lattices[:, tail.TOP] - leading + digits
    is_bad = (digits > leading) | ((numbers < 0) & (sizes > 0))
    if (is_bad & (base > 0) & wanted).any():  # FAST-43, FAST-44
        raise fault_of("tails", "lane", int(np.argwhere(is_bad & (base > 0) & wanted)[0, 1]))
    n = np.where((base > 0) & (sizes > 0) & wanted, lattices[:, tail.DIGITS] - digits, 0)
    tens = np.where(base == 10, n, 0)
    bits = np.where(base == 10, FEWEST_BITS[tens], np.where(base == 2, n, lattices[:, tail.DROP]))
    bits = np.where(((base == 10) & (sizes == 0)) | ~wanted, 0, bits)
    long = np.where((base == 10) & (n > 0), FIRST_LONG[tens], NEVER)
    streams = _streams(batch, lambda lanes: lanes.tails, usual & (bits.max(axis=0) > 0))
    tails = _read_bits(streams, bits, long, LONGER[tens])
    mantissas = np.where(base == 10, sizes * POWERS[tens], sizes << np.where(base == 2, n, 0))
    magnitudes = numbers * lattices[:, tail.PER_CLASS] + mantissas + tails
    magnitudes += lattices[:, tail.FIRST] - lattices[:, tail.LOW]
    magnitudes = np.where(sizes > 0, magnitudes << lattices[:, tail.DROP], 0)
    plain = (leads << np.where(base == 0, lattices[:, tail.DROP], 0)) | tails
    return np.where(base > 0, magnitudes ^ minus, plain)


def _read_bits(streams: Streams, bits: Ints, long: Ints, longer: Ints) -> Ints:
    """Numbers of ``bits``, from ``long`` on with a bit more, plus ``longer``; (rows, lanes)."""
    numbers = np.zeros_like(bits)
    steps = [
        (lanes, bits[:, lanes], MASKS[bits[:, lanes]], long[:, lanes].astype(np.uint64))
        for lanes in streams.lanes
    ]
    for row in range(len(bits)):
        for lanes, own_bits, masks, least in steps:
            words = streams.words(len(lanes))
            values = words & masks[row]
            is_long = values >= least[row]
            more = (_shift_words(words, own_bits[row]) & ONE).astype(np.int64) * is_long
            numbers[row, lanes] = values.astype(np.int64) + more * longer[row, lanes]
            streams.bits[: len(lanes)] += own_bits[row] + is_long
    if (streams.bits > streams.ends).any():
        raise fault_of("tails", "row", len(bits))
    streams.check("tails")
    return numbers
