"""Report files of ``mcz verify --report``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from mcz.cli.common import Exit, Failure, about, check_new, given, write_output
from mcz.cli.terminal import json_text
from mcz.model.types import JsonObject

if TYPE_CHECKING:
    from mcz.files.bags import BagCheck
    from mcz.files.reading.file import File

SUFFIXES = (".txt", ".json")
NONE = "none"  # as a date


class VerifyReport:
    """A report at ``path``, which must be new unless ``force``; raises Failure at once."""

    def __init__(self, path: str, date: str | None, force: bool, inputs: Sequence[str]) -> None:
        from mcz.files.writing.atomic import refuse_inputs

        self.path, self.force = Path(path), force
        if self.path.suffix.lower() not in SUFFIXES:
            raise Failure("a report is a .txt or a .json", Exit.USAGE, path=path)
        with about(path):
            refuse_inputs(path, inputs)
        check_new(self.path, force)
        self.date = _now() if date is None else None if date == NONE else date
        self._facts: JsonObject = {}  # of the file that was taken last

    def take(self, held: File) -> None:
        """Keep what the report says of an open file."""
        from mcz.files.reading.verification import bytes_facts, contents

        self._facts = {**bytes_facts(held.container.source), **contents(held)}

    def take_bytes(self, file: str) -> None:
        """Keep what can be said of a file that cannot be opened."""
        from mcz.files.reading.file import open_bytes
        from mcz.files.reading.verification import bytes_facts

        with about(file):
            source = open_bytes(given(file))
            try:
                self._facts = bytes_facts(source)
            finally:
                source.close()

    def document(self, rows: Sequence[JsonObject], *, quick: bool, where: str | None) -> JsonObject:
        """The report, see ``mcz.files.reading.verification.report``."""
        from mcz import __version__
        from mcz.files.reading.verification import report

        tool = f"mcz {__version__}"
        return report(self._facts, rows, tool=tool, date=self.date, quick=quick, chosen=where)

    def write(self, rows: Sequence[JsonObject], *, quick: bool, where: str | None) -> None:
        """Write the report of ``rows``, one for each part."""
        from mcz.files.reading.verification import text_lines

        document = self.document(rows, quick=quick, where=where)
        self._write(document, text_lines(document))

    def write_bag(
        self,
        found: BagCheck,
        verified: bool,
        files: Sequence[JsonObject],
        documents: Sequence[JsonObject],
    ) -> None:
        """Write the report of a bag: of itself, then the ``documents`` of the archives in it.

        ``files``: a row for each archive, unreadable ones included.
        """
        from mcz import __version__
        from mcz.files.reading.verification import bag_lines, text_lines

        unread = [
            f"{row['file']}: {problem}"
            for row in files
            for part in row["parts"]
            if part["kind"] == "file"
            for problem in part["problems"]
        ]
        document = {
            "verified": verified,
            "bag": str(found.folder),
            "tool": f"mcz {__version__}",
            "date": self.date,
            "bagit_version": found.version,
            "algorithms": found.algorithms,
            "info": dict(found.info),
            "payload_files": len(found.files),
            "payload_bytes": found.n_bytes,
            "problems": [*found.problems, *unread],
            "files": list(documents),
        }
        lines = bag_lines(document)
        for held in documents:
            lines += ["", *text_lines(held)]
        self._write(document, lines)

    def _write(self, document: object, lines: Sequence[str]) -> None:
        as_text = self.path.suffix.lower() == ".txt"
        text = "\n".join(lines) if as_text else json_text(document)
        write_output(self.path, f"{text}\n".encode("utf-8", "backslashreplace"), self.force)


def _now() -> str:
    """The date and time of the day, in UTC, to a second."""
    from datetime import UTC, datetime

    return datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
