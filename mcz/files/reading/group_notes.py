"""Group notes: grid changes, and numbers off their grid; joined over segments.

SPEC.md, "Group notes", is normative.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mcz.container.segments import GroupNotes
from mcz.errors import FormatError
from mcz.model.motion import Exceptions
from mcz.model.numbers import Grid, values_of_texts
from mcz.model.schema import parse

# Grid changes (channel, grid) and exceptions (row, channel, text) of one group in one segment.
ParsedNotes = tuple[list[tuple[int, Grid]], list[tuple[int, int, bytes]]]


class Noted:
    """Notes of segments on ``n_rows`` rows, whose grids in CLIP are ``baseline``."""

    def __init__(self, baseline: Sequence[Grid], n_rows: int) -> None:
        self._baseline, self._n_rows = baseline, n_rows
        self._grids: dict[int, dict[int, Grid]] = {}  # by row, grids that differ from CLIP
        self._exceptions: list[tuple[int, int, bytes]] = []
        self._row = 0

    def begin(self, row: int) -> None:
        """Begin a segment at ``row``, which may be before the first row of the range."""
        self._row = max(0, row)
        self._grids.setdefault(self._row, {})

    def add(self, shift: int, columns: Sequence[int], notes: ParsedNotes) -> None:
        """Add the notes of a group with the first row ``shift`` and the channels ``columns``."""
        for channel, grid in notes[0]:
            self._grids[self._row][columns[channel]] = grid
        self._exceptions += [
            (shift + row, columns[channel], text)
            for row, channel, text in notes[1]
            if 0 <= shift + row < self._n_rows
        ]

    def exceptions(self) -> Exceptions:
        entries = sorted(self._exceptions)
        return Exceptions(
            np.array([row for row, _, _ in entries], np.int64),
            np.array([column for _, column, _ in entries], np.int64),
            tuple(text for _, _, text in entries),
        )

    def grid_changes(self) -> tuple[tuple[int, int, Grid], ...]:
        """Convert grids stated segment by segment to changes from the row before."""
        changes: list[tuple[int, int, Grid]] = []
        if not any(self._grids.values()):
            return ()
        current = list(self._baseline)
        for row in sorted(self._grids):
            for column, grid in enumerate(self._baseline):
                new_grid = self._grids[row].get(column, grid)  # NOTES-06
                if new_grid != current[column]:
                    changes.append((row, column, new_grid))
                    current[column] = new_grid
        return tuple(changes)


def parse_group_notes(data: bytes, n_rows: int, grids: Sequence[Grid], name: str) -> ParsedNotes:
    """Grid changes (channel, grid) and exceptions (row, channel, text) of one group.

    ``grids`` are those of its channels in CLIP.
    """
    if not data:
        return [], []
    where = f"clip {name!r}, group notes"
    fields = parse(GroupNotes, data, where)
    n_channels = len(grids)
    changes = [(c.channel, c.grid) for c in fields.grid_changes]
    channels = [channel for channel, _ in changes]
    # NOTES-02, NOTES-03
    if channels != sorted(set(channels)) or any(c >= n_channels for c in channels):
        raise FormatError(f"grid changes of channels {channels}", where=where)
    current = dict(enumerate(grids)) | dict(changes)  # NOTES-08
    row, last, exceptions = 0, (-1, -1), []
    for e in fields.exceptions:
        row += e.row
        # NOTES-03, NOTES-04, NOTES-05
        if row >= n_rows or e.channel >= n_channels or (row, e.channel) <= last:
            raise FormatError(f"exception at row {row}, channel {e.channel}", where=where)
        if not current[e.channel].is_text:  # NOTES-08
            raise FormatError(f"exception on {current[e.channel]}, which has no text", where=where)
        last = row, e.channel
        exceptions.append((row, e.channel, bytes(e.text)))
    return changes, exceptions


def values_of_exceptions(texts: Sequence[bytes], name: str) -> NDArray[np.float64]:
    """The numbers that exceptions spell; raises FormatError for a bad one."""
    values, bad = values_of_texts(texts)  # TEXT-05
    if bad.any():
        text = texts[int(np.argmax(bad))]
        raise FormatError(f"exception {text[:40]!r} is not a number", clip=name)
    return values
