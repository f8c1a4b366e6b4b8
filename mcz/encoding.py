"""Motion -> chunks: what a clip says of itself, its segments, its hashes.

Part of the joint between motion, codec and container (see ``file.py``).
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.base import Codec, Encoded, Layout, Request, Segment, Span
from mcz.container import payloads
from mcz.container.limits import check
from mcz.container.segments import FRAME_NOTES, FRESH, GROUP_NOTES, MASKS, SegmentHeader
from mcz.container.skeletons import build_skeleton, channel_fields
from mcz.container.writer import Writer
from mcz.errors import MotionError
from mcz.formats import FORMATS
from mcz.frames import frame_number_metadata
from mcz.masks import build_mask
from mcz.motion import Exceptions, Motion, Signal, Skeleton, Source
from mcz.numbers import Grid
from mcz.schema import MAX_COUNT, build

Progress = Callable[[int, int, str], None]
MAX_INTEGER = 2**53  # what a binary64, and so every language, holds exactly


def write_skeleton(writer: Writer, skeleton: Skeleton) -> bytes:
    """Write SKEL, after the SRCE of its own file if it has one; return its id."""
    check("joints", skeleton.n_joints, writer.profile.joints)
    check("channels", skeleton.n_channels, writer.profile.channels)
    source = None
    if skeleton.source is not None:
        format_id = FORMATS[skeleton.source.format].id
        source = {
            "template": writer.template(format_id, skeleton.source.template),
            "format": format_id,
            "size": skeleton.source.size,
            "sha256": skeleton.source.sha256,
        }
    return writer.shared(b"SKEL", build_skeleton(skeleton, source))


def write_clip(
    writer: Writer,
    motion: Motion,
    codec: Codec,
    params: Mapping[str, Any],
    progress: Progress | None = None,
) -> None:
    """Write one clip: its skeleton and template if new, CLIP, segments, CEND.

    Raises OptionError for a bad parameter, MotionError for values that the codec cannot hold.
    """
    options = codec.options(params)
    sources = [MemorySource(motion, index, codec) for index in range(len(motion.signals))]
    encoded = [codec.encode(source, options) for source in sources]
    fields = _clip_fields(writer, motion, codec, sources, encoded)
    writer.begin_clip(fields, [signal.n_channels for signal in motion.signals])
    hashes = []
    for index, (source, part) in enumerate(zip(sources, encoded, strict=True)):
        kept = []
        for segment in part.segments:
            _write_segment(writer, motion, index, source, segment)
            if not codec.lossless:
                kept.append(segment)
            if progress is not None:
                progress(segment.first + segment.n_frames, motion.n_frames, motion.name)
        hashes.append(_value_hash(source, codec, part, kept))
    sha256 = motion.source.sha256 if motion.source else b""
    writer.end_clip(motion.n_frames, sha256, hashes)


class MemorySource:
    """A signal in memory, as a codec reads it.

    Values that lie on no point of their text grid join the exceptions, so that nothing is lost.
    """

    def __init__(self, motion: Motion, index: int, codec: Codec) -> None:
        self.signal = motion.signals[index]
        self.layout = Layout(
            n_frames=motion.n_frames,
            groups=make_groups(motion.skeleton, self.signal, codec.grouping),
            samples_per_frame=self.signal.samples_per_frame,
            skeleton=motion.skeleton,
            frame_rate=motion.frame_rate,
            grids=self.signal.grids,
        )
        per_frame = self.signal.samples_per_frame
        rows = {row - row % per_frame for row, _, _ in self.signal.grid_changes}
        self.breaks: Sequence[int] = sorted(row // per_frame for row in rows if row)
        # What a lossy codec returns is no longer the number that an exception spells.
        self.exceptions = self.signal.exceptions if codec.lossless else Exceptions()
        self._ordinals: NDArray[np.int64] | None = None

    def grids(self, frame: int) -> tuple[Grid, ...]:
        grids = list(self.signal.grids)
        for row, channel, grid in sorted(self.signal.grid_changes, key=_row):
            if row <= frame * self.signal.samples_per_frame:
                grids[channel] = grid
        return tuple(grids)

    def values(self, start: int, stop: int) -> NDArray[np.float64]:
        per_frame = self.signal.samples_per_frame
        return self.signal.values[start * per_frame : stop * per_frame]

    def ordinals(self, start: int, stop: int) -> NDArray[np.int64]:
        if self._ordinals is None:
            self._ordinals = self._place()
        per_frame = self.signal.samples_per_frame
        return self._ordinals[start * per_frame : stop * per_frame]

    def _place(self) -> NDArray[np.int64]:
        """Ordinals of the whole signal; exceptions repeat the ordinal of the row before."""
        signal = self.signal
        if signal.values.dtype == np.int64:
            if signal.values.size and not (abs(signal.values) <= MAX_INTEGER).all():
                raise MotionError(f"signal {signal.name!r}: an integer is beyond 2^53")
            return signal.values
        ordinals, exact = signal.place()
        known = np.zeros(signal.values.shape, np.bool_)
        known[self.exceptions.rows, self.exceptions.channels] = True
        if not (exact | known).all():
            self.exceptions = self._with_strays(~(exact | known))
            known[self.exceptions.rows, self.exceptions.channels] = True
        for row, channel in zip(self.exceptions.rows, self.exceptions.channels, strict=True):
            ordinals[row, channel] = ordinals[row - 1, channel] if row else 0
        return ordinals

    def _with_strays(self, stray: NDArray[np.bool_]) -> Exceptions:
        """The exceptions and every value in ``stray``, written as its shortest decimal."""
        rows, channels = np.nonzero(stray)
        grids = self.signal.grids
        for row, channel in zip(rows, channels, strict=True):
            if not grids[channel].is_text:
                raise MotionError(
                    f"signal {self.signal.name!r}: row {row}, channel {channel} is "
                    f"{self.signal.values[row, channel]!r}, which its grid "
                    f"{grids[channel].kind.name} does not hold"
                )
        old = self.exceptions
        texts = [repr(float(v)).encode() for v in self.signal.values[rows, channels]]
        merged = sorted(
            [
                *zip(old.rows.tolist(), old.channels.tolist(), old.texts, strict=True),
                *zip(rows.tolist(), channels.tolist(), texts, strict=True),
            ]
        )
        return Exceptions(
            np.array([m[0] for m in merged], np.int64),
            np.array([m[1] for m in merged], np.int64),
            tuple(m[2] for m in merged),
        )


def make_groups(skeleton: Skeleton, signal: Signal, grouping: str) -> tuple[tuple[int, ...], ...]:
    """The channels of each group; a signal with channels of its own has no joints."""
    if grouping == "all" and signal.n_channels:
        return (tuple(range(signal.n_channels)),)
    if grouping == "joint" and signal.channels is None:
        columns = (tuple(skeleton.columns(j)) for j in range(skeleton.n_joints))
        return tuple(group for group in columns if group)
    return tuple((channel,) for channel in range(signal.n_channels))


def _clip_fields(
    writer: Writer,
    motion: Motion,
    codec: Codec,
    sources: Sequence[MemorySource],
    encoded: Sequence[Encoded],
) -> dict[str, Any]:
    rate = motion.frame_rate
    if rate is not None and max(rate.numerator, rate.denominator) > MAX_COUNT:
        raise MotionError(f"frame rate {rate} has a term beyond 2^53 - 1")
    metadata = dict(motion.metadata) | frame_number_metadata(motion.frame_numbers)
    return {
        "name": motion.name,
        "flags": 0 if motion.frame_rate_exact else payloads.ROUNDED_RATE,
        "skeleton": write_skeleton(writer, motion.skeleton),
        "n_frames": motion.n_frames,
        "rate_numerator": rate.numerator if rate else 0,
        "rate_denominator": rate.denominator if rate else 1,
        "metadata": [{"key": k, "value": metadata[k]} for k in sorted(metadata)],
        "source": [_source_fields(writer, motion.source)] if motion.source else [],
        "signals": [
            _signal_fields(source.signal, codec, part)
            for source, part in zip(sources, encoded, strict=True)
        ],
        "extension": b"",
    }


def _source_fields(writer: Writer, source: Source) -> dict[str, Any]:
    format_id = FORMATS[source.format].id
    return {
        "template": writer.template(format_id, source.template),
        "format": format_id,
        "detail": source.detail,
        "path": source.path,
        "size": source.size,
    }


def _signal_fields(signal: Signal, codec: Codec, part: Encoded) -> dict[str, Any]:
    runs: list[dict[str, Any]] = []
    for grid in signal.grids:
        if runs and runs[-1]["grid"] == grid:
            runs[-1]["n_channels"] += 1
        else:
            runs.append({"n_channels": 1, "grid": grid})
    kinds = {"all": payloads.GROUP_ALL, "joint": payloads.GROUP_JOINT}
    own = signal.channels is not None
    kind = kinds.get(codec.grouping, payloads.GROUP_CHANNEL)
    if own and codec.grouping == "joint":
        kind = payloads.GROUP_CHANNEL
    return {
        "name": signal.name,
        "flags": payloads.OWN_CHANNELS if own else 0,
        "channels": channel_fields(signal.channels) if signal.channels is not None else None,
        "samples_per_frame": signal.samples_per_frame,
        "grids": runs,
        "codec": codec.id,
        "codec_version": codec.version,
        "header": part.header,
        "groups": {"kind": kind, "sizes": None},
        "n_resolutions": part.n_resolutions,
        "extension": b"",
    }


def _write_segment(
    writer: Writer, motion: Motion, index: int, source: MemorySource, segment: Segment
) -> None:
    start, stop = segment.first, segment.first + segment.n_frames
    flags = FRESH if segment.fresh else 0
    streams: list[bytes] = []
    notes = b""
    if index == 0 and motion.source is not None and motion.source.notes is not None:
        notes = motion.source.notes.cut(start, stop)
    if notes:
        flags |= FRAME_NOTES
        streams.append(notes)
    group_notes = _group_notes(source, start, stop)
    if any(group_notes):
        flags |= GROUP_NOTES
        streams += group_notes
    masks = _masks(source, start, stop)
    if any(masks):
        flags |= MASKS
        streams += masks
    streams += segment.streams
    header = SegmentHeader(index, start, segment.n_frames, segment.lead, segment.tail, flags)
    writer.segment(header, streams)


def _group_notes(source: MemorySource, start: int, stop: int) -> list[bytes]:
    """The group notes of frames start <= f < stop, b"" for a group that needs none."""
    signal, per_frame = source.signal, source.signal.samples_per_frame
    first, last = start * per_frame, stop * per_frame
    changes = {c: grid for row, c, grid in sorted(signal.grid_changes, key=_row) if row <= first}
    exceptions = source.exceptions
    low, high = np.searchsorted(exceptions.rows, (first, last))
    if not changes and low == high:
        return []
    where = {c: (g, i) for g, group in enumerate(source.layout.groups) for i, c in enumerate(group)}
    notes: list[dict[str, list[Any]]] = [
        {"grid_changes": [], "exceptions": []} for _ in source.layout.groups
    ]
    for channel, grid in sorted(changes.items()):
        group, place = where[channel]
        row = {"channel": place, "grid": grid}
        notes[group]["grid_changes"].append(row)
    before = [first] * len(notes)
    for at in range(low, high):
        group, place = where[int(exceptions.channels[at])]
        row_number = int(exceptions.rows[at])
        fields = {
            "row": row_number - before[group],
            "channel": place,
            "text": exceptions.texts[at],
        }
        notes[group]["exceptions"].append(fields)
        before[group] = row_number
    return [
        build(payloads.GROUP_NOTES, n, "group notes")
        if n["grid_changes"] or n["exceptions"]
        else b""
        for n in notes
    ]


def _row(change: tuple[int, int, Grid]) -> int:
    return change[0]


def _masks(source: MemorySource, start: int, stop: int) -> list[bytes]:
    """The mask of each group, b"" where all is valid."""
    signal = source.signal
    if signal.mask is None:
        return []
    rows = signal.mask[start * signal.samples_per_frame : stop * signal.samples_per_frame]
    return [
        b"" if block.all() else build_mask(block)
        for block in (rows[:, list(group)] for group in source.layout.groups)
    ]


def canonical(values: NDArray[Any]) -> bytes:
    """The bytes that hashes and conformance compare: little-endian, row after row, one NaN."""
    if values.dtype == np.int64:
        return values.astype("<i8").tobytes()
    return np.where(np.isnan(values), math.nan, values).astype("<f8").tobytes()


def _value_hash(
    source: MemorySource, codec: Codec, part: Encoded, segments: Sequence[Segment]
) -> bytes:
    """SHA-256 of the canonical array, as a reader will decode it, and of the mask if any."""
    values = source.signal.values
    if not codec.lossless:
        values = _decoded(source, codec, part, segments)
    digest = hashlib.sha256(canonical(values))
    if source.signal.mask is not None and not source.signal.mask.all():
        digest.update(source.signal.mask.astype("u1").tobytes())
    return digest.digest()


def _decoded(
    source: MemorySource, codec: Codec, part: Encoded, segments: Sequence[Segment]
) -> NDArray[np.float64]:
    layout = source.layout
    spans = [Span(s.first, s.n_frames, s.lead, s.tail, s.fresh) for s in segments]
    n_groups = len(layout.groups)
    request = Request(0, layout.n_frames, tuple(range(n_groups)))
    return codec.decode(
        part.header,
        layout,
        spans,
        request,
        lambda segment, resolution, group: segments[segment].streams[resolution * n_groups + group],
    )
