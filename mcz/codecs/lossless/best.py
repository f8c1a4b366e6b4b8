"""Codec 2, ``best``: the leads of fast, predicted by regressions that learn while they are used.

SPEC.md, "Codec 2: best", is normative; the names below are its field names.

Exactness: lossless and bit-exact. Predictions are binary64 in one stated order, of ``+ - * /`` and
rounding down alone; all else is integers. A signal is one group, so that each channel can be
predicted from those before it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.coding.fast import decode_kernels, residual_kernels, survey_kernels, write_kernels
from mcz.codecs.coding.fast.decoder import (
    MOST_ROWS,
    SegmentDecoder,
    Shape,
    check_size,
    read_segments,
)
from mcz.codecs.coding.fast.encoder import Plan, StreamBuilder
from mcz.codecs.coding.fast.lanes import fault_of
from mcz.codecs.coding.fast.residual_kernels import Predictors
from mcz.codecs.coding.forms import WITH_UNIT
from mcz.codecs.coding.streams import decode_stream, encode_stream, start_states
from mcz.codecs.contract import (
    Codec,
    Encoded,
    Fetch,
    Layout,
    RecodeRequest,
    Request,
    SignalSource,
    Span,
    refuse_extras,
)
from mcz.codecs.lossless import best_kernels
from mcz.codecs.lossless.best_kernels import Regressions, Rests
from mcz.codecs.lossless.echoes import (
    Echo,
    build_echoes,
    choose_references,
    echo_table,
    find_echoes,
    read_echoes,
)
from mcz.codecs.segments import Sizing, gather, lossless_segment_frames, segments_by_guess
from mcz.errors import FormatError
from mcz.model.numbers import Grid
from mcz.model.schema import varint
from mcz.model.threads import thread_limit
from mcz.model.types import Ints, Params

SIZING = Sizing(60_500, 65_000, value_bytes=1.5, most_rows=MOST_ROWS, spare=1, full=True)


def encode(source: SignalSource, params: Params) -> Encoded:
    """Encode the ordinals of ``source``; ``segment_frames`` 0 chooses lengths by size."""
    prepare = partial(_prepare, source)
    return Encoded(
        b"", segments_by_guess(source, params["segment_frames"], SIZING, prepare, thread_limit())
    )


def _prepare(source: SignalSource, start: int, stop: int) -> Callable[[], tuple[bytes, ...]]:
    layout, grids, ordinals = source.layout, source.grids(start), source.ordinals(start, stop)
    return lambda: tuple(build_stream(ordinals, grids, layout) for _ in layout.groups)


def recode(request: RecodeRequest) -> Iterator[tuple[bytes, ...]]:
    """Yield the streams of each segment with new values."""
    for span in request.spans:
        yield _prepare(request.source, span.first, span.stop)()


def decode(
    header: bytes, layout: Layout, spans: Sequence[Span], request: Request, fetch: Fetch
) -> Ints:
    """Return the ordinals, int64 (rows, channels of the groups); raise FormatError on bad bytes."""
    refuse_extras("best", header, layout)  # BEST-01
    if len(layout.groups) > 1:  # BEST-02
        raise FormatError(f"best: {len(layout.groups)} groups of channels are too many")
    shape = Shape(layout.grids, layout.groups)

    def rows(index: int, group: int) -> Ints:
        n_rows = spans[index].n_frames * layout.samples_per_frame
        check_size(n_rows, layout.n_channels, spans[index].n_frames)
        out = np.empty((n_rows, layout.n_channels), np.int64)
        read_stream(shape, fetch(index, 0, group), out)
        return out

    return gather(layout, spans, request, rows)


CODEC = Codec(
    id=2,
    name="best",
    version=0,
    domain="ordinals",
    lossless=True,
    grouping="all",
    encode=encode,
    decode=decode,
    recode=recode,
    parameters=(lossless_segment_frames("57,000", MOST_ROWS),),
)


Words = NDArray[np.int32]
Bytes = NDArray[np.uint8]

AS_FAST, PREDICTED, ECHOED = range(3)  # method
WORK_OF_BYTE, SPARE = 64, 1024  # references x rows a byte of stream may cost, after SPARE bytes


def build_stream(ordinals: Ints, grids: tuple[Grid, ...], layout: Layout) -> bytes:
    """Build the shortest stream; ``ordinals`` (rows, channels), ``grids`` in force."""
    builder = StreamBuilder(layout.grids, layout.groups)
    plan = builder.plan(ordinals, grids)
    streams: list[bytes] = []
    if len(plan.lanes.numbers):
        leads = np.ascontiguousarray(plan.lanes.leads.T)
        chosen = choose_references(leads, best_kernels.MOST_REFERENCES, best_kernels.MOST_IN_ALL)
        echoes = _usable_echoes(plan, leads)
        for repeated in ([], echoes) if echoes else ([],):
            stream = code_plan(plan, chosen, repeated)
            if _work(chosen, len(leads)) <= WORK_OF_BYTE * (len(stream) + SPARE):
                streams.append(stream)
    # Last, because it adds parents to the heads.
    streams.append(bytes((AS_FAST,)) + builder.write(plan)[0])
    return min(streams, key=len)


def _usable_echoes(plan: Plan, leads: Words) -> list[Echo]:
    """Find echoes in the lanes whose ordinals equal their leads and tails."""
    numbers = plan.lanes.numbers
    is_whole = plan.channels.plans[numbers, survey_kernels.LIMIT] < 0
    is_usable = is_whole & (plan.lanes.lattices[:, residual_kernels.REST] < 0)
    columns = plan.channels.numbers[numbers]
    return find_echoes(plan.channels.ordinals[:, columns], leads, np.flatnonzero(is_usable))


def _work(references: Sequence[Sequence[int]], n_rows: int) -> int:
    return (len(references) + sum(map(len, references))) * n_rows


def code_plan(plan: Plan, references: Sequence[Sequence[int]], echoes: Sequence[Echo]) -> bytes:
    """Build the stream of method 1, or 2 if there are echoes, for one or more lanes."""
    coded, columns = plan.lanes, plan.channels.columns
    n_lanes, n_rows = coded.leads.shape
    table = echo_table(echoes, n_rows, n_lanes)
    lanes = residual_kernels.predictors_of(n_lanes)
    lanes.first[:], lanes.scales[:] = coded.leads[:, 0], coded.scales
    taps = plan.channels.plans[
        coded.numbers, decode_kernels.TAPS : decode_kernels.TAPS + decode_kernels.N_TAPS
    ]
    lanes.behind[:] = np.diff(taps, axis=1, prepend=0, append=0).T
    leads = np.zeros((residual_kernels.BEHIND + n_rows, n_lanes), np.int32)
    leads[residual_kernels.BEHIND :] = coded.leads.T
    rests = best_kernels.Rests(
        np.zeros((n_rows, n_lanes), np.int32), coded.lattices[:, residual_kernels.REST].copy()
    )
    has_rests = rests.scales >= 0
    rests.values[:, has_rests] = columns[coded.numbers[has_rests]].T
    model = _Model(lanes, table, leads, rests)
    for row, chosen in zip(model.references, references, strict=True):
        row[: 1 + len(chosen)] = len(chosen), *chosen
    bits = encode_stream(
        start_states("best")[0], 4 * leads.size + 1024, model.run, "best: a segment"
    )
    residuals = (build_echoes(echoes) if echoes else b"") + bits
    buffer = np.empty(plan.most_bytes, np.uint8)
    n_bytes = write_kernels.write_heads(plan.channels, 0, plan.fields, buffer)
    heads = buffer[:n_bytes].tobytes()
    tails = buffer[: best_kernels.write_tails(coded, columns, table, buffer)].tobytes()
    method = bytes((ECHOED if echoes else PREDICTED,))
    return b"".join((method, heads, varint(len(residuals)), residuals, tails))


class _Model:
    """The state of a segment, and the loops that code it."""

    def __init__(self, lanes: Predictors, echoes: Ints, leads: Words, rests: Rests) -> None:
        self.lanes, self.echoes, self.leads, self.rests = lanes, echoes, leads, rests
        n_lanes, most = leads.shape[1], best_kernels.MOST_REFERENCES
        # for each lane the number of its references, then these
        self.references = np.zeros((n_lanes, 1 + most), np.int64)
        self.most_work: int | None = None  # of references x rows, for a decoder

    def run(self, state: Ints, data: Bytes) -> bool:
        """Code references, leads and rests in place; return False if one has no code."""
        total = best_kernels.code_references(state, data, self.references)
        if total < 0:
            return False
        work = (len(self.references) + total) * (len(self.leads) - residual_kernels.BEHIND)
        if self.most_work is not None and work > self.most_work:  # BEST-12
            raise FormatError("best: too many references for the size of the stream")
        args = state, data, self.lanes, self.references, self._regressions(), self.echoes
        with np.errstate(all="ignore"):  # an estimate may be NaN
            return bool(best_kernels.code_leads(*args, self.leads, self.rests) < 0)

    def _regressions(self) -> Regressions:
        sizes: list[int] = []
        for n in self.references[:, 0].tolist():
            sizes += best_kernels.n_linear(n), best_kernels.n_quadratic(n), best_kernels.N_BLENDED
        result: Regressions = best_kernels.regressions_of(sizes)
        return result


def read_stream(shape: Shape, stream: bytes, out: Ints) -> None:
    """Fill ``out`` (rows, channels) with the ordinals of a segment; raises FormatError."""
    if not stream or stream[0] > ECHOED:  # BEST-03
        raise FormatError(f"best: the method is {stream[:1].hex() or 'missing'}")
    decoder = SegmentDecoder(shape, (0,), lambda _: stream[1:], out, len(out))
    if stream[0] == AS_FAST:
        read_segments([decoder])
        return
    lanes = decoder.lanes
    n_lanes = len(lanes.columns)
    if n_lanes == 0:  # BEST-04
        raise FormatError("best: the method must be 0 if no channel is coded")
    if (lanes.predictors.parents >= 0).any():  # BEST-05
        raise FormatError("best: no channel may have a parent")
    (start, stop), (tail, end) = lanes.residuals[0] // 8, lanes.tails[0]
    bits = lanes.data[start:stop].tobytes()
    rests = best_kernels.Rests(
        np.zeros((len(out), n_lanes), np.int32), lanes.lattices[:, residual_kernels.REST].copy()
    )
    lanes.lattices[:, residual_kernels.REST] = -1  # tails have none
    echoes: list[Echo] = []
    if stream[0] == ECHOED:
        echoes, at = read_echoes(bits, len(out), (rests.scales < 0).tolist())
        bits = bits[at:]
    table = echo_table(echoes, len(out), n_lanes)
    lanes.leads[:] = 0
    model = _Model(lanes.predictors, table, lanes.leads, rests)
    model.most_work = WORK_OF_BYTE * (len(stream) + SPARE)
    start = start_states("best")[0]  # BEST-06
    decode_stream(bits, start, model.run, "best: the residuals", whole=True)  # BEST-07
    tails = residual_kernels.Tails(
        lanes.data, np.array([tail]), np.array([end]), lanes.starts, lanes.columns
    )
    leads = lanes.leads[residual_kernels.BEHIND :]
    exact = _exact_echoes(table, decoder)
    fault = best_kernels.read_ordinals(tails, lanes.lattices, leads, exact, decoder.rows)
    if fault != -1:
        raise fault_of("tails", "lane", fault)
    for lane in np.flatnonzero(rests.scales >= 0).tolist():
        decoder.rows[:, lanes.columns[lane]] = rests.values[:, lane]
    decoder.finish()


def _exact_echoes(table: Ints, decoder: SegmentDecoder) -> Ints:
    """``table`` without channels in units, whose ordinals are their leads and need no echo."""
    forms = decoder.heads.plans[decoder.lanes.columns, decode_kernels.FORM]
    return np.where(np.isin(forms, WITH_UNIT), 0, table)
