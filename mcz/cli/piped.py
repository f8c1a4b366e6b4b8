"""``mcz encode -``: a motion on standard input, frame by frame where its codec can do that."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from io import BufferedReader, FileIO, RawIOBase
from pathlib import Path
from select import select
from tempfile import TemporaryDirectory
from typing import Any, BinaryIO

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

NAME = "standard input"
PATIENCE = 0.3  # seconds of waiting for input between two looks whether there was an interrupt


def standard_input() -> BinaryIO:
    """Standard input as bytes; raises Failure where it is closed."""
    if sys.stdin is None:
        raise Failure(f"{NAME} is closed")
    return sys.stdin.buffer


def live_input() -> BinaryIO:
    """Standard input of which lines are read as they come, and an interrupt is never missed."""
    stream = standard_input()
    raw = getattr(stream, "raw", None)
    if raw is None or sys.platform == "win32":  # which cannot wait for a pipe
        return stream
    return BufferedReader(_Awaited(raw))


class _Awaited(RawIOBase):
    """Waits for bytes without reading: a read does not see an interrupt that came just before."""

    def __init__(self, raw: FileIO) -> None:
        self._raw = raw

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any, /) -> int | None:
        with suppress(OSError, ValueError):  # a descriptor that cannot be waited for
            while not select([self._raw], [], [], PATIENCE)[0]:
                pass
        return self._raw.readinto(buffer)


@contextmanager
def stored(format_name: str | None) -> Iterator[str]:
    """The path of a file, for as long as the block runs, that holds all of standard input."""
    from mcz.live.text_writer import suffix_of

    data = standard_input().read()
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
    from mcz.live.text_writer import encode_live
    from mcz.writing.entry import Terms

    for name in ("verbatim", "archive", "copies", "effort"):
        if options.pop(name):
            raise Failure(f"--{name} has no meaning for what is coded frame by frame", Exit.USAGE)
    stream = live_input()
    name = format_name or ("bvh" if skeleton is None else "amc")
    others = () if target in (None, "-") else (str(target),)
    with about(NAME, *others), live_output(target, force) as sink:
        terms = Terms(skeleton=skeleton, **options)
        report = encode_live(iter(stream.readline, b""), sink, name, terms)
    for remark in report.remarks:
        say(f"{NAME}: {remark}")
    if target not in (None, "-"):
        size = Path(str(target)).stat().st_size
        held = f"{plural(report.n_frames, 'frame')} of {plural(report.n_channels, 'channel')}"
        echo(f"{target}: {held}, live; {size:,} bytes")


@contextmanager
def live_output(target: str | None, force: bool) -> Iterator[BinaryIO | _Late]:
    """Where frames go at once, so that what was written before a crash stays."""
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
    """Whether ``path`` is a device or a pipe, which is there to be written to."""
    return path.exists() and not (path.is_file() or path.is_dir())
