"""A clip of an open file: values decoded on demand, in part if that is all that is asked for.

Part of the joint between motion, codec and container (see ``file.py``).
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcz.codecs import by_id
from mcz.codecs.base import Layout
from mcz.container import payloads
from mcz.container.directory import ClipRow
from mcz.container.limits import check
from mcz.container.reader import Container
from mcz.container.segments import FRAME_NOTES, FRESH, StreamCounts
from mcz.container.skeletons import parse_channels, parse_skeleton
from mcz.encoding import value_hash
from mcz.errors import ChecksumError, FormatError, OptionError, UnsupportedError
from mcz.formats import Format, format_by_id
from mcz.frames import parse_frame_numbers
from mcz.motion import Motion, Signal, Skeleton, Source
from mcz.schema import parse
from mcz.signals import SignalInfo, SignalReader, parse_grids, parse_groups
from mcz.views import ClipValues


@dataclass(frozen=True, slots=True)
class SourceInfo:
    """What is known of a source file without restoring it."""

    format: str
    path: str
    size: int
    sha256: bytes


class Clip:
    """One clip; nothing is decoded before it is asked for."""

    def __init__(self, container: Container, row: ClipRow) -> None:
        self._container = container
        self._row = row
        self.name = row.name
        self.n_frames = row.n_frames

    def __repr__(self) -> str:
        return f"<Clip {self.name!r}: {self.n_frames} frames, {self.n_channels} channels>"

    @cached_property
    def _fields(self) -> Any:
        return self._container.clip(self._row)

    @cached_property
    def _cend(self) -> Any:
        fields = self._container.cend(self._row)
        if fields is not None and len(fields.source_sha256) != len(self._fields.source):
            raise FormatError(f"clip {self.name!r}: a source without a hash, or a hash without it")
        return fields

    @cached_property
    def skeleton(self) -> Skeleton:
        """The skeleton of the clip, its own source file not read."""
        fields = self._container.shared(b"SKEL", self._row.skeleton, payloads.SKEL)
        return parse_skeleton(fields, self._container.profile, f"SKEL {self._row.skeleton.hex()}")

    @property
    def skeleton_id(self) -> bytes:
        return self._row.skeleton

    @property
    def frame_rate(self) -> Fraction | None:
        """Frames a second, None while unknown."""
        if not self._row.rate_numerator:
            return None
        if not self._row.rate_denominator:
            raise FormatError(f"clip {self.name!r}: frame rate with the denominator 0")
        return Fraction(self._row.rate_numerator, self._row.rate_denominator)

    @property
    def frame_rate_exact(self) -> bool:
        return not self._fields.flags & payloads.ROUNDED_RATE

    @cached_property
    def metadata(self) -> Mapping[str, str]:
        return {pair.key: pair.value for pair in self._fields.metadata}

    @property
    def frame_numbers(self) -> NDArray[np.int64]:
        """The number of every frame; 1, 2, 3, ... unless the metadata say otherwise."""
        where = f"clip {self.name!r}: bytes of frame numbers"
        check(where, 8 * self.n_frames, self._container.max_decoded)
        return parse_frame_numbers(
            self.metadata.get("frame-numbers", "1"), self.n_frames, self.name
        )

    @property
    def damage(self) -> list[str]:
        """What salvage found wrong with this clip."""
        return self._row.damage

    @cached_property
    def signals(self) -> tuple[SignalInfo, ...]:
        """The signals, the motion first."""
        if not self._fields.signals:
            raise FormatError(f"clip {self.name!r} has no signal")
        return tuple(self._signal(i, fields) for i, fields in enumerate(self._fields.signals))

    def _signal(self, index: int, fields: Any) -> SignalInfo:
        where = f"clip {self.name!r}, signal {index}"
        channels = None
        if fields.flags & payloads.OWN_CHANNELS:
            channels = parse_channels(fields.channels, where)
        n_channels = self.skeleton.n_channels if channels is None else len(channels)
        check(f"{where}: channels", n_channels, self._container.profile.channels)
        layout = Layout(
            self.n_frames,
            parse_groups(
                fields.groups, self.skeleton if channels is None else None, n_channels, where
            ),
            fields.samples_per_frame,
            self.skeleton,
            self.frame_rate,
            parse_grids(fields.grids, n_channels, where),
            fields.n_resolutions,
        )
        counts = StreamCounts(len(layout.groups), fields.n_resolutions)
        rows = tuple(row for row in self._row.segments if row.header.signal == index)
        info = SignalInfo(
            index,
            fields.name,
            channels,
            layout.grids,
            fields.codec,
            fields.codec_version,
            bytes(fields.header),
            layout,
            counts,
            rows,
        )
        self._check_rows(info, where)
        return info

    def _check_rows(self, info: SignalInfo, where: str) -> None:
        limit = self._container.profile.segment_bytes
        per_frame = max(1, info.layout.n_channels) * info.layout.samples_per_frame * 8
        due = 0
        noted = info.index == 0 and bool(self._fields.source)
        for row in info.rows:
            if row.header.flags & FRAME_NOTES and not noted:
                raise FormatError(f"{where}: frame notes, but no source that they belong to")
            if not (row.header.first or row.header.flags & FRESH):
                raise FormatError(f"{where}: the first segment needs one before it")
            check(f"{where}: bytes of a segment", row.header.n_frames * per_frame, limit)
            if row.header.first != due and not self._container.salvage:
                raise FormatError(f"{where}: a segment begins at {row.header.first}, {due} is due")
            due = row.header.stop
        if due != self.n_frames and not self._container.salvage:
            raise FormatError(f"{where}: segments end at frame {due} of {self.n_frames}")

    @property
    def n_channels(self) -> int:
        """Channels of the motion signal."""
        return self._row.signals[0].n_channels

    @property
    def codec(self) -> str:
        """Name of the codec of the motion signal, ``codec N`` where it is unknown."""
        row = self._row.signals[0]
        try:
            return by_id(row.codec, row.codec_version).name
        except UnsupportedError:
            return f"codec {row.codec}"

    @property
    def source(self) -> SourceInfo | None:
        """Format, path, size and hash of the source file; None where the clip has none."""
        if not self._fields.source:
            return None
        fields = self._fields.source[0]
        hashes = self._cend.source_sha256 if self._cend is not None else []
        return SourceInfo(
            format_by_id(fields.format).name,
            fields.path,
            fields.size,
            bytes(hashes[0]) if hashes else b"",
        )

    @property
    def quality(self) -> dict[str, str] | None:
        """The quality record, None where the clip has none."""
        for chunk in self._row.ancillary:
            if chunk.type == b"QUAL":
                fields = parse(payloads.QUAL, self._container.payload(chunk), chunk.label)
                return {entry.key: entry.value for entry in fields.entries}
        return None

    @property
    def values(self) -> ClipValues:
        """The motion signal as something to slice: ``clip.values[100:200]`` decodes 100 frames."""
        return ClipValues(self)

    def read(
        self,
        frames: tuple[int, int] | None = None,
        joints: Sequence[int | str] | None = None,
        resolution: int = 0,
        *,
        decimate: bool = False,
        signal: int = 0,
    ) -> NDArray[Any]:
        """The values of frames a <= f < b of some joints, NaN where invalid.

        Shape (rows, channels of the joints in the order given), binary64 in source units.
        ``resolution`` leaves out that many of the finest details; with ``decimate`` only every
        2^resolution-th frame is returned. Raises OptionError for a range outside the clip and
        FormatError for bad bytes; a full read also checks the value hash.
        """
        values, mask = self.read_masked(frames, joints, resolution, signal=signal)
        if mask is not None:
            values = np.where(mask, values, np.nan)
        return values[:: 2**resolution] if decimate else values

    def read_masked(
        self,
        frames: tuple[int, int] | None = None,
        joints: Sequence[int | str] | None = None,
        resolution: int = 0,
        *,
        signal: int = 0,
    ) -> tuple[NDArray[Any], NDArray[np.bool_] | None]:
        """The values with the stored coordinates beneath the mask, and the mask."""
        info = self._info(signal)
        start, stop = self._range(frames)
        if not 0 <= resolution < info.counts.n_resolutions:
            raise OptionError(
                f"clip {self.name!r} has resolutions 0 to {info.counts.n_resolutions - 1}, "
                f"not {resolution}"
            )
        columns = self._columns(info, joints)
        groups, places = _groups_of(info.layout, columns)
        reader = SignalReader(self._container, info, groups, resolution, self.name)
        values, mask = reader.read(start, stop)
        if joints is not None:
            values = values[:, places]
            mask = mask[:, places] if mask is not None else None
        whole = (start, stop) == (0, self.n_frames) and joints is None and resolution == 0
        if whole and not self._container.salvage:
            self._check_hash(info, values, mask)
        return values, mask

    def _info(self, signal: int) -> SignalInfo:
        if not 0 <= signal < len(self.signals):
            raise OptionError(f"clip {self.name!r} has {len(self.signals)} signals, not {signal}")
        return self.signals[signal]

    def _range(self, frames: tuple[int, int] | None) -> tuple[int, int]:
        start, stop = frames if frames is not None else (0, self.n_frames)
        if not 0 <= start <= stop <= self.n_frames:
            raise OptionError(
                f"clip {self.name!r} has frames 0 to {self.n_frames}, not {start}:{stop}"
            )
        return start, stop

    def _columns(self, info: SignalInfo, joints: Sequence[int | str] | None) -> list[int]:
        if joints is None:
            return list(range(info.layout.n_channels))
        if info.channels is not None:
            raise OptionError(f"signal {info.name!r} has channels of its own, no joints")
        return [c for j in joints for c in self.skeleton.columns(self.skeleton.find(j))]

    def _check_hash(
        self, info: SignalInfo, values: NDArray[Any], mask: NDArray[np.bool_] | None
    ) -> None:
        hashes = self._cend.value_sha256
        if len(hashes) != len(self.signals):
            raise FormatError(
                f"clip {self.name!r}: {len(hashes)} hashes of {len(self.signals)} signals"
            )
        found = value_hash(values, mask)
        if found != hashes[info.index]:
            raise ChecksumError(
                f"clip {self.name!r}, signal {info.index}: value hash is {found.hex()}, "
                f"stored is {hashes[info.index].hex()}"
            )

    def motion(self, frames: tuple[int, int] | None = None) -> Motion:
        """The whole clip, or frames a <= f < b of it, as a Motion with its source."""
        start, stop = self._range(frames)
        signals = tuple(self._read_signal(info, start, stop) for info in self.signals)
        numbers_ = self.frame_numbers[start:stop]
        return Motion(
            skeleton=self.skeleton,
            signals=signals,
            frame_rate=self.frame_rate,
            frame_rate_exact=self.frame_rate_exact,
            name=self.name,
            metadata={k: v for k, v in self.metadata.items() if k != "frame-numbers"},
            source=self._source(start, stop),
            frame_numbers=None if "frame-numbers" not in self.metadata and not start else numbers_,
        )

    def _read_signal(self, info: SignalInfo, start: int, stop: int) -> Signal:
        values, mask = self.read_masked((start, stop), signal=info.index)
        groups = range(len(info.layout.groups))
        reader = SignalReader(self._container, info, tuple(groups), 0, self.name)
        exceptions, changes = reader.exceptions(start, stop)
        binary = not info.is_integer and any(not grid.is_text for grid in info.grids)
        keep = binary and info.codec.domain == "ordinals" and not self._container.salvage
        return Signal(
            values=values,
            grids=info.grids,
            name=info.name,
            samples_per_frame=info.layout.samples_per_frame,
            mask=mask,
            exceptions=exceptions,
            grid_changes=changes,
            channels=info.channels,
            ordinals=reader.ordinals(start, stop) if keep else None,
        )

    def _source(self, start: int, stop: int) -> Source | None:
        info = self.source
        if info is None:
            return None
        fields = self._fields.source[0]
        source_format = format_by_id(fields.format)
        signal = self.signals[0]
        parts = []
        for row in signal.rows:
            if row.header.first < stop and start < row.header.stop:
                table, streams = self._container.streams(row, signal.counts, None)
                index = table.frame_notes()
                part = b"" if index is None else streams[index]
                parts.append((row.header.first, row.header.stop, part))
        notes = source_format.join_notes(parts) if source_format.join_notes else None
        source = Source(
            format=info.format,
            template=self._container.template(fields.template, fields.format),
            detail=bytes(fields.detail),
            notes=notes,
            path=info.path,
            size=info.size,
            sha256=info.sha256,
        )
        if (start, stop) == (0, self.n_frames):
            return source
        return _cut_source(source, source_format, start, stop)

    def source_bytes(self, frames: tuple[int, int] | None = None) -> bytes:
        """The source file, byte for byte (of a lossy clip: like it), or a range of its frames.

        Raises ChecksumError where a lossless clip does not give back the bytes it was made of.
        """
        info = self.source
        if info is None:
            raise OptionError(f"clip {self.name!r} has no source file; choose a format with --to")
        check(f"clip {self.name!r}: source bytes", info.size, self._container.max_decoded)
        motion = self.motion(frames)
        source_format = format_by_id(self._fields.source[0].format)
        data = source_format.write(motion)
        lossless = all(signal.codec.lossless for signal in self.signals)
        if frames is None and lossless and not self._container.salvage:
            self._check_source(data, info)
        return data

    def _check_source(self, data: bytes, info: SourceInfo) -> None:
        digest = hashlib.sha256(data).digest()
        if len(data) != info.size or digest != info.sha256:
            raise ChecksumError(
                f"clip {self.name!r}: the restored {info.path} has {len(data)} bytes and hash "
                f"{digest.hex()}, stored are {info.size} and {info.sha256.hex()}"
            )


def _groups_of(layout: Layout, columns: Sequence[int]) -> tuple[tuple[int, ...], list[int]]:
    """The groups that hold ``columns``, and where each column is among theirs."""
    group_of = {c: g for g, group in enumerate(layout.groups) for c in group}
    groups = tuple(dict.fromkeys(sorted(group_of[c] for c in columns)))
    place = {c: i for i, c in enumerate(c for g in groups for c in layout.groups[g])}
    return groups, [place[c] for c in columns]


def _cut_source(source: Source, source_format: Format, start: int, stop: int) -> Source:
    """The source of frames start <= f < stop alone; its hash is that of no file."""
    notes = source.notes
    if notes is not None and source_format.join_notes is not None:
        notes = source_format.join_notes([(0, stop - start, notes.cut(start, stop))])
    return replace(source, notes=notes, size=0, sha256=b"")
