"""Run the command ``mcz`` in this process."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any, NamedTuple

from mcz.cli.common import run as run_command
from mcz.cli.main import cli


class Result(NamedTuple):
    """The exit code of a command and what it printed."""

    code: int
    out: str
    err: str

    @property
    def document(self) -> Any:
        assert self.code == 0, self.err
        return json.loads(self.out)


Call = Callable[..., Result]


def run(*arguments: Any) -> int:
    """The exit code of ``mcz`` with these arguments."""
    return int(run_command(cli, "mcz", [str(argument) for argument in arguments]))


def fails(result: Result, code: int, *words: str) -> None:
    """The command ended with ``code``, one line on stderr that has ``words``, none on stdout."""
    assert (result.code, result.out) == (code, ""), result
    assert result.err.startswith("mcz: ") and result.err.count("\n") == 1
    for word in words:
        assert word in result.err
