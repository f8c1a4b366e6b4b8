"""Work of a pool's process: call a function for one item after the other until the input ends.

Messages are a length of 8 bytes and a pickle. The first is the number of threads and the pickled
state, each further one a function and an item; each is answered with whether it went well, and
the result or the error.
"""

from __future__ import annotations

import os
import pickle
import signal
import sys
from contextlib import suppress
from typing import Any, BinaryIO

LENGTH = 8


def send(stream: BinaryIO, message: bytes) -> None:
    stream.write(len(message).to_bytes(LENGTH, "little"))
    stream.write(message)
    stream.flush()


def receive(stream: BinaryIO) -> bytes | None:
    """The next message, None where the other side has gone."""
    head = stream.read(LENGTH)
    if len(head) < LENGTH:
        return None
    size = int.from_bytes(head, "little")
    message = stream.read(size)
    return message if len(message) == size else None


def main() -> None:
    """Answer what comes on standard input; whatever prints prints to standard error."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # whoever started the pool ends it
    replies = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    first = receive(sys.stdin.buffer)
    if first is None:
        return
    from mcz.model.threads import limited

    n_threads, packed = pickle.loads(first)
    with limited(n_threads):
        state = State(packed)
        with suppress(BrokenPipeError):  # it was killed, and needs no answer any more
            while (message := receive(sys.stdin.buffer)) is not None:
                send(replies, _answer(state, message))


class State:
    """State of all calls, unpickled on the first, whose error it may be."""

    def __init__(self, packed: bytes) -> None:
        self._packed: bytes | None = packed
        self._value: object = None

    def __call__(self) -> Any:
        if self._packed is not None:
            self._value = pickle.loads(self._packed)
            self._packed = None
        return self._value


def _answer(state: State, message: bytes) -> bytes:
    try:
        function, item = pickle.loads(message)
        return pickle.dumps((True, function(state(), item)), pickle.HIGHEST_PROTOCOL)
    except Exception as error:  # whatever it is, the caller gets it
        return _failure(error)


def _failure(error: Exception) -> bytes:
    try:
        packed = pickle.dumps((False, error))
        pickle.loads(packed)
    except Exception:  # one of a library, that cannot be pickled
        packed = pickle.dumps((False, RuntimeError(f"{type(error).__name__}: {error}")))
    return packed
