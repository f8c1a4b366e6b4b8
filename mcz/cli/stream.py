"""``mcz stream``: numbers to a live stream and back; each part is loaded when it is called."""

from __future__ import annotations

import click

from mcz.cli.common import EXIT_CODES
from mcz.cli.lazy import lazy_group


@click.command(
    cls=lazy_group("mcz.cli.stream_", ("encode", "decode")),
    name="stream",
    short_help="Encode frames as they come: rows of numbers to a live stream, and back.",
    epilog=EXIT_CODES,
)
def command() -> None:
    """Code frames as they come, each before the next is known, over a pipe or TCP."""
