"""``mcz stream``: rows of numbers to a live stream, and back, as they arrive."""

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

from mcz.cli import shared_options
from mcz.cli.command_groups import lazy_group
from mcz.cli.common import OPTION_HINTS, Exit, Failure, errors_about, require_file
from mcz.cli.standard_input import (
    NAME,
    NUMBER,
    STATE,
    Rows,
    live_input,
    live_output,
    note_abort,
    rate_warning,
    report_live,
    skeleton_in,
)
from mcz.cli.terminal import binary_output, plural, printable, say, text_output
from mcz.errors import TruncatedError
from mcz.model.text_format import spreadsheet_cell

if TYPE_CHECKING:
    from mcz.cli.tcp import Heartbeat
    from mcz.files.live.clip_state import LiveClip, LiveFrame, Lost
    from mcz.files.live.generators import LiveReader
    from mcz.files.live.writer import LiveWriter


COMMANDS = {"encode": "stream.stream_encode_command", "decode": "stream.stream_decode_command"}


@click.command(
    cls=lazy_group(COMMANDS),
    name="stream",
    short_help="Encode rows of numbers to a live stream, and decode it.",
)
def stream_command() -> None:
    """Encode or decode frames as they arrive, over a pipe or TCP."""


HEARTBEAT = 5.0  # seconds
TIMEOUT = 30.0  # seconds; ``--listen`` sends a heartbeat every 5
WARN_AFTER = 5.0  # seconds of frames


@click.command(short_help="Encode rows of numbers to a live stream.")
@click.option(
    "-o",
    "--output",
    metavar="OUT.mcz",
    help="Write to a file, or - for standard output. Default: standard output.",
)
@click.option(
    "--listen",
    metavar="HOST:PORT",
    help="Serve the stream over TCP instead of writing it; port 0: any free port.",
)
@click.option(
    "--clients",
    metavar="N",
    type=click.IntRange(min=0),
    default=0,
    help="Wait for N clients before the first row is read (with --listen).",
)
@shared_options.token("Require this token from clients.")
@click.option(
    "--codec",
    metavar="NAME",
    default="online",
    show_default=True,
    help="Set the codec, which must work frame by frame.",
)
@shared_options.params
@shared_options.rate("Set the frame rate (120, 29.97, 30000/1001).")
@shared_options.unit("the numbers")
@shared_options.up("Set the up axis of the numbers.")
@click.option("--name", metavar="NAME", default="live", help="Name the clip.  [default: live]")
@click.option(
    "--skeleton",
    metavar="FILE",
    type=click.Path(readable=False),
    help="Take rows as the channels of the skeleton in a .bvh, .asf or .mcz file.",
)
@click.option("--float32", "binary", is_flag=True, help="Read little-endian binary32 rows.")
@click.option(
    "--repeat",
    metavar="N",
    type=click.IntRange(min=0),
    help="Repeat skeleton and clip header at every N-th place to join; 0: never.  [default: 1, or "
    "less often with a bit rate]",
)
@click.option(
    "--heartbeat",
    metavar="SECONDS",
    type=click.FloatRange(min=0),
    help="Tell clients every SECONDS that the stream continues while no row arrives; 0: never.  "
    "[default: 5 with --listen, else 0]",
)
@shared_options.force
def stream_encode_command(
    output: str | None,
    listen: str | None,
    clients: int,
    heartbeat: float | None,
    token: str | None,
    skeleton: str | None,
    binary: bool,
    force: bool,
    **options: Any,
) -> Exit:
    """Encode rows of numbers from standard input, one by one.

    The first line names markers (a,b,c: a row then has x, y and z of each in turn) or coordinates
    (a.x,a.y,a.z,...). With --skeleton there is no such line: columns are the channels of the
    skeleton. A row of CSV follows for each frame; an empty field is a missing value. With
    --float32 rows are binary, and NaN is a missing value. The output of mcz decode --to csv and
    mcz stream decode for markers is accepted, too. A CSV line "# set bitrate=4 gof=20" changes
    parameters of the codec from its next group of frames on.

    A bad or truncated row aborts the stream: all earlier frames are sent, but not the end. Finally
    standard error reports the size of the stream, including framing.
    """
    from mcz.cli import tcp
    from mcz.cli.tcp import Heartbeat
    from mcz.files.writing.atomic import refuse_inputs

    if listen is not None and output is not None:
        raise Failure("-o and --listen exclude each other", Exit.USAGE)
    if clients and listen is None:
        raise Failure("--clients needs --listen", Exit.USAGE)
    if skeleton is not None:
        require_file(skeleton)
    if listen is None:
        refuse_inputs(sys.stdout if output in (None, "-") else output, (sys.stdin, skeleton))
    with errors_about(NAME):
        if listen is not None:
            beat = HEARTBEAT if heartbeat is None else heartbeat
            with tcp.listen(listen, token) as listener:
                source = _Source(skeleton, binary)
                writer = _writer(listener, source, **options)
                listener.entry = lambda: writer.entry
                with Heartbeat(writer, beat, listener) as heart, writer:
                    listener.wait_for(clients)
                    _push_all(source.rows, writer, heart)
        else:
            with live_output(output, force) as sink:
                source = _Source(skeleton, binary)
                writer = _writer(sink, source, **options)
                with Heartbeat(writer, heartbeat or 0.0) as heart, writer:
                    _push_all(source.rows, writer, heart)
    report_live(output, writer)
    return Exit.FINE


