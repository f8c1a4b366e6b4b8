"""The only way to standard output and standard error, without control characters.

Names in files may have any characters, so every command prints through these functions; a test
forbids all other modules of the command line to print.
"""

from __future__ import annotations

import io
import json
import re
import sys
import time
import unicodedata
from collections.abc import Sequence
from typing import TYPE_CHECKING, BinaryIO, TextIO

import click

from mcz.errors import AccessError, OptionError
from mcz.model.text_format import ODD
from mcz.model.text_format import printable as printable

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer


ENCODING, KEPT = "utf-8", "surrogateescape"  # of text that is printed as bytes


class StatusLine:
    """A line on the terminal of standard error that disappears when anything else is printed."""

    def __init__(self) -> None:
        self._width = 0  # columns of the line that is shown

    def show(self, text: str) -> None:
        """Show as much of ``text`` as fits, in place of the line before."""
        import shutil

        n_columns, width, line = shutil.get_terminal_size().columns - 1, 0, ""
        for letter in printable(text):
            width += columns_of(letter)
            if width > n_columns:
                width -= columns_of(letter)
                break
            line += letter
        click.echo(f"\r{line}{' ' * (self._width - width)}", err=True, nl=False)
        self._width = width

    def remove(self) -> None:
        """Put the cursor where the line began, and blanks where it was."""
        if self._width:
            click.echo(f"\r{' ' * self._width}\r", err=True, nl=False)
            self._width = 0


STATUS = StatusLine()


def columns_of(letter: str) -> int:
    """The terminal columns of a printable letter."""
    if unicodedata.combining(letter):
        return 0
    return 2 if unicodedata.east_asian_width(letter) in "WF" else 1


def echo(*lines: str) -> None:
    """Print lines on standard output."""
    STATUS.remove()
    for line in lines:
        click.echo(printable(line))


def can_show(letters: str) -> bool:
    """Return whether standard output can encode these letters."""
    try:
        letters.encode(getattr(sys.stdout, "encoding", None) or "ascii")
    except (UnicodeError, LookupError):
        return False
    return True


def is_terminal() -> bool:
    """Return whether standard output is a terminal."""
    return sys.stdout is not None and sys.stdout.isatty()


def say(message: str) -> None:
    """Print one line on standard error."""
    STATUS.remove()
    click.echo(f"mcz: {printable(message.strip())}", err=True)


def say_json(document: object) -> None:
    """Print ``document`` as one line of JSON on standard error."""
    STATUS.remove()
    click.echo(json_text(document, indent=None), err=True)


def json_text(document: object, indent: int | None = 2) -> str:
    r"""``document`` as JSON, with escapes for invisible characters; see ``printable``.

    >>> print(json_text("a\u202eb \x9b V\xe4sa"))
    "a\u202eb \u009b Väsa"
    """

    def escaped(match: re.Match[str]) -> str:
        letter = match[0]
        plain = letter.isprintable() or letter == "\n"  # a line end is only between the values
        return letter if plain else json.dumps(letter)[1:-1]

    return ODD.sub(
        escaped, json.dumps(document, indent=indent, ensure_ascii=False, allow_nan=False)
    )


def print_json(document: object) -> None:
    """Print ``document`` as one JSON document with sorted layout but kept key order."""
    STATUS.remove()
    click.echo(json_text(document))


def binary_output() -> BinaryIO:
    """Standard output as binary.

    Raises AccessError if it is closed, OptionError if it is a terminal.
    """
    if _stdout().isatty():
        raise OptionError("binary data are not printed on a terminal; use -o FILE or > FILE")
    return _buffer()


def text_output() -> BinaryIO:
    """Standard output as bytes of text: unchanged, but with escapes on a terminal.

    Raises AccessError if it is closed.
    """
    return _Escaping(_buffer()) if _stdout().isatty() else _buffer()


def _stdout() -> TextIO:
    if sys.stdout is None:
        raise AccessError("standard output is closed")
    return sys.stdout


def _buffer() -> BinaryIO:
    buffer: BinaryIO = _stdout().buffer
    return buffer


class _Escaping(io.BytesIO):
    """Passes text on, with escapes for control sequences; it gets whole lines."""

    def __init__(self, below: BinaryIO) -> None:
        super().__init__()
        self._below = below

    def write(self, data: ReadableBuffer, /) -> int:
        text = bytes(data).decode(ENCODING, KEPT).replace("\r\n", "\n")
        self._below.write(printable(text, "\n\t").encode(ENCODING, "backslashreplace"))
        return memoryview(data).nbytes

    def flush(self) -> None:
        self._below.flush()


WIDEST_CELL = 48  # characters that the columns of a table are aligned to


def plural(count: int, word: str) -> str:
    """
    >>> plural(1, "clip"), plural(2400, "frame")
    ('1 clip', '2,400 frames')
    """
    return f"{count:,} {word}" if count == 1 else f"{count:,} {word}s"


def table(rows: Sequence[Sequence[str]], right: str = "") -> list[str]:
    """Rows as lines of aligned columns, the first a heading; an "r" in ``right`` aligns right.

    A cell of more than ``WIDEST_CELL`` characters shifts only the rest of its own row.

    >>> table([["name", "n"], ["walk", "240"]], "lr")
    ['name    n', 'walk  240']
    """
    rows = [[printable(cell) for cell in row] for row in rows]
    widths = [
        max((len(cell) for cell in column if len(cell) <= WIDEST_CELL), default=0)
        for column in zip(*rows, strict=True)
    ]
    sides = right.ljust(len(widths), "l")
    return [
        "  ".join(
            cell.rjust(width) if side == "r" else cell.ljust(width)
            for cell, width, side in zip(row, widths, sides, strict=True)
        ).rstrip()
        for row in rows
    ]


PATIENCE = 1.0  # seconds of work before the line appears
INTERVAL = 0.1  # seconds between two states of it
BAR = 24  # columns


class Progress:
    """A callable ``progress(done, total, what)`` and a context that removes its line."""

    def __init__(self) -> None:
        self._due = time.monotonic() + PATIENCE
        self._is_shown = sys.stderr is not None and sys.stderr.isatty()

    def __call__(self, done: int, total: int, label: str) -> None:
        now = time.monotonic()
        if self._is_shown and now >= self._due:
            self._due = now + INTERVAL
            share = min(done / total, 1.0) if total > 0 else 1.0
            bar = "#" * int(BAR * share)
            STATUS.show(f"[{bar:-<{BAR}}] {share:4.0%} {label}")

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *_: object) -> None:
        STATUS.remove()
