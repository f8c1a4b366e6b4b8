"""Live streams as Python generators: rows of numbers, or lines of text, -> bytes to send, and back.

SPEC.md, "Open DATA and packets", is normative.
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

from mcz.codecs import codec_by_name
from mcz.container.writer import Sink
from mcz.errors import FormatError, MotionError, OptionError, SourceError, TruncatedError
from mcz.files.live.clip_state import LOST, LiveClip, LiveFrame, Lost, StreamSummary, StrictFrames
from mcz.files.live.reader_with_losses import FramesWithLosses
from mcz.files.live.writer import LiveWriter
from mcz.files.reading.read import NONE
from mcz.files.reading.read import NOTE as SKELETON_NOTE
from mcz.files.reading.source_files import SourceOptions, read_skeleton
from mcz.files.writing.file import EncodingOptions, rate_notes
from mcz.model.checks import check_arguments
from mcz.model.motion import POSITION_KINDS, Channel, Joint, Skeleton
from mcz.model.text_format import compression_remark
from mcz.model.types import Params, Values
from mcz.model.units import in_unit, with_axes
from mcz.sources import FORMATS, likely_formats
from mcz.sources.text.source import Arriving

if TYPE_CHECKING:
    from mcz.codecs.transforms.post_filter import PostFilter

Frame = tuple[int, Values, NDArray[np.bool_]]


def live_frames(stream: BinaryIO) -> Iterator[Frame]:
    """Yield the frames of the MCZ file in a binary stream as they arrive.

    Yields the number of the frame in its clip, from 0, its values and their validity, both
    (n_channels,) of the motion signal, the values NaN where invalid. A clip whose codec does not
    decode frame by frame comes when it has ended. Raises FormatError at the first fault, after all
    frames before it: TruncatedError if the stream ends too early, ChecksumError if the frames
    of a clip differ from its hash. ``stream_decode`` can continue instead.
    """
    if not hasattr(stream, "read"):
        raise OptionError(f"cannot read from {stream!r}, which is not a binary stream")
    frames = StrictFrames(stream, StreamSummary()).frames()
    return ((frame.number, frame.values, frame.valid) for frame in frames)


AXES = "xyz"
Row = ArrayLike | Params


@check_arguments()
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
    """Yield the bytes of a live clip: those before the frames, then each frame as it comes.

    ``skeleton`` may be names instead, of markers or of their coordinates (see ``markers``).
    ``frames`` yields rows in source units, (n_channels,), NaN where invalid; a mapping among them
    changes parameters of the codec from the next group of frames on. The bytes of a frame are
    yielded before the next is read. If ``frames`` raises, so does this, and the stream has no end.
    ``repeat`` and errors: see ``LiveWriter``.
    """
    sink = io.BytesIO()
    resolved = skeleton if isinstance(skeleton, Skeleton) else markers(skeleton)
    writer = LiveWriter(
        sink,
        with_axes(in_unit(resolved, unit), up),
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
    """A skeleton of markers; ``names`` are theirs, or those of their coordinates.

    Coordinates are ``a.x a.y a.z``, or ``a.tx a.ty a.tz``, for each marker. Raises OptionError for
    no names, an empty one, or coordinates in another order.
    """
    if not isinstance(names, Sequence) or not all(isinstance(name, str) for name in names):
        raise OptionError(f"skeleton is {names!r}; it must be a Skeleton or a list of marker names")
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
    """Iterate over the frames of the MCZ file in ``source`` as they arrive.

    ``source`` is a binary stream, bytes, or an iterable of bytes. ``lost`` decides about frames
    that are missing, damaged or depend on such a frame: ``refuse`` raises at the first fault, as
    ``live_frames``; ``missing`` gives NaN, ``hold`` the last decoded values, ``linear`` a straight
    line to the next decoded ones, when these have come. Frames before the first decoded one are
    missing. With ``join`` the stream may begin anywhere, and frames start with the first one whose
    number is known. ``post_filter``: positions go through the post filter, with a delay of 12
    frames; ``rate`` is the frame rate of a clip that states none.

    With ``lost`` other than ``refuse``, FormatError is raised if a clip cannot be read at all,
    and ChecksumError if all of its frames came and differ from its hash.
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
        """Yield frames with filtered positions, 12 frames late; a gap restarts the filter."""
        waiting: deque[LiveFrame] = deque()
        post_filter: PostFilter | None = None
        clip: LiveClip | None = None
        try:
            for frame in self._count_frames():
                follows = waiting and frame.number == waiting[-1].number + 1
                if post_filter is None or clip is not self.clip or not follows:
                    current, self.clip = self.clip, clip or self.clip
                    yield from _flush(post_filter, waiting)
                    self.clip = clip = current
                    post_filter = self._stage()
                waiting.append(frame)
                row = post_filter.push(np.asarray(frame.values, np.float64))
                if row is not None:
                    yield _with_values(waiting.popleft(), row)
        except FormatError:
            yield from _flush(post_filter, waiting)
            raise
        yield from _flush(post_filter, waiting)

    def _stage(self) -> PostFilter:
        from mcz.files.reading.post_filtering import live_filter

        assert self.clip is not None
        rate = self.clip.frame_rate
        rate = self._filter_rate if rate is None else rate
        return live_filter(self.clip.skeleton, rate, self.clip.name)


