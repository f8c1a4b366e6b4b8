"""``mcz verify``: proof that a file is whole and gives its sources back."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING

import click

from mcz.cli.common import (
    Exit,
    Failure,
    about,
    echo,
    existing,
    given,
    opened,
    plural,
    print_json,
    say,
)
from mcz.cli.hints import OPTION_HINTS, in_options
from mcz.cli.options import (
    decoded_option,
    force_option,
    jobs_option,
    json_option,
    threads_option,
    where_option,
)
from mcz.cli.progress import Progress
from mcz.cli.verify_report import VerifyReport
from mcz.errors import FormatError, LimitError, MczError, UnsupportedError
from mcz.model.types import JsonObject

if TYPE_CHECKING:
    from mcz.files.reading.file import File


@click.command(short_help="Prove that sources come back identical.")
@click.argument("file", metavar="FILE.mcz|BAG", type=click.Path(readable=False))
@click.option(
    "--source",
    metavar="SRC",
    type=click.Path(readable=False),
    help="Compare with this source file, too.",
)
@click.option(
    "--quick", is_flag=True, help="Check checksums and index alone, at the speed of the disk."
)
@click.option(
    "--report",
    metavar="REPORT",
    type=click.Path(readable=False),
    help="Write a report file, too: REPORT.txt or REPORT.json.",
)
@click.option(
    "--date", metavar="DATE", help="Set the date of the report. Default: now; 'none' leaves it out."
)
@where_option
@decoded_option
@threads_option
@force_option
@jobs_option
@json_option
def command(
    file: str,
    source: str | None,
    quick: bool,
    report: str | None,
    date: str | None,
    where: str | None,
    max_decoded: int | None,
    force: bool,
    as_json: bool,
) -> Exit:
    """Check every checksum, decode everything, restore every source and compare its SHA-256.

    With --where every checksum of the file, and all that is said of the clips that it takes. With
    --quick every checksum and the index; it says that nothing was decoded. Of a BAG, a folder that
    mcz bag or another tool has made (BagIt), each file against the manifests, then each .mcz in it.
    """
    if quick and (where is not None or source is not None):
        raise Failure("--quick decodes nothing: it takes no --where and no --source", Exit.USAGE)
    if date is not None and report is None:
        raise Failure("--date is that of the --report", Exit.USAGE)
    if source is not None:
        existing(source)
    if Path(file).is_dir() and (where is not None or source is not None):
        raise Failure("--where and --source are of one file, not of a bag", Exit.USAGE)
    counts = ""
    report_file = None if report is None else VerifyReport(report, date, force, inputs=(file,))
    if Path(file).is_dir():
        return _bag(file, quick, max_decoded, report_file, as_json)
    if quick:
        rows, counts = _verify_quickly(file, report_file)
    else:
        rows = _verify_fully(file, source, where, max_decoded, report_file)
    failed = [row for row in rows if row["problems"]]
    if report_file is not None:
        report_file.write(rows, quick=quick, where=where)
    if as_json:
        print_json({"verified": not failed, "mode": "quick" if quick else "full", "parts": rows})
    elif not failed:
        echo(_success_line(file, rows, counts))
    _print_problems(file, failed)
    return Exit.NOT_VERIFIED if failed else Exit.FINE


def _success_line(file: str, rows: list[JsonObject], counts: str) -> str:
    """One line about a sound file; ``counts``: of a quick check."""
    if counts:
        return f"{file}: checksums right, {counts}; values and sources were not checked"
    return f"{file}: verified, {', '.join(_counts(rows))}"


def _print_problems(file: str, failed: list[JsonObject]) -> None:
    for row in failed:
        for problem in row["problems"]:
            say(f"{file}: {row['kind']} {row['name']}: {problem}".replace(" :", ":"))


def _bag(
    folder: str,
    quick: bool,
    max_decoded: int | None,
    report_file: VerifyReport | None,
    as_json: bool,
) -> Exit:
    """Check a bag, and each archive in it."""
    from mcz.files.bags import check_bag, is_bag

    if not is_bag(folder):
        raise Failure("a folder and no bag: it has no bagit.txt", path=folder, kind="AccessError")
    with about(folder), Progress() as progress:
        found = check_bag(folder, progress)
    fine, documents, files = not found.problems, [], []
    for name in found.files:
        if not name.lower().endswith(".mcz"):
            continue
        path, counts = str(Path(folder) / name), ""
        try:
            if quick:
                rows, counts = _verify_quickly(path, report_file)
            else:
                rows = _verify_fully(path, None, None, max_decoded, report_file)
            if report_file is not None:
                documents.append(report_file.document(rows, quick=quick, where=None))
        except MczError as error:  # the others are checked all the same
            rows = [_row("file", "", [error.describe(OPTION_HINTS, with_path=False)])]
        failed = [row for row in rows if row["problems"]]
        files.append({"file": name, "verified": not failed, "parts": rows})
        fine = fine and not failed
        if not failed and not as_json:
            echo(_success_line(path, rows, counts))
        _print_problems(path, failed)
    if report_file is not None:
        report_file.write_bag(found, fine, files, documents)
    if as_json:
        mode = "quick" if quick else "full"
        document = {"verified": fine, "mode": mode, "problems": found.problems, "files": files}
        print_json(document)
    elif not found.problems:
        count = plural(len(found.files), "file")
        echo(f"{folder}: a valid bag, {count}, {found.n_bytes:,} bytes")
    for problem in found.problems:
        say(f"{folder}: {problem}")
    return Exit.FINE if fine else Exit.NOT_VERIFIED


def _verify_fully(
    file: str,
    source: str | None,
    where: str | None,
    max_decoded: int | None,
    report_file: VerifyReport | None,
) -> list[JsonObject]:
    """The verification row of each part of the file."""
    try:
        with opened(file, max_decoded=max_decoded) as held, Progress() as progress:
            rows = list(_parts(held, where, progress))
            if source is not None:
                rows.append(_compare(held, source))
            if report_file is not None:
                report_file.take(held)
    except MczError as error:
        if not is_unsound(error):
            raise
        if report_file is not None:
            report_file.take_bytes(file)
        rows = [_row("structure", "", [error.describe(OPTION_HINTS, with_path=False)])]
    return rows


def _verify_quickly(file: str, report_file: VerifyReport | None) -> tuple[list[JsonObject], str]:
    """One row, that of the checksums; and what was seen."""
    from mcz.files.reading.faults import quick_check

    target = given(file)
    with about(file), Progress() as progress:
        seen, problems = quick_check(target, lambda done, total: progress(done, total, file))
    if report_file is not None:
        try:
            with opened(file) as held:
                report_file.take(held)
        except MczError as error:
            if not is_unsound(error):
                raise
            report_file.take_bytes(file)
    counts = f"{seen.n_chunks:,} chunks"
    if seen.n_packets:
        counts += f", {seen.n_packets:,} packets"
    if not seen.indexed:
        counts += ", no index"
    return [
        _row("checksums", "", [f"at {p.offset}: {in_options(p.message)}" for p in problems])
    ], counts


def is_unsound(error: MczError) -> bool:
    """Return whether the error means a malformed file, not an unsupported one."""
    return isinstance(error, FormatError) and not isinstance(error, UnsupportedError | LimitError)


def _parts(held: File, where: str | None, progress: Progress) -> Iterator[JsonObject]:
    from mcz.files.reading.faults import part_problems, structure_problems

    clips = None if where is None else held.chosen(where=where)
    total = 1 + len(held.clips if clips is None else clips) + len(held.attachments)
    problems = structure_problems(held)
    yield _row("structure", "", [in_options(problem.message) for problem in problems])
    for done, (kind, name, found) in enumerate(part_problems(held, clips)):
        progress(min(done, total), total, name)
        yield _row(kind, name, [in_options(problem.message) for problem in found])


def _row(kind: str, name: str, problems: list[str]) -> JsonObject:
    return {"kind": kind, "name": name, "problems": problems}


def _counts(rows: list[JsonObject]) -> Iterator[str]:
    kinds = [row["kind"] for row in rows]
    for kind in dict.fromkeys(kinds):
        count = kinds.count(kind)
        if kind == "structure":
            yield "every chunk checked"
        elif kind == "source":
            yield "source identical"
        else:
            yield f"{count:,} {kind}{'s' if count > 1 else ''}"


def _compare(held: File, source: str) -> JsonObject:
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
    """The function that restores the stored file with the name of ``source``."""
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
        raise Failure("the file holds nothing of this name", Exit.USAGE, path=source)
    return held.only_clip().source_bytes
