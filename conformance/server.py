"""One process for many requests (README.md, "The contract": --serve)."""

from __future__ import annotations

import json
import subprocess
import tempfile
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import IO

from conformance.child import Answer, Child, Limits, excess, peak_of, size_of, tail

MAX_LINE = 2**12  # bytes of the line before an answer
MAX_ERRORS = 2**28  # bytes on standard error over the life of a process


class _Lost(Exception):
    """The process gave no answer: the name of the fault, if it is not the end that says it."""


class Server:
    """Asks one process; after a crash, a hang or an excess the next request gets a new one."""

    def __init__(self, command: Sequence[str], limits: Limits) -> None:
        self._command = [*command, "--serve"]
        self._limits = limits
        self._child: Child | None = None
        self._errors: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115 - closed in close()

    def ask(self, arguments: Sequence[str], data: Path | bytes, max_output: int) -> Answer:
        started = time.monotonic()
        content = data if isinstance(data, bytes) else data.read_bytes()
        child = self._start_child()
        n_logged = size_of(self._errors)
        child.watch()
        try:
            code, output = _exchange(child.process, arguments, content, max_output)
            child.unwatch()
            fault, detail = excess(child, peak_of(child.process.pid), len(output), max_output)
            if fault:
                self._stop()
        except _Lost as lost:
            code, fault, detail = self._lost_answer(child, lost)
            output = b""
        errors = tail(self._errors, n_logged)
        return Answer(code, output, errors, time.monotonic() - started, fault, detail)

    def _start_child(self) -> Child:
        if self._child is None:
            pipe = subprocess.PIPE
            self._child = Child(
                self._command,
                self._limits,
                MAX_ERRORS,
                stdin=pipe,
                stdout=pipe,
                stderr=self._errors,
            )
        return self._child

    def _lost_answer(self, child: Child, lost: _Lost) -> tuple[int, str, str]:
        """Exit code, fault and detail of a process that gave no answer."""
        if lost.args:  # it is there, but what it says is no use
            child.unwatch()
            child.kill()
        code, peak = self._stop()
        fault, detail = excess(child, peak, 0, 0)
        if not fault and lost.args:
            fault, detail = lost.args
        if not fault and code >= 0:
            fault, detail = f"crash (exit {code})", "it ended without an answer"
        return code, fault, detail

    def _stop(self) -> tuple[int, int]:
        """End the process; its exit code and the most bytes that were resident."""
        child, self._child = self._child, None
        if child is None:
            return 0, 0
        for pipe in (child.process.stdin, child.process.stdout):
            with suppress(OSError):  # what was not written has no reader any more
                if pipe is not None:
                    pipe.close()
        child.watch()  # a process that stays when its input ends
        return child.end()

    def kill(self) -> None:
        if self._child is not None:
            self._child.kill()

    def close(self) -> None:
        """Allow the process to end."""
        self._stop()
        self._errors.close()


def _exchange(
    process: subprocess.Popen[bytes], arguments: Sequence[str], content: bytes, max_output: int
) -> tuple[int, bytes]:
    """Send a request; the exit code and the output of its answer. _Lost without a whole one."""
    assert process.stdin is not None and process.stdout is not None
    request = json.dumps({"arguments": list(arguments), "bytes": len(content)})
    try:
        process.stdin.write(request.encode() + b"\n" + content)
        process.stdin.flush()
        line = process.stdout.readline(MAX_LINE)
    except OSError:
        raise _Lost from None
    if not line:
        raise _Lost
    try:
        answer = json.loads(line)
        code, size = int(answer["exit"]), int(answer["bytes"])
    except (ValueError, TypeError, KeyError, OverflowError, RecursionError):
        raise _Lost("bad answer", f"a server's line is {line[:100]!r}") from None
    if not (0 <= code < 256 and size >= 0):
        raise _Lost("bad answer", f"exit {code}, {size} bytes")
    if size > max_output:
        raise _Lost("output too long", f"{size:,} bytes, at most {max_output:,} are read")
    output = process.stdout.read(size)
    if len(output) < size:
        raise _Lost
    return code, output
