"""What the decoder of this process makes of vectors, and what is wrong with it."""

from __future__ import annotations

import traceback
from collections.abc import Iterator, Sequence
from functools import cache
from typing import Any

from conformance import run

CRASH = "crash"


def faults(vector: dict[str, Any]) -> list[str]:
    """What is wrong with the answers about ``vector``, as the runner would say it."""
    from mcz.cli import conformance

    found = []
    for request in run.requests(vector, conformance.OPTIONS):
        code, output = answer(request.path.read_bytes(), request.arguments)
        answered = code in (0, 1, 3)
        fault = run.judge(request, code, output) if answered else f"{CRASH}: {output.decode()}"
        if fault:
            found.append(f"{' '.join(request.arguments)}: {fault}")
    return found


def answer(data: bytes, arguments: Sequence[str]) -> tuple[int, bytes]:
    """Exit code and output of one request; a crash has code 2 and its last line as output.

    A name or module that is not there is a slip in the break, and is raised.
    """
    from mcz.cli import conformance
    from mcz.errors import MczError, UnsupportedError

    try:
        given = conformance._parser().parse_args(list(arguments))
        return 0, b"".join(conformance.respond(data, given))
    except UnsupportedError:
        return 3, b""
    except MczError:
        return 1, b""
    except (ImportError, NameError):
        raise
    except Exception:
        return 2, traceback.format_exc().splitlines()[-1].encode()


@cache
def vectors() -> dict[str, dict[str, Any]]:
    """The rows of the manifest by the names of their files without the suffix."""
    return {row["file"].removesuffix(".mcz"): row for row in run.load_manifest()}


def by_name(names: Sequence[str]) -> Iterator[dict[str, Any]]:
    """The vectors of these names, or whose names begin so; raises KeyError where there is none."""
    for wanted in names:
        if wanted in vectors():
            yield vectors()[wanted]
            continue
        found = [row for name, row in vectors().items() if name.startswith(wanted)]
        if not found:
            raise KeyError(f"no vector is called {wanted}")
        yield from found