def _flush(post_filter: PostFilter | None, waiting: deque[LiveFrame]) -> Iterator[LiveFrame]:
    if post_filter is not None:
        for row in post_filter.finish():
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


NOTE = "coded live, frame by frame, from {format} text, which was not kept"


class LiveText:
    """A motion that arrives as text, and ``writer``, which writes it.

    ``remarks`` list facts that the clip cannot hold, complete when ``push_all`` has returned.
    """

    def __init__(self, arriving: Arriving, writer: LiveWriter, remarks: tuple[str, ...]) -> None:
        self.writer, self.remarks = writer, remarks
        self._open_source = arriving

    def push_all(self) -> None:
        """Write each frame before the next line is read.

        Raises SourceError for malformed text, for a last line without a line end, and for fewer
        frames than declared; the clip has all frames before that.
        """
        expected, is_renumbered = self._open_source.first_number, False
        for number, values in self._open_source.frames:
            if number is not None and number != expected:
                if number > expected:
                    self.writer.miss(number - expected)
                elif not is_renumbered:
                    remark = f"frame {number} instead of {expected}; the clip continues its count"
                    self.remarks = (*self.remarks, remark)
                    is_renumbered = True
                expected = number
            self.writer.push(values)
            expected += 1
        declared, n_frames = self._open_source.declared, self.writer.n_frames
        if declared not in (None, n_frames):
            remark = f"{declared} frames are declared, {n_frames} came"
            if n_frames < declared:
                raise SourceError(remark)
            self.remarks = (*self.remarks, remark)


def begin_live(
    lines: Iterable[bytes],
    sink: Sink,
    source_format: str,
    options: SourceOptions,
    encoding: EncodingOptions,
) -> LiveText:
    """Begin a live clip of the motion in ``lines``, up to its first frame.

    The caller uses its writer as a context manager. ``source_format`` is ``bvh`` or ``amc``; an AMC
    needs the ``skeleton`` of ``options``, its ASF. Raises SourceError for malformed text, and
    otherwise as ``LiveWriter``.
    """
    arriving, base = _open_source(_check_lines(lines), source_format, options)
    notes = [arriving.metadata.get("source-note", ""), NOTE.format(format=source_format.upper())]
    metadata = dict(arriving.metadata) | {"source-note": "; ".join(filter(None, notes))}
    writer = LiveWriter(
        sink,
        with_axes(in_unit(arriving.skeleton, options.unit), *options.axes),
        encoding.codec,
        encoding.params,
        frame_rate=arriving.frame_rate if options.rate is None else Fraction(options.rate),
        frame_rate_exact=arriving.frame_rate_exact if options.rate is None else True,
        metadata=metadata,
        first_number=arriving.first_number,
        base=base,
    )
    return LiveText(arriving, writer, _remarks_on(arriving, options))


def _check_lines(lines: Iterable[bytes]) -> Iterator[bytes]:
    """Lines as they come; raises SourceError for a last one that may be truncated."""
    for number, line in enumerate(lines, 1):
        if not line.endswith(b"\n") and line.strip():
            raise SourceError(f"line {number} has no line end: the source was cut off")
        yield line


def _open_source(
    lines: Iterable[bytes], source_format: str, options: SourceOptions
) -> tuple[Arriving, Skeleton | None]:
    text_format = FORMATS.get(source_format)
    if text_format is None or text_format.arrive is None:
        able = ", ".join(f.name for f in FORMATS.values() if f.arrive is not None)
        raise OptionError(
            f"format {source_format!r} cannot be read line by line; these can: {able}"
        )
    base = None
    if text_format.wants_skeleton:
        if options.skeleton is None or options.skeleton == NONE:
            raise OptionError(f"{source_format} read line by line needs its skeleton file")
        base = in_unit(read_skeleton(options.skeleton), options.unit)
    arriving: Arriving = text_format.arrive(iter(lines), base)
    return arriving, base


def _remarks_on(arriving: Arriving, options: SourceOptions) -> tuple[str, ...]:
    notes = tuple(rate_notes(arriving.frame_rate, options))
    if SKELETON_NOTE not in arriving.metadata:
        return notes
    return (f"{options.skeleton} does not fit: {arriving.metadata[SKELETON_NOTE]}", *notes)


def codes_live(codec: str, params: Params) -> bool:
    """Return True if the codec of that name, with these parameters, codes frame by frame.

    Raises OptionError for an unknown codec or parameter.
    """
    chosen = codec_by_name(codec)
    if chosen.live is None:
        return False
    options = chosen.options(params)
    return all(options[name] == value for name, value in chosen.live_options.items())


def suffix_of(data: bytes, format_name: str | None) -> str:
    """The suffix of files of a source format, or the likely one of ``data``; OptionError."""
    formats = likely_formats(data) if format_name is None else (format_name,)
    if not formats:
        raise OptionError(compression_remark(data) or "the format is unknown; name it")
    return FORMATS[formats[0]].suffix
