"""``mcz stream encode``: rows of numbers on standard input to a live stream."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from fractions import Fraction
from threading import Event, Lock, Thread
from time import monotonic
from typing import TYPE_CHECKING, Any

import click

from mcz.cli.common import (
    Exit,
    Failure,
    about,
    existing,
    say,
)
from mcz.cli.encode_stdin import NAME, aborting, live_input, live_output, rate_warning, report_live
from mcz.cli.options import (
    force_option,
    param_option,
    rate_option,
    token_option,
    unit_option,
    up_option,
)
from mcz.cli.rows import Rows, skeleton_in

if TYPE_CHECKING:
    from mcz.cli.tcp import Listener
    from mcz.files.live.writer import LiveWriter

HEARTBEAT = 5.0  # seconds
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
    help="Send the stream to all who connect over TCP instead; port 0 is any that is free.",
)
@click.option(
    "--clients",
    metavar="N",
    type=click.IntRange(min=0),
    default=0,
    help="Wait for N clients before the first row is read (with --listen).",
)
@token_option
@click.option("--codec", metavar="NAME", default="online", show_default=True)
@param_option
@rate_option("Frames a second (120, 29.97, 30000/1001).")
@unit_option("Length unit of the numbers.")
@up_option("Axis of the numbers that points up.")
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
    help="Repeat skeleton and clip header at every N-th frame at which one can join; 0: never.  "
    "[default: 1, or less often with a bit rate]",
)
@click.option(
    "--heartbeat",
    metavar="SECONDS",
    type=click.FloatRange(min=0),
    help="Tell clients every so often that the stream goes on while no row comes; 0: never.  "
    "[default: 5 with --listen, else 0]",
)
@force_option
def command(
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
    """Encode rows of numbers on standard input, each before the next is read.

    The first line names markers (a,b,c: then a row has x, y and z of each in turn) or their
    coordinates (a.x,a.y,a.z,...), unless --skeleton says what the columns are. CSV rows follow, an
    empty field where a value is missing, or, with --float32, binary ones, NaN there. What mcz
    decode --to csv and mcz stream decode print of markers will do, too. A CSV line
    "# set bitrate=4 gof=20" changes parameters of the codec from its next group of frames on.

    A bad row or one that is cut off aborts the stream: all frames before it are sent, and no end.
    Standard error says at the end what the stream took, framing included.
    """
    from mcz.files.writing.atomic import refuse_inputs

    if listen is not None and output is not None:
        raise Failure("-o and --listen exclude each other", Exit.USAGE)
    if clients and listen is None:
        raise Failure("--clients needs --listen", Exit.USAGE)
    if skeleton is not None:
        existing(skeleton)
    if listen is None:
        refuse_inputs(sys.stdout if output in (None, "-") else output, (sys.stdin, skeleton))
    with about(NAME):
        if listen is not None:
            beat = HEARTBEAT if heartbeat is None else heartbeat
            with _listening(listen, token) as listener:
                source = _Source(skeleton, binary)
                writer = _writer(listener, source, **options)
                listener.entry = lambda: writer.entry
                with _Heart(writer, beat, listener) as heart, writer:
                    listener.wait_for(clients)
                    _push_all(source.rows, writer, heart)
        else:
            with live_output(output, force) as sink:
                source = _Source(skeleton, binary)
                writer = _writer(sink, source, **options)
                with _Heart(writer, heartbeat or 0.0) as heart, writer:
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
    from mcz.model.units import facing, in_unit

    skeleton = facing(in_unit(source.skeleton, unit), up)
    return LiveWriter(sink, skeleton, frame_rate=rate, **live)


def _push_all(rows: Rows, writer: LiveWriter, heart: _Heart) -> None:
    warned = False
    with aborting(writer):
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


class _Heart:
    """Writes a heartbeat after every ``seconds`` without a frame, from a thread; 0: never.

    Who uses the writer holds ``lock``.
    """

    def __init__(
        self, writer: LiveWriter, seconds: float, listener: Listener | None = None
    ) -> None:
        self.lock = Lock()
        self._writer, self._seconds, self._listener = writer, seconds, listener
        self._is_over = Event()
        self._thread = Thread(target=self._beat, daemon=True)

    def __enter__(self) -> _Heart:
        if self._seconds:
            self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._is_over.set()
        if self._seconds:
            self._thread.join()

    def _beat(self) -> None:
        sent, since = self._writer.traffic.total, monotonic()
        while not self._is_over.wait(min(self._seconds / 4, 1.0)):
            with self.lock:
                now = self._writer.traffic.total
                if now == sent and monotonic() - since >= self._seconds:
                    with suppress(OSError):  # the next frame meets it, too
                        self._write()
                    now = self._writer.traffic.total
            if now != sent:
                sent, since = now, monotonic()

    def _write(self) -> None:
        if self._listener is None:
            self._writer.heartbeat()
        else:
            self._listener.beat(self._writer.heartbeat)


@contextmanager
def _listening(where: str, token: str | None) -> Iterator[Listener]:
    """A sink that sends to clients."""
    from mcz.cli.tcp import Listener

    with about(where):
        listener = Listener(where, token)
    say(f"listening on {listener.address}")
    if listener.is_open_to_others:
        who = "everyone who" if token is None else "everyone who has the token and"
        hint = "; --token asks for one" if token is None else ""
        say(f"{who} reaches the port can read the stream, which is not encrypted{hint}")
    try:
        yield listener
    finally:
        listener.close()
