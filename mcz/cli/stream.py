"""``mcz stream``: numbers to a live stream and back; each part is loaded when it is called."""

from __future__ import annotations

from importlib import import_module

import click

from mcz.cli.common import EXIT_CODES

COMMANDS = ("encode", "decode")


class _Commands(click.Group):
    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        found: click.Command = import_module(f"mcz.cli.stream_{cmd_name}").command
        return found


@click.command(
    cls=_Commands,
    name="stream",
    short_help="Frames as they come: rows of numbers to a live stream, and back.",
    epilog=EXIT_CODES,
)
def command() -> None:
    """Code frames as they come, each before the next is known, over a pipe or TCP."""
