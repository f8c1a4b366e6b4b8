"""One signal of a clip: its description, and decoding a range of its frames."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from threading import Lock

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.contract import Request, Span
from mcz.codecs.known_answers import check_known_answer
from mcz.container.caches import MOST_OF_ONE, Run
from mcz.container.limits import check_decoded
from mcz.container.reader import Container
from mcz.container.segments import (
    FRESH,
    GROUP_NOTES,
    MASKS,
    Noted,
    ParsedNotes,
    StreamTable,
    parse_group_notes,
    parse_mask,
    values_of_exceptions,
)
from mcz.errors import FormatError, MczError
from mcz.files.reading.signal_info import SignalInfo, salvage
from mcz.kernels import lacks_compiled_kernels
from mcz.model.checks import merged_ranges
from mcz.model.motion import Exceptions, Signal
from mcz.model.numbers import Grid, GridKind, values_of
from mcz.model.threads import map_in_order, thread_limit, timing, useful_threads
from mcz.model.types import Values

BLOCK_ROWS = 1024  # decoded at a time, at least
BARE_BLOCK_ROWS = 4096  # without compiled kernels: numpy is faster with several segments at a time
NEIGHBORS = 4  # segments whose streams are kept for a thread


@dataclass(frozen=True, slots=True)
class Block:
    """Frames start <= f < stop: decoded values, and mask (None: all valid)."""

    start: int
    stop: int
    coded: Values
    values: Values
    mask: NDArray[np.bool_] | None


class SignalReader:
    """Decodes a range of stored frames of some groups, each stream fetched once."""

    def __init__(
        self,
        container: Container,
        info: SignalInfo,
        groups: tuple[int, ...] | None,
        resolution: int,
        name: str,
    ) -> None:
        """``groups``: None for all."""
        self.container = container
        self.info = info
        self.groups = tuple(range(info.counts.n_groups)) if groups is None else groups
        self.resolution, self.name = resolution, name
        self._cache: dict[int, tuple[StreamTable, dict[int, bytes]]] = {}
        self._read_ones: set[int] = set()  # segments
        self._lock = Lock()  # of both
        self._threads = container.threads or thread_limit()
        layout = info.layout
        if groups is None:
            self._columns, self._grids = info.columns, info.coded_grids
        else:
            self._columns = [c for group in groups for c in layout.groups[group]]
            self._grids = tuple(layout.grids[c] for c in self._columns)

    def signal(self, start: int, stop: int) -> Signal:
        """All groups as a Signal, decoded once."""
        info = self.info
        exceptions, changes = self.exceptions(start, stop)
        grids = (*info.grids, *(grid for _, _, grid in changes))
        binary = not info.is_integer and any(not grid.is_text for grid in grids)
        keep = binary and info.codec.domain == "ordinals" and not self.container.salvage
        ordinals = np.empty(self._shape(start, stop), np.int64) if keep else None
        values, mask = self.read(start, stop, ordinals)
        per_frame = info.layout.samples_per_frame
        signal = Signal(values, info.grids, info.name, per_frame, mask, exceptions, changes)
        return replace(
            signal, channels=info.channels, ordinals=ordinals, role=info.role, of=info.of
        )

    def read(
        self, start: int, stop: int, ordinals: NDArray[np.int64] | None = None
    ) -> tuple[Values, NDArray[np.bool_] | None]:
        """Values and mask of frames start <= f < stop; ``ordinals`` gets decoded ordinals."""
        if self.container.salvage:
            return self._salvage(self._prepare(start, stop), start, stop)
        self._check_size(start, stop)
        near = ordinals is None and not self.container.reads_parts
        return self._join(self._near_blocks if near else self.blocks, start, stop, ordinals)

    def _join(
        self,
        blocks: Callable[[int, int, Values], Iterator[Block]],
        start: int,
        stop: int,
        ordinals: NDArray[np.int64] | None = None,
    ) -> tuple[Values, NDArray[np.bool_] | None]:
        """Values and mask of all blocks of the range; see ``read``."""
        kind = np.int64 if self.info.is_integer else np.float64
        values: Values = np.empty(self._shape(start, stop), kind)
        mask: NDArray[np.bool_] | None = None
        for block in blocks(start, stop, values):
            rows = self._rows(start, block.start, block.stop)
            if block.values.base is not values:
                values[rows] = block.values
            if ordinals is not None:
                ordinals[rows] = block.coded
            if block.mask is not None:
                mask = np.ones(values.shape, np.bool_) if mask is None else mask
                mask[rows] = block.mask
        return values, mask

    def _shape(self, start: int, stop: int) -> tuple[int, int]:
        return (stop - start) * self.info.samples_per_frame, len(self._columns)

    def _rows(self, base: int, start: int, stop: int) -> slice:
        """The rows of frames start <= f < stop in an array that begins with frame ``base``."""
        per_frame = self.info.samples_per_frame
        return slice((start - base) * per_frame, (stop - base) * per_frame)

    def blocks(self, start: int, stop: int, out: Values | None = None) -> Iterator[Block]:
        """Yield the values block by block; ``out`` may have those of all rows already."""
        spans = self._prepare(start, stop)
        if start == stop:  # the header has to be right all the same (CODEC-05)
            self._decode(spans, start, stop)
        name = self.info.codec.name

        def block(ends: tuple[int, int]) -> Block:
            a, b = ends
            own = None if out is None or self.info.is_integer else out[self._rows(start, a, b)]
            with timing(name, math.prod(self._shape(a, b))):
                coded = self._decode(spans, a, b)
                return Block(a, b, coded, *self._finish(coded, a, b, own))

        threads = useful_threads(name, math.prod(self._shape(start, stop)), self._threads)
        yield from map_in_order(block, list(self._ranges(start, stop)), threads)

    def _near_blocks(self, start: int, stop: int, out: Values) -> Iterator[Block]:
        """``blocks``; a run that the range overlaps is decoded whole, and kept."""
        at = start
        if start < stop:
            run = self._run(start)
            if run is not None and (run[0] < start or stop < run[1]):
                at = min(run[1], stop)
                yield from self._cut(run, start, at)
        if at < stop:
            run = self._run(stop - 1)
            if run is not None and stop < run[1]:
                if at < run[0]:
                    yield from self.blocks(at, run[0], out[self._rows(start, at, stop)])
                at = stop
                yield from self._cut(run, run[0], stop)
        if at < stop or start == stop:
            yield from self.blocks(at, stop, out[self._rows(start, at, stop)])

    def _run(self, frame: int) -> tuple[int, int] | None:
        """Decode shown frames that depend on each other; None if they are too many to cache."""
        info, rows = self.info, self.info.rows
        per_frame = math.prod(self._shape(0, 1)) * 8
        most = min(MOST_OF_ONE, self.container.max_decoded) // max(per_frame, 1)
        first = last = info.covering(frame, frame + 1)[0]
        while (
            first
            and not rows[first].header.flags & FRESH
            and frame - rows[first].header.first < most
        ):
            first -= 1
        while last + 1 < len(rows) and not rows[last + 1].header.flags & FRESH:
            last += 1
            if rows[last].header.stop - frame > most:
                return None
        start = max(rows[first].header.first, info.skip)
        stop = min(rows[last].header.stop, info.layout.n_frames - info.spare)
        return (start, stop) if stop - start <= most else None

    def _cut(self, run: tuple[int, int], start: int, stop: int) -> Iterator[Block]:
        """Frames of a run; if not cached, the whole run is decoded where that pays."""
        rows = self.info.covering(run[0], run[0] + 1)
        key = self.info.rows[rows[0]].offset, self.groups, self.resolution
        decoded = self.container.runs.get(key)
        if decoded is None:
            size = 8 * math.prod(self._shape(*run))
            if self.info.codec.by_rows and not self.container.runs.is_worthwhile(key, size):
                yield from self.blocks(start, stop)
                return
            try:
                values, mask = self._join(self.blocks, *run)
            except MczError:  # perhaps of a segment that these frames do not need
                yield from self.blocks(start, stop)
                return
            decoded = Run(run[0], values, mask)
            self.container.runs.put(key, decoded)
        cut = self._rows(run[0], start, stop)
        mask = None if decoded.mask is None else decoded.mask[cut]
        yield Block(start, stop, decoded.values[cut], decoded.values[cut], mask)

    def _ranges(self, start: int, stop: int) -> Iterator[tuple[int, int]]:
        """The range in blocks of a few segments, to bound the additional memory."""
        rows = self.info.rows
        least = BARE_BLOCK_ROWS if lacks_compiled_kernels() else BLOCK_ROWS
        for index in self.info.covering(start, stop):
            end = min(rows[index].header.stop, stop)
            full = (end - start) * self.info.layout.samples_per_frame >= least
            # A block that began within a dependent run would be decoded from its start.
            if full and index + 1 < len(rows) and rows[index + 1].header.flags & FRESH:
                yield start, end
                start = end
        if start < stop:
            yield start, stop

    def _decode(self, spans: Sequence[Span], start: int, stop: int) -> Values:
        of_ordinals = self.info.exact
        exact = tuple(group for group in self.groups if group in of_ordinals)
        if not exact:
            return self._decode_groups(self.groups, spans, start, stop)
        lossy = tuple(group for group in self.groups if group not in exact)
        layout = self.info.layout
        is_exact = np.isin(self._columns, [c for group in exact for c in layout.groups[group]])
        values = np.empty(self._shape(start, stop))
        if lossy:
            values[:, ~is_exact] = self._decode_groups(lossy, spans, start, stop)
        number = {int(column): n for n, column in enumerate(np.flatnonzero(is_exact))}
        changes = self.exceptions(start, stop, self._columns)[1]
        values[:, is_exact] = values_of(  # CODEC-06
            self._decode_groups(exact, spans, start, stop),
            [self._grids[column] for column in number],
            [(row, number[column], grid) for row, column, grid in changes if column in number],
        )
        return values

    def _decode_groups(
        self, groups: tuple[int, ...], spans: Sequence[Span], start: int, stop: int
    ) -> Values:
        check_known_answer(self.info.codec)
        return self.info.codec.decode(
            self.info.header,
            self.info.layout,
            spans,
            Request(start, stop, groups, self.resolution),
            self.fetch,
        )

    def _prepare(self, start: int, stop: int) -> list[Span]:
        """The spans of all segments, after a check of the limit and a read of near ones."""
        self._check_size(start, stop)
        info = self.info
        covering = info.covering(start, stop)
        self.container.source.read_ahead(
            (info.rows[i].chunk().offset, info.rows[i].chunk().size)
            for i in covering
            if not info.rows[i].packet and not self.container.in_part(info.rows[i])
        )
        return info.spans

    def _check_size(self, start: int, stop: int) -> None:
        n_rows, n_columns = self._shape(start, stop)
        size = 8 * n_rows * max(1, n_columns)
        check_decoded(f"clip {self.name!r}: values", size, self.container.max_decoded)

    def _salvage(
        self, spans: Sequence[Span], start: int, stop: int
    ) -> tuple[Values, NDArray[np.bool_]]:
        shape = self._shape(start, stop)
        values = np.zeros(shape, np.int64) if self.info.is_integer else np.full(shape, np.nan)
        mask = np.zeros(shape, np.bool_)

        def rescue(a: int, b: int) -> None:
            part, valid = self._finish(self._decode(spans, a, b), a, b)
            rows = self._rows(start, a, b)
            values[rows], mask[rows] = part, True if valid is None else valid

        salvage(spans, self.info.covering(start, stop), (start, stop), rescue, self._complain)
        return values, mask

    def whole_runs(self, start: int, stop: int) -> list[tuple[int, int]]:
        """The runs of the stored frames start <= f < stop that can be decoded."""
        spans, runs = self._prepare(start, stop), []

        def rescue(a: int, b: int) -> None:
            self._finish(self._decode(spans, a, b), a, b)
            runs.append((a, b))

        salvage(spans, self.info.covering(start, stop), (start, stop), rescue, lambda *_: None)
        return merged_ranges(runs)

    def _complain(self, start: int, stop: int, reason: object) -> None:
        self.container.damage.append(f"clip {self.name!r}, frames {start}:{stop}: {reason}")

    def fetch(self, segment: int, resolution: int, group: int) -> bytes:
        table, streams = self._cache.get(segment) or self._streams(segment)
        index = table.codec(resolution, group)
        if index not in streams:  # a group that another depends upon
            with self._lock:
                row = self.info.rows[segment]
                streams.update(self.container.streams(row, table.counts, [index], table)[1])
        return streams[index]

    def _streams(self, segment: int) -> tuple[StreamTable, dict[int, bytes]]:
        with self._lock:
            streams = self._cache.get(segment)
            if streams is None:
                streams = self._cache[segment] = self._fetch_segment(segment)
                self._read_ones.add(segment)
                while len(self._cache) > NEIGHBORS * self._threads:  # bounds the memory
                    self._cache.pop(next(iter(self._cache)))
            return streams

    def _fetch_segment(self, segment: int) -> tuple[StreamTable, dict[int, bytes]]:
        row, counts = self.info.rows[segment], self.info.counts
        is_all = len(self.groups) == counts.n_groups and not self.resolution
        if is_all or not self.container.in_part(row):
            return self.container.streams(row, counts, None)
        table = self.container.table(row, counts)
        stored = range(counts.n_resolutions - self.resolution)
        indices = [table.codec(r, g) for r in stored for g in self.groups]
        for stream_of in (table.group_notes, table.mask):
            indices += [i for i in map(stream_of, self.groups) if i is not None]
        return self.container.streams(row, counts, indices, table)

    def _finish(
        self, coded: Values, start: int, stop: int, out: Values | None = None
    ) -> tuple[Values, NDArray[np.bool_] | None]:
        """Convert ordinals to values, in ``out`` if given; add exceptions and masks."""
        for index in self.info.covering(start, stop):
            if index not in self._read_ones:  # the codec did not read it: check it now
                self._streams(index)
        exceptions, changes = self.exceptions(start, stop, self._columns)
        values = coded
        if self.info.is_integer:
            if self.info.codec.domain == "values":  # CODEC-01
                raise FormatError(
                    f"signal {self.info.name!r} is of integers, which codec "
                    f"{self.info.codec.name} does not support",
                    clip=self.name,
                )
            Grid(GridKind.INTEGER).magnitudes(coded)  # refuses ordinals out of range
        if self.info.codec.domain == "ordinals" and not self.info.is_integer:
            values = values_of(coded, self._grids, changes, out)  # NOTES-09
        if len(exceptions):  # NOTES-10
            values[exceptions.rows, exceptions.channels] = values_of_exceptions(
                exceptions.texts, self.name
            )
        return values, self._mask(start, stop)  # MASK-04

    def exceptions(
        self, start: int, stop: int, columns: Sequence[int] | None = None
    ) -> tuple[Exceptions, tuple[tuple[int, int, Grid], ...]]:
        """Exceptions and grid changes of the range, rows from its start.

        Channels are numbered as in ``columns``, by default as in the signal.
        """
        layout, per_frame = self.info.layout, self.info.layout.samples_per_frame
        covering = self.info.covering(start, stop)
        if not any(self.info.rows[index].header.flags & GROUP_NOTES for index in covering):
            return Exceptions(), ()  # no notes, and the grids of the clip
        of_signal = range(layout.n_channels) if columns is None else columns
        column = {channel: number for number, channel in enumerate(of_signal)}
        noted = Noted([layout.grids[channel] for channel in column], (stop - start) * per_frame)
        for index in covering:
            row = self.info.rows[index]
            shift = (row.header.first - start) * per_frame
            noted.begin(shift)
            if not row.header.flags & GROUP_NOTES:
                continue
            for group in self.groups:
                notes = self._group_notes(index, group)
                # NOTES-07
                if self.info.is_integer and any(g.kind != GridKind.INTEGER for _, g in notes[0]):
                    raise FormatError("integers must not change their grid", clip=self.name)
                noted.add(shift, [column[c] for c in layout.groups[group]], notes)
        return noted.exceptions(), noted.grid_changes()

    def _group_notes(self, index: int, group: int) -> ParsedNotes:
        table, streams = self._streams(index)
        at = table.group_notes(group)
        layout = self.info.layout
        return parse_group_notes(
            streams[at] if at is not None else b"",
            self.info.rows[index].header.n_frames * layout.samples_per_frame,
            [layout.grids[channel] for channel in layout.groups[group]],
            self.name,
        )

    def _mask(self, start: int, stop: int) -> NDArray[np.bool_] | None:
        layout, per_frame = self.info.layout, self.info.samples_per_frame
        mask: NDArray[np.bool_] | None = None
        for index in self.info.covering(start, stop):
            header = self.info.rows[index].header
            if not header.flags & MASKS:
                continue  # all of it is valid
            table, streams = self._streams(index)
            a, b = max(start, header.first), min(stop, header.stop)
            rows, cut = self._rows(start, a, b), self._rows(header.first, a, b)
            at = 0
            for group in self.groups:
                n = len(layout.groups[group])
                data = streams[table.mask(group) or 0]
                if data:
                    if mask is None:
                        mask = np.ones(self._shape(start, stop), np.bool_)
                    bits = parse_mask(data, header.n_frames * per_frame, n, self.name)
                    mask[rows, at : at + n] = bits[cut]
                at += n
        return mask
