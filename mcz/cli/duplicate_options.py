"""Reject repeated options."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import click

from mcz.model.types import Settings

HELP = ["-h", "--help"]


def refuse_repeats(
    command: click.Command,
    name: str | None,
    arguments: Sequence[str],
    parent: click.Context | None = None,
) -> None:
    """Raise UsageError where ``arguments`` give an option twice that does not take a list."""
    settings: Settings = {"help_option_names": HELP, **command.context_settings}
    with click.Context(command, parent, name, **settings) as context:
        if command.no_args_is_help and not arguments:
            return
        if isinstance(command, click.Group):
            context.allow_interspersed_args = False
        _, _, given = command.make_parser(context).parse_args(list(arguments))
        if any(option.is_eager for option in given):
            return  # --help and the like end the run
        counts = Counter(option for option in given if isinstance(option, click.Option))
        for option, count in counts.items():
            if count > 1 and not option.multiple and not option.count:
                shown = max((*option.opts, *option.secondary_opts), key=len)
                raise click.UsageError(f"{shown} is given {count} times, and takes one", context)


class Once(click.Command):
    """A command outside a group that rejects repeated options."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        if not ctx.resilient_parsing:
            refuse_repeats(self, ctx.info_name, args, ctx.parent)
        return super().parse_args(ctx, args)
