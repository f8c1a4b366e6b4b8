"""Run the command ``mcz`` in this process."""

from __future__ import annotations

from typing import Any

from mcz.cli.common import run as run_command
from mcz.cli.main import cli


def run(*arguments: Any) -> int:
    """The exit code of ``mcz`` with these arguments."""
    return int(run_command(cli, "mcz", [str(argument) for argument in arguments]))