class _Source:
    """The rows on standard input, and the skeleton that their columns are the channels of."""

    def __init__(self, skeleton: str | None, binary: bool) -> None:
        from mcz.files.live.generators import markers

        known = None if skeleton is None else skeleton_in(skeleton)
        n_channels = None if known is None else known.n_channels
        self.rows = Rows(live_input(), binary=binary, n_channels=n_channels)
        self.skeleton = markers(self.rows.names or []) if known is None else known
        self.rows.expect(self.skeleton.n_channels)


def _writer(
    sink: Any,
    source: _Source,
    *,
    rate: Fraction | None,
    unit: str | None,
    up: str | None,
    **live: Any,
) -> LiveWriter:
    """The writer of the stream; ``live`` are further arguments of ``LiveWriter``."""
    from mcz.files.live.writer import LiveWriter
    from mcz.model.units import in_unit, with_axes

    skeleton = with_axes(in_unit(source.skeleton, unit), up)
    return LiveWriter(sink, skeleton, frame_rate=rate, **live)


def _push_all(rows: Rows, writer: LiveWriter, heart: Heartbeat) -> None:
    warned = False
    with note_abort(writer):
        for row in rows:
            with heart.lock:
                if isinstance(row, dict):
                    writer.change(**row)
                else:
                    writer.push(row)
            traffic = writer.traffic
            if not warned and (traffic.seconds or 0) >= WARN_AFTER and not traffic.is_held:
                warned = True
                say(rate_warning(traffic))


