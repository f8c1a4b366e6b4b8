"""A process that has all imports but those of mcz, and answers each name of a break by a child.

A line of standard input names a break; a line of JSON says which of its vectors the decoder that is
so broken fails, and how. Forking costs a tenth of a process of its own.
"""

from __future__ import annotations

import json
import os
import signal
import sys

from tests.broken import answers, install
from tests.broken.table import BREAKS

SECONDS = 120  # of a child; one that hangs fails the test, and is not to hold up the others


def main() -> None:
    import construct  # noqa: F401
    import numba  # noqa: F401
    import numpy  # noqa: F401

    answers.vectors()
    for line in sys.stdin:
        pid = os.fork()
        if pid == 0:
            signal.alarm(SECONDS)
            _catch(line.strip())
            sys.stdout.flush()
            os._exit(0)
        status = os.waitpid(pid, 0)[1]
        if status:
            print(json.dumps(f"the child ended with status {status}"), flush=True)


def _catch(name: str) -> None:
    try:
        install(BREAKS[name])
        rows = answers.by_name(BREAKS[name].vectors)
        found: object = {row["file"]: answers.faults(row) for row in rows}
    except BaseException as error:
        found = f"{type(error).__name__}: {error}"
    print(json.dumps(found))


if __name__ == "__main__":
    main()
