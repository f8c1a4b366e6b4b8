"""A process that has all imports, and answers each request by a child that it breaks.

A line of standard input is [rule, variant, [vector, ...], seconds]; without a rule nothing is
broken, and a decoder that takes more seconds of the processor shows nothing. A line of JSON says
which of the vectors was the first that the broken decoder fails, and how: {vector, fault, crashes};
null where none was. Forking costs a hundredth of a process of its own.
"""

from __future__ import annotations

import gc
import importlib
import json
import os
import resource
import signal
import sys
from types import FrameType

from tests.broken import answers, by_hand, install, marks, variants

MEMORY = 2**32  # of a child


class HangError(BaseException):
    """No answer in time, which shows nothing."""


def main() -> None:
    from mcz.cli import conformance  # noqa: F401

    for module in sorted({place.module for row in marks.places().values() for place in row}):
        importlib.import_module(module)
        variants.whole(module)
    install.forget_known_answers()
    answers.vectors()
    functions = install.live()
    signal.signal(signal.SIGPROF, _hang)
    gc.freeze()  # what a child collected of it, it would copy first
    for line in sys.stdin:
        sys.stdout.flush()
        pid = os.fork()
        if pid == 0:
            resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
            rule, variant, vectors, seconds = json.loads(line)
            signal.setitimer(signal.ITIMER_PROF, seconds)
            print(json.dumps(_catch(functions, rule, variant, vectors)), flush=True)
            os._exit(0)
        status = os.waitpid(pid, 0)[1]
        if status:
            print(json.dumps({"slip": f"the child ended with status {status}"}), flush=True)


def _hang(number: int, frame: FrameType | None) -> None:
    raise HangError


def _catch(
    functions: install.Live, rule: str, name: str, vectors: list[str]
) -> dict[str, object] | None:
    try:
        codes = variants.codes(rule, name) if rule else {}
        if codes and not install.swap(codes, functions):
            install.install(codes, loops="checked" if rule in by_hand.LARGE else "interpreted")
        crash = None
        for vector in vectors:
            fault = answers.fault(answers.vectors()[vector])
            if fault and answers.CRASH not in fault:
                return {"vector": vector, "fault": fault, "crashes": False}
            if fault and not crash:
                crash = {"vector": vector, "fault": fault, "crashes": True}
        return crash
    except BaseException as error:
        return {"slip": f"{type(error).__name__}: {error}"}


if __name__ == "__main__":
    main()
