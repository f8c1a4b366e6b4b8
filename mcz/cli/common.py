"""Exit codes, one-line errors with hints, and files of all commands."""

from __future__ import annotations

import os
import signal
import sys
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from enum import IntEnum
from pathlib import Path
from threading import current_thread, main_thread
from typing import TYPE_CHECKING, Any

import click

from mcz.cli.terminal import say, say_json
from mcz.errors import (
    AccessError,
    ContactWarning,
    Fields,
    FormatError,
    LimitError,
    MczError,
    OptionError,
    SkeletonWarning,
    UnsupportedError,
    reason_of,
)
from mcz.hints import PYTHON_HINTS, Hint, Words, with_worded_hint
from mcz.model.text_format import count_text
from mcz.model.types import JsonObject, Params

if TYPE_CHECKING:
    from typing import Unpack

    from mcz.files.reading.file import File


class Exit(IntEnum):
    """Exit codes of ``mcz`` and ``mcz-info``, as docs/reference/scripts.md lists them."""

    FINE = 0
    BAD_INPUT = 1  # a file is missing, unreadable, refused or invalid
    USAGE = 2  # an unknown option or value, a missing extra, a target that exists and no --force
    NOT_VERIFIED = 3  # verify or info --validate reported a fault
    SALVAGED = 4  # --salvage wrote the readable parts, and some were lost
    INTERRUPTED = 130
    TERMINATED = 143


EXIT_CODES = """\b
Exit codes:
  0  success
  1  bad input: a file is missing, unreadable, damaged or refused
  2  wrong usage, a package is missing, or the target exists and --force is not given
  3  verification failed
  4  salvaged: the readable parts were written, and something was lost
  130  interrupted
  143  terminated"""


class Failure(MczError):
    """An error of a command: a message and an exit code.

    ``kind`` is its name in ``--json``: the class of the original error if there is one.
    """

    def __init__(
        self,
        message: str,
        code: Exit = Exit.BAD_INPUT,
        *,
        kind: str | None = None,
        **fields: Unpack[Fields],
    ) -> None:
        super().__init__(message, **fields)
        self.code = code
        self.kind = kind or ("UsageError" if code == Exit.USAGE else "InputError")


class JsonRefused(Failure):
    """A command without JSON output, also of this error."""


OUT_OF_MEMORY = "out of memory: this needs more than the process may use"


def run(command: click.Command, prog: str, arguments: Sequence[str] | None = None) -> int:
    """Run ``command`` with ``arguments`` (default: those of the process); return the exit code.

    Every expected error becomes one line on standard error, which is JSON with ``--json``; any
    other is a bug and a traceback.
    """
    _prepare_streams()
    words = sys.argv[1:] if arguments is None else list(arguments)
    try:
        with _exit_on_sigterm(), _print_warnings():
            result = command.main(
                words, prog_name=prog, standalone_mode=False, help_option_names=["-h", "--help"]
            )
        if sys.stdout is not None:
            sys.stdout.flush()
    except click.exceptions.NoArgsIsHelpError as error:
        error.show()
        return Exit.USAGE
    except (KeyboardInterrupt, click.Abort):
        say("interrupted")
        return Exit.INTERRUPTED
    except BrokenPipeError:  # the reader of our output is done
        _give_up_output()
        return Exit.FINE
    except (click.ClickException, MczError, OSError, MemoryError) as error:
        return _report_failure(error, as_json="--json" in words)
    except ImportError as error:
        if not _is_starved(error):
            raise
        return _report_failure(MemoryError(), as_json="--json" in words)
    except _Terminated:
        say("terminated")
        return Exit.TERMINATED
    return int(result or Exit.FINE)


OURS = SkeletonWarning, ContactWarning


@contextmanager
def _print_warnings() -> Iterator[None]:
    """Print warnings of the library to standard error, each once."""
    with warnings.catch_warnings():
        for category in OURS:
            warnings.simplefilter("once", category)
        show = warnings.showwarning

        def warning_line(
            message: Warning | str, category: type[Warning], *where: Any, **to: Any
        ) -> None:
            if issubclass(category, OURS):
                say(str(message))
            else:
                show(message, category, *where, **to)

        warnings.showwarning = warning_line
        yield


def _is_starved(error: ImportError) -> bool:
    """Return whether a library failed to load for lack of memory, by the loader's message."""
    return "failed to map segment" in str(error) or "annot allocate memory" in str(error)


