"""A motion whose text arrives line by line -> a live clip."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from fractions import Fraction

from mcz.codecs import codec_by_name
from mcz.container.writer import Sink
from mcz.errors import OptionError, SourceError
from mcz.files.live.writer import LiveWriter
from mcz.files.reading.read import NONE
from mcz.files.reading.read import NOTE as SKELETON_NOTE
from mcz.files.reading.source_files import SourceOptions, read_skeleton
from mcz.files.writing.file import EncodingOptions, rate_notes
from mcz.model.motion import Skeleton
from mcz.model.types import Params
from mcz.model.units import in_unit, with_axes
from mcz.sources import FORMATS, likely_formats
from mcz.sources.text.source import Arriving

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
        due, is_renumbered = self._open_source.first_number, False
        for number, values in self._open_source.frames:
            if number is not None and number != due:
                if number > due:
                    self.writer.miss(number - due)
                elif not is_renumbered:
                    remark = f"frame {number} comes where {due} is due; the clip counts on"
                    self.remarks = (*self.remarks, remark)
                    is_renumbered = True
                due = number
            self.writer.push(values)
            due += 1
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
    """A live clip, up to its first frame, of the motion in ``lines``.

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
        raise OptionError("the format is unknown; name it")
    return FORMATS[formats[0]].suffix
