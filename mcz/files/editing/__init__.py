"""Files -> files, stored bytes copied: cut, replaced, appended to, packed and unpacked.

The reports of commands over many files are here. Modules of protection and repair, in this folder
and others:

    recovering.py                      ``protect``; restores damaged bytes from recovery data
    appending.py                       computes recovery data and appends them
    repair.py                          ``repair``: plans the new file, reports what is lost
    salvage_copier.py                  copies the intact parts of a damaged file
    ../../container/chunk_repair.py    restores chunks from their copies and the index
    ../../container/parser_drivers.py  parses live streams with lost or damaged parts
    ../../container/recovery/          the erasure code and the layout of its blocks
    ../reading/signal_info.py          finds the intact segments of a damaged signal
    ../reading/lost_skeletons.py       rebuilds lost skeletons from stored source files
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from mcz.errors import ExistsError, MczError, remark_of
from mcz.model.text_format import fields_text


@dataclass(frozen=True, slots=True)
class Outcome:
    """Outcome for one file; ``message`` gives the reason if ``result`` alone does not.

    ``result`` of a file that is added to an archive:
        "parsed", "skeleton", "verbatim", "present" (the target has it already),
        "alias" (the same bytes are stored under another name)
    of a restored file:
        "restored", "written", "cut" or "lossy" (the clip differs from its source)
    of an item that is copied from another archive:
        "copied", "renamed", "moved", "deleted"
    of a truncated or damaged file:
        "salvaged", "dropped", "damaged"
    of a file that is not written:
        "skipped", "exists" (it may not be replaced), "failed"

    For "failed" and "exists" the message names the file. ``notes`` are remarks of the reader of an
    added file, and the name of the skeleton that it uses.
    """

    path: str
    result: str
    size: int = 0
    message: str = ""
    notes: tuple[str, ...] = ()

    __repr__ = fields_text


def failure_outcome(path: str, error: MczError | OSError) -> Outcome:
    """The outcome of a file that was not written because of an error."""
    result = "exists" if isinstance(error, ExistsError) else "failed"
    return Outcome(path, result, 0, remark_of(error, path=path))


@dataclass(slots=True)
class Report:
    """The outcomes of a command over many files.

    ``damage`` lists faults found by salvage, ``left_out`` parts of the old file that are not
    copied. ``size`` is the size of the MCZ file, once it is written.
    """

    outcomes: list[Outcome] = field(default_factory=list)
    damage: list[str] = field(default_factory=list)
    size: int | None = None
    left_out: list[str] = field(default_factory=list)

    __repr__ = fields_text

    @property
    def failures(self) -> list[Outcome]:
        """Outcomes "failed" and "exists"."""
        return [outcome for outcome in self.outcomes if outcome.result in ("failed", "exists")]

    def add_messages(self, texts: Mapping[str, str]) -> None:
        """Append texts to the messages of paths, by path."""
        for index, outcome in enumerate(self.outcomes):
            if (text := texts.get(outcome.path)) and outcome.result not in ("failed", "skipped"):
                message = f"{outcome.message}; {text}" if outcome.message else text
                self.outcomes[index] = replace(outcome, message=message)

    def count(self, result: str) -> int:
        return sum(outcome.result == result for outcome in self.outcomes)
