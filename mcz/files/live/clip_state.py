"""A live clip in its reader: its head, its decoder, its frames in order and their hash.

SPEC.md, "Open DATA and packets", is normative, and "Live streams with losses" has the limits; the
substitute of a lost frame is a reader's choice.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mcz.codecs import codec_by_id
from mcz.codecs.contract import LiveDecoder
from mcz.codecs.known_answers import check_known_answer
from mcz.container import payloads
from mcz.container.chunks import FRAME, SIGNATURE, Chunk, ChunkType, build_foot
from mcz.container.directory import ClipRow
from mcz.container.model_records import ValueDigest
from mcz.container.reader import Container
from mcz.container.segments import (
    FRESH,
    MASKS,
    SegmentHeader,
    frame_table,
    parse_mask,
    parse_stream_table,
)
from mcz.container.source import ByteSource
from mcz.errors import ChecksumError, FormatError, LostFrameError, TruncatedError, UnsupportedError
from mcz.files.reading.signal_info import SignalInfo, check_roles, read_signal
from mcz.model.motion import Skeleton
from mcz.model.text_format import fields_text
from mcz.model.types import Floats, Values

Mask = NDArray[np.bool_]
State = Literal["decoded", "concealed", "missing"]
Lost = Literal["refuse", "missing", "hold", "linear"]
LOST = ("refuse", "missing", "hold", "linear")


@dataclass(frozen=True, slots=True)
class LiveFrame:
    """A frame of a clip, from 0: its values and their validity, both (n_channels,).

    ``values`` are NaN where invalid. ``state``: they come from the file (``decoded``), are a
    substitute for a frame that is lost or could not be decoded (``concealed``), or are unknown
    (``missing``).
    """

    number: int
    values: Values
    valid: Mask
    state: State = "decoded"

    __repr__ = fields_text


class Concealer:
    """Puts frames in order; ``lost`` decides the substitute of missing ones.

    ``shown`` are the stored frames that the clip shows, None for all; input counts stored frames,
    output the shown ones. ``due`` is the stored frame that comes next, None as long as it is
    unknown. ``spend`` decides whether so many may be concealed.
    """

    def __init__(
        self,
        n_channels: int,
        lost: Lost,
        shown: range | None,
        spend: Callable[[int], bool],
        *,
        join: bool = False,
    ) -> None:
        self._first = 0 if shown is None else shown.start
        self._stop = None if shown is None else shown.stop
        self.due: int | None = None if join else self._first
        self._lost, self._spend = lost, spend
        self._nothing = np.full(n_channels, np.nan), np.zeros(n_channels, np.bool_)
        self._last: tuple[Floats, Mask] | None = None
        self._owed = 0  # frames before the one due that wait for the next decoded one
        self.is_whole = not join  # every shown frame up to now was decoded

    def give(self, number: int, values: Floats, mask: Mask | None) -> Iterator[LiveFrame]:
        """Add a decoded frame; earlier ones that are due were not decoded."""
        yield from self.reach(number)
        assert self.due is not None
        if number < self.due or (self._stop is not None and number >= self._stop):
            return
        valid = np.ones(values.shape, np.bool_) if mask is None else mask
        shown = values if mask is None else np.where(valid, values, np.nan)
        if self._owed:
            yield from self._between(shown, valid)
        self.due, self._last = number + 1, (shown, valid)
        yield LiveFrame(number - self._first, shown, valid)  # LIVE-02

    def reach(self, number: int) -> Iterator[LiveFrame]:
        """Note that no frame before ``number`` will come."""
        if self.due is None:
            self.due = max(self._first, number)
            self.is_whole = self.due == self._first
        if self._stop is not None:
            number = min(number, self._stop)
        count = number - self.due
        if count <= 0:
            return
        self.is_whole = False
        if self._lost == "refuse":
            raise LostFrameError(f"frame {self.due - self._first} did not arrive")
        if not self._spend(count):  # LIVE-12
            yield from self.end()
            self.due = number
        elif self._lost == "linear" and self._last is not None:
            self.due += count
            self._owed += count
        else:
            for _ in range(count):
                self.due += 1
                yield self._held(self.due - 1)

    def end(self) -> Iterator[LiveFrame]:
        """Note that no frame follows the missing ones."""
        owed, self._owed = self._owed, 0
        for number in range((self.due or 0) - owed, self.due or 0):
            yield self._held(number)

    def _held(self, number: int) -> LiveFrame:
        if self._last is None or self._lost == "missing":
            return LiveFrame(number - self._first, *self._nothing, "missing")
        return LiveFrame(number - self._first, *self._last, "concealed")  # LIVE-01

    def _between(self, values: Floats, valid: Mask) -> Iterator[LiveFrame]:
        """The frames that are owed, on straight lines from the last decoded one to ``values``."""
        assert self._last is not None
        assert self.due is not None
        before, known = self._last
        both, steps = known & valid, self._owed + 1
        for k in range(1, steps):
            row = np.where(both, before + (values - before) * (k / steps), np.nan)
            yield LiveFrame(self.due - steps + k - self._first, row, both, "concealed")
        self._owed = 0


Shared = dict[tuple[bytes, bytes], bytes]  # kind and id -> chunk


@dataclass(frozen=True, slots=True)
class LiveClip:
    """Head of a clip that is being read; ``frame_rate`` None: unknown."""

    name: str
    skeleton: Skeleton
    frame_rate: Fraction | None
    codec: str


def needed_chunks(fields: payloads.Clip) -> Iterator[tuple[bytes, bytes]]:
    """Kind and id of the chunks that a clip with these ``fields`` cannot be read without."""
    yield ChunkType.SKEL, bytes(fields.skeleton)
    if fields.source is not None:
        yield ChunkType.SRCE, fields.source.template
    for signal in fields.signals:
        with suppress(FormatError):  # reported when the signal is read
            uses = codec_by_id(signal.codec, signal.codec_version, signal.preset).uses
            for id_ in () if uses is None else uses(bytes(signal.header)):
                yield ChunkType.MODL, id_


def row_of(fields: payloads.Clip, chunk: Chunk) -> ClipRow:
    """A clip from its CLIP alone; raises FormatError."""
    if not fields.name or not fields.signals:
        raise FormatError("a clip must have a name and a signal", where=f"chunk {chunk.label}")
    check_roles(fields.signals, f"chunk {chunk.label}")
    return ClipRow.of(fields, chunk)


def begin_clip(
    head: bytes, shared: Shared, row: ClipRow, fields: payloads.Clip
) -> ClipState | None:
    """Return a decoder of the clip that begins; None for a codec that needs all frames.

    ``head`` is HEAD, ``shared`` the chunks before the clip. Raises FormatError for a missing one.
    """
    container = Container(ByteSource(io.BytesIO(opening(head, shared, fields) + build_foot(0, 0))))
    skeleton = container.skeleton(row.skeleton)
    rate = Fraction(row.rate_numerator, row.rate_denominator) if row.rate_numerator else None
    motion = fields.signals[0]
    shown = range(motion.skip, motion.skip + fields.n_frames)
    motion.skip = motion.spare = 0
    nothing = replace(row, n_frames=0, segments=[])  # its later parts are unknown
    info = read_signal(container, nothing, fields, 0, skeleton, rate)
    one = (info.counts.n_groups, info.counts.n_resolutions, info.layout.samples_per_frame)
    if info.codec.follow is None or one != (1, 1, 1):
        return None
    is_open = bool(fields.flags & payloads.OPEN_CLIP)
    clip = LiveClip(row.name, skeleton, rate, info.codec.name)
    return ClipState(clip, info, None if is_open else shown, len(fields.signals))


def opening(head: bytes, shared: Shared, fields: payloads.Clip) -> bytes:
    """A file up to the clip with these ``fields``: only the chunks that it needs."""
    needed = [shared[key] for key in needed_chunks(fields) if key in shared]
    return b"".join([SIGNATURE, head, *needed])


class ClipState:
    """A clip that is decoded frame by frame.

    ``shown`` are the stored frames that the clip shows, None for all.
    """

    def __init__(
        self, clip: LiveClip, info: SignalInfo, shown: range | None, n_signals: int
    ) -> None:
        assert info.codec.follow is not None
        self.clip, self.info, self.shown, self.n_signals = clip, info, shown, n_signals
        self._where = f"clip {clip.name!r}"
        check_known_answer(info.codec)
        self.decoder: LiveDecoder = info.codec.follow(info.header, info.layout)
        self._digest = ValueDigest()
        self._mask: NDArray[np.bool_] | None = None  # that packets of kind 2 imply

    def parts(
        self, header: SegmentHeader, packet: int, payload: bytes
    ) -> tuple[bytes, NDArray[np.bool_] | None]:
        """The codec's stream of a segment of one frame, and its mask, (n_channels,).

        ``packet`` is the kind of its packet, 0 for a closed DATA. Raises FormatError,
        UnsupportedError for a segment of several frames.
        """
        if packet == FRAME:
            frame_table(header, self.info.counts, len(payload), 0)
            return payload, self._mask
        where = f"{self._where}, frame {header.first}"
        if header.n_frames != 1 or header.flags & ~(FRESH | MASKS):
            raise UnsupportedError(
                f"a segment of {header.n_frames} frames with flags {header.flags} cannot be "
                "read live; read the whole file",
                where=self._where,
            )
        try:
            table = parse_stream_table(payload, self.info.counts)
        except TruncatedError as error:
            raise FormatError(str(error), where=where) from None
        if table.payload_size != len(payload):
            raise FormatError(
                f"the sizes of the streams do not add up to {len(payload)} bytes", where=where
            )
        streams = [
            payload[at : at + size] for at, size in zip(table.offsets, table.lengths, strict=True)
        ]
        number = table.mask(0)
        mask = self._mask = None
        if number is not None and streams[number]:
            n_channels = self.info.layout.n_channels
            mask = self._mask = parse_mask(streams[number], 1, n_channels, self._where)[0]
        return streams[table.codec(0, 0)], mask

    def digest(self, values: Floats, mask: NDArray[np.bool_] | None) -> None:
        self._digest.update(values[None], None if mask is None else mask[None])

    def check_hash(self, fields: payloads.Cend) -> None:
        """Compare the hash of all frames with that of CEND; raises ChecksumError."""
        hashes = fields.value_sha256
        if len(hashes) != self.n_signals:
            raise FormatError(
                f"{len(hashes)} hashes for {self.n_signals} signals", where=self._where
            )
        if self._digest.digest() != hashes[0]:
            raise ChecksumError("its frames differ from the hash in CEND", where=self._where)
