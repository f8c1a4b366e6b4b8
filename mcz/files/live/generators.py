"""Live streams as Python generators: rows of numbers -> bytes to send, and back.

Frames are read strictly here; ``reader_with_losses.py`` continues after lost ones. SPEC.md, "Open
DATA and packets", is normative.
"""

from __future__ import annotations

import io
from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcz.container import payloads
from mcz.container.chunks import ChunkType, build_foot
from mcz.container.directory import SegmentRow
from mcz.container.encodings import chunk_id
from mcz.container.grammar import ChunkEvent, PacketEvent
from mcz.container.parser_drivers import Stream
from mcz.container.reader import Container
from mcz.container.scanner import Scanner
from mcz.container.segments import FRESH
from mcz.container.source import ByteSource
from mcz.errors import FormatError, MotionError, OptionError, TruncatedError
from mcz.files.live.clip_state import (
    LOST,
    ClipState,
    LiveClip,
    LiveFrame,
    Lost,
    Shared,
    begin_clip,
    opening,
)
from mcz.files.live.reader_with_losses import FramesWithLosses, StreamSummary
from mcz.files.live.writer import LiveWriter
from mcz.files.reading.clip import Clip
from mcz.model.motion import POSITION_KINDS, Channel, Joint, Skeleton
from mcz.model.schema import parse
from mcz.model.types import Params, Values
from mcz.model.units import in_unit, with_axes

if TYPE_CHECKING:
    from mcz.codecs.transforms.post_filter import PostFilter

Frame = tuple[int, Values, NDArray[np.bool_]]
SHARED = (ChunkType.SKEL, ChunkType.MODL, ChunkType.SRCE)  # chunks that clips refer to


def live_frames(stream: BinaryIO) -> Iterator[Frame]:
    """The frames of the MCZ file in a binary stream, each as soon as its bytes are there.

    Yields the number of the frame in its clip, from 0, its values and their validity, both
    (n_channels,) of the motion signal, the values NaN where invalid. A clip whose codec does not
    decode frame by frame comes when it has ended. Raises FormatError at the first fault, after all
    frames before it: TruncatedError where the stream ends too early, ChecksumError where the frames
    of a clip differ from its hash. ``stream_decode`` can continue instead.
    """
    if not hasattr(stream, "read"):
        raise OptionError(f"cannot read from {stream!r}, which is not a binary stream")
    frames = StrictFrames(stream, StreamSummary()).frames()
    return ((frame.number, frame.values, frame.valid) for frame in frames)


class StrictFrames:
    """The frames of a stream; ``clip`` is the clip of the last one."""

    def __init__(self, stream: BinaryIO, summary: StreamSummary) -> None:
        self._stream, self.summary = Stream(stream), summary
        self.scanner = Scanner(None)
        self.clip: LiveClip | None = None
        self.is_checked = False  # a value hash was right

    @property
    def size(self) -> int:
        return self._stream.size

    def frames(self) -> Iterator[LiveFrame]:
        """As ``live_frames``."""
        head = b""
        shared: Shared = {}
        clip: ClipState | _WholeClip | None = None
        for event in self._stream.events(self.scanner.parser):
            self.scanner.take(event)
            if not isinstance(event, (ChunkEvent, PacketEvent)):
                continue
            kind = event.chunk.type
            if kind == ChunkType.HEAD:
                head = event.data
            elif kind in SHARED:
                shared.setdefault((kind, chunk_id(kind, event.payload)), event.data)
            elif kind == ChunkType.CLIP:
                row = self.scanner.clip
                assert row is not None
                fields = parse(payloads.Clip, event.payload, row.clip.label)
                before = opening(head, shared, fields)
                clip = begin_clip(head, shared, row, fields) or _WholeClip(
                    before + event.data, row.name
                )
            elif isinstance(clip, ClipState):
                if kind == ChunkType.CEND:
                    clip.check_hash(parse(payloads.Cend, event.payload, "CEND"))  # PACK-19
                    self.is_checked = True
                for segment in self.scanner.clip.segments if self.scanner.clip else ():
                    yield from self._frame(clip, segment, event.payload)
            elif clip is not None:
                yield from clip.take(self, kind, event)
            self.scanner.forget()
            clip = None if kind == ChunkType.CEND else clip
        self.summary.is_checked = self.is_checked

    def _frame(self, clip: ClipState, row: SegmentRow, payload: bytes) -> Iterator[LiveFrame]:
        if row.header.signal:
            return
        stream, mask = clip.parts(row.header, row.packet, payload)
        self.summary.payload_bytes += len(stream)
        frame = row.header.first
        fresh = bool(row.header.flags & FRESH)
        if not (frame or fresh):
            raise FormatError("the first segment depends on an earlier one", clip=clip.clip.name)
        values = clip.decoder.push(stream, fresh)
        if clip.shown is not None:
            if frame not in clip.shown:
                return
            frame -= clip.shown.start
        clip.digest(values, mask)
        self.clip = clip.clip
        if mask is None:
            yield LiveFrame(frame, values, np.ones(values.shape, np.bool_))
        else:
            yield LiveFrame(frame, np.where(mask, values, np.nan), mask)


