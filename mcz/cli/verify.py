"""``mcz verify``: proof that a file is intact and restores its sources."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING

import click

from mcz.cli import shared_options
from mcz.cli.common import (
    OPTION_HINTS,
    Exit,
    Failure,
    bytes_or_path,
    check_new,
    errors_about,
    in_options,
    open_input,
    require_file,
    write_output,
)
from mcz.cli.terminal import Progress, echo, json_text, plural, print_json, say
from mcz.errors import FormatError, LimitError, MczError, UnsupportedError
from mcz.model.types import JsonObject

if TYPE_CHECKING:
    from mcz.files.bags import BagCheck
    from mcz.files.reading.file import File


@click.command(short_help="Prove that sources come back identical.")
@click.argument("file", metavar="FILE.mcz|BAG", type=click.Path(readable=False))
@click.option(
    "--source",
    metavar="SRC",
    type=click.Path(readable=False),
    help="Also compare with this source file.",
)
@click.option("--quick", is_flag=True, help="Check only checksums and index, at disk speed.")
@click.option(
    "--report",
    metavar="REPORT",
    type=click.Path(readable=False),
    help="Also write a report: REPORT.txt or REPORT.json.",
)
@click.option(
    "--date", metavar="DATE", help="Set the date of the report. Default: now; 'none' leaves it out."
)
@shared_options.where
@shared_options.max_decoded
@shared_options.threads
@shared_options.force
@shared_options.jobs
@shared_options.json
def verify_command(
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

    --where decodes only the selected clips, and still checks every checksum. A BAG is a BagIt
    folder of mcz bag or another tool: each file is checked against the manifests, then each .mcz.
    """
    if quick and (where is not None or source is not None):
        raise Failure("--quick decodes nothing, so it excludes --where and --source", Exit.USAGE)
    if date is not None and report is None:
        raise Failure("--date needs --report", Exit.USAGE)
    if source is not None:
        require_file(source)
    is_folder = Path(file).is_dir()
    if is_folder and (where is not None or source is not None):
        raise Failure("--where and --source apply to one file, not to a bag", Exit.USAGE)
    report_file = None if report is None else VerifyReport(report, date, force, inputs=(file,))
    if is_folder:
        return _verify_bag(file, quick, max_decoded, report_file, as_json)
    if quick:
        rows, success = _verify_quickly(file, report_file)
    else:
        rows, success = _verify_fully(file, source, where, max_decoded, report_file)
    failed = [row for row in rows if row["problems"]]
    if report_file is not None:
        report_file.write(rows, quick=quick, where=where)
    if as_json:
        print_json({"verified": not failed, "mode": "quick" if quick else "full", "parts": rows})
    elif not failed:
        echo(f"{file}: {success}")
    _print_problems(file, failed)
    return Exit.NOT_VERIFIED if failed else Exit.FINE


def _print_problems(file: str, failed: list[JsonObject]) -> None:
    for row in failed:
        for problem in row["problems"]:
            say(f"{file}: {row['kind']} {row['name']}: {problem}".replace(" :", ":"))


def _verify_bag(
    folder: str,
    quick: bool,
    max_decoded: int | None,
    report_file: VerifyReport | None,
    as_json: bool,
) -> Exit:
    from mcz.files.bags import check_bag, is_bag

    if not is_bag(folder):
        raise Failure(
            "the folder is not a bag: it has no bagit.txt", path=folder, kind="AccessError"
        )
    with errors_about(folder), Progress() as progress:
        bag = check_bag(folder, progress)
    is_valid, documents, files = not bag.problems, [], []
    for name in bag.files:
        if not name.lower().endswith(".mcz"):
            continue
        path, success = str(Path(folder) / name), ""
        try:
            if quick:
                rows, success = _verify_quickly(path, report_file)
            else:
                rows, success = _verify_fully(path, None, None, max_decoded, report_file)
            if report_file is not None:
                documents.append(report_file.document(rows, quick=quick, where=None))
        except MczError as error:  # the others are still checked
            rows = [_row("file", "", [error.describe(OPTION_HINTS, with_path=False)])]
        failed = [row for row in rows if row["problems"]]
        files.append({"file": name, "verified": not failed, "parts": rows})
        is_valid = is_valid and not failed
        if not failed and not as_json:
            echo(f"{path}: {success}")
        _print_problems(path, failed)
    if report_file is not None:
        report_file.write_bag(bag, is_valid, files, documents)
    if as_json:
        document = {"verified": is_valid, "mode": "quick" if quick else "full"}
        print_json(document | {"problems": bag.problems, "files": files})
    elif not bag.problems:
        count = plural(len(bag.files), "file")
        echo(f"{folder}: a valid bag, {count}, {bag.n_bytes:,} bytes")
    for problem in bag.problems:
        say(f"{folder}: {problem}")
    return Exit.FINE if is_valid else Exit.NOT_VERIFIED


