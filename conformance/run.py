"""Run a decoder, and an encoder, over the conformance vectors.

    python -m conformance.run --decoder "CMD" [--encoder "CMD"] [--only WHAT]... [--json] ...

README.md beside this file is the contract. Standard library only, so that an implementation in any
language can be tested without installing this package.
"""

from __future__ import annotations

import argparse
import io
import json
import os
import shlex
import shutil
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from conformance import export
from conformance.child import Limits
from conformance.encode import Result, try_encoder
from conformance.judge import judge
from conformance.manifest import (
    CLASSES,
    HERE,
    VECTORS,
    Capabilities,
    Request,
    Vector,
    load,
    load_manifest,
    requests,
    select,
)
from conformance.outcome import ask, capabilities, starter
from conformance.report import text
from conformance.summary import Report

__all__ = ("HERE", "VECTORS", "Request", "judge", "load_manifest", "main", "requests")


def main(arguments: Sequence[str] | None = None) -> int:
    """0: everything that was asked passed; 1: something failed; 2: nothing could be asked."""
    given = _parser().parse_args(arguments)
    try:
        report = _run(given)
    except (ValueError, OSError) as error:
        print(f"conformance.run: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130
    print(json.dumps(export.document(report), indent=2) if given.json else text(report))
    if not any(outcome.asked for outcome in report.outcomes):
        print("conformance.run: nothing was asked", file=sys.stderr)
        return 2
    return int(report.failed)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="conformance.run", description=__doc__.splitlines()[0])
    add = parser.add_argument
    add("--decoder", required=True, metavar="CMD", help="the command to test, as in a shell")
    add("--encoder", metavar="CMD", help="an encoder, whose files the decoder reads")
    what = "a group, codec, requirement, glob or part of a path; may be given again"
    add("--only", action="append", default=[], metavar="WHAT", help=what)
    add("--every", type=int, default=1, metavar="N", help="of these only every so many")
    add("--class", dest="class_", choices=tuple(CLASSES), help="ask for what this class has")
    add("--arrays-only", action="store_true", help="ask for no sources")
    add("--serve", action="store_true", help="many requests a process, where the decoder has it")
    add("--jobs", type=int, default=os.cpu_count() or 1, metavar="N", help="processes at once")
    add("--timeout", type=float, default=60.0, metavar="S", help="seconds a request")
    add("--memory", type=int, default=2048, metavar="MIB", help="a process, 0: no limit")
    add("--json", action="store_true", help="print one JSON document")
    add("--junit", type=Path, metavar="FILE", help="write JUnit XML")
    add("--badge", type=Path, metavar="FILE", help="write an .svg, or .json for shields.io")
    return parser


def _run(given: argparse.Namespace) -> Report:
    """Ask, and write the files; ValueError where the arguments do not allow it."""
    command = _command(given.decoder)
    encoder = None if given.encoder is None else _command(given.encoder)
    if given.badge is not None and given.badge.suffix not in (".svg", ".json"):
        raise ValueError(f"--badge {given.badge}: the suffix is neither .svg nor .json")
    limits = Limits(given.timeout, given.memory * 2**20)
    manifest = load()
    vectors = select(manifest["vectors"], given.only)[:: max(1, given.every)]
    can = capabilities(command, limits)
    if given.class_ is not None:
        can = can.within(given.class_)
    if given.arrays_only:
        can = replace(can, sources=frozenset())
    if given.serve and "--serve" not in can.options:
        raise ValueError("--serve: the decoder does not list it among its options")
    started = time.monotonic()
    start = starter(command, limits, serve=given.serve)
    outcomes = ask(vectors, can, start, jobs=given.jobs)
    results: list[Result] | None = None
    if encoder is not None:
        results = try_encoder(encoder, limits, vectors, can, start, given.jobs)
    report = Report(
        version=manifest["format_version"],
        outcomes=outcomes,
        can=can,
        seconds=time.monotonic() - started,
        total=len(manifest["vectors"]),
        is_full=can.is_full(manifest["vectors"]),
        results=results,
        command=given.decoder,
        remarks=_remarks(can, manifest["vectors"]),
    )
    export.write(report, given.junit, given.badge)
    return report


def _command(words: str) -> list[str]:
    """The words of a command; ValueError if there is no such program."""
    command = shlex.split(words)
    if not command or shutil.which(command[0]) is None:
        raise ValueError(f"there is no command {words!r}")
    return command


def _remarks(can: Capabilities, vectors: Sequence[Vector]) -> list[str]:
    """Suspicious entries of a declaration: a misspelled codec is never asked for."""
    known = {name for vector in vectors for name in vector.get("codecs", [])}
    return [
        f"note: no vector uses codec {name!r}" for name in sorted((can.codecs or set()) - known)
    ]


if __name__ == "__main__":
    if isinstance(sys.stdout, io.TextIOWrapper):  # what a decoder says may not fit its encoding
        sys.stdout.reconfigure(errors="backslashreplace")
    sys.exit(main())