class _WholeClip:
    def __init__(self, data: bytes, name: str) -> None:
        self._parts, self._name = [data], name

    def take(
        self, reader: StrictFrames, kind: bytes, event: ChunkEvent | PacketEvent
    ) -> Iterator[LiveFrame]:
        self._parts.append(event.data)
        if kind != ChunkType.CEND:
            return
        data = b"".join(self._parts) + build_foot(0, 0)
        container = Container(ByteSource(io.BytesIO(data)), verify=True)
        clip = Clip(container, container.directory.clips[self._name])
        values, mask = clip.read_masked()
        reader.clip = LiveClip(clip.name, clip.skeleton, clip.frame_rate, clip.codec)
        reader.summary.payload_bytes += sum(row.size for row in clip.signals[0].rows)
        reader.is_checked = True
        per_frame = clip.signals[0].layout.samples_per_frame
        valid = np.ones(values.shape, np.bool_) if mask is None else mask
        if not valid.all():
            values = np.where(valid, values, np.nan)
        for frame in range(clip.n_frames):
            rows = frame if per_frame == 1 else slice(frame * per_frame, (frame + 1) * per_frame)
            yield LiveFrame(frame, values[rows], valid[rows])


AXES = "xyz"
Row = ArrayLike | Params


def stream_encode(
    frames: Iterable[Row],
    skeleton: Skeleton | Sequence[str],
    *,
    codec: str = "online",
    params: Params = MappingProxyType({}),
    frame_rate: Fraction | None = None,
    unit: str | None = None,
    up: str | None = None,
    name: str = "live",
    metadata: Mapping[str, str] = MappingProxyType({}),
    repeat: int | None = None,
) -> Iterator[bytes]:
    """The bytes of a live clip: first what precedes the frames, then each frame as it comes.

    ``skeleton`` may be names instead, of markers or of their coordinates (see ``markers``).
    ``frames`` yields rows in source units, (n_channels,), NaN where invalid; a mapping among them
    changes parameters of the codec from the next group of frames on. The bytes of a frame are
    yielded before the next is read. If ``frames`` raises, so does this, and the stream has no end.
    ``repeat`` and errors: see ``LiveWriter``.
    """
    sink = io.BytesIO()
    known = skeleton if isinstance(skeleton, Skeleton) else markers(skeleton)
    writer = LiveWriter(
        sink,
        with_axes(in_unit(known, unit), up),
        codec,
        params,
        frame_rate=frame_rate,
        name=name,
        metadata=metadata,
        repeat=repeat,
    )
    yield _drain(sink)
    for row in frames:
        if isinstance(row, Mapping):
            writer.change(**{str(name): value for name, value in row.items()})
        else:
            writer.push(_to_floats(row))
            yield _drain(sink)
    writer.close()
    yield _drain(sink)