def _report_failure(error: Exception, *, as_json: bool) -> Exit:
    failure = _failure_of(error)
    if as_json and not isinstance(failure, JsonRefused):
        say_json({"error": _facts(failure)})
    else:
        say(_text_of(failure))
    _give_up_output()
    return code_of(failure)


def _failure_of(error: Exception) -> MczError:
    if isinstance(error, MczError):
        return error
    if isinstance(error, click.ClickException):
        context = getattr(error, "ctx", None)
        note = f"see {context.command_path} --help" if context else None
        has_json = getattr(error, "option_name", None) != "--json"
        kind = Failure if has_json else JsonRefused
        return kind(error.format_message().rstrip("."), Exit.USAGE, note=note)
    if isinstance(error, OSError):
        return _failure_of_system(error)
    return Failure(OUT_OF_MEMORY, kind="MemoryError")


def _failure_of_system(error: OSError) -> Failure:
    return Failure(reason_of(error), code_of(error), kind=type(error).__name__, path=error.filename)


def _text_of(error: MczError) -> str:
    text = " ".join(error.describe(OPTION_HINTS, with_path=False).split())
    return f"{error.path}: {text}" if error.path else text


def _facts(error: MczError) -> JsonObject:
    """The ``--json`` document of an error; docs/reference/scripts.md lists the keys."""
    facts = {
        "exit_code": int(code_of(error)),
        "class": error.kind if isinstance(error, Failure) else type(error).__name__,
        "message": _text_of(error),
        "file": error.path,
    }
    return facts | {name: getattr(error, name) for name in Fields.__annotations__ if name != "path"}


class _Terminated(BaseException):
    """SIGTERM arrived: half-written files are removed on the way out."""


@contextmanager
def _exit_on_sigterm() -> Iterator[None]:
    """Raise an exception in the block on SIGTERM, so that it cleans up as on Ctrl-C."""

    def end(number: int, frame: object) -> None:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        raise _Terminated

    if current_thread() is not main_thread():  # handlers can only be set there
        yield
        return
    before = signal.signal(signal.SIGTERM, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before or signal.SIG_DFL)


