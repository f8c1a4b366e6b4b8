"""Groups of commands, each of which is loaded when it is called.

No command of theirs takes an option twice, unless that makes a list.
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module

import click

from mcz.cli.duplicate_options import refuse_repeats


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
            if args and args[0] not in names and not args[0].startswith("-"):
                ctx.fail(unknown(args[0], names))
            name, command, rest = super().resolve_command(ctx, args)
            if command is not None and not ctx.resilient_parsing:
                refuse_repeats(command, name, rest, ctx)
            return name, command, rest

    return Commands


# What else people call our commands.
OTHER_NAMES = {
    "check": "verify",
    "compare": "diff",
    "compress": "encode",
    "cut": "extract",
    "find": "list --where",
    "ls": "list",
    "play": "view",
    "remove": "delete",
    "search": "list --where",
    "show": "view",
    "trim": "extract",
}


def unknown(name: str, names: Sequence[str]) -> str:
    """The message about an unknown command, with similar names."""
    from difflib import get_close_matches

    near = get_close_matches(name.lower(), names, 3, 0.7)
    if (meant := OTHER_NAMES.get(name.lower(), "")) and meant.split()[0] in names:
        return f"no command {name!r}; that is {meant}"
    near += [known for known in names if known.startswith(name) and known not in near][:3]
    hint = f"did you mean {' or '.join(near)}?" if near else f"there are: {', '.join(names)}"
    return f"no command {name!r}; {hint}"
