"""``mcz encode -``: a motion on standard input, frame by frame where its codec can do that."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from io import BufferedReader, FileIO, RawIOBase
from pathlib import Path
from select import select
from tempfile import TemporaryDirectory
from time import monotonic
from typing import TYPE_CHECKING, Any, BinaryIO

from mcz.cli.common import (
    Exit,
    Failure,
    about,
    binary_output,
    check_new,
    echo,
    plural,
    say,
)
from mcz.errors import MczError

if TYPE_CHECKING:
    from _typeshed import WriteableBuffer

    from mcz.files.live.writer import LiveTraffic, LiveWriter

NAME = "standard input"
PATIENCE = 0.3  # seconds of waiting for input between two looks whether there was an interrupt


def standard_input() -> BinaryIO:
    """Standard input as bytes; raises Failure where it is closed."""
    if sys.stdin is None:
        raise Failure(f"{NAME} is closed")
    return sys.stdin.buffer


def live_input(timeout: float | None = None) -> BinaryIO:
    """Standard input of which lines are read as they come, and an interrupt is never missed."""
    stream = standard_input()
    raw = getattr(stream, "raw", None)
    if raw is None or sys.platform == "win32":  # which cannot wait for a pipe
        if timeout is not None and raw is not None:
            raise Failure("--timeout needs --connect on Windows", Exit.USAGE)
        return stream
    return BufferedReader(Awaited(raw, timeout))


class Awaited(RawIOBase):
    """Waits for bytes without reading: a read does not see an interrupt that came just before.

    It ends where ``raw`` does, where the connection breaks, and after ``timeout`` seconds without a
    byte (None: never); ``ending`` says which of the last two it was.
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
def stored(format_name: str | None) -> Iterator[str]:
    """The path of a file, for as long as the block runs, that holds all of standard input."""
    from mcz.files.live.text_writer import suffix_of

    data = standard_input().read()
    if not data:
        raise Failure(f"{NAME} is empty", path="-")
    with about(NAME):
        suffix = suffix_of(data, format_name)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "stdin" / f"stdin{suffix}"  # with nothing beside it
        path.parent.mkdir()
        path.write_bytes(data)
        yield str(path)


def encode_lines(
    target: str | None, force: bool, format_name: str | None, skeleton: str | None, **options: Any
) -> None:
    """Encode standard input frame by frame to ``target``, - or None being standard output."""
    from mcz.files.live.text_writer import begin_live
    from mcz.files.reading.source_files import SourceOptions
    from mcz.files.writing.source_encoder import encoding_options

    options["profile"] = options["profile"] != "base"
    for name in ("verbatim", "profile", "copies", "effort"):
        if options.pop(name):
            raise Failure(f"--{name} has no meaning for what is coded frame by frame", Exit.USAGE)
    stream = live_input()
    name = format_name or ("bvh" if skeleton is None else "amc")
    with about(NAME), live_output(target, force) as sink:
        encoding = encoding_options(options.pop("codec"), None, options.pop("params"))
        told = SourceOptions(skeleton=skeleton, **options)
        live = begin_live(iter(stream.readline, b""), sink, name, told, encoding)
        with live.writer, aborting(live.writer):
            live.push_all()
    for remark in live.remarks:
        say(f"{NAME}: {remark}")
    report_live(target, live.writer)


@contextmanager
def aborting(writer: LiveWriter) -> Iterator[None]:
    """Say of an error that it leaves the clip without an end."""
    try:
        yield
    except MczError as error:
        count = plural(writer.n_frames, "frame")
        error.add(path=NAME, note=f"the stream is aborted after {count}, and has no end")
        raise


def report_live(target: str | None, writer: LiveWriter) -> None:
    """Say what was written to ``target``, - or None being a pipe, and what it took."""
    traffic = writer.traffic
    rates = ""
    if traffic.seconds:
        total, frames, coded = (
            n / 125 / traffic.seconds for n in (traffic.total, traffic.frames, traffic.coded)
        )
        asked = "" if traffic.asked is None else f" ({traffic.asked:g} asked)"
        rates = (
            f"; {total:.2f} kbit/s{asked}: {coded:.2f} of coded frames, {frames - coded:.2f} of "
            f"framing, {total - frames:.2f} before and behind them"
        )
    if target not in (None, "-"):
        held = (
            f"{plural(writer.n_frames, 'frame')} of {plural(writer.skeleton.n_channels, 'channel')}"
        )
        echo(f"{target}: {held}, live; {traffic.total:,} bytes{rates}")
    elif rates:
        say(f"{plural(writer.n_frames, 'frame')}, {traffic.total:,} bytes{rates}")
    if not traffic.is_held:
        say(rate_warning(traffic))


def rate_warning(traffic: LiveTraffic) -> str:
    """A line about a rate that framing alone exceeds."""
    assert traffic.seconds is not None
    all_, coded = (n / 125 / traffic.seconds for n in (traffic.frames, traffic.coded))
    return (
        f"{traffic.asked:g} kbit/s cannot be held: packets, masks and repeated clip headers take "
        f"{all_ - coded:.2f}, and {all_:.2f} is the least with them; --repeat 0, a longer "
        "intra_period, fewer gaps or a lower frame rate reduce it"
    )


@contextmanager
def live_output(target: str | None, force: bool) -> Iterator[BinaryIO | _Late]:
    """Open an unbuffered output, which keeps all frames written before a crash."""
    if target in (None, "-"):
        yield binary_output()
        return
    path = Path(str(target))
    if not _is_special(path):
        check_new(path, force)
    with _Late(path) as sink:
        yield sink


class _Late:
    """A file that is opened for its first bytes: what is refused before leaves an old one alone."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._stack = ExitStack()
        self._stream: FileIO | None = None

    def __enter__(self) -> _Late:
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
