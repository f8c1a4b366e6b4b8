"""One signal of a clip: its description, and decoding a range of its frames.

Part of the joint between motion, codec and container (see ``file.py``).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.base import Request, Span
from mcz.container import payloads
from mcz.container.limits import check_decoded
from mcz.container.packets import SHORT
from mcz.container.reader import Container
from mcz.container.segments import FRESH, StreamTable
from mcz.errors import FormatError
from mcz.files.masks import parse_mask
from mcz.files.salvage import salvage
from mcz.files.signal_info import SignalInfo
from mcz.motion import Exceptions, grid_blocks
from mcz.numbers import Grid, GridKind, values_of_texts
from mcz.schema import parse

BLOCK_ROWS = 2048  # decoded at a time, at least


class SignalReader:
    """Decodes a range of stored frames of some groups, each stream fetched once."""

    def __init__(
        self,
        container: Container,
        info: SignalInfo,
        groups: tuple[int, ...],
        resolution: int,
        name: str,
    ) -> None:
        self.container = container
        self.info = info
        self.groups = groups
        self.resolution = resolution
        self.name = name
        self._cache: dict[int, tuple[StreamTable, dict[int, bytes]]] = {}

    def read(self, start: int, stop: int) -> tuple[NDArray[Any], NDArray[np.bool_] | None]:
        """Values and mask of frames start <= f < stop, groups side by side."""
        if self.container.salvage:
            return self._salvage(self._prepare(start, stop), start, stop)
        self._check_size(start, stop)
        per_frame = self.info.layout.samples_per_frame
        n_columns = sum(len(self.info.layout.groups[g]) for g in self.groups)
        dtype = np.int64 if self.info.is_integer else np.float64
        values = np.empty(((stop - start) * per_frame, n_columns), dtype)
        mask: NDArray[np.bool_] | None = None
        for a, b, part, valid in self.blocks(start, stop):
            rows = slice((a - start) * per_frame, (b - start) * per_frame)
            values[rows] = part
            if valid is not None:
                mask = np.ones(values.shape, np.bool_) if mask is None else mask
                mask[rows] = valid
        return values, mask

    def blocks(
        self, start: int, stop: int
    ) -> Iterator[tuple[int, int, NDArray[Any], NDArray[np.bool_] | None]]:
        """The same block by block: its frames a <= f < b, values and mask (None: all valid)."""
        spans = self._prepare(start, stop)
        if start == stop:  # the header has to be right all the same
            self._decode(spans, start, stop)
        for a, b in self._ranges(start, stop):
            yield a, b, *self._finish(self._decode(spans, a, b), a, b)

    def _ranges(self, start: int, stop: int) -> Iterator[tuple[int, int]]:
        """The range in blocks of a few segments, which bound the memory beside the result."""
        rows = self.info.rows
        for index in self.info.covering(start, stop):
            end = min(rows[index].header.stop, stop)
            full = (end - start) * self.info.layout.samples_per_frame >= BLOCK_ROWS
            # A block that began amid what hangs together would be decoded from its start.
            if full and index + 1 < len(rows) and rows[index + 1].header.flags & FRESH:
                yield start, end
                start = end
        if start < stop:
            yield start, stop

    def ordinals(self, start: int, stop: int) -> NDArray[np.int64]:
        """What a codec of ordinals decodes, before the grids are applied."""
        return self._decode(self._prepare(start, stop), start, stop)

    def _decode(self, spans: Sequence[Span], start: int, stop: int) -> NDArray[Any]:
        return self.info.codec.decode(
            self.info.header,
            self.info.layout,
            spans,
            Request(start, stop, self.groups, self.resolution),
            self.fetch,
        )

    def _prepare(self, start: int, stop: int) -> list[Span]:
        """The spans of all segments, after the limit was checked and near ones were read."""
        self._check_size(start, stop)
        info = self.info
        covering = info.covering(start, stop)
        self.container.source.read_ahead(
            (info.rows[i].chunk().offset, info.rows[i].chunk().size)
            for i in covering
            if not info.rows[i].packet
        )
        return info.spans

    def _check_size(self, start: int, stop: int) -> None:
        """Raise LimitError for more than may be decoded."""
        layout = self.info.layout
        n_columns = sum(len(layout.groups[g]) for g in self.groups)
        size = (stop - start) * layout.samples_per_frame * max(1, n_columns) * 8
        check_decoded(f"clip {self.name!r}: values", size, self.container.max_decoded)

    def _salvage(
        self, spans: Sequence[Span], start: int, stop: int
    ) -> tuple[NDArray[Any], NDArray[np.bool_]]:
        """What can be decoded; the rest is invalid."""
        per_frame = self.info.layout.samples_per_frame
        n_columns = sum(len(self.info.layout.groups[g]) for g in self.groups)
        shape = (stop - start) * per_frame, n_columns
        values = np.zeros(shape, np.int64) if self.info.is_integer else np.full(shape, np.nan)
        mask = np.zeros(shape, np.bool_)

        def rescue(a: int, b: int) -> None:
            part, valid = self._finish(self._decode(spans, a, b), a, b)
            rows = slice((a - start) * per_frame, (b - start) * per_frame)
            values[rows], mask[rows] = part, True if valid is None else valid

        salvage(spans, self.info.covering(start, stop), (start, stop), rescue, self._complain)
        return values, mask

    def _complain(self, start: int, stop: int, reason: object) -> None:
        self.container.damage.append(f"clip {self.name!r}, frames {start}:{stop}: {reason}")

    def fetch(self, segment: int, resolution: int, group: int) -> bytes:
        """One stream of the codec."""
        table, streams = self._streams(segment)
        index = table.codec(resolution, group)
        if index not in streams:  # a group that another depends upon
            streams.update(
                self.container.streams(self.info.rows[segment], table.counts, [index], table)[1]
            )
        return streams[index]

    def _streams(self, segment: int) -> tuple[StreamTable, dict[int, bytes]]:
        if segment not in self._cache:
            row, counts = self.info.rows[segment], self.info.counts
            everything = len(self.groups) == counts.n_groups and not self.resolution
            table = wanted = None
            if not everything:
                table = self.container.table(row, counts)
                wanted = self._wanted(table)
            self._cache[segment] = self.container.streams(row, counts, wanted, table)
            while len(self._cache) > 4:  # neighbors only: memory is bounded by segments
                self._cache.pop(next(iter(self._cache)))
        return self._cache[segment]

    def _wanted(self, table: StreamTable) -> list[int]:
        stored = range(table.counts.n_resolutions - self.resolution)
        wanted = [table.codec(r, g) for r in stored for g in self.groups]
        for place in (table.group_notes, table.mask):
            wanted += [i for i in map(place, self.groups) if i is not None]
        return wanted

    def _finish(
        self, coded: NDArray[Any], start: int, stop: int
    ) -> tuple[NDArray[Any], NDArray[np.bool_] | None]:
        """Ordinals to values, exceptions and masks put in."""
        layout = self.info.layout
        columns = [c for g in self.groups for c in layout.groups[g]]
        exceptions, changes = self.exceptions(start, stop, columns)
        values = coded
        if self.info.is_integer:
            if self.info.codec.domain == "values":
                raise FormatError(
                    f"clip {self.name!r}: signal {self.info.name!r} is of integers, codec "
                    f"{self.info.codec.name} decodes none"
                )
            Grid(GridKind.INTEGER).magnitudes(coded)  # refuses what is out of range
        if self.info.codec.domain == "ordinals" and not self.info.is_integer:
            values = _values_of(coded, [layout.grids[c] for c in columns], changes)
        if len(exceptions):
            values[exceptions.rows, exceptions.channels] = _values_of_texts(
                exceptions.texts, self.name
            )
        return values, self._mask(start, stop, columns)

    def exceptions(
        self, start: int, stop: int, columns: Sequence[int] | None = None
    ) -> tuple[Exceptions, tuple[tuple[int, int, Grid], ...]]:
        """Exceptions and grid changes of the range, rows from its start.

        Channels are numbered as in ``columns``, by default as in the signal.
        """
        layout, per_frame = self.info.layout, self.info.layout.samples_per_frame
        place = {
            c: i for i, c in enumerate(columns if columns is not None else range(layout.n_channels))
        }
        found: list[tuple[int, int, bytes]] = []
        changes: dict[int, dict[int, Grid]] = {}
        for index in self.info.covering(start, stop):
            header = self.info.rows[index].header
            shift = (header.first - start) * per_frame
            n_rows = header.n_frames * per_frame
            row = max(0, shift)
            if self.info.rows[index].packet in SHORT:
                changes.setdefault(row, {})  # it has no notes, and the grids of the clip
                continue
            table, streams = self._streams(index)
            for group in self.groups:
                at = table.group_notes(group)
                notes = _notes(
                    streams[at] if at is not None else b"",
                    n_rows,
                    [layout.grids[c] for c in layout.groups[group]],
                    self.name,
                )
                if self.info.is_integer and any(g.kind != GridKind.INTEGER for _, g in notes[0]):
                    raise FormatError(f"clip {self.name!r}: another grid in a signal of integers")
                channels = [place[c] for c in layout.groups[group]]
                for change in notes[0]:
                    changes.setdefault(row, {})[channels[change[0]]] = change[1]
                found += [
                    (shift + r, channels[c], text)
                    for r, c, text in notes[1]
                    if 0 <= shift + r < (stop - start) * per_frame
                ]
            changes.setdefault(row, {})
        found.sort()
        exceptions = Exceptions(
            np.array([f[0] for f in found], np.int64),
            np.array([f[1] for f in found], np.int64),
            tuple(f[2] for f in found),
        )
        baseline = [layout.grids[c] for c in place]
        return exceptions, _as_changes(changes, baseline)

    def _mask(self, start: int, stop: int, columns: Sequence[int]) -> NDArray[np.bool_] | None:
        layout, per_frame = self.info.layout, self.info.layout.samples_per_frame
        mask: NDArray[np.bool_] | None = None
        for index in self.info.covering(start, stop):
            if self.info.rows[index].packet in SHORT:
                continue  # all of it is valid
            header = self.info.rows[index].header
            table, streams = self._streams(index)
            if table.mask(0) is None:
                continue
            a, b = max(start, header.first), min(stop, header.stop)
            rows = slice((a - start) * per_frame, (b - start) * per_frame)
            cut = slice((a - header.first) * per_frame, (b - header.first) * per_frame)
            at = 0
            for group in self.groups:
                n = len(layout.groups[group])
                data = streams[table.mask(group) or 0]
                if data:
                    if mask is None:
                        mask = np.ones(((stop - start) * per_frame, len(columns)), np.bool_)
                    bits = parse_mask(data, header.n_frames * per_frame, n, self.name)
                    mask[rows, at : at + n] = bits[cut]
                at += n
        return mask


def _values_of(
    ordinals: NDArray[np.int64], grids: Sequence[Grid], changes: Sequence[tuple[int, int, Grid]]
) -> NDArray[np.float64]:
    values = np.empty(ordinals.shape)
    for rows, columns, grid in grid_blocks(len(ordinals), grids, changes):
        values[rows, columns] = grid.values(ordinals[rows][:, columns])
    return values


def _as_changes(
    rows: Mapping[int, Mapping[int, Grid]], baseline: Sequence[Grid]
) -> tuple[tuple[int, int, Grid], ...]:
    """Grids stated segment by segment as changes from the row before."""
    changes: list[tuple[int, int, Grid]] = []
    if not any(rows.values()):
        return ()
    current = list(baseline)
    for row in sorted(rows):
        for channel, grid in enumerate(baseline):
            wanted = rows[row].get(channel, grid)
            if wanted != current[channel]:
                changes.append((row, channel, wanted))
                current[channel] = wanted
    return tuple(changes)


def _notes(
    data: bytes, n_rows: int, grids: Sequence[Grid], name: str
) -> tuple[list[tuple[int, Grid]], list[tuple[int, int, bytes]]]:
    """Grid changes (channel, grid) and exceptions (row, channel, text) of one group.

    ``grids`` are those of its channels in CLIP.
    """
    if not data:
        return [], []
    where = f"clip {name!r}, group notes"
    fields = parse(payloads.GROUP_NOTES, data, where)
    n_channels = len(grids)
    changes = [(c.channel, c.grid) for c in fields.grid_changes]
    channels = [channel for channel, _ in changes]
    if channels != sorted(set(channels)) or any(c >= n_channels for c in channels):
        raise FormatError(f"{where}: grid changes of channels {channels}")
    current = dict(enumerate(grids)) | dict(changes)
    row, last, exceptions = 0, (-1, -1), []
    for e in fields.exceptions:
        row += e.row
        if row >= n_rows or e.channel >= n_channels or (row, e.channel) <= last:
            raise FormatError(f"{where}: exception at row {row}, channel {e.channel}")
        if not current[e.channel].is_text:
            raise FormatError(f"{where}: exception on {current[e.channel]}, which has no text")
        last = row, e.channel
        exceptions.append((row, e.channel, bytes(e.text)))
    return changes, exceptions


def _values_of_texts(texts: Sequence[bytes], name: str) -> NDArray[np.float64]:
    """The numbers that exceptions spell; raises FormatError where one is none."""
    values, bad = values_of_texts(texts)
    if bad.any():
        text = texts[int(np.argmax(bad))]
        raise FormatError(f"clip {name!r}: exception {text[:40]!r} is not a number")
    return values
