"""A signal in memory, as a codec reads it, and its notes and masks.

One block of frames is processed at a time, so that encoding needs memory for a segment in addition
to the values themselves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.contract import Codec, Layout
from mcz.container import payloads
from mcz.container.segments import GridChange, GroupNotes, OddToken, build_mask
from mcz.errors import MotionError
from mcz.files.reading.signal_info import parse_groups
from mcz.model.motion import Exceptions, Motion, Signal
from mcz.model.numbers import Grid, GridKind, values_of_texts
from mcz.model.schema import build
from mcz.model.types import Params
from mcz.sources import recording_of

KEPT_BLOCKS = 8
MAX_INTEGER = 2**53  # binary64 holds all integers up to this exactly
Block = tuple[NDArray[np.int64], Signal]


class MemorySource:
    """The SignalSource of one signal of a motion.

    Values off their text grid become exceptions, so that nothing is lost.
    """

    def __init__(
        self,
        motion: Motion,
        index: int,
        codec: Codec,
        segment_bytes: int,
        options: Params = MappingProxyType({}),
    ) -> None:
        """``options``: all of the codec's, if it has groups of ordinals besides values."""
        signal = motion.signals[index]
        parts = codec.partition(motion.skeleton, options) if codec.partition and options else None
        self.is_listed = parts is not None
        kinds = payloads.Groups(kind=group_kind(signal, codec.grouping))
        default = parse_groups(kinds, motion.skeleton, signal.n_channels)
        groups, exact = parts or (default, ())
        self.is_lossless = codec.lossless
        self.exact = [channel for group in exact for channel in groups[group]]
        # A value from a lossy codec is no longer the number that an exception spells.
        self.signal = signal if codec.lossless else _with_exceptions_of(signal, self.exact)
        self.layout = Layout(
            n_frames=motion.n_frames,
            groups=groups,
            samples_per_frame=signal.samples_per_frame,
            skeleton=motion.skeleton,
            frame_rate=motion.frame_rate,
            grids=signal.grids,
            segment_bytes=segment_bytes,
        )
        frames = {row // signal.samples_per_frame for row, _, _ in signal.grid_changes}
        self.breaks: Sequence[int] = sorted(frames - {0})
        self._settled: dict[tuple[int, int], Block] = {}  # the last blocks

    def grids(self, frame: int) -> tuple[Grid, ...]:
        signal = self.signal
        return signal.cut(frame, frame).grids if signal.grid_changes else signal.grids

    def values(self, start: int, stop: int) -> NDArray[np.float64]:
        return self.signal.cut(start, stop).values.astype(np.float64, copy=False)

    def valid(self, start: int, stop: int) -> NDArray[np.bool_] | None:
        return self.signal.cut(start, stop).mask

    def ordinals(self, start: int, stop: int) -> NDArray[np.int64]:
        return self._block(start, stop)[0]

    def _block(self, start: int, stop: int) -> Block:
        """Ordinals of a block, exceptions repeating the row before, and its signal with strays.

        A lossy codec has only its exact channels; others have no strays.
        """
        if (start, stop) not in self._settled:
            signal = self.signal.cut(start, stop)
            ordinals, settled = settle(
                signal if self.is_lossless else _free_grids(signal, self.exact)
            )
            if settled.exceptions is not signal.exceptions:
                signal = replace(signal, exceptions=settled.exceptions)
            self._settled[start, stop] = ordinals, signal
            while len(self._settled) > KEPT_BLOCKS:
                self._settled.pop(next(iter(self._settled)))
        return self._settled[start, stop]

    def group_notes(self, start: int, stop: int) -> list[bytes]:
        """The group notes of frames start <= f < stop, b"" for a group that needs none."""
        signal = self.signal.cut(start, stop)
        if self.is_lossless or self.exact:
            signal = self._block(start, stop)[1]
        changed = [c for c, grid in enumerate(signal.grids) if grid != self.layout.grids[c]]
        if not changed and not len(signal.exceptions):
            return []
        notes = [GroupNotes() for _ in self.layout.groups]
        groups = enumerate(self.layout.groups)
        where = {c: (g, column) for g, group in groups for column, c in enumerate(group)}
        for channel in changed:
            group, column = where[channel]
            change = GridChange(channel=column, grid=signal.grids[channel])
            notes[group].grid_changes.append(change)
        before = [0] * len(notes)
        exceptions = signal.exceptions
        for number, channel, text in zip(
            exceptions.rows, exceptions.channels, exceptions.texts, strict=True
        ):
            group, column = where[int(channel)]
            row = int(number) - before[group]
            note = OddToken(row=row, channel=column, text=text)
            notes[group].exceptions.append(note)
            before[group] = int(number)
        return [build(n, "group notes") if n.grid_changes or n.exceptions else b"" for n in notes]

    def masks(self, start: int, stop: int) -> list[bytes]:
        """The mask of each group, b"" if all of it is valid."""
        mask = self.signal.cut(start, stop).mask
        if mask is None:
            return []
        blocks = (mask[:, list(group)] for group in self.layout.groups)
        return [b"" if block.all() else build_mask(block) for block in blocks]


def _with_exceptions_of(signal: Signal, channels: Sequence[int]) -> Signal:
    old = signal.exceptions
    rows = np.flatnonzero(np.isin(old.channels, channels))
    texts = tuple(old.texts[i] for i in rows)
    return replace(signal, exceptions=Exceptions(old.rows[rows], old.channels[rows], texts))


def _free_grids(signal: Signal, channels: Sequence[int]) -> Signal:
    free = Grid(GridKind.BINARY64)
    return replace(
        signal,
        grids=tuple(grid if c in channels else free for c, grid in enumerate(signal.grids)),
        grid_changes=tuple(change for change in signal.grid_changes if change[1] in channels),
    )


def as_stored(motion: Motion) -> Motion:
    """``motion`` with the stored numbers of a file, which its source scales.

    Without such a source, the values are stored unchanged, in their units. Raises MotionError if
    the source contradicts a signal.
    """
    if all(signal.scaling is None for signal in motion.signals):
        return motion
    recorded = recording_of(motion.source)
    if recorded is None:
        return replace(motion, signals=tuple(map(_store_units, motion.signals)))
    for signal in motion.signals:
        if signal.scaling is not None and not signal.scaling.equals(recorded.scaling):
            raise MotionError(
                f"signal {signal.name!r} and its source have different scalings; leave out "
                "one of the two"
            )
    return replace(motion, signals=tuple(signal.as_stored() for signal in motion.signals))


def _store_units(signal: Signal) -> Signal:
    if signal.scaling is None:
        return signal
    return Signal(
        signal.values,
        name=signal.name,
        samples_per_frame=signal.samples_per_frame,
        mask=signal.mask,
        channels=signal.channels,
        role=signal.role,
        of=signal.of,
    )


def settle(signal: Signal) -> Block:
    """The ordinals of a signal, and the signal with every value off its grid as an exception."""
    if signal.values.dtype == np.int64:
        inside = (signal.values >= -MAX_INTEGER) & (signal.values <= MAX_INTEGER)
        if not inside.all():
            raise MotionError(f"signal {signal.name!r}: an integer exceeds 2^53")
        return signal.values.astype(np.int64, copy=False), signal
    if len(signal.exceptions):
        signal = replace(signal, exceptions=_valid_exceptions(signal))
    ordinals, exact = signal.to_ordinals()
    exact[signal.exceptions.rows, signal.exceptions.channels] = True
    if not exact.all():
        signal = replace(signal, exceptions=_with_strays(signal, ~exact))
    exceptions = signal.exceptions
    for row, channel in zip(exceptions.rows, exceptions.channels, strict=True):
        ordinals[row, channel] = ordinals[row - 1, channel] if row else 0
    return ordinals, signal


def _valid_exceptions(signal: Signal) -> Exceptions:
    """The exceptions that still spell the value at their row and channel."""
    old = signal.exceptions
    meant, bad = values_of_texts(old.texts)
    now = signal.values[old.rows, old.channels]
    same = (meant.view(np.int64) == now.view(np.int64)) | (np.isnan(meant) & np.isnan(now))
    keep = np.flatnonzero(same & ~bad)
    texts = tuple(old.texts[i] for i in keep)
    return Exceptions(old.rows[keep], old.channels[keep], texts)


def _with_strays(signal: Signal, stray: NDArray[np.bool_]) -> Exceptions:
    """The exceptions and every value in ``stray``, written as its shortest decimal."""
    rows, channels = (cells.tolist() for cells in np.nonzero(stray))
    for row, channel in zip(rows, channels, strict=True):
        if not signal.grids[channel].is_text:
            raise MotionError(
                f"signal {signal.name!r}: row {row} of a segment, channel {channel}: grid "
                f"{signal.grids[channel].kind.name} does not hold "
                f"{float(signal.values[row, channel])!r}"
            )
    old = signal.exceptions
    texts = [repr(float(v)).encode() for v in signal.values[rows, channels]]
    merged = [
        *zip(old.rows.tolist(), old.channels.tolist(), old.texts, strict=True),
        *zip(rows, channels, texts, strict=True),
    ]
    rows, channels, texts = map(list, zip(*sorted(merged), strict=True))
    return Exceptions(np.array(rows, np.int64), np.array(channels, np.int64), tuple(texts))


def group_kind(signal: Signal, grouping: str) -> int:
    """The ``kind`` of GROUPS for a codec's grouping; channels of its own have no joints."""
    if grouping == "joint" and signal.channels is None:
        return payloads.GROUP_JOINT
    return payloads.GROUP_ALL if grouping == "all" else payloads.GROUP_CHANNEL
