"""``mcz completion``: what a shell needs to complete commands, options and files."""

from __future__ import annotations

import click

from mcz.cli.common import Exit, Failure, echo

SHELLS = ("bash", "zsh", "fish")


@click.command(short_help="Print completion for bash, zsh or fish.")
@click.argument("shell", metavar="|".join(SHELLS), type=click.Choice(SHELLS))
def command(shell: str) -> Exit:
    """Print what a shell needs to complete mcz commands and options with the tab key.

    \b
    bash:  eval "$(mcz completion bash)"     in ~/.bashrc
    zsh:   eval "$(mcz completion zsh)"      in ~/.zshrc
    fish:  mcz completion fish | source      in ~/.config/fish/config.fish
    """
    from click.shell_completion import get_completion_class

    from mcz.cli.main import cli

    completes = get_completion_class(shell)
    if completes is None:
        raise Failure(f"no completion for {shell}", Exit.USAGE)
    # bash asks for no check of its version: the script says what it needs by itself
    source = completes(cli, {}, "mcz", "_MCZ_COMPLETE")
    echo(*(source.source_template % source.source_vars()).splitlines())
    return Exit.FINE
