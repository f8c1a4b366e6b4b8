"""Answers of this process's decoder to vectors, judged by the runner's rules."""

from __future__ import annotations

import io
import traceback
from collections.abc import Sequence
from contextlib import redirect_stderr
from functools import cache
from typing import Any

from conformance import run

CRASH = ": crash: "


def fault(vector: dict[str, Any]) -> str | None:
    """First fault of the answers about ``vector``, in the runner's words."""
    from mcz.cli import conformance

    for request in run.requests(vector, conformance.OPTIONS):
        code, output = answer(request.path.read_bytes(), request.arguments)
        answered = code in (0, 1, 3)
        first = run.judge(request, code, output) if answered else None
        if not answered or first:
            what = f": {first}" if answered else f"{CRASH}{output.decode()}"
            return f"{' '.join(request.arguments)}{what}"
    return None


def answer(data: bytes, arguments: Sequence[str]) -> tuple[int, bytes]:
    """Exit code and output of one request; a crash has code 2 and its last line as output.

    A name or module that is not there is a slip in the break, and is raised.
    """
    from mcz.cli import conformance

    try:
        with redirect_stderr(io.StringIO()):  # the reasons of refusals
            return conformance.answer(data, arguments)
    except (ImportError, NameError):
        raise
    except Exception:
        return 2, traceback.format_exc().splitlines()[-1].encode()


@cache
def vectors() -> dict[str, dict[str, Any]]:
    """The rows of the manifest by the names of their files without the suffix."""
    return {row["file"].removesuffix(".mcz"): row for row in run.load_manifest()}


@cache
def of_rules() -> dict[str, list[str]]:
    """The vectors that the manifest names for each rule, to be refused and small ones first."""
    vectors_by_rule: dict[str, list[str]] = {}
    for name, row in vectors().items():
        for rule in row["requirements"]:
            vectors_by_rule.setdefault(rule, []).append(name)
    for names in vectors_by_rule.values():
        names.sort(key=lambda name: (not name.startswith("invalid/"), _size(name)))
    return vectors_by_rule


def _size(name: str) -> int:
    return (run.VECTORS / str(vectors()[name]["file"])).stat().st_size
