"""Processes under test: each with a time limit, a memory limit and a limit of what it writes.

``Once`` starts a process for each request; server.py asks one process many. Both give an Answer and
leave it to judge.py.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, Protocol

POSIX = os.name == "posix"
# A shell sets the limits and becomes the command: safe where several threads start processes. Data,
# not address space: JavaScript engines reserve far more than they use. A lower limit stays.
LIMITED = 'ulimit -d "$1" 2>/dev/null; ulimit -f "$2" 2>/dev/null; shift 2; exec "$@"'


@dataclass(frozen=True, slots=True)
class Limits:
    """Seconds and bytes a request may take; ``memory`` 0 is no limit."""

    timeout: float = 60.0
    memory: int = 2**31


@dataclass(frozen=True, slots=True)
class Answer:
    """A process's answer to one request."""

    code: int  # the exit code; below 0: minus the signal that ended the process
    output: bytes = b""
    errors: str = ""  # the end of standard error
    seconds: float = 0.0
    fault: str = ""  # "hang", "memory", "output too long" or another end without a result
    detail: str = ""


class Worker(Protocol):
    """Owner of one or several processes."""

    def kill(self) -> None: ...

    def close(self) -> None: ...


class Asker(Worker, Protocol):
    """A worker that answers requests, one at a time."""

    def ask(self, arguments: Sequence[str], data: Path | bytes, max_output: int) -> Answer: ...


class Child:
    """A running process with its watchdog, whose group dies with it."""

    def __init__(self, command: Sequence[str], limits: Limits, max_file: int, **files: Any) -> None:
        self.limits = limits
        self.hangs = False
        self._timer: threading.Timer | None = None
        self.process = subprocess.Popen(
            _limit_command(command, limits.memory, max_file), start_new_session=POSIX, **files
        )
        self._inherited = peak_of("self")

    def watch(self) -> None:
        """Kill the process unless ``unwatch`` is called within the time limit."""
        self.unwatch()
        self._timer = threading.Timer(self.limits.timeout, self._bark)
        self._timer.daemon = True
        self._timer.start()

    def unwatch(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer.join()
            self._timer = None

    def _bark(self) -> None:
        self.hangs = True
        self.kill()

    def kill(self) -> None:
        """End the process and what it started."""
        if self.process.returncode is not None:
            return
        if not POSIX:
            self.process.kill()
            return
        try:
            os.killpg(self.process.pid, signal.SIGKILL)
        except (ProcessLookupError, PermissionError):  # the latter: macOS, of a zombie
            return

    def end(self) -> tuple[int, int]:
        """Wait for the end; exit code, and the most bytes that were resident, 0 if unknown.

        Linux counts what this process held when it started the other one: up to there nothing is
        known.
        """
        if not hasattr(os, "wait4"):
            self.process.wait()
            self.unwatch()
            return self.process.returncode, 0
        if hasattr(os, "waitid"):  # the number stays taken until the watchdog is gone
            os.waitid(os.P_PID, self.process.pid, os.WEXITED | os.WNOWAIT)
            self.unwatch()
            self.kill()  # what it left behind
        _, status, usage = os.wait4(self.process.pid, 0)
        self.process.returncode = os.waitstatus_to_exitcode(status)
        self.unwatch()
        peak = usage.ru_maxrss * (1 if sys.platform == "darwin" else 1024)
        return self.process.returncode, peak if peak > self._inherited else 0


def peak_of(process: int | str) -> int:
    """The most bytes of a running process that were resident, 0 where the system does not say."""
    with suppress(OSError, ValueError):
        for line in Path(f"/proc/{process}/status").read_text("utf-8").splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) * 1024
    return 0


def _limit_command(command: Sequence[str], memory: int, max_file: int) -> list[str]:
    if not POSIX:
        return list(command)
    data = str(memory // 1024) if memory else "unlimited"
    blocks = str(max_file // 512 + 1)
    return ["/bin/sh", "-c", LIMITED, "sh", data, blocks, *command]


class Once:
    """A process for each request."""

    def __init__(self, command: Sequence[str], limits: Limits) -> None:
        self._command = command
        self._limits = limits
        self._child: Child | None = None

    def ask(self, arguments: Sequence[str], data: Path | bytes, max_output: int) -> Answer:
        started = time.monotonic()
        with (
            _store_bytes(data) as stdin,
            tempfile.TemporaryFile() as output,
            tempfile.TemporaryFile() as errors,
        ):
            child = Child(
                [*self._command, *arguments],
                self._limits,
                max_output,
                stdin=stdin,
                stdout=output,
                stderr=errors,
            )
            self._child = child
            child.watch()
            code, peak = child.end()
            fault, detail = excess(child, peak, max(size_of(output), size_of(errors)), max_output)
            return Answer(
                code=code,
                output=b"" if fault else _content(output),
                errors=tail(errors, 0),
                seconds=time.monotonic() - started,
                fault=fault,
                detail=detail,
            )

    def kill(self) -> None:
        if self._child is not None:
            self._child.kill()

    def close(self) -> None:
        """Nothing is left to end."""


def excess(child: Child, peak: int, written: int, max_output: int) -> tuple[str, str]:
    """The limit that ``child`` went beyond, and how far."""
    memory = child.limits.memory
    if child.hangs:
        return "hang", f"no answer in {child.limits.timeout:g} s"
    if written > max_output:
        return "output too long", f"more than {max_output:,} bytes"
    if memory and peak > memory:
        return "memory", f"{peak / 2**20:.0f} MiB, the limit is {memory / 2**20:.0f}"
    return "", ""


def _store_bytes(data: Path | bytes) -> IO[bytes]:
    if isinstance(data, Path):
        return data.open("rb")
    file = tempfile.TemporaryFile()  # noqa: SIM115 - the caller closes it
    file.write(data)
    file.seek(0)
    return file


def size_of(file: IO[bytes]) -> int:
    return os.fstat(file.fileno()).st_size


def _content(file: IO[bytes]) -> bytes:
    file.seek(0)
    return file.read()


def tail(file: IO[bytes], start: int) -> str:
    """The last 4,000 bytes of ``file`` from ``start`` on, as text."""
    file.seek(max(start, size_of(file) - 4000))
    return file.read().decode("utf-8", "replace")
