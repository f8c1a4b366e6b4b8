"""Faults of an answer, by name: the rules of README.md, "The contract"."""

from __future__ import annotations

import hashlib
import json
import re
from dataclasses import dataclass
from typing import Any

from conformance.child import Answer
from conformance.manifest import MAX_LINE, Request

OK, REFUSED, UNSUPPORTED = 0, 1, 3
FIELDS = {
    "arrays": ("clip", "signal", "array", "dtype", "shape"),
    "sources": ("path",),
}
ENDED = ("hang", "memory", "output too long", "bad answer")  # by the runner
# What runtimes write about memory that they did not get, and about exceptions that nobody caught.
NO_MEMORY = re.compile(
    r"^(\w+\.)*_?\w*MemoryError\b|std::bad_alloc|heap out of memory|runtime: out of memory"
    r"|memory allocation of \d+ bytes failed|Array buffer allocation failed|OutOfMemoryError"
    r"|Cannot allocate memory",
    re.MULTILINE,
)
UNCAUGHT = re.compile(
    r"^Traceback \(most recent call last\):|^Node\.js v\d+|^Exception in thread \""
    r"|^thread '.*' panicked at|^panic: |^terminate called ",
    re.MULTILINE,
)


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault of an answer: ``kind`` is one of the names in README.md."""

    kind: str
    detail: str = ""

    def __str__(self) -> str:
        return f"{self.kind}: {self.detail}" if self.detail else self.kind


class Wrong(Exception):
    """A fault that was found while an answer was read."""

    def __init__(self, kind: str, detail: str) -> None:
        super().__init__(kind, detail)
        self.fault = Fault(kind, detail)


def judge_answer(request: Request, answer: Answer) -> Fault | None:
    """Return the fault of ``answer``, or None."""
    return end_of(answer) or judge(request, answer.code, answer.output)


def end_of(answer: Answer) -> Fault | None:
    """Return the fault in a process's end, or None if it gave an exit code."""
    if answer.fault in ENDED:
        return Fault(answer.fault, answer.detail)
    if answer.code != OK and NO_MEMORY.search(answer.errors):
        return Fault("memory", "standard error says that there was too little")
    if answer.code < 0:
        return Fault(f"crash (signal {-answer.code})")
    if answer.code != OK and UNCAUGHT.search(answer.errors):
        return Fault("crash (uncaught exception)", f"exit {answer.code}")
    return Fault(answer.fault, answer.detail) if answer.fault else None


def judge(request: Request, code: int, output: bytes) -> Fault | None:
    """Return the fault of this exit code and this output, or None."""
    wanted = request.vector["exit"]
    if code not in wanted:
        return _wrong_code(request, code, wanted)
    if code != OK:
        return None
    try:
        _compare(parse_output(output, request.listing), request)
    except Wrong as wrong:
        return wrong.fault
    return None


def _wrong_code(request: Request, code: int, wanted: list[int]) -> Fault:
    expected = f"exit {code}, expected {' or '.join(map(str, wanted))}"
    if code == OK:
        effect = request.vector.get("effect")
        return Fault("accepted", f"{expected}; effect: {effect}" if effect else expected)
    kinds = {REFUSED: "wrongly refused", UNSUPPORTED: "called unsupported"}
    return Fault(kinds.get(code, "bad exit code"), expected)


def _compare(rows: list[dict[str, Any]], request: Request) -> None:
    """Raise Wrong where ``rows`` are not what is expected: first their names, then their bytes."""
    names = FIELDS[request.listing]
    got = [tuple(map(_plain, (row[name] for name in names))) for row in rows]
    wanted = [tuple(map(_plain, (row[name] for name in names))) for row in request.expected]
    if got != wanted:
        if sorted(map(repr, got)) == sorted(map(repr, wanted)):
            raise Wrong("wrong order", f"{request.listing}: {got}, expected {wanted}"[:400])
        raise Wrong("wrong listing", _first_difference(got, wanted, request.listing))
    for row, expected in zip(rows, request.expected, strict=True):
        if row["sha256"] != expected["sha256"]:
            place = " ".join(str(row[name]) for name in names[:3])
            hashes = f"sha256 {row['sha256']}, expected {expected['sha256']}"
            raise Wrong("wrong values", f"{place}: {hashes}")


def _plain(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


def _first_difference(got: list[Any], wanted: list[Any], listing: str) -> str:
    if len(got) != len(wanted):
        return f"{len(got)} {listing}, expected {len(wanted)}"
    return next(
        f"{listing}: {name} is {value!r}, expected {expected!r}"
        for row, target in zip(got, wanted, strict=True)
        for name, value, expected in zip(FIELDS[listing], row, target, strict=True)
        if value != expected
    )


def parse_output(output: bytes, listing: str) -> list[dict[str, Any]]:
    """The rows of a decoder's ``output``, each with the hash of its bytes; Wrong if bad."""
    rows, body = listing_of(output, listing)
    listed, at = [], 0
    for row in rows:
        size = row["bytes"]
        data = body[at : at + size]
        listed.append(row | {"sha256": hashlib.sha256(data).hexdigest()})
        at += size
    if at != len(body):
        raise Wrong("bad listing", f"{len(body)} bytes follow the line, which lists {at}")
    return listed


def listing_of(output: bytes, listing: str) -> tuple[list[dict[str, Any]], bytes]:
    """The rows of the line, with sizes and shapes as numbers, and the bytes after it."""
    line, newline, body = output.partition(b"\n")
    if not newline or len(line) >= MAX_LINE:
        raise Wrong("bad listing", f"the first line has {len(line)} bytes, or no end")
    try:
        document = json.loads(line)
        rows = document.get(listing) if isinstance(document, dict) else None
        if not isinstance(rows, list):
            raise ValueError(f"the line is no object with a list {listing!r}")
        return [_row(row, listing) for row in rows], body
    except (ValueError, TypeError, OverflowError, RecursionError) as error:
        raise Wrong("bad listing", str(error)) from None


def _row(row: Any, listing: str) -> dict[str, Any]:
    """``row`` with integers where the contract lets strings stand for them."""
    if not isinstance(row, dict):
        raise ValueError(f"a row is {row!r}"[:200])
    missing = {"bytes", *FIELDS[listing]} - set(row)
    if missing:
        raise ValueError(f"a row without {', '.join(sorted(missing))}")
    numbers = {"bytes": _integer(row["bytes"])}
    if numbers["bytes"] < 0:
        raise ValueError(f"a row of {row['bytes']} bytes")
    if listing == "arrays":
        return row | numbers | {"shape": [_integer(length) for length in row["shape"]]}
    return row | numbers


def _integer(value: Any) -> int:
    number = int(value)
    if number != value and str(number) != value:
        raise ValueError(f"{value!r} is no whole number"[:200])
    return number