def _verify_fully(
    file: str,
    source: str | None,
    where: str | None,
    max_decoded: int | None,
    report_file: VerifyReport | None,
) -> tuple[list[JsonObject], str]:
    """The verification row of each part of the file, and a line for success."""
    try:
        with open_input(file, max_decoded=max_decoded) as opened_file, Progress() as progress:
            rows = list(_check_parts(opened_file, where, progress))
            if source is not None:
                rows.append(_compare(opened_file, source))
            if report_file is not None:
                report_file.take(opened_file)
    except MczError as error:
        if not is_malformed(error):
            raise
        if report_file is not None:
            report_file.take_bytes(file)
        rows = [_row("structure", "", [error.describe(OPTION_HINTS, with_path=False)])]
    return rows, f"verified, {', '.join(_counts(rows))}"


def _verify_quickly(file: str, report_file: VerifyReport | None) -> tuple[list[JsonObject], str]:
    from mcz.files.reading.faults import quick_check

    target = bytes_or_path(file)
    with errors_about(file), Progress() as progress:
        scanned, problems = quick_check(target, lambda done, total: progress(done, total, file))
    if report_file is not None:
        try:
            with open_input(file) as opened_file:
                report_file.take(opened_file)
        except MczError as error:
            if not is_malformed(error):
                raise
            report_file.take_bytes(file)
    counts = f"{scanned.n_chunks:,} chunks"
    if scanned.n_packets:
        counts += f", {scanned.n_packets:,} packets"
    if not scanned.indexed:
        counts += ", no index"
    rows = [_row("checksums", "", [f"at {p.offset}: {in_options(p.message)}" for p in problems])]
    return rows, f"checksums right, {counts}; values and sources were not checked"


def is_malformed(error: MczError) -> bool:
    """Return whether the error means a malformed file, not an unsupported one."""
    return isinstance(error, FormatError) and not isinstance(error, UnsupportedError | LimitError)


def _check_parts(file: File, where: str | None, progress: Progress) -> Iterator[JsonObject]:
    from mcz.files.reading.faults import part_problems, structure_problems

    clips = None if where is None else file.select_clips(where=where)
    total = 1 + len(file.clips if clips is None else clips) + len(file.attachments)
    problems = structure_problems(file)
    yield _row("structure", "", [in_options(problem.message) for problem in problems])
    for done, (kind, name, messages) in enumerate(part_problems(file, clips)):
        progress(min(done, total), total, name)
        yield _row(kind, name, [in_options(problem.message) for problem in messages])


def _row(kind: str, name: str, problems: list[str]) -> JsonObject:
    return {"kind": kind, "name": name, "problems": problems}


def _counts(rows: list[JsonObject]) -> Iterator[str]:
    words = {"structure": "every chunk checked", "source": "source identical"}
    for kind, count in Counter(row["kind"] for row in rows).items():
        if kind == "recovery data":  # each set covers a part of the file
            yield f"{plural(count, 'part')} with recovery data"
        else:
            yield words.get(kind) or plural(count, kind)


def _compare(file: File, source: str) -> JsonObject:
    """Compare SRC with the restored file of its name, or with the only clip."""
    restore = _find_restore(file, source)
    with errors_about(source):
        expected = Path(source).read_bytes()
        restored = restore()
    if restored == expected:
        return _row("source", source, [])
    at = next(
        (i for i, (a, b) in enumerate(zip(restored, expected, strict=False)) if a != b),
        min(len(restored), len(expected)),
    )
    text = f"differs from byte {at} on; restored {len(restored)} bytes, compared {len(expected)}"
    return _row("source", source, [text])


