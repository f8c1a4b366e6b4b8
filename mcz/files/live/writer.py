"""Live clips: frames written as they come, each decodable at once, and read as they arrive.

SPEC.md, "Open DATA and packets", is normative.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from fractions import Fraction
from types import MappingProxyType, TracebackType

import numpy as np
from numpy.typing import NDArray

from mcz.codecs import codec_by_name
from mcz.codecs.contract import Codec, Encoded, LiveDecoder, LiveEncoder, model_finder
from mcz.container.chunks import REPEATED, ChunkFlag, ChunkType
from mcz.container.model_records import MissingRunCounter, ValueDigest
from mcz.container.segments import FRESH, MASKS, SegmentHeader, build_mask
from mcz.container.writer import Sink, Writer
from mcz.errors import LimitError, MotionError, OptionError
from mcz.files.reading.stored_clip import with_indices
from mcz.files.writing.atomic import check_metadata
from mcz.files.writing.clip_writer import begin_open_clip, quality_payload, texts_of
from mcz.files.writing.planning import (
    Prepared,
    StoredSkeleton,
    find_targets,
    plan_open_clip,
    stored_with_base,
    under_its_path,
    wants_positions,
)
from mcz.files.writing.signal_source import MemorySource
from mcz.kinematics.frames import FramePositions
from mcz.kinematics.metrics.sums import RunningFigures
from mcz.kinematics.points import NOTE, SEPARATOR, marker_skeleton
from mcz.model.motion import Motion, Signal, Skeleton
from mcz.model.text_format import fields_text
from mcz.model.types import Floats, Params

MOST_OVER = 1.05  # of a rate that counts as kept
REPEATED_SHARE = 0.1  # of a rate, for headers repeated for joining readers

Mask = NDArray[np.bool_]


@dataclass(slots=True)
class LiveTraffic:
    """The bytes of a live clip on the wire.

    ``total`` bytes were sent, ``frames`` of them for frames, ``coded`` of these as streams of the
    codec; the rest is framing, masks and repeated clip headers. ``asked`` is the last target bit
    rate of the codec, in kbit/s, None without one; ``seconds`` is the duration of the frames, None
    if the frame rate is unknown.
    """

    total: int = 0
    frames: int = 0
    coded: int = 0
    asked: float | None = None
    seconds: float | None = None

    __repr__ = fields_text

    @property
    def is_held(self) -> bool:
        """False if frames take more than the target, and no coarser step would help."""
        if self.asked is None or not self.seconds:
            return True
        return self.frames / 125 / self.seconds <= MOST_OVER * self.asked


class LiveWriter:
    """Writes one clip to ``sink`` frame by frame, without seeking, so a pipe will do.

    ``skeleton`` belongs to the pushed frames; a codec of positions of points codes those, under a
    skeleton of markers. ``codec`` names one that works live, ``params`` are its parameters;
    ``metadata`` are those of the clip, ``first_number`` is the number of its first frame, ``base``
    the id of the skeleton that its own was derived from. Each frame's bytes are written in one
    call, and flushed. Every ``repeat``-th frame that starts fresh, except the first, is preceded by
    the headers that a joining reader needs (0: none is; None: each, with a bit rate as many as take
    a tenth of it). Raises OptionError for a codec that cannot, for a bad parameter or one that
    needs all frames, MotionError for a skeleton without channels.

    ``traffic`` counts the sent bytes. ``entry`` is the offset, in the bytes that are being written
    or were last, where a reader can join that has those of the beginning or finds them repeated
    there; None if there is none.

    As a context manager it closes the clip, also if an interrupt (Ctrl-C) ends the block, as a
    recording is ended. Any other exception aborts it: the file stops without CEND and FOOT, and a
    reader raises TruncatedError after the last frame. An interrupt during a frame waits until that
    is written; a second one truncates the clip.
    """

    def __init__(
        self,
        sink: Sink,
        skeleton: Skeleton,
        codec: str,
        params: Params = MappingProxyType({}),
        *,
        frame_rate: Fraction | None = None,
        frame_rate_exact: bool = True,
        name: str = "live",
        metadata: Mapping[str, str] = MappingProxyType({}),
        first_number: int = 1,
        base: Skeleton | None = None,
        repeat: int | None = None,
    ) -> None:
        if repeat is not None and repeat < 0:
            raise OptionError(f"repeat is {repeat}; it must be 0 or more")
        self.n_frames, self._gaps = 0, MissingRunCounter(first_number)
        self.entry: int | None = None
        self._repeat, self._n_fresh, self._changed = repeat, 0, set[str]()
        self._repeated_at = 0  # frame
        self.codec = codec_by_name(codec)
        self.options = self.codec.options(params)
        self.traffic = LiveTraffic(asked=self.options.get("bitrate"))
        self._rate = frame_rate
        self._outlet = _Outlet(sink, self.traffic)
        self._writer = Writer(self._outlet)
        self._is_open = self._has_data = self._is_stuck = False
        self._mask, self._was_masked = b"", False  # of the previous frame, and of any in the DATA
        check_metadata(metadata, name)
        self.skeleton, self._n_channels = skeleton, skeleton.n_channels
        self._positions = wants_positions(self.codec, self.options, skeleton)
        skeletons = stored_with_base(skeleton, None if base is None else under_its_path(base))
        coded = skeleton
        if self._positions:
            self._placed = FramePositions(skeleton, virtual_markers=self._virtual)
            coded = marker_skeleton(skeleton, virtual_markers=self._virtual)
            skeletons = (*skeletons, StoredSkeleton(coded, derives=True))
        signal = Signal(np.zeros((0, coded.n_channels)))
        if self._positions:
            note = metadata.get("source-note", "")
            metadata = dict(metadata) | {"source-note": SEPARATOR.join(filter(None, (NOTE, note)))}
        motion = Motion(coded, (signal,), frame_rate, frame_rate_exact, name, metadata)
        self._encoder, self._decoder = _open_coders(self.codec, motion, self.options, self._writer)
        live = self._encoder
        encoded = Encoded(live.header, iter(()), 1, live.models, (), live.version, live.preset)
        prepared = Prepared(motion, skeletons)
        plan = plan_open_clip(prepared, self.codec, self.options, encoded, self._writer.profile)
        begin_open_clip(self._writer, plan, first_number)
        self._is_open = True
        self._digest = ValueDigest()
        self._figures = RunningFigures(coded)
        self._opening = self._outlet.chunks(REPEATED) if repeat != 0 else b""  # REPT-01
        self._outlet.send()

    @property
    def _virtual(self) -> bool:
        return bool(self.options.get("virtual_markers"))

    def __enter__(self) -> LiveWriter:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if error is None or isinstance(error, KeyboardInterrupt):
            self.close()
        else:
            self.abort()

    def push(self, values: Floats) -> Floats:
        """Write the next frame, (n_channels,) in source units, NaN where invalid.

        Returns the values that a reader will have, NaN where invalid. Raises MotionError for values
        that the codec cannot hold, LimitError for a frame too large for a packet; nothing is
        written then, and after a LimitError the clip can only be closed: the state of the codec is
        ahead of the file.
        """
        if not self._is_open or self._is_stuck:
            raise MotionError(
                "a frame was too large, the live clip can only be closed"
                if self._is_open
                else "the live clip is closed"
            )
        row = np.asarray(values, np.float64)
        if row.shape != (self._n_channels,):
            raise MotionError(
                f"frame {self.n_frames}: values have shape {row.shape}, but the skeleton has "
                f"{self._n_channels} channels"
            )
        with defer_sigint():
            try:
                return self._push(row)
            except KeyboardInterrupt:  # a second one: the stream ends within a frame
                self._is_open = False
                raise

    def miss(self, n_frames: int = 1) -> None:
        """Skip ``n_frames`` frame numbers after the last one; OptionError before the first."""
        self._gaps.miss(n_frames)

    def _push(self, row: Floats) -> Floats:
        if self._positions:
            row = self._placed(row).reshape(-1)
        known = ~np.isnan(row)
        valid = None if known.all() else known
        finite = row if valid is None else np.where(valid, row, 0.0)
        stream, fresh = self._encoder.push(finite, valid)
        try:
            self._write(stream, fresh, valid)
        except LimitError:
            self._is_stuck = True
            raise
        size = self._outlet.size
        self._outlet.send()
        self._count(size, len(stream))
        decoded = self._decoder.push(stream, fresh)
        self._digest.update(decoded[None], None if valid is None else valid[None])
        self._gaps.frame()
        self.n_frames += 1
        self._figures.add(row, decoded)
        return decoded if valid is None else np.where(valid, decoded, np.nan)

    def _count(self, n_bytes: int, n_coded: int) -> None:
        """Count the bytes of a frame; the codec's budget includes headers before the first."""
        traffic = self.traffic
        if traffic.asked is not None:
            self._encoder.charge(n_bytes if self.n_frames else traffic.total)
        traffic.frames += n_bytes
        traffic.coded += n_coded
        if self._rate:
            traffic.seconds = float((self.n_frames + 1) / self._rate)

    def change(self, /, **params: object) -> None:
        """Change parameters of the codec from the next group of frames on.

        Raises OptionError for one that cannot change, or a bad value; nothing changes then.
        """
        if not self._is_open:
            raise MotionError("the live clip is closed")
        options = self.codec.options(params)
        self._encoder.change({name: options[name] for name in params})
        if "bitrate" in params:
            self.traffic.asked = options["bitrate"]
        self._changed |= set(params)

    def _write(self, stream: bytes, fresh: bool, valid: Mask | None) -> None:
        """Write one frame; a fresh one begins a DATA."""
        self.entry = None
        if fresh and self._has_data:
            self._writer.close_data()
            self._has_data = False
        mask = b"" if valid is None else build_mask(valid[None])
        repeats_mask = self._was_masked and self._encoder.is_reference
        if self._has_data and mask == self._mask and not repeats_mask:
            self._writer.frame(self.n_frames, stream, fresh=fresh)
            return
        if not self._has_data:
            self._begin_data(fresh)
        flags, streams = fresh * FRESH, [stream]
        if mask:
            flags, streams = flags | MASKS, [mask, stream]
        self._writer.segment(SegmentHeader(0, self.n_frames, 1, flags=flags), streams)
        self._mask, self._was_masked = mask, self._was_masked or bool(mask)

    def _begin_data(self, fresh: bool) -> None:
        """Open a DATA, from time to time after a copy of the headers needed to read it.

        One that does not start ``fresh`` follows a heartbeat, and no reader can join there.
        """
        if fresh:
            self.entry = self._outlet.size
            self._n_fresh += 1
            if self._n_fresh > 1 and self._repeats():  # REPT-02
                self._writer.chunk(ChunkType.REPT, self._opening, ChunkFlag.ANCILLARY)
                self._repeated_at = self.n_frames
        self._writer.open_data()
        self._has_data, self._was_masked = True, False

    def _repeats(self) -> bool:
        """True if the fresh frame that is due follows repeated headers."""
        interval = self.traffic.asked
        if self._repeat is not None:
            return self._repeat > 0 and (self._n_fresh - 1) % self._repeat == 0
        if interval is None or not self._rate:
            return True
        spent = 125 * interval * float((self.n_frames - self._repeated_at) / self._rate)
        return len(self._opening) <= REPEATED_SHARE * spent

    def heartbeat(self) -> None:
        """Write an open DATA without a frame, which readers skip.

        It shows readers with a timeout that the stream continues while its source is silent.
        """
        if not self._is_open or self._is_stuck:
            return
        with defer_sigint():
            if self._has_data:
                self._writer.close_data()
                self._has_data = False
            self.entry = self._outlet.size
            self._writer.open_data()
            self._writer.close_data()
            self._outlet.send()

    def abort(self) -> None:
        """Leave the clip without an end, so that readers see that it is incomplete."""
        self._is_open = False

    def close(self) -> None:
        """Write the parts after the frames: hash, quality record, index."""
        with defer_sigint():
            if self._is_open:
                self._is_open = False
                self._end()

    def _end(self) -> None:
        if self._has_data:
            self._writer.close_data()
        self.entry = self._outlet.size
        hashes, missing = [self._digest.digest()], self._gaps.runs
        self._writer.end_clip(self.n_frames, b"", hashes, missing=missing)
        if not self.codec.lossless:
            fixed = {k: v for k, v in self.options.items() if k not in self._changed}
            settings = {f"param.{name}": value for name, value in fixed.items()}
            record = {"codec": self.codec.name, **settings, **self._figures.entries()}
            stored = with_indices(texts_of(record), self._figures.skeleton)
            self._writer.ancillary(ChunkType.QUAL, quality_payload(stored))
        self._writer.finish()
        self._outlet.send()


