"""``mcz stream decode``: a live stream to rows of numbers, as they come."""

from __future__ import annotations

import builtins
import csv
import io
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from fractions import Fraction
from typing import TYPE_CHECKING, Any, BinaryIO

import click
import numpy as np

from mcz.cli.common import (
    Exit,
    Failure,
    about,
    binary_output,
    existing,
    plural,
    printable,
    say,
    text_output,
)
from mcz.cli.encode_stdin import NAME, live_input
from mcz.cli.hints import OPTION_HINTS
from mcz.cli.options import rate_option, token_option
from mcz.cli.rows import NUMBER, STATE
from mcz.errors import TruncatedError
from mcz.model.text_format import spreadsheet_cell

TIMEOUT = 30.0  # seconds; ``mcz stream encode --listen`` sends a heartbeat every 5

if TYPE_CHECKING:
    from mcz.files.live.clip_state import LiveClip
    from mcz.files.live.concealment import LiveFrame, Lost
    from mcz.files.live.generators import LiveReader


@click.command(short_help="Decode a live stream to rows of numbers.")
@click.argument("file", metavar="[FILE.mcz]", type=click.Path(readable=False), default="-")
@click.option(
    "--connect", metavar="HOST:PORT", help="Read from this address over TCP; implies --join."
)
@token_option
@click.option(
    "--lost",
    type=click.Choice(("refuse", "missing", "hold", "linear")),
    default="refuse",
    show_default=True,
    help="Of frames that did not come: stop, print empty fields, the last frame that came, or "
    "what lies between that and the next one.",
)
@click.option("--join", is_flag=True, help="Join a stream anywhere.")
@click.option(
    "--timeout",
    metavar="SECONDS",
    type=click.FloatRange(min=0),
    help=(
        "Stop after so long without data; 0: wait for ever.  [default: 30 with --connect, else 0]"
    ),
)
@click.option(
    "--post-filter",
    "post_filter",
    is_flag=True,
    help="Smooth positions as coarse coding needs it; rows come 12 frames late.",
)
@rate_option("Frames a second of a stream that states none (with --post-filter).")
@click.option("--float32", "binary", is_flag=True, help="Print little-endian binary32 rows.")
@click.option("--states", is_flag=True, help="Print which frames are concealed or missing.")
def command(
    file: str,
    connect: str | None,
    token: str | None,
    lost: Lost,
    join: bool,
    timeout: float | None,
    post_filter: bool,
    rate: Fraction | None,
    binary: bool,
    states: bool,
) -> Exit:
    """Print the frames of a live stream, each as soon as its bytes have come.

    The stream is FILE.mcz, or standard input. A line of names comes first. CSV rows begin with the
    number of the frame, counted from 0, and have an empty field where a value is missing; with
    --float32 a row is its values alone, NaN there. Standard error says at the end what came; the
    exit code is 4 where frames are missing, or where the stream was cut off: the source died, the
    connection broke, or nothing came for --timeout.
    """
    if connect is not None and file != "-":
        raise Failure("FILE.mcz and --connect exclude each other", Exit.USAGE)
    if binary and states:
        raise Failure("--states has no place in binary rows", Exit.USAGE)
    if rate is not None and not post_filter:
        raise Failure("--rate needs --post-filter", Exit.USAGE)
    from mcz.files.live.generators import stream_decode
    from mcz.files.writing.atomic import refuse_inputs

    if connect is None:
        refuse_inputs(sys.stdout, (sys.stdin if file == "-" else file,))

    where = connect or (NAME if file == "-" else file)
    if timeout is None and connect is not None:
        timeout = TIMEOUT
    with about(where), _stream(file, connect, token, timeout or None) as stream:
        join = join or connect is not None
        reader = stream_decode(stream, lost=lost, join=join, post_filter=post_filter, rate=rate)
        try:
            _print_all(reader, _Binary() if binary else _Text(states=states))
        except BrokenPipeError:  # whoever read it has seen enough
            raise
        except TruncatedError as error:
            if not reader.summary.stream_bytes:
                raise
            say(f"{where}: {error.describe(OPTION_HINTS, with_path=False)}")
        except BaseException:
            _sum_up(where, reader)
            raise
        ending = getattr(getattr(stream, "raw", None), "ending", None)
        if ending is not None:
            say(f"{where}: {ending}")
        _sum_up(where, reader)
    found = reader.summary
    gone = found.concealed or found.missing or found.skipped or found.n_faults
    whole = not (gone or found.is_cut)
    return Exit.FINE if whole else Exit.SALVAGED


