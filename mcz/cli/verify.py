"""``mcz verify``: proof that a file is whole and gives its sources back."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any

import click

from mcz.cli.common import Exit, Failure, about, echo, existing, opened, print_json, say
from mcz.cli.options import (
    decoded_option,
    jobs_option,
    json_option,
    threads_option,
    where_option,
)
from mcz.cli.progress import Progress
from mcz.errors import FormatError, LimitError, UnsupportedError

if TYPE_CHECKING:
    from mcz.reading.file import File


@click.command(short_help="Prove that sources come back identical.")
@click.argument("file", metavar="FILE.mcz", type=click.Path(readable=False))
@click.option(
    "--source",
    metavar="SRC",
    type=click.Path(readable=False),
    help="Compare with this source file, too.",
)
@where_option
@decoded_option
@threads_option
@jobs_option
@json_option
def command(
    file: str, source: str | None, where: str | None, max_decoded: int | None, as_json: bool
) -> Exit:
    """Check every checksum, decode everything, restore every source and compare its SHA-256.

    With --where every checksum of the file, and all that is said of the clips that it takes.
    """
    if source is not None:
        existing(source)
    try:
        with opened(file, max_decoded=max_decoded) as held, Progress() as progress:
            rows = list(_parts(held, where, progress))
            if source is not None:
                rows.append(_compare(held, source))
    except Failure as failure:
        if not is_unsound(failure):
            raise
        rows = [_row("structure", "", [str(failure).removeprefix(f"{file}: ")])]
    failed = [row for row in rows if row["problems"]]
    if as_json:
        print_json({"verified": not failed, "parts": rows})
    elif not failed:
        echo(f"{file}: verified, {', '.join(_counts(rows))}")
    for row in failed:
        for problem in row["problems"]:
            say(f"{file}: {row['kind']} {row['name']}: {problem}".replace(" :", ":"))
    return Exit.NOT_VERIFIED if failed else Exit.FINE


def is_unsound(failure: Failure) -> bool:
    """Whether the file is no sound MCZ file, rather than one that cannot be read, or not here."""
    cause = failure.__cause__
    return isinstance(cause, FormatError) and not isinstance(cause, UnsupportedError | LimitError)


def _parts(held: File, where: str | None, progress: Progress) -> Iterator[dict[str, Any]]:
    from mcz.reading import report

    clips = None if where is None else held.chosen(where=where)
    total = 1 + len(held.clips if clips is None else clips) + len(held.attachments)
    problems = report.structure_problems(held)
    yield _row("structure", "", [problem.message for problem in problems])
    for done, (kind, name, found) in enumerate(report.part_problems(held, clips)):
        progress(min(done, total), total, name)
        yield _row(kind, name, [problem.message for problem in found])


def _row(kind: str, name: str, problems: list[str]) -> dict[str, Any]:
    return {"kind": kind, "name": name, "problems": problems}


def _counts(rows: list[dict[str, Any]]) -> Iterator[str]:
    kinds = [row["kind"] for row in rows]
    for kind in dict.fromkeys(kinds):
        count = kinds.count(kind)
        if kind == "structure":
            yield "every chunk checked"
        elif kind == "source":
            yield "source identical"
        else:
            yield f"{count:,} {kind}{'s' if count > 1 else ''}"


def _compare(held: File, source: str) -> dict[str, Any]:
    """Compare SRC with what is restored under its name, or with the only clip."""
    restore = _find(held, source)
    with about(source):
        wanted = Path(source).read_bytes()
        restored = restore()
    if restored == wanted:
        return _row("source", source, [])
    same = next(
        (i for i, (a, b) in enumerate(zip(restored, wanted, strict=False)) if a != b),
        min(len(restored), len(wanted)),
    )
    text = f"differs from byte {same} on; restored {len(restored)} bytes, compared {len(wanted)}"
    return _row("source", source, [text])


def _find(held: File, source: str) -> Callable[[], bytes]:
    """What restores the file that is called like ``source``."""
    name = Path(source).name
    for clip in held.clips.values():
        if clip.source is not None and PurePosixPath(clip.source.path).name == name:
            return clip.source_bytes
    for alias, (_, target) in held.aliases.items():
        if PurePosixPath(alias).name == name and target in dict(held.skeletons):
            return lambda: held.skeleton_bytes(target)
    for attachment in held.attachments.values():
        if PurePosixPath(attachment.name).name == name:
            return attachment.read
    if len(held.clips) != 1:
        raise Failure(f"{source}: the file holds nothing of this name", Exit.USAGE)
    return held.only_clip().source_bytes
