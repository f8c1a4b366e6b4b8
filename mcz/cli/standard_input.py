"""Standard input: a whole file, a motion coded frame by frame, or rows of numbers."""

from __future__ import annotations

import csv
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from io import BufferedReader, FileIO, RawIOBase
from pathlib import Path
from select import select
from tempfile import TemporaryDirectory
from time import monotonic
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from mcz.cli.common import Exit, Failure, check_new, errors_about
from mcz.cli.shared_options import literal
from mcz.cli.terminal import binary_output, echo, plural, say
from mcz.errors import MczError, OptionError, SourceError
from mcz.model.motion import Skeleton
from mcz.model.text_format import cell_text, quote
from mcz.model.types import JsonObject

if TYPE_CHECKING:
    from _typeshed import WriteableBuffer

    from mcz.files.live.writer import LiveTraffic, LiveWriter


NAME = "standard input"
PATIENCE = 0.3  # seconds between two checks for an interrupt while waiting for input


def standard_input() -> BinaryIO:
    """Standard input as bytes; raises Failure if it is closed."""
    if sys.stdin is None:
        raise Failure(f"{NAME} is closed")
    return sys.stdin.buffer


def live_input(timeout: float | None = None) -> BinaryIO:
    """Standard input whose lines are read as they arrive, without missing an interrupt."""
    stream = standard_input()
    raw = getattr(stream, "raw", None)
    if raw is None or sys.platform == "win32":  # which cannot wait for a pipe
        if timeout is not None and raw is not None:
            raise Failure("--timeout needs --connect on Windows", Exit.USAGE)
        return stream
    return BufferedReader(InputWaiter(raw, timeout))


class InputWaiter(RawIOBase):
    """Waits for bytes without reading: a read ignores an interrupt that came just before.

    It ends at the end of ``raw``, when the connection breaks, and after ``timeout`` seconds without
    a byte (None: never); ``ending`` names the latter two.
    """

    def __init__(self, raw: RawIOBase, timeout: float | None = None) -> None:
        self._raw, self._timeout = raw, timeout
        self.ending: str | None = None

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: WriteableBuffer, /) -> int | None:
        if self.ending is not None:
            return 0
        until = None if self._timeout is None else monotonic() + self._timeout
        with suppress(OSError, ValueError):  # a descriptor that cannot be waited for
            while not select([self._raw], [], [], PATIENCE)[0]:
                if until is not None and monotonic() >= until:
                    self.ending = f"nothing came for {self._timeout:g} s"
                    return 0
        try:
            return self._raw.readinto(buffer)
        except ConnectionError as error:
            self.ending = error.strerror or "the connection broke"
            return 0


@contextmanager
def spool_input(format_name: str | None) -> Iterator[str]:
    """The path of a file with all of standard input, within the block."""
    from mcz.files.live.generators import suffix_of

    data = standard_input().read()
    if not data:
        raise Failure(f"{NAME} is empty", path="-")
    with errors_about(NAME):
        suffix = suffix_of(data, format_name)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "stdin" / f"stdin{suffix}"  # alone in its folder
        path.parent.mkdir()
        path.write_bytes(data)
        yield str(path)


def encode_lines(
    target: str | None, force: bool, format_name: str | None, skeleton: str | None, **options: Any
) -> None:
    """Encode standard input frame by frame to ``target``; - or None is standard output."""
    from mcz.files.live.generators import begin_live
    from mcz.files.reading.source_files import SourceOptions
    from mcz.files.writing.file import encoding_options

    options["profile"] = options["profile"] != "base"
    for name in ("verbatim", "profile", "copies", "effort"):
        if options.pop(name):
            raise Failure(f"--{name} does not apply to encoding frame by frame", Exit.USAGE)
    stream = live_input()
    name = format_name or ("bvh" if skeleton is None else "amc")
    with errors_about(NAME), live_output(target, force) as sink:
        encoding = encoding_options(options.pop("codec"), None, options.pop("params"))
        facts = SourceOptions(skeleton=skeleton, **options)
        live = begin_live(iter(stream.readline, b""), sink, name, facts, encoding)
        with live.writer, note_abort(live.writer):
            live.push_all()
    for remark in live.remarks:
        say(f"{NAME}: {remark}")
    report_live(target, live.writer)