def _open_coders(
    codec: Codec, motion: Motion, options: Params, writer: Writer
) -> tuple[LiveEncoder, LiveDecoder]:
    if codec.live is None or codec.follow is None:
        raise OptionError(f"codec {codec.name} does not work frame by frame")
    if find_targets(options):
        raise OptionError(
            f"{', '.join(find_targets(options))}: a live stream cannot meet a target that "
            "depends on all frames"
        )
    layout = MemorySource(motion, 0, codec, writer.profile.segment_bytes).layout
    if len(layout.groups) != 1:
        raise MotionError(
            f"codec {codec.name}: {len(layout.groups)} groups, but a live clip has one"
        )
    encoder = codec.live(layout, options)
    known = replace(layout, find_model=model_finder(encoder.models))
    return encoder, codec.follow(encoder.header, known)


class _Outlet:
    def __init__(self, sink: Sink, traffic: LiveTraffic) -> None:
        self._sink, self._traffic = sink, traffic
        self._parts: list[bytes] = []

    def write(self, data: bytes, /) -> None:
        self._parts.append(data)

    @property
    def size(self) -> int:
        """The bytes that were collected and not sent."""
        return sum(map(len, self._parts))

    def chunks(self, kinds: Sequence[bytes]) -> bytes:
        """Join the collected chunks of these types, in order."""
        return b"".join(part for part in self._parts if part[:4] in kinds)

    def send(self) -> None:
        self._traffic.total += self.size
        while self._parts:
            data = b"".join(self._parts)
            n_written = self._sink.write(data)  # a raw stream may write only a part
            left = b"" if n_written is None else data[n_written:]
            self._parts = [left] if left else []
        flush = getattr(self._sink, "flush", None)
        if flush is not None:
            flush()


@contextmanager
def defer_sigint() -> Iterator[None]:
    """Delay an interrupt (Ctrl-C) to the end of the block; a second one does not wait.

    Only the main thread is ever interrupted, and only if Python handles the signal.
    """
    handler = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(handler):
        yield
        return
    signals = []

    def wait(number: int, frame: object) -> None:
        signals.append(number)
        signal.signal(signal.SIGINT, handler)

    signal.signal(signal.SIGINT, wait)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)
        if signals:
            signal.raise_signal(signal.SIGINT)