@click.command(short_help="Decode a live stream to rows of numbers.")
@click.argument("file", metavar="[FILE.mcz]", type=click.Path(readable=False), default="-")
@click.option(
    "--connect", metavar="HOST:PORT", help="Read from this address over TCP; implies --join."
)
@shared_options.token("Send this token to the server.")
@click.option(
    "--lost",
    type=click.Choice(("refuse", "missing", "hold", "linear")),
    default="refuse",
    show_default=True,
    help="Handle frames that did not arrive: stop, print empty fields, repeat the last frame, or "
    "interpolate to the next one.",
)
@click.option("--join", is_flag=True, help="Join a stream anywhere.")
@click.option(
    "--timeout",
    metavar="SECONDS",
    type=click.FloatRange(min=0),
    help="Stop after SECONDS without data; 0: wait forever.  [default: 30 with --connect, else 0]",
)
@click.option(
    "--post-filter",
    "post_filter",
    is_flag=True,
    help="Smooth coarsely coded positions; rows come 12 frames late.",
)
@shared_options.rate("Set the frame rate of a stream that states none (with --post-filter).")
@click.option("--float32", "binary", is_flag=True, help="Print little-endian binary32 rows.")
@click.option("--states", is_flag=True, help="Print which frames are concealed or missing.")
def stream_decode_command(
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
    """Print the frames of a live stream as they arrive.

    The stream is FILE.mcz, or standard input. A line of names comes first. CSV rows begin with the
    number of the frame, counted from 0; an empty field is a missing value. With --float32 a row
    has only values, and NaN is a missing value. At the end standard error reports what arrived.
    The exit code is 4 if frames are concealed or missing, or if the stream was cut off: the source
    died, the connection broke, or no data arrived for --timeout.
    """
    if connect is not None and file != "-":
        raise Failure("FILE.mcz and --connect exclude each other", Exit.USAGE)
    if binary and states:
        raise Failure("--states and --float32 exclude each other", Exit.USAGE)
    if rate is not None and not post_filter:
        raise Failure("--rate needs --post-filter", Exit.USAGE)
    from mcz.files.live.generators import stream_decode
    from mcz.files.writing.atomic import refuse_inputs

    if connect is None:
        refuse_inputs(sys.stdout, (sys.stdin if file == "-" else file,))

    where = connect or (NAME if file == "-" else file)
    if timeout is None and connect is not None:
        timeout = TIMEOUT
    with errors_about(where), _input_stream(file, connect, token, timeout or None) as stream:
        join = join or connect is not None
        reader = stream_decode(stream, lost=lost, join=join, post_filter=post_filter, rate=rate)
        try:
            _print_all(reader, _BinaryRows() if binary else _TextRows(states=states))
        except BrokenPipeError:  # the reader of our output is done
            raise
        except TruncatedError as error:
            if not reader.summary.stream_bytes:
                raise
            say(f"{where}: {error.describe(OPTION_HINTS, with_path=False)}")
        except BaseException:
            _print_summary(where, reader)
            raise
        ending = getattr(getattr(stream, "raw", None), "ending", None)
        if ending is not None:
            say(f"{where}: {ending}")
        _print_summary(where, reader)
    summary = reader.summary
    is_lossy = summary.concealed or summary.missing or summary.skipped or summary.n_faults
    whole = not (is_lossy or summary.is_cut)
    return Exit.FINE if whole else Exit.SALVAGED


@contextmanager
def _input_stream(
    file: str, connect: str | None, token: str | None, timeout: float | None
) -> Iterator[BinaryIO]:
    if connect is not None:
        from mcz.cli import tcp

        with tcp.connect(connect, token, timeout) as stream:
            yield stream
    elif file == "-":
        yield live_input(timeout)
    else:
        require_file(file)
        with builtins.open(file, "rb") as stream:
            yield stream


class _TextRows:
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


class _BinaryRows:
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


def _print_all(reader: LiveReader, printer: _TextRows | _BinaryRows) -> None:
    from mcz.files.tables import channel_names

    output = binary_output() if isinstance(printer, _BinaryRows) else text_output()
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
                raise Failure(f"clip {clip.name!r} has other channels than the clip before")
        output.write(printer.row(frame))
        output.flush()


def _print_summary(where: str, reader: LiveReader) -> None:
    """Report the received frames on standard error."""
    summary: Any = reader.summary
    for remark in summary.remarks:
        say(f"{where}: {remark}")
    if summary.n_faults > len(summary.remarks):
        say(f"{where}: {summary.n_faults - len(summary.remarks):,} more faults")
    others = {name: getattr(summary, name) for name in ("concealed", "missing", "skipped")}
    counts = [f"{count:,} {name}" for name, count in others.items() if count or name != "skipped"]
    facts = [f"{plural(summary.decoded, 'frame')} decoded, {', '.join(counts)}"]
    framing = summary.stream_bytes - summary.payload_bytes
    facts.append(f"{summary.payload_bytes:,} bytes of payload, {framing:,} of framing")
    n_frames = summary.decoded + summary.concealed + summary.missing
    rate = reader.clip.frame_rate if reader.clip is not None else None
    if rate and n_frames:
        seconds = float(n_frames / rate)
        all_bytes, payload = (
            n / 125 / seconds for n in (summary.stream_bytes, summary.payload_bytes)
        )
        facts.append(f"{all_bytes:.2f} kbit/s received, {payload:.2f} of payload")
    if summary.is_cut:
        facts.append("it was cut off")
    elif not summary.is_checked:
        facts.append("value hash not checked")
    say(f"{where}: {'; '.join(facts)}")
