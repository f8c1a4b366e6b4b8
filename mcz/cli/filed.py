"""The report of a verification as a file: ``mcz verify --report``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mcz.cli.common import Exit, Failure, about, check_new, given, write_output
from mcz.cli.terminal import json_text

if TYPE_CHECKING:
    from mcz.reading.file import File

SUFFIXES = (".txt", ".json")
NONE = "none"  # as a date


class Filed:
    """A report at ``path``, which must be new unless ``force``; raises Failure at once."""

    def __init__(self, path: str, date: str | None, force: bool, inputs: Sequence[str]) -> None:
        from mcz.writing.inputs import refuse_inputs

        self.path, self.force = Path(path), force
        if self.path.suffix.lower() not in SUFFIXES:
            raise Failure(f"{path}: a report is a .txt or a .json", Exit.USAGE)
        with about(path):
            refuse_inputs(path, inputs)
        check_new(self.path, force)
        self.date = _now() if date is None else None if date == NONE else date
        self._facts: dict[str, Any] = {}

    def take(self, held: File) -> None:
        """Keep what the report says of an open file."""
        from mcz.reading.verification import bytes_facts, contents

        self._facts = {**bytes_facts(held.container.source), **contents(held)}

    def take_bytes(self, file: str) -> None:
        """Keep what can be said of a file that cannot be opened."""
        from mcz.reading.file import reached
        from mcz.reading.verification import bytes_facts

        with about(file):
            source = reached(given(file))
            try:
                self._facts = bytes_facts(source)
            finally:
                source.close()

    def document(self, rows: Sequence[dict[str, Any]], *, quick: bool, where: str | None) -> Any:
        """The report, see ``mcz.reading.verification.report``."""
        from mcz import __version__
        from mcz.reading.verification import report

        tool = f"mcz {__version__}"
        return report(self._facts, rows, tool=tool, date=self.date, quick=quick, chosen=where)

    def write(self, rows: Sequence[dict[str, Any]], *, quick: bool, where: str | None) -> None:
        """Write the report of ``rows``, what is said of each part."""
        from mcz.reading.verification import text_lines

        document = self.document(rows, quick=quick, where=where)
        as_text = self.path.suffix.lower() == ".txt"
        text = "\n".join(text_lines(document)) if as_text else json_text(document)
        write_output(self.path, f"{text}\n".encode("utf-8", "backslashreplace"), self.force)


def _now() -> str:
    """The date and time of the day, in UTC, to a second."""
    from datetime import UTC, datetime

    return datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