@contextmanager
def note_abort(writer: LiveWriter) -> Iterator[None]:
    """Add to errors that the clip is left without an end."""
    try:
        yield
    except MczError as error:
        count = plural(writer.n_frames, "frame")
        error.add(path=NAME, note=f"the stream is aborted after {count}, and has no end")
        raise


def report_live(target: str | None, writer: LiveWriter) -> None:
    """Report the frames written to ``target``, - or None being a pipe, and their size."""
    traffic = writer.traffic
    rates = ""
    if traffic.seconds:
        total, frames, coded = (
            n / 125 / traffic.seconds for n in (traffic.total, traffic.frames, traffic.coded)
        )
        request = "" if traffic.asked is None else f" ({traffic.asked:g} asked)"
        rates = (
            f"; {total:.2f} kbit/s{request}: {coded:.2f} of coded frames, {frames - coded:.2f} of "
            f"framing, {total - frames:.2f} before and behind them"
        )
    if target not in (None, "-"):
        shape = (
            f"{plural(writer.n_frames, 'frame')} of {plural(writer.skeleton.n_channels, 'channel')}"
        )
        echo(f"{target}: {shape}, live; {traffic.total:,} bytes{rates}")
    elif rates:
        say(f"{plural(writer.n_frames, 'frame')}, {traffic.total:,} bytes{rates}")
    if not traffic.is_held:
        say(rate_warning(traffic))


def rate_warning(traffic: LiveTraffic) -> str:
    """A warning for a rate that framing alone exceeds."""
    assert traffic.seconds is not None
    all_, coded = (n / 125 / traffic.seconds for n in (traffic.frames, traffic.coded))
    return (
        f"{traffic.asked:g} kbit/s cannot be kept: packets, masks and repeated clip "
        f"headers take {all_ - coded:.2f}, so the minimum is {all_:.2f}; --repeat 0, "
        "a longer intra_period, fewer gaps or a lower frame rate reduce it"
    )


@contextmanager
def live_output(target: str | None, force: bool) -> Iterator[BinaryIO | _LazyFile]:
    """Open an unbuffered output, which keeps all frames written before a crash."""
    if target in (None, "-"):
        yield binary_output()
        return
    path = Path(str(target))
    if not _is_special(path):
        check_new(path, force)
    with _LazyFile(path) as sink:
        yield sink


