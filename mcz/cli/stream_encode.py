"""``mcz stream encode``: rows of numbers on standard input to a live stream."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mcz.cli.common import (
    Exit,
    Failure,
    about,
    echo,
    existing,
    plural,
    say,
)
from mcz.cli.options import (
    force_option,
    param_option,
    rate_option,
    token_option,
    unit_option,
    up_option,
)
from mcz.cli.piped import NAME, live_input, live_output
from mcz.cli.rows import Rows, skeleton_in

if TYPE_CHECKING:
    from mcz.live.writer import LiveWriter

Entry = Callable[[], int | None]


@click.command(short_help="Rows of numbers to a live stream.")
@click.option(
    "-o", "--output", metavar="OUT.mcz", help="Default: standard output, which - is, too."
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
@click.option("--name", metavar="NAME", default="live", help="Of the clip.  [default: live]")
@click.option(
    "--skeleton",
    metavar="FILE",
    type=click.Path(readable=False),
    help="Rows are the channels of the skeleton in a .bvh, .asf or .mcz file.",
)
@click.option("--float32", "binary", is_flag=True, help="Rows are little-endian binary32.")
@click.option(
    "--repeat",
    metavar="N",
    type=click.IntRange(min=0),
    default=1,
    show_default=True,
    help="Repeat skeleton and clip header at every N-th frame at which one can join; 0: never.",
)
@force_option
def command(
    output: str | None,
    listen: str | None,
    clients: int,
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
    """
    from mcz.writing.inputs import refuse_inputs

    if listen is not None and output is not None:
        raise Failure("-o and --listen exclude each other", Exit.USAGE)
    if clients and listen is None:
        raise Failure("--clients needs --listen", Exit.USAGE)
    if skeleton is not None:
        existing(skeleton)
    if listen is None:
        refuse_inputs(sys.stdout if output in (None, "-") else output, (sys.stdin, skeleton))
    others = tuple(name for name in (output, skeleton) if name not in (None, "-"))
    with about(NAME, *map(str, others)):
        if listen is not None:
            with _listening(listen, clients, token) as (sink, tell):
                _encode(sink, tell, skeleton, binary, **options)
            return Exit.FINE
        with live_output(output, force) as sink:
            held = _encode(sink, None, skeleton, binary, **options)
    if output not in (None, "-"):
        size = Path(str(output)).stat().st_size
        echo(f"{output}: {held}, live; {size:,} bytes")
    return Exit.FINE


def _encode(
    sink: Any,
    tell: Callable[[Entry], None] | None,
    skeleton: str | None,
    binary: bool,
    *,
    rate: Fraction | None,
    unit: str | None,
    up: str | None,
    **live: Any,
) -> str:
    """Write the stream; returns what it holds in words. ``tell`` is told where one can join.

    ``live``: further arguments of ``LiveWriter``.
    """
    from mcz.live.generators import markers
    from mcz.live.writer import LiveWriter
    from mcz.units import facing, in_unit

    known = None if skeleton is None else skeleton_in(skeleton)
    n_channels = None if known is None else known.n_channels
    rows = Rows(live_input(), binary=binary, n_channels=n_channels)
    if known is None:
        known = markers(rows.names or [])
    rows.expect(known.n_channels)
    writer = LiveWriter(sink, facing(in_unit(known, unit), up), frame_rate=rate, **live)
    if tell is not None:
        tell(lambda: writer.entry)
    with writer:
        _push_all(rows, writer)
    return f"{plural(writer.n_frames, 'frame')} of {plural(known.n_channels, 'channel')}"


def _push_all(rows: Rows, writer: LiveWriter) -> None:
    for row in rows:
        if isinstance(row, dict):
            writer.change(**row)
        else:
            writer.push(row)


@contextmanager
def _listening(
    where: str, n_clients: int, token: str | None
) -> Iterator[tuple[Any, Callable[[Entry], None]]]:
    """A sink that sends to clients, and what it is told of the places where one can join."""
    from mcz.cli.tcp import Listener

    with about(where):
        listener = Listener(where, token)
    say(f"listening on {listener.address}")
    if listener.is_open_to_others:
        who = "everyone who" if token is None else "everyone who has the token and"
        hint = "; --token asks for one" if token is None else ""
        say(f"{who} reaches the port can read the stream, which is not encrypted{hint}")

    def tell(entry: Entry) -> None:
        listener.entry = entry
        listener.wait_for(n_clients)

    try:
        yield listener, tell
    finally:
        listener.close()
