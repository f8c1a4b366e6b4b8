"""The records of the group notes of a segment. SPEC.md, "Group notes", has their tables."""

from __future__ import annotations

from mcz.model.numbers import GRID, Grid
from mcz.model.schema import SIZED, UVARINT, Record, counted, field


class GridChange(Record):
    """A grid that differs from the clip's, in GROUP_NOTES."""

    channel: int = field(UVARINT, "channel, counted within the group")
    grid: Grid = field(GRID, "its grid in this segment")


class OddToken(Record):
    """A token that its grid does not print, in GROUP_NOTES."""

    row: int = field(UVARINT, "rows after the exception before, or after the segment's first row")
    channel: int = field(UVARINT, "channel, counted within the group")
    text: bytes = field(SIZED, "the token")


class GroupNotes(Record):
    """The notes stream of a group in a segment."""

    grid_changes: list[GridChange] = field(
        counted(GridChange), "grids that differ from the clip's", default=[]
    )
    exceptions: list[OddToken] = field(
        counted(OddToken), "tokens that the grid does not print, sorted", default=[]
    )
