"""Groups of commands, each of which is loaded when it is called.

No command of theirs takes an option twice, unless that makes a list.
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module

import click

from mcz.cli.repeats import refuse_repeats


def lazy_group(prefix: str, names: Sequence[str]) -> type[click.Group]:
    """A group of commands that are the ``command`` of the modules called ``prefix`` and a name."""

    class Commands(click.Group):
        def list_commands(self, ctx: click.Context) -> list[str]:
            return list(names)

        def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
            if cmd_name not in names:
                return None
            command: click.Command = import_module(prefix + cmd_name).command
            return command

        def resolve_command(
            self, ctx: click.Context, args: list[str]
        ) -> tuple[str | None, click.Command | None, list[str]]:
            name, command, rest = super().resolve_command(ctx, args)
            if command is not None and not ctx.resilient_parsing:
                refuse_repeats(command, name, rest, ctx)
            return name, command, rest

    return Commands