def _to_floats(row: ArrayLike) -> NDArray[np.float64]:
    try:
        return np.asarray(row, np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise MotionError(f"a row is not numeric: {error}") from None


def _drain(sink: io.BytesIO) -> bytes:
    data = sink.getvalue()
    sink.seek(0)
    sink.truncate()
    return data


def markers(names: Sequence[str]) -> Skeleton:
    """A skeleton of markers of these ``names``, or of those whose coordinates they name.

    Coordinates are ``a.x a.y a.z``, or ``a.tx a.ty a.tz``, of each marker in turn. Raises
    OptionError for no names, an empty one, or coordinates in another order.
    """
    if not names or not all(names):
        raise OptionError("a stream needs marker names, and none may be empty")
    split = [name.rpartition(".") for name in names]
    named_axes = [(marker, axis.removeprefix("t")) for marker, _, axis in split]
    if len(names) % 3 == 0 and {axis for _, axis in named_axes} == set(AXES):
        chosen = [marker for marker, _ in named_axes[::3]]
        expected = [(marker, axis) for marker in chosen for axis in AXES]
        if named_axes != expected:
            raise OptionError(
                f"{', '.join(names[:3])}, ... must name x, y and z of each marker in turn"
            )
        names = chosen
    channels = tuple(map(Channel, POSITION_KINDS))
    return Skeleton(tuple(Joint(name, channels=channels) for name in names))


def stream_decode(
    source: object,
    *,
    lost: Lost = "refuse",
    join: bool = False,
    post_filter: bool = False,
    rate: Fraction | None = None,
) -> LiveReader:
    """The frames of the MCZ file in ``source``, each as soon as its bytes are there.

    ``source`` is a binary stream, bytes, or an iterable of such. ``lost`` decides about frames that
    do not come, come damaged, or need such a one: ``refuse`` raises at the first fault, as
    ``live_frames``; ``missing`` gives NaN, ``hold`` the last decoded values, ``linear`` a straight
    line to the next decoded ones, when these have come. Frames before the first decoded one are
    missing. With ``join`` the stream may begin anywhere, and frames start with the first one whose
    number is known. ``post_filter``: positions go through the post filter, with a delay of 12
    frames; ``rate`` is the frame rate of a clip that states none.

    With ``lost`` other than ``refuse``, FormatError is raised where a clip cannot be read at all,
    and ChecksumError where all of its frames came and differ from its hash.
    """
    if lost not in LOST:
        raise OptionError(f"lost is {lost!r}; it must be one of {', '.join(LOST)}")
    return LiveReader(_stream_of(source), lost, join, rate, post_filter=post_filter)


def _stream_of(source: object) -> Any:
    if hasattr(source, "read"):
        return source
    if isinstance(source, bytes | bytearray | memoryview):
        return io.BytesIO(source)
    if isinstance(source, str) or not isinstance(source, Iterable):
        raise OptionError(
            f"cannot read from {source!r}, which is neither a binary stream nor bytes"
        )
    return _PieceStream(source)


class LiveReader:
    """Iterates over the ``LiveFrame`` of a stream.

    ``summary`` counts the input up to now, ``clip`` is the clip of the last frame, None before.
    """

    def __init__(
        self, stream: BinaryIO, lost: Lost, join: bool, rate: Fraction | None, *, post_filter: bool
    ) -> None:
        self.summary = StreamSummary()
        self.clip: LiveClip | None = None
        if lost == "refuse" and not join:
            self._source: StrictFrames | FramesWithLosses = StrictFrames(stream, self.summary)
        else:
            self._source = FramesWithLosses(stream, lost, join, self.summary)
        self._filter_rate = rate
        self._frames = self._filter_frames() if post_filter else self._count_frames()

    def __iter__(self) -> LiveReader:
        return self

    def __next__(self) -> LiveFrame:
        return next(self._frames)

    def _count_frames(self) -> Iterator[LiveFrame]:
        source, summary = self._source, self.summary
        try:
            for frame in source.frames():
                self.clip, summary.stream_bytes = source.clip, source.size
                summary.count(frame)
                yield frame
        except TruncatedError:
            summary.is_cut = True
            raise
        finally:
            summary.stream_bytes = source.size

    def _filter_frames(self) -> Iterator[LiveFrame]:
        """The frames 12 later, their positions filtered; gaps in their numbers separate them."""
        waiting: deque[LiveFrame] = deque()
        stage: PostFilter | None = None
        clip: LiveClip | None = None
        try:
            for frame in self._count_frames():
                follows = waiting and frame.number == waiting[-1].number + 1
                if stage is None or clip is not self.clip or not follows:
                    now, self.clip = self.clip, clip or self.clip
                    yield from _flush(stage, waiting)
                    self.clip = clip = now
                    stage = self._stage()
                waiting.append(frame)
                row = stage.push(np.asarray(frame.values, np.float64))
                if row is not None:
                    yield _with_values(waiting.popleft(), row)
        except FormatError:
            yield from _flush(stage, waiting)
            raise
        yield from _flush(stage, waiting)

    def _stage(self) -> PostFilter:
        from mcz.files.reading.post_filtering import live_filter

        assert self.clip is not None
        rate = self.clip.frame_rate
        rate = self._filter_rate if rate is None else rate
        return live_filter(self.clip.skeleton, rate, self.clip.name)


def _flush(stage: PostFilter | None, waiting: deque[LiveFrame]) -> Iterator[LiveFrame]:
    if stage is not None:
        for row in stage.finish():
            yield _with_values(waiting.popleft(), row)


def _with_values(frame: LiveFrame, row: Any) -> LiveFrame:
    return replace(frame, values=np.where(frame.valid, row, np.nan))


class _PieceStream:
    def __init__(self, pieces: Iterable[bytes]) -> None:
        self._pieces = iter(pieces)

    def read1(self, size: int) -> bytes:
        """The next piece that is not empty, of any size; empty at the end."""
        for piece in self._pieces:
            if not isinstance(piece, bytes | bytearray | memoryview):
                raise OptionError(f"cannot read from {piece!r}, which is not bytes")
            if piece:
                return bytes(piece)
        return b""