def _prepare_streams() -> None:
    """A name that the terminal lacks, or a stream that is closed, must not end the run."""
    while (free := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass  # no file of ours gets the number of a closed standard stream
    os.close(free)
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")


def _give_up_output() -> None:
    """Redirect a broken standard output, so that Python does not fail on it at exit."""
    if sys.stdout is None:
        return
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def code_of(error: Exception) -> Exit:
    if isinstance(error, Failure):
        return error.code
    if isinstance(error, AccessError):
        return Exit.BAD_INPUT
    return Exit.USAGE if isinstance(error, OptionError | FileExistsError) else Exit.BAD_INPUT


@contextmanager
def errors_about(path: str) -> Iterator[None]:
    """Add ``path`` to errors raised in the block that name no file yet."""
    try:
        yield
    except (BrokenPipeError, Failure):
        raise
    except MczError as error:
        error.add(path=path)
        raise
    except OSError as error:
        failure = _failure_of_system(error)
        failure.add(path=path)
        raise failure from error
    except MemoryError as error:
        raise Failure(OUT_OF_MEMORY, path=path, kind="MemoryError") from error


def require_file(path: str, of_folders: str = "") -> None:
    """Raise Failure unless a local ``path`` is a file; ``of_folders``: the command takes
    folders.
    """
    if path != "-" and "://" not in path and not Path(path).is_file():
        is_there = f"is a folder{of_folders}" if Path(path).is_dir() else "not a file"
        problem = is_there if Path(path).exists() else "no such file"
        raise Failure(problem, path=path or repr(path), kind="AccessError")


class StandardInput(bytes):
    """The bytes of standard input, which errors call by ``name``."""

    name = "standard input"


def bytes_or_path(path: str) -> str | bytes:
    """``path``, which must exist; for ``-`` the bytes of standard input."""
    if path != "-":
        require_file(path)
        return path
    if sys.stdin is None:
        raise Failure("standard input is closed")
    data = StandardInput(sys.stdin.buffer.read())
    if not data:
        raise Failure("standard input is empty")
    return data


@contextmanager
def open_input(path: str, **options: Any) -> Iterator[File]:
    """The MCZ file at ``path``, or on standard input for ``-``; errors name it.

    ``options`` are those of ``mcz.open``.
    """
    import mcz

    target = bytes_or_path(path)
    with errors_about(path), add_salvage_hint(target, options), mcz.open(target, **options) as file:
        if file.grows:
            say(f"{path}: another process is appending to it; earlier contents are shown")
        yield file


def report_damage(path: str, damage: Sequence[str]) -> Exit:
    """Print faults found by salvage; return the exit code."""
    for line in damage:
        say(f"{path}: salvage: {line}")
    return Exit.SALVAGED if damage else Exit.FINE


def exists_error(path: Path) -> Failure:
    """The error about an existing file that ``--force`` would replace."""
    return Failure("already exists", Exit.USAGE, path=path, kind="ExistsError", hint=Hint.FORCE)


def check_new(path: Path, force: bool) -> None:
    """Raise Failure for an existing file before work on it begins."""
    if os.path.lexists(path) and not force:
        raise exists_error(path)


def write_output(path: Path, data: bytes, force: bool) -> None:
    """Write ``data`` under its name in one step, never over an existing file without ``force``."""
    from mcz.files.writing.atomic import replacing

    with errors_about(str(path)), replacing(path, force=force) as stream:
        stream.write(data)


OPTION_HINTS: Words = {
    Hint.BLENDER: PYTHON_HINTS[Hint.BLENDER],
    Hint.CONVERT: "choose a format with --to",
    Hint.ENCODE: "encode a source file with mcz encode",
    Hint.FEET: "name the joints of feet (--feet)",
    Hint.FILM: "make it shorter (--speed, --fps, --frames)",
    Hint.FORCE: "use --force to replace it",
    Hint.FORCE_RATE: "--force-rate overrides it",
    Hint.FRAMES: "write only some of the frames (--frames)",
    Hint.JOBS: "--jobs 1 needs less memory",
    Hint.KEEP_ALL: "--keep-all keeps it",
    Hint.KEY_ERROR: "allow a larger error (--key-error)",
    Hint.LARGE: "--profile large allows more",
    Hint.MAX_DECODED: "raise it with --max-decoded",
    Hint.NAME_CODEC: "--codec re-encodes it",
    Hint.OLD_FORMAT: PYTHON_HINTS[Hint.OLD_FORMAT],
    Hint.PAGE: "select clips (--clip), choose --codec lossy, or allow more bytes (--max-size)",
    Hint.PORTABLE_NAMES: "--names portable writes both",
    Hint.RATE: "set the frame rate (--rate)",
    Hint.RECODE: "--recode re-encodes them",
    Hint.RECODE_LOSSY: "--recode re-encodes them, which adds a small error",
    Hint.REPLACE: "replace it with mcz append --replace",
    Hint.SALVAGE: "--salvage reads the intact parts, mcz repair writes them to a valid file",
    Hint.SERIES: "choose channels by name (--channel)",
    Hint.SKELETON: "choose one with --skeleton, or 'none'",
    Hint.UNIT: "set the unit (--unit)",
    Hint.UP: "set the up axis (--up)",
    Hint.VERBATIM: "--verbatim keeps the file as an attachment",
}


def in_options(text: str) -> str:
    """``text`` and its hint, if any, in terms of the command line."""
    return with_worded_hint(text, OPTION_HINTS)


@contextmanager
def add_salvage_hint(target: str | bytes, options: Params) -> Iterator[None]:
    """Add the intact parts of a damaged file, and the hint to salvage them, to its error."""
    try:
        yield
    except (UnsupportedError, LimitError):
        raise
    except FormatError as error:
        from mcz.files.reading.file import is_source

        name = target if isinstance(target, str) else getattr(target, "name", None)
        if error.path not in (None, name):
            raise  # of another file
        whole = None if options.get("salvage") else _intact_counts(target)
        if whole is not None:
            error.add(note=whole, hint=Hint.SALVAGE)
        elif isinstance(target, str) and is_source(target):
            error.add(hint=Hint.ENCODE)
        raise


def _intact_counts(target: str | bytes) -> str | None:
    """Counts of the intact parts of a damaged local file; None if there are none."""
    import mcz

    if isinstance(target, str) and "://" in target:
        return None  # all of it would have to be read
    try:
        with mcz.open(target, salvage=True) as file:
            rows = file.container.directory.clips.values()
            clips = sum(row.cend is not None and not row.damage for row in rows)
            damaged, attachments = len(rows) - clips, len(file.attachments)
    except MczError:
        return None
    counts = ((clips, "whole clip"), (damaged, "damaged clip"), (attachments, "attachment"))
    parts = [count_text(count, noun) for count, noun in counts if count]
    if not parts:
        return None
    return f"it holds {', '.join(parts)}"
