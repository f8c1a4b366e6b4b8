"""Signals from tokens of rows: values, number grids, exceptions and masks.

Columns differ: a time, an angle, a force. So do their digits: each may have its own grid.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from mcz.errors import OptionError, SourceError
from mcz.model.motion import Channel, Exceptions, Signal
from mcz.model.numbers import Grid, GridFlag, GridKind, Tokens, bits_of, fit_grid, scan
from mcz.model.text_format import quote
from mcz.sources.tables.text_columns import TextColumn
from mcz.sources.text.rows import TokenRows, line_of

Bools = NDArray[np.bool_]
Ints = NDArray[np.int64]

CANDIDATES = 8  # most grids of single columns that are tried on all columns
BLOCK = 512  # rows that may have a grid of their own
WORTH = 32  # exceptions that a change of grid must save
RARE = 1 / 200  # exceptions of a column, by its tokens, that are cheaper than a digit more for each


def read_signal(data: bytes, rows: TokenRows, n_each: int = 1) -> Signal:
    """The signal of ``rows``, ``n_each`` a frame; SourceError for a token that is no number.

    A token that is absent has mask False and the value of the row before (0 in the first row).
    """
    shape = rows.start.shape
    mask = rows.stop > 0
    dense = bool(mask.all())
    chosen = slice(None) if dense else np.flatnonzero(mask)
    tokens = scan(data, rows.start.ravel()[chosen], rows.stop.ravel()[chosen])
    try:
        numbers = tokens.values()
    except SourceError:
        first = int(np.flatnonzero(tokens.bad())[0])
        text = tokens.token(first)[:40]
        raise SourceError(
            f"{quote(text)} is not a number",
            line=line_of(data, int(tokens.start[first])),
            value=text.decode("latin-1"),
        ) from None
    values = numbers.reshape(shape) if dense else np.zeros(shape)
    if not dense:
        values[mask] = numbers
        _hold_values(values, mask)
    grids, changes, printed = _grids(tokens, mask, n_each)
    odd = np.flatnonzero(~printed)
    cells = np.arange(mask.size)[chosen][odd] if len(odd) else odd
    return Signal(
        values,
        grids,
        mask=None if dense else mask,
        exceptions=Exceptions(
            *divmod(cells, shape[1] or 1), tuple(tokens[odd].texts()) if len(odd) else ()
        ),
        samples_per_frame=n_each,
        grid_changes=changes,
    )


def _hold_values(values: NDArray[np.float64], mask: Bools) -> None:
    """Put the value of the row before beneath every False of the mask."""
    rows = np.where(mask, np.arange(len(mask))[:, None], 0)
    values[:] = np.take_along_axis(values, np.maximum.accumulate(rows, axis=0), axis=0)


def _grids(
    tokens: Tokens, mask: Bools, n_each: int
) -> tuple[tuple[Grid, ...], tuple[tuple[int, int, Grid], ...], Bools]:
    """The grid of every column, its changes, and which tokens the grids print.

    ``mask``: which cells (rows, columns) have a token.
    """
    n_columns = mask.shape[1]
    common, _, printed = fit_grid(tokens)
    if printed.all():
        return (common,) * n_columns, (), printed
    places = _by_column(mask)
    own = {
        c: fit_grid(tokens[places[c][0]])[::2]
        for c in _doubtful_columns(tokens, mask, common, printed)
    }
    common, printed = _common_grid(tokens, [grid for grid, _ in own.values()], common, printed)
    grids, changes = [common] * n_columns, []
    for c, (grid, mine_printed) in own.items():
        at, row = places[c]
        if np.count_nonzero(mine_printed) > np.count_nonzero(printed[at]):
            grids[c], printed[at] = grid, mine_printed
        if np.count_nonzero(~printed[at]) >= WORTH:
            blocks, printed[at] = _by_blocks(tokens[at], row, grids[c], printed[at], n_each)
            changes += [(first, c, change) for first, change in blocks]
    return tuple(grids), tuple(sorted(changes, key=lambda change: change[:2])), printed


def _doubtful_columns(tokens: Tokens, mask: Bools, common: Grid, printed: Bools) -> list[int]:
    """The columns that may fit another grid than ``common`` better, as they have exceptions."""
    missed = np.flatnonzero(~printed)
    cells = missed if mask.all() else np.flatnonzero(mask)[missed]
    n_columns = mask.shape[1]
    misses = np.bincount(cells % n_columns, minlength=n_columns)
    doubtful = misses > 0
    if common.kind == GridKind.FIXED and common.digits and not common.flags:
        doubtful &= misses >= RARE * np.count_nonzero(mask, axis=0)
        doubtful[cells[tokens[missed].styled()] % n_columns] = True  # nearly all others are plain
    columns: list[int] = np.flatnonzero(doubtful).tolist()
    return columns


def _by_column(mask: Bools) -> list[tuple[slice | Ints, Ints]]:
    """The tokens of every column, rows in order, among those of all, and their rows."""
    n_rows, n_columns = mask.shape
    if mask.all():
        rows = np.arange(n_rows)
        return [(slice(c, None, n_columns), rows) for c in range(n_columns)]
    number = np.cumsum(mask).reshape(mask.shape) - 1
    rows_of_columns = [np.flatnonzero(mask[:, c]) for c in range(n_columns)]
    return [(number[rows, c], rows) for c, rows in enumerate(rows_of_columns)]


def _common_grid(
    tokens: Tokens, grids: Sequence[Grid], guess: Grid, printed: Bools
) -> tuple[Grid, Bools]:
    """The grid that prints most tokens, and which these are.

    Candidates are ``guess``, which prints ``printed``, the most frequent of the grids of single
    columns, and ``guess`` with the flags of these.
    """
    candidates = [grid for grid, _ in Counter(grids).most_common(CANDIDATES)]
    for flags in sorted({GridFlag.POINT_ZERO, *(grid.flags for grid in grids)}):
        with suppress(OptionError):
            candidates.append(replace(guess, flags=flags))
    for grid in dict.fromkeys(grid for grid in candidates if grid != guess):
        more = grid.ordinals_of_tokens(tokens)[1]
        if np.count_nonzero(more) > np.count_nonzero(printed):
            guess, printed = grid, more
    return guess, printed


def _by_blocks(
    tokens: Tokens, row: Ints, grid: Grid, printed: Bools, n_each: int
) -> tuple[list[tuple[int, Grid]], Bools]:
    """Changes (row, grid) of a column if another grid saves exceptions; what is printed then.

    They lie between frames of ``n_each`` rows.
    """
    changes: list[tuple[int, Grid]] = []
    result = printed.copy()
    firsts = -(-row[::BLOCK] // n_each) * n_each
    edges = [*np.unique(np.searchsorted(row, firsts)).tolist(), len(row)]
    for start, stop in pairwise(edges):
        block = slice(start, stop)
        usual = grid.ordinals_of_tokens(tokens[block])[1]
        best, _, better = fit_grid(tokens[block])
        if np.count_nonzero(better) >= np.count_nonzero(usual) + WORTH:
            changes.append((int(row[start]) // n_each * n_each, best))
            grid, usual = best, better
        result[block] = usual
    return changes, result


RUN_BITS = 48  # of one more run of grids in CLIP, and of what its heads need
EXCEPTION_BITS = 200
TEXT = "text"  # the signal of the numbers in text columns
MAX_NOTE = 200
_TEXT_NOTE = re.compile(r"(?:^|; )[0-9]+ columns? (?:is|are) text: ([^;]*)")
MOST_TRIED = 2048  # most columns that are tried; among more, each gains little


def select_columns(rows: TokenRows, columns: Sequence[int]) -> TokenRows:
    """``rows`` with these columns alone; their layout is not theirs any more."""
    chosen = list(columns)
    start, stop = rows.start[:, chosen], rows.stop[:, chosen]
    return replace(rows, start=np.ascontiguousarray(start), stop=np.ascontiguousarray(stop))


def read_columns(data: bytes, rows: TokenRows, columns: Sequence[int], n_each: int = 1) -> Signal:
    """The signal of these columns, ``n_each`` rows a frame; SourceError for what is no number."""
    rows = select_columns(rows, columns)
    signal = read_signal(data, rows, n_each)
    tried = range(min(len(columns), MOST_TRIED))
    better_columns = {c: better for c in tried if (better := _better_grid(data, rows, signal, c))}
    if not better_columns:
        return signal
    grids = list(signal.grids)
    exceptions = signal.exceptions
    is_kept = ~np.isin(exceptions.channels, list(better_columns))
    entries = [
        *zip(
            exceptions.rows[is_kept].tolist(),
            exceptions.channels[is_kept].tolist(),
            [text for text, keep in zip(exceptions.texts, is_kept.tolist(), strict=True) if keep],
            strict=True,
        )
    ]
    for column, (grid, odd) in better_columns.items():
        grids[column] = grid
        entries += [(row, column, text) for row, text in odd]
    entries.sort()
    return replace(
        signal,
        grids=tuple(grids),
        grid_changes=tuple(
            change for change in signal.grid_changes if change[1] not in better_columns
        ),
        exceptions=Exceptions(
            np.array([row for row, _, _ in entries], np.int64),
            np.array([column for _, column, _ in entries], np.int64),
            tuple(text for _, _, text in entries),
        ),
    )


def read_text(
    data: bytes,
    rows: TokenRows,
    texts: Sequence[TextColumn],
    labels: Sequence[str],
    at: tuple[int, int],
) -> tuple[Signal, ...]:
    """The signal of the numbers in text columns, if there are any.

    ``labels``: of each text column. ``at``: the first column of the numbers, and how many rows a
    frame has.
    """
    first, n_each = at
    channels = [
        Channel("", f"{label}.{k + 1}" if text.n_numbers > 1 else label)
        for text, label in zip(texts, labels, strict=True)
        for k in range(text.n_numbers)
    ]
    if not channels:
        return ()
    signal = read_columns(data, rows, range(first, first + len(channels)), n_each)
    return (replace(signal, name=TEXT, channels=tuple(channels)),)


def text_note(labels: Sequence[str]) -> str:
    """A note that these columns are text; "" for none."""
    verb = "column is" if len(labels) == 1 else "columns are"
    return f"{len(labels)} {verb} text: {', '.join(labels)}"[:MAX_NOTE] if labels else ""


def text_columns(metadata: Mapping[str, str]) -> str:
    """Names of the columns of text of a table; "" if it has none."""
    match = _TEXT_NOTE.search(metadata.get("source-note", ""))
    return match[1] if match else ""


def table_metadata(encoding: str, notes: Sequence[str]) -> dict[str, str]:
    """The metadata of a clip about its source: the encoding of its names, oddities."""
    metadata = {
        "name-encoding": encoding if encoding != "utf-8" else "",
        "source-note": "; ".join(filter(None, notes)),
    }
    return {key: value for key, value in metadata.items() if value}


def _better_grid(
    data: bytes, rows: TokenRows, signal: Signal, column: int
) -> tuple[Grid, list[tuple[int, bytes]]] | None:
    """A grid that suits the column better than that of the signal, with what it does not print."""
    present = np.flatnonzero(rows.stop[:, column])
    tokens = scan(data, rows.start[present, column], rows.stop[present, column])
    values = signal.values[present, column]
    tokens.known.append(values)
    if not len(values) or (values == values[0]).all():
        return None  # a constant costs nothing
    grid, _, known = fit_grid(tokens)
    n_odd = int(np.count_nonzero(signal.exceptions.channels == column))
    now = bits_of(signal.grids[column]) * len(tokens) + EXCEPTION_BITS * n_odd
    odd = np.flatnonzero(~known)
    then = bits_of(grid) * len(tokens) + EXCEPTION_BITS * len(odd)
    if grid == signal.grids[column] or len(odd) > n_odd or then + RUN_BITS >= now:
        return None
    texts = tokens[odd].texts().tolist() if len(odd) else []
    return grid, list(zip(present[odd].tolist(), texts, strict=True))
