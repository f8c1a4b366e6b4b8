"""Limits of one input, and records of inputs that exceed them or break a property."""

from __future__ import annotations

import hashlib
import json
import resource
import signal
import time
import traceback
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType
from typing import TypeVar

from mcz.errors import MczError

Result = TypeVar("Result")

SECONDS = 10.0  # of processor time, so that a busy machine raises no alarm
MEMORY = 1536 * 2**20  # bytes of data beyond those of the start
MOST_OF_A_KIND = 3  # inputs that are kept of one finding


class BrokenError(Exception):
    """A property does not hold."""


class HangError(BaseException):
    """An input takes too long; no ``except Exception`` may swallow it."""


def hold(truth: object, message: str) -> None:
    """Raise BrokenError unless ``truth``."""
    if not truth:
        raise BrokenError(message)


def limit_memory(extra: int = MEMORY) -> None:
    """Limit this process to ``extra`` bytes of data more than it has; then it raises MemoryError.

    Where the system does not say what it has, there is no limit.
    """
    status = Path("/proc/self/status")
    if not status.exists():
        return
    used = next(int(line.split()[1]) for line in status.open() if line.startswith("VmData"))
    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    resource.setrlimit(resource.RLIMIT_DATA, (used * 1024 + extra, hard))


def limit_time() -> None:
    """Make ``timed`` raise HangError."""
    signal.signal(signal.SIGVTALRM, _too_long)


def _too_long(number: int, frame: FrameType | None) -> None:
    raise HangError(f"more than {SECONDS} s of processor time")


def call_in_time(call: Callable[[bytes], Result], data: bytes) -> Result:
    """``call(data)`` within ``SECONDS``; a first excess may be that of a compiler."""
    try:
        return _call_with_timer(call, data)
    except HangError:
        return _call_with_timer(call, data)


def _call_with_timer(call: Callable[[bytes], Result], data: bytes) -> Result:
    signal.setitimer(signal.ITIMER_VIRTUAL, SECONDS)
    try:
        return call(data)
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)


@dataclass(slots=True)
class Record:
    """Results of a target's inputs so far, and the folder of its findings and figures."""

    target: str
    folder: Path
    figures: Path
    executions: int = 0
    decoded: int = 0
    refused: Counter[str] = field(default_factory=Counter)
    findings: Counter[str] = field(default_factory=Counter)
    saved: float = 0.0

    def run(self, check: Callable[[bytes], bool], data: bytes) -> None:
        """Check one input; ``check`` tells whether it was decoded, and may raise MczError."""
        self.executions += 1
        try:
            self.decoded += call_in_time(check, data)
        except MczError as error:
            self.refused[type(error).__name__] += 1
        except (Exception, HangError) as error:
            self._find(error, data)
        if time.monotonic() > self.saved + 1:
            self.save()

    def _find(self, error: BaseException, data: bytes) -> None:
        key = f"{type(error).__name__} in {_place(error)}"
        self.findings[key] += 1
        if self.findings[key] > MOST_OF_A_KIND:
            return
        name = f"{self.target}-{hashlib.sha256(data).hexdigest()[:12]}"
        (self.folder / name).write_bytes(data)
        text = "".join(traceback.format_exception(error))
        (self.folder / f"{name}.txt").write_text(f"{key}\n{len(data)} bytes\n\n{text}")
        self.save()

    def save(self) -> None:
        """Write the figures, for whoever started this process."""
        self.saved = time.monotonic()
        figures = {
            "executions": self.executions,
            "decoded": self.decoded,
            "refused": self.refused,
            "findings": self.findings,
        }
        self.figures.write_text(json.dumps(figures))


def _place(error: BaseException) -> str:
    """The property that broke, or the innermost line of the package that the error came through."""
    if isinstance(error, BrokenError):
        return str(error)[:60]
    frames = traceback.extract_tb(error.__traceback__)
    last = [*frames[-1:], *(frame for frame in frames if "/mcz/" in frame.filename)][-1]
    return f"{Path(last.filename).name}:{last.lineno} {last.name}"
