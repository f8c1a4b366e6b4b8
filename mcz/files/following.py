"""Reading a clip while it is being written.

Part of the joint between motion, codec and container (see ``file.py``). SPEC.md, "Open DATA and
packets", is normative.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcz.codecs import by_id
from mcz.container import payloads
from mcz.container.chunks import SIGNATURE, build_foot
from mcz.container.directory import ClipRow
from mcz.container.following import Arrival, Follower
from mcz.container.packets import FRAME
from mcz.container.reader import Container
from mcz.container.segments import FRESH, MASKS, frame_table, parse_table
from mcz.container.skeletons import parse_skeleton
from mcz.container.source import ByteSource
from mcz.container.writer import payload_id
from mcz.errors import ChecksumError, FormatError, OptionError, TruncatedError, UnsupportedError
from mcz.files.clip import Clip
from mcz.files.digest import ValueDigest
from mcz.files.masks import parse_mask
from mcz.files.signal_info import SignalInfo, read_signal
from mcz.schema import parse

Floats = NDArray[np.float64]
Frame = tuple[int, NDArray[Any], NDArray[np.bool_]]
SHARED = (b"SKEL", b"MODL", b"SRCE")  # what clips refer to
Shared = dict[tuple[bytes, bytes], bytes]  # kind and id -> chunk


def live_frames(stream: Any) -> Iterator[Frame]:
    """The frames of the MCZ file that a binary stream gives, each as soon as its bytes are there.

    Yields the number of the frame in its clip, from 0, its values and which of them are valid, both
    (n_channels,) of the motion signal, the values NaN where invalid. A clip whose codec does not
    decode frame by frame comes when it has ended. Raises FormatError at the first fault, after all
    frames before it: TruncatedError where the stream ends too early, ChecksumError where the
    frames of a clip were not those that it was closed with.
    """
    if not hasattr(stream, "read"):
        raise OptionError(f"cannot read from {stream!r}: not a binary stream")
    follower = Follower(stream)
    head = b""
    shared: Shared = {}
    clip: _Followed | _Held | None = None
    for arrival in follower.arrivals():
        kind = arrival.chunk.type if arrival.chunk is not None else b"FOOT"
        if kind == b"HEAD":
            head = SIGNATURE + arrival.data
        elif kind in SHARED:
            shared.setdefault((kind, payload_id(arrival.payload)), arrival.data)
        elif kind == b"CLIP":
            assert follower.clip is not None
            fields = parse(payloads.CLIP, arrival.payload, follower.clip.clip.label)
            needed = [shared[key] for key in _needs(fields) if key in shared]
            clip = _begin(b"".join([head, *needed]), follower.clip, fields, arrival)
        elif clip is not None:
            yield from clip.take(kind, arrival)
            clip = None if kind == b"CEND" else clip


def _needs(fields: Any) -> Iterator[tuple[bytes, bytes]]:
    """Kind and id of the chunks that a clip cannot be read without."""
    yield b"SKEL", bytes(fields.skeleton)
    for source in fields.source:
        yield b"SRCE", bytes(source.template)
    for signal in fields.signals:
        with suppress(FormatError):  # it is said when the signal is read
            uses = by_id(signal.codec, signal.codec_version).uses
            for id_ in () if uses is None else uses(bytes(signal.header)):
                yield b"MODL", id_


def _begin(shared: bytes, row: ClipRow, fields: Any, arrival: Arrival) -> _Followed | _Held:
    """What reads the frames of the clip that begins."""
    container = Container(ByteSource(io.BytesIO(shared + build_foot(0, 0))))
    where = f"SKEL {row.skeleton.hex()}"
    bones = container.shared(b"SKEL", row.skeleton, payloads.SKEL)
    skeleton = parse_skeleton(bones, container.profile, where)
    rate = Fraction(row.rate_numerator, row.rate_denominator) if row.rate_numerator else None
    motion = fields.signals[0]
    shown = range(motion.skip, motion.skip + fields.n_frames)
    motion.skip = motion.spare = 0
    nothing = replace(row, n_frames=0, segments=[])  # it is not known what will come
    info = read_signal(container, nothing, fields, 0, skeleton, rate)
    one = (info.counts.n_groups, info.counts.n_resolutions, info.layout.samples_per_frame)
    if info.codec.follow is None or one != (1, 1, 1):
        return _Held(shared + arrival.data, row.name)
    is_open = bool(fields.flags & payloads.OPEN_CLIP)
    return _Followed(row.name, info, None if is_open else shown, len(fields.signals))


class _Held:
    """A clip that is decoded when it has ended."""

    def __init__(self, data: bytes, name: str) -> None:
        self._parts, self._name = [data], name

    def take(self, kind: bytes, arrival: Arrival) -> Iterator[Frame]:
        self._parts.append(arrival.data)
        if kind != b"CEND":
            return
        container = Container(ByteSource(io.BytesIO(b"".join(self._parts) + build_foot(0, 0))))
        clip = Clip(container, container.directory.clips[self._name])
        values, mask = clip.read_masked()
        per_frame = clip.signals[0].layout.samples_per_frame
        valid = np.ones(values.shape, np.bool_) if mask is None else mask
        if not valid.all():
            values = np.where(valid, values, np.nan)
        for frame in range(clip.n_frames):
            rows = frame if per_frame == 1 else slice(frame * per_frame, (frame + 1) * per_frame)
            yield frame, values[rows], valid[rows]


class _Followed:
    """A clip that is decoded frame by frame."""

    def __init__(self, name: str, info: SignalInfo, shown: range | None, n_signals: int) -> None:
        assert info.codec.follow is not None
        self.info, self.shown, self.n_signals = info, shown, n_signals
        self._where = f"clip {name!r}"
        self._decoder = info.codec.follow(info.header, info.layout)
        self._digest = ValueDigest()

    def take(self, kind: bytes, arrival: Arrival) -> Iterator[Frame]:
        row = arrival.segment
        if kind == b"CEND":
            self._check_hash(parse(payloads.CEND, arrival.payload, "CEND"))
        if row is None or row.header.signal:
            return
        stream, mask = self._parts(arrival)
        frame = row.header.first
        fresh = bool(row.header.flags & FRESH)
        if not (frame or fresh):
            raise FormatError(f"{self._where}: the first segment needs one before it")
        values = self._decoder.push(stream, fresh)
        if self.shown is not None:
            if frame not in self.shown:
                return
            frame -= self.shown.start
        self._digest.update(values[None], None if mask is None else mask[None])
        if mask is None:
            yield frame, values, np.ones(values.shape, np.bool_)
        else:
            yield frame, np.where(mask, values, np.nan), mask

    def _parts(self, arrival: Arrival) -> tuple[bytes, NDArray[np.bool_] | None]:
        """The codec's stream of a segment of one frame, and its mask."""
        row, payload = arrival.segment, arrival.payload
        assert row is not None
        header, counts = row.header, self.info.counts
        if row.packet == FRAME:
            frame_table(header, counts, row.size)
            return payload, None
        if header.n_frames != 1 or header.flags & ~(FRESH | MASKS):
            raise UnsupportedError(
                f"{self._where}: a segment of {header.n_frames} frames, flags {header.flags}, "
                "cannot be followed; read the whole file"
            )
        try:
            table = parse_table(payload, counts)
        except TruncatedError as error:
            raise FormatError(f"{self._where}, frame {header.first}: {error}") from None
        if table.payload_size != row.size:
            raise FormatError(f"{self._where}, frame {header.first}: {row.size} bytes of streams")
        streams = [
            payload[at : at + size] for at, size in zip(table.offsets, table.lengths, strict=True)
        ]
        place = table.mask(0)
        mask = None
        if place is not None and streams[place]:
            mask = parse_mask(streams[place], 1, self.info.layout.n_channels, self._where)[0]
        return streams[table.codec(0, 0)], mask

    def _check_hash(self, fields: Any) -> None:
        hashes = fields.value_sha256
        if len(hashes) != self.n_signals:
            raise FormatError(f"{self._where}: {len(hashes)} hashes of {self.n_signals} signals")
        if self._digest.digest() != hashes[0]:
            raise ChecksumError(f"{self._where}: its frames are not those it was closed with")