def _find_restore(file: File, source: str) -> Callable[[], bytes]:
    """The function that restores the stored file with the name of ``source``."""
    name = Path(source).name
    for clip in file.clips.values():
        if clip.source is not None and PurePosixPath(clip.source.path).name == name:
            return clip.source_bytes
    for alias, (_, target) in file.aliases.items():
        if PurePosixPath(alias).name == name and target in dict(file.skeletons):
            return lambda: file.skeleton_bytes(target)
    for attachment in file.attachments.values():
        if PurePosixPath(attachment.name).name == name:
            return attachment.read
    if len(file.clips) != 1:
        raise Failure("the .mcz has no file of this name", Exit.USAGE, path=source)
    return file.only_clip().source_bytes


SUFFIXES = (".txt", ".json")
NONE = "none"  # as a date


class VerifyReport:
    """A report at ``path``, which must be new unless ``force``; raises Failure at once."""

    def __init__(self, path: str, date: str | None, force: bool, inputs: Sequence[str]) -> None:
        from mcz.files.writing.atomic import refuse_inputs

        self.path, self.force = Path(path), force
        if self.path.suffix.lower() not in SUFFIXES:
            raise Failure("a report must be a .txt or a .json", Exit.USAGE, path=path)
        with errors_about(path):
            refuse_inputs(path, inputs)
        check_new(self.path, force)
        self.date = _current_time() if date is None else None if date == NONE else date
        self._facts: JsonObject = {}  # of the last file

    def take(self, file: File) -> None:
        """Store the report of an open file."""
        from mcz.cli.verification_report import bytes_facts, contents

        self._facts = {**bytes_facts(file.container.source), **contents(file)}

    def take_bytes(self, file: str) -> None:
        """Store the facts of a file that cannot be opened."""
        from mcz.cli.verification_report import bytes_facts
        from mcz.files.reading.file import open_bytes

        with errors_about(file):
            source = open_bytes(bytes_or_path(file))
            try:
                self._facts = bytes_facts(source)
            finally:
                source.close()

    def document(self, rows: Sequence[JsonObject], *, quick: bool, where: str | None) -> JsonObject:
        """The report, see ``verification_report.report``."""
        from mcz import __version__
        from mcz.cli.verification_report import report

        tool = f"mcz {__version__}"
        return report(self._facts, rows, tool=tool, date=self.date, quick=quick, chosen=where)

    def write(self, rows: Sequence[JsonObject], *, quick: bool, where: str | None) -> None:
        """Write the report of ``rows``, one for each part."""
        from mcz.cli.verification_report import text_lines

        document = self.document(rows, quick=quick, where=where)
        self._write(document, text_lines(document))

    def write_bag(
        self,
        bag: BagCheck,
        verified: bool,
        files: Sequence[JsonObject],
        documents: Sequence[JsonObject],
    ) -> None:
        """Write the report of a bag: its own facts, then the ``documents`` of its archives.

        ``files``: a row for each archive, unreadable ones included.
        """
        from mcz import __version__
        from mcz.cli.verification_report import bag_lines, text_lines

        unread = [
            f"{row['file']}: {problem}"
            for row in files
            for part in row["parts"]
            if part["kind"] == "file"
            for problem in part["problems"]
        ]
        document = {
            "verified": verified,
            "bag": str(bag.folder),
            "tool": f"mcz {__version__}",
            "date": self.date,
            "bagit_version": bag.version,
            "algorithms": bag.algorithms,
            "info": dict(bag.info),
            "payload_files": len(bag.files),
            "payload_bytes": bag.n_bytes,
            "problems": [*bag.problems, *unread],
            "files": list(documents),
        }
        lines = bag_lines(document)
        for each in documents:
            lines += ["", *text_lines(each)]
        self._write(document, lines)

    def _write(self, document: object, lines: Sequence[str]) -> None:
        as_text = self.path.suffix.lower() == ".txt"
        text = "\n".join(lines) if as_text else json_text(document)
        write_output(self.path, f"{text}\n".encode("utf-8", "backslashreplace"), self.force)


def _current_time() -> str:
    from datetime import UTC, datetime

    return datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
