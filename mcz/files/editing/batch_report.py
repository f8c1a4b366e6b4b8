"""Reports of commands over many files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from mcz.errors import ExistsError, MczError, remark_of
from mcz.model.text_format import brief


@dataclass(frozen=True, slots=True)
class Outcome:
    """Outcome for one file, with a reason unless it is plain.

    ``result`` is "parsed", "skeleton", "alias" (the same bytes under another name), "verbatim",
    "present" (the target has it already), "restored", or "cut" or "lossy" of a clip that is no
    longer what its source was, "written", "skipped", "exists" (it may not be replaced) or
    "failed"; of a file that was cut short also "salvaged" or "dropped", in salvage "damaged"; of
    what is carried over "copied", "renamed", "moved" or "deleted".
    The ``message`` of one that failed or exists names the file.
    ``notes`` are remarks of the reader of an added file, and the name of the skeleton it uses.
    """

    path: str
    result: str
    size: int = 0
    message: str = ""
    notes: tuple[str, ...] = ()

    __repr__ = brief


def failure_outcome(path: str, error: MczError | OSError) -> Outcome:
    """The outcome of a file that an error has kept from being written."""
    result = "exists" if isinstance(error, ExistsError) else "failed"
    return Outcome(path, result, 0, remark_of(error, path=path))


@dataclass(slots=True)
class Report:
    """The outcomes of a command over many files.

    ``damage`` is what salvage found wrong, ``size`` that of the MCZ file, once it is written,
    ``left_out`` what may not be carried over to it from another one.
    """

    outcomes: list[Outcome] = field(default_factory=list)
    damage: list[str] = field(default_factory=list)
    size: int | None = None
    left_out: list[str] = field(default_factory=list)

    __repr__ = brief

    @property
    def failures(self) -> list[Outcome]:
        """The files that failed, those among them that exist and may not be replaced."""
        return [outcome for outcome in self.outcomes if outcome.result in ("failed", "exists")]

    def note(self, notes: Mapping[str, str]) -> None:
        """Add what is to be said of some paths to their outcomes."""
        for index, outcome in enumerate(self.outcomes):
            if (text := notes.get(outcome.path)) and outcome.result not in ("failed", "skipped"):
                message = f"{outcome.message}; {text}" if outcome.message else text
                self.outcomes[index] = replace(outcome, message=message)

    def count(self, result: str) -> int:
        return sum(outcome.result == result for outcome in self.outcomes)