@contextmanager
def _stream(
    file: str, connect: str | None, token: str | None, timeout: float | None
) -> Iterator[BinaryIO]:
    if connect is not None:
        from mcz.cli.tcp import connected

        with connected(connect, token, timeout) as stream:
            yield stream
    elif file == "-":
        yield live_input(timeout)
    else:
        existing(file)
        with builtins.open(file, "rb") as stream:
            yield stream


class _Text:
    """CSV: a line of names, then a row a frame."""

    def __init__(self, *, states: bool) -> None:
        self._states = states

    def names(self, names: list[str]) -> bytes:
        return _csv([NUMBER, *names, *([STATE] if self._states else [])])

    def row(self, frame: LiveFrame) -> bytes:
        pairs = zip(frame.values.tolist(), frame.valid.tolist(), strict=True)
        cells = [repr(float(value)) if valid else "" for value, valid in pairs]
        state = [frame.state] if self._states else []
        return ",".join([str(frame.number), *cells, *state]).encode() + b"\n"


class _Binary:
    """A line of names, then binary32 values."""

    def names(self, names: list[str]) -> bytes:
        return _csv(names)

    def row(self, frame: LiveFrame) -> bytes:
        return np.where(frame.valid, frame.values, np.nan).astype("<f4").tobytes()


def _csv(cells: list[str]) -> bytes:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerow(
        spreadsheet_cell(printable(cell)) for cell in cells
    )
    return text.getvalue().encode("utf-8", "surrogateescape")


def _print_all(reader: LiveReader, printer: _Text | _Binary) -> None:
    from mcz.files.tables.files import channel_names

    output = binary_output() if isinstance(printer, _Binary) else text_output()
    clip: LiveClip | None = None
    names: list[str] | None = None
    for frame in reader:
        if reader.clip is not clip:
            assert reader.clip is not None
            clip, before = reader.clip, names
            names = channel_names(clip.skeleton)
            if before is None:
                output.write(printer.names(names))
            elif names != before:
                raise Failure(f"clip {clip.name!r} begins, and has other channels")
        output.write(printer.row(frame))
        output.flush()


def _sum_up(where: str, reader: LiveReader) -> None:
    """Say on standard error what came."""
    found: Any = reader.summary
    for remark in found.remarks:
        say(f"{where}: {remark}")
    if found.n_faults > len(found.remarks):
        say(f"{where}: {found.n_faults - len(found.remarks):,} more faults")
    others = {name: getattr(found, name) for name in ("concealed", "missing", "skipped")}
    counts = [f"{count:,} {name}" for name, count in others.items() if count or name != "skipped"]
    told = [f"{plural(found.decoded, 'frame')} decoded, {', '.join(counts)}"]
    framing = found.stream_bytes - found.payload_bytes
    told.append(f"{found.payload_bytes:,} bytes of payload, {framing:,} of framing")
    n_frames = found.decoded + found.concealed + found.missing
    rate = reader.clip.frame_rate if reader.clip is not None else None
    if rate and n_frames:
        seconds = float(n_frames / rate)
        all_bytes, payload = (n / 125 / seconds for n in (found.stream_bytes, found.payload_bytes))
        told.append(f"{all_bytes:.2f} kbit/s received, {payload:.2f} of payload")
    if found.is_cut:
        told.append("it was cut off")
    elif not found.is_checked:
        told.append("value hash not checked")
    say(f"{where}: {'; '.join(told)}")