class _LazyFile:
    """A file that is opened for its first bytes: an error before leaves an old one unchanged."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._stack = ExitStack()
        self._stream: FileIO | None = None

    def __enter__(self) -> _LazyFile:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def write(self, data: bytes, /) -> int | None:
        if self._stream is None:
            self._stream = self._stack.enter_context(FileIO(self._path, "wb"))
        return self._stream.write(data)


def _is_special(path: Path) -> bool:
    """Return whether ``path`` is a device or a pipe, which needs no ``--force``."""
    return path.exists() and not (path.is_file() or path.is_dir())


MOST_LINE = 2**24  # bytes of a line
SET = b"# set "
NUMBER, TIME, STATE = "frame", "time", "state"  # columns besides the values, as printed by decoders
COORDINATES = ("x", "y", "z", "tx", "ty", "tz")

Row = NDArray[np.float64] | JsonObject


class Rows:
    """Iterates over rows, (n_channels,), NaN where a value is missing.

    ``names`` are from the first line; None if ``n_channels`` is given, without such a line. A line
    ``# set name=value ...`` gives a dict, other lines that begin with # are left out. Raises
    SourceError, with the number of the line or row, for a bad row, and for a last line without a
    line end, which may be truncated.
    """

    def __init__(self, stream: BinaryIO, *, binary: bool, n_channels: int | None = None) -> None:
        self._stream, self._binary, self._at = stream, binary, 0
        self.names: list[str] | None = None
        self._drop_first, self._drop_last = 0, False
        if n_channels is None:
            self.names = self._read_names()
        self._width = n_channels

    def _read_names(self) -> list[str]:
        line = self._line()
        if line is None:
            raise SourceError("the input is empty; its first line must be names")
        try:
            (names,) = csv.reader([line.decode("utf-8-sig")], strict=True)
        except (UnicodeDecodeError, ValueError, csv.Error) as error:
            raise SourceError(f"line {self._at}: not a line of names: {error}") from None
        names = [cell_text(name.strip()) for name in names]
        lead = next((n for n in ([NUMBER, TIME], [NUMBER]) if names[: len(n)] == n), [])
        if lead and _are_coordinates(names[len(lead) : len(lead) + 2]):
            self._drop_first = len(lead)
        self._drop_last = names[-1:] == [STATE] and _are_coordinates(names[-3:-1])
        return names[self._drop_first : len(names) - self._drop_last]

    def expect(self, n_channels: int) -> None:
        """Set the number of values of a row."""
        self._width = n_channels

    def __iter__(self) -> Iterator[Row]:
        return self._binary_rows() if self._binary else self._text_rows()

    def _line(self) -> bytes | None:
        line = self._stream.readline(MOST_LINE + 1)
        if not line:
            return None
        self._at += 1
        if len(line) > MOST_LINE:
            raise SourceError(f"line {self._at}: longer than {MOST_LINE} bytes")
        if not line.endswith(b"\n") and line.strip():
            raise SourceError(f"line {self._at} has no line end: the source was cut off")
        return line.removesuffix(b"\n").removesuffix(b"\r")

    def _text_rows(self) -> Iterator[Row]:
        while (line := self._line()) is not None:
            if line.startswith(SET):
                yield self._changes(line[len(SET) :])
            elif line.strip() and not line.startswith(b"#"):
                cells = line.split(b",")
                yield self._row(cells[self._drop_first : len(cells) - self._drop_last])

    def _row(self, cells: Sequence[bytes]) -> NDArray[np.float64]:
        if len(cells) != self._width:
            raise SourceError(f"line {self._at}: {plural(len(cells), 'value')}, {self._needed()}")
        return np.array([self._number(cell) if cell.strip() else np.nan for cell in cells])

    def _needed(self) -> str:
        n_names = None if self.names is None else len(self.names)
        if n_names is None or n_names == self._width:
            return f"not {self._width}, separated by commas"
        markers = plural(n_names, "marker")
        return f"but a row of {markers} has {self._width}: x, y and z of each, separated by commas"

    def _number(self, cell: bytes) -> float:
        with suppress(ValueError):
            if b"_" not in cell:  # Python accepts an underscore between digits
                return float(cell)
        raise SourceError(f"line {self._at}: {quote(cell.strip())} is not a number")

    def _changes(self, text: bytes) -> JsonObject:
        words = tuple(text.decode("utf-8", "replace").split())
        if not words or not all("=" in word for word in words):
            raise SourceError(f"line {self._at}: not '# set name=value ...'")
        pairs = (word.partition("=") for word in words)
        return {name: literal(value) for name, _, value in pairs}

    def _binary_rows(self) -> Iterator[Row]:
        assert self._width is not None
        size, row = 4 * self._width, 0
        while data := self._stream.read(size):
            if len(data) != size:
                raise SourceError(f"row {row} ends after {len(data)} of {size} bytes")
            yield np.frombuffer(data, "<f4").astype(np.float64)
            row += 1


def _are_coordinates(names: Sequence[str]) -> bool:
    """Return whether the names are coordinates; a joint may have the name of one of our columns."""
    return bool(names) and all(name.rpartition(".")[2] in COORDINATES for name in names)


def skeleton_in(path: str) -> Skeleton:
    """The skeleton in a .bvh, .asf or .mcz file, without its source; raises as its reader."""
    from dataclasses import replace

    import mcz

    lower = path.lower()
    if lower.endswith(".asf"):
        skeleton = mcz.read_skeleton(path)
    elif lower.endswith(".mcz"):
        with mcz.open(path) as file:
            if not file.clips and len(file.skeletons) == 1:
                skeleton = file.skeletons[0][1]
            else:
                skeleton = file.only_clip(None).skeleton
    elif lower.endswith(".bvh"):
        skeleton = mcz.read(path).skeleton
    else:
        raise OptionError("give the skeleton as a .bvh, .asf or .mcz file", path=path)
    return replace(skeleton, source=None, base=None)
