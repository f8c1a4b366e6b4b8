"""Run the command ``mcz`` in this process, or in one of its own."""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import mcz
from mcz.cli.common import run as run_command
from mcz.cli.main import cli

ROOT = Path(mcz.__file__).parent.parent
ENV = os.environ | {"PYTHONPATH": str(ROOT)}


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


def run_piped(*arguments: Any, data: bytes = b"") -> tuple[int, bytes, str]:
    """Exit code, standard output and standard error of ``mcz``, in this process."""
    before = sys.stdin, sys.stdout, sys.stderr
    streams = [io.TextIOWrapper(io.BytesIO(part), "utf-8") for part in (data, b"", b"")]
    sys.stdin, sys.stdout, sys.stderr = streams
    try:
        code = run(*arguments)
        for stream in streams[1:]:
            stream.flush()
    finally:
        sys.stdin, sys.stdout, sys.stderr = before
    out, errors = (stream.buffer.getvalue() for stream in streams[1:])
    return code, out, errors.decode()


def fails(result: Result, code: int, *words: str) -> None:
    """The command ended with ``code``, one line on stderr that has ``words``, none on stdout."""
    assert (result.code, result.out) == (code, ""), result
    assert result.err.startswith("mcz: ") and result.err.count("\n") == 1
    for word in words:
        assert word in result.err


class Started:
    """A process of ``mcz`` with its pipes in hand."""

    def __init__(self, *arguments: object) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", "mcz", *map(str, arguments)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            cwd=ROOT,
            env=ENV,
        )
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        assert self.process.stderr is not None
        self.stdin, self.stdout = self.process.stdin, self.process.stdout
        self.stderr = self.process.stderr

    def __enter__(self) -> Started:
        return self

    def __exit__(self, *_: object) -> None:
        for stream in (self.stdin, self.stdout, self.stderr):
            stream.close()
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()

    def say(self, data: bytes) -> None:
        self.stdin.write(data)
        self.stdin.flush()

    def address(self) -> str:
        """The address that it listens on."""
        return self.stderr.readline().decode().split()[-1]

    def end(self) -> int:
        self.stdin.close()
        return self.process.wait()
