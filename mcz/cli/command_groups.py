"""Groups of commands; a command is loaded when it is called.

Commands reject repeated options, unless an option makes a list.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from importlib import import_module

import click

from mcz.model.types import Settings


def lazy_group(commands: Mapping[str, str]) -> type[click.Group]:
    """Class of a group of commands; each value is a module of ``mcz.cli`` and its function."""
    names = tuple(commands)

    class Commands(click.Group):
        def list_commands(self, ctx: click.Context) -> list[str]:
            return list(names)

        def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
            if cmd_name not in commands:
                return None
            module, function = commands[cmd_name].split(".")
            command: click.Command = getattr(import_module(f"mcz.cli.{module}"), function)
            return command

        def resolve_command(
            self, ctx: click.Context, args: list[str]
        ) -> tuple[str | None, click.Command | None, list[str]]:
            if args and args[0] not in names and not args[0].startswith("-"):
                ctx.fail(unknown_command_text(args[0], names))
            name, command, rest = super().resolve_command(ctx, args)
            if command is not None and not ctx.resilient_parsing:
                refuse_repeats(command, name, rest, ctx)
            return name, command, rest

    return Commands


# Other people's names of our commands.
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


def unknown_command_text(name: str, names: Sequence[str]) -> str:
    """The message about an unknown command, with similar names."""
    from difflib import get_close_matches

    near = get_close_matches(name.lower(), names, 3, 0.7)
    if (meant := OTHER_NAMES.get(name.lower(), "")) and meant.split()[0] in names:
        return f"no command {name!r}; did you mean {meant}?"
    near += [known for known in names if known.startswith(name) and known not in near][:3]
    hint = f"did you mean {' or '.join(near)}?" if near else f"there are: {', '.join(names)}"
    return f"no command {name!r}; {hint}"


HELP = ["-h", "--help"]


def refuse_repeats(
    command: click.Command,
    name: str | None,
    arguments: Sequence[str],
    parent: click.Context | None = None,
) -> None:
    """Raise UsageError if ``arguments`` repeat an option that does not make a list."""
    settings: Settings = {"help_option_names": HELP, **command.context_settings}
    with click.Context(command, parent, name, **settings) as context:
        if command.no_args_is_help and not arguments:
            return
        if isinstance(command, click.Group):
            context.allow_interspersed_args = False
        _, _, present = command.make_parser(context).parse_args(list(arguments))
        if any(option.is_eager for option in present):
            return  # --help and the like end the run
        counts = Counter(option for option in present if isinstance(option, click.Option))
        for option, count in counts.items():
            if count > 1 and not option.multiple and not option.count:
                longest = max((*option.opts, *option.secondary_opts), key=len)
                raise click.UsageError(f"{longest} is given {count} times; give it once", context)


class StrictCommand(click.Command):
    """A command outside a group that rejects repeated options."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        if not ctx.resilient_parsing:
            refuse_repeats(self, ctx.info_name, args, ctx.parent)
        return super().parse_args(ctx, args)
