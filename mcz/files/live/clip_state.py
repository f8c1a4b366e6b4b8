"""The state of a live clip in its reader: the facts of CLIP, its decoder, the hash of its values.

SPEC.md, "Open DATA and packets", is normative.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from mcz.codecs import codec_by_id
from mcz.codecs.contract import LiveDecoder
from mcz.codecs.known_answers import check_known_answer
from mcz.container import payloads
from mcz.container.chunks import SIGNATURE, Chunk, ChunkType, build_foot
from mcz.container.directory import ClipRow
from mcz.container.packets import FRAME
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
from mcz.container.value_hash import ValueDigest
from mcz.errors import ChecksumError, FormatError, TruncatedError, UnsupportedError
from mcz.files.reading.signal_info import SignalInfo, check_roles, read_signal
from mcz.model.motion import Skeleton
from mcz.model.types import Floats

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
        raise FormatError("a clip without a name or a signal", where=f"chunk {chunk.label}")
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
                f"a segment of {header.n_frames} frames, flags {header.flags}, "
                "cannot be followed; read the whole file",
                where=self._where,
            )
        try:
            table = parse_stream_table(payload, self.info.counts)
        except TruncatedError as error:
            raise FormatError(str(error), where=where) from None
        if table.payload_size != len(payload):
            raise FormatError(f"{len(payload)} bytes of streams", where=where)
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
                f"{len(hashes)} hashes of {self.n_signals} signals", where=self._where
            )
        if self._digest.digest() != hashes[0]:
            raise ChecksumError("its frames differ from the hash of its end", where=self._where)
