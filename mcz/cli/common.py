"""What every command shares: exit codes, errors on one line, JSON, argument types."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from enum import IntEnum
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mcz.errors import MczError, OptionError

if TYPE_CHECKING:
    from mcz.file import File


class Exit(IntEnum):
    """Exit codes of ``mcz`` and ``mcz-info``; README and ``mcz --help`` list them."""

    FINE = 0
    BAD_INPUT = 1  # a file is missing, unreadable, refused or not what it should be
    USAGE = 2  # an unknown option or value, or a target that exists and no --force
    NOT_VERIFIED = 3  # verify or info --validate found something wrong
    SALVAGED = 4  # --salvage wrote what could be read, and something was lost
    INTERRUPTED = 130


EXIT_CODES = """\b
Exit codes:
  0  fine
  1  bad input: a file is missing, unreadable, damaged or refused
  2  wrong usage, or the target exists and --force is not given
  3  verification failed
  4  salvaged: what could be read was written, and something was lost
  130  interrupted"""


class Failure(Exception):
    """An error as the user sees it: one line and an exit code."""

    def __init__(self, message: str, code: Exit = Exit.BAD_INPUT) -> None:
        super().__init__(message)
        self.code = code


def run(command: click.Command, prog: str, arguments: Sequence[str] | None = None) -> int:
    """Run ``command`` with ``arguments`` (default: those of the process); return the exit code.

    Every expected error becomes one line on standard error; any other is a bug and a traceback.
    """
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):  # a name that the terminal lacks must not end the run
            stream.reconfigure(errors="backslashreplace")
    try:
        result = command.main(arguments, prog_name=prog, standalone_mode=False)
        sys.stdout.flush()
    except click.exceptions.NoArgsIsHelpError as error:
        error.show()
        return Exit.USAGE
    except click.ClickException as error:
        context = getattr(error, "ctx", None)
        hint = f"; see {context.command_path} --help" if context else ""
        say(error.format_message().rstrip(".") + hint)
        return Exit.USAGE
    except (KeyboardInterrupt, click.Abort):
        say("interrupted")
        return Exit.INTERRUPTED
    except BrokenPipeError:  # the reader of our output has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return Exit.FINE
    except Failure as failure:
        say(str(failure))
        return failure.code
    except (MczError, OSError) as error:
        say(reason(error))
        return code_of(error)
    return int(result or Exit.FINE)


def say(message: str) -> None:
    """Print one line on standard error."""
    click.echo(f"mcz: {printable(' '.join(message.split()))}", err=True)


def printable(text: str) -> str:
    r"""``text`` with control characters escaped: names in files must not steer a terminal.

    >>> print(printable("a\x1b[2Jb"))
    a\x1b[2Jb
    """
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


def reason(error: Exception) -> str:
    """What an error says, on one line, without Python's decorations."""
    if isinstance(error, OSError) and error.strerror:
        named = f"{error.filename}: " if error.filename is not None else ""
        return f"{named}{error.strerror}"
    return " ".join(str(error).split()) or type(error).__name__


def code_of(error: Exception) -> Exit:
    return Exit.USAGE if isinstance(error, OptionError | FileExistsError) else Exit.BAD_INPUT


@contextmanager
def about(path: str, *others: str) -> Iterator[None]:
    """Put ``path`` in front of what goes wrong inside, unless the message names a file already."""
    try:
        yield
    except BrokenPipeError:
        raise
    except (MczError, OSError) as error:
        text = reason(error)
        named = text if any(name in text for name in (path, *others)) else f"{path}: {text}"
        raise Failure(named, code_of(error)) from error


def existing(path: str) -> None:
    """Raise Failure where a local ``path`` is no file."""
    if path != "-" and "://" not in path and not Path(path).is_file():
        raise Failure(f"{path}: {'not a file' if Path(path).exists() else 'no such file'}")


@contextmanager
def opened(path: str, *, salvage: bool = False) -> Iterator[File]:
    """The MCZ file at ``path``, or on standard input where that is ``-``; errors name it."""
    import mcz

    target: str | bytes = path
    if path == "-":
        target = sys.stdin.buffer.read()
    else:
        existing(path)
    with about(path), mcz.open(target, salvage=salvage) as file:
        yield file


def write_output(path: Path, data: bytes, force: bool) -> None:
    """Write ``data`` under its name in one step, never over an existing file without ``force``."""
    with about(str(path)):
        if path.exists() and not force:
            raise Failure(f"{path}: exists; --force overwrites it", Exit.USAGE)
        part = path.with_name(f".{path.name}.{os.getpid()}.part")
        try:
            part.write_bytes(data)
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)


def print_json(document: Any) -> None:
    """Print ``document`` as one JSON document with sorted layout but kept key order."""
    click.echo(json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False))


def plural(count: int, word: str) -> str:
    """
    >>> plural(1, "clip"), plural(2400, "frame")
    ('1 clip', '2,400 frames')
    """
    return f"{count:,} {word}" if count == 1 else f"{count:,} {word}s"


def table(rows: Sequence[Sequence[str]], right: str = "") -> str:
    """Rows as aligned columns, the first row a heading; ``right`` marks right-aligned ones by "r".

    >>> print(table([["name", "n"], ["walk", "240"]], "lr"))
    name    n
    walk  240
    """
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    sides = right.ljust(len(widths), "l")
    lines = (
        "  ".join(
            cell.rjust(width) if side == "r" else cell.ljust(width)
            for cell, width, side in zip(row, widths, sides, strict=True)
        ).rstrip()
        for row in rows
    )
    return "\n".join(lines)


def to_frames(
    ctx: click.Context, param: click.Parameter, value: str | None
) -> tuple[int, int | None] | None:
    """Callback of ``A:B``: frames A <= f < B counted from 0; either end may be left out."""
    if value is None:
        return None
    start, colon, stop = value.partition(":")
    digits = all(part.isascii() and part.isdigit() for part in (start, stop) if part)
    if not colon or not digits or (start and stop and int(start) > int(stop)):
        raise click.BadParameter(f"{value!r} is not a range A:B of frames with A <= B")
    return int(start or 0), int(stop) if stop else None


def to_rate(ctx: click.Context, param: click.Parameter, value: str | None) -> Fraction | None:
    """Callback of a rate: frames a second as ``120``, ``29.97`` or ``30000/1001``."""
    if value is None:
        return None
    try:
        rate = Fraction(value)
    except (ValueError, ZeroDivisionError):
        rate = Fraction(0)
    if rate <= 0:
        raise click.BadParameter(f"{value!r} is not a rate such as 120, 29.97 or 30000/1001")
    return rate


def to_params(
    ctx: click.Context, param: click.Parameter, values: tuple[str, ...]
) -> dict[str, Any]:
    """Callback of ``KEY=VALUE``; a value that reads as a number or a truth becomes one."""
    pairs = {}
    for value in values:
        key, equals, text = value.partition("=")
        if not equals or not key:
            raise click.BadParameter(f"{value!r} is not KEY=VALUE")
        pairs[key] = _literal(text)
    return pairs


def _literal(text: str) -> Any:
    """
    >>> _literal("3"), _literal("4.4"), _literal("true"), _literal("bior4.4")
    (3, 4.4, True, 'bior4.4')
    """
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return {"true": True, "false": False}.get(text, text)
