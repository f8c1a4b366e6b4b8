"""The columns of a table -> a Signal. Each column may have a grid of its own.

The columns of a table are different things: a time, an angle, a force. So are their digits.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from mcz.model.motion import Channel, Exceptions, Signal
from mcz.model.numbers import Grid, bits_of, fit, scan
from mcz.sources.tables.text_columns import TextColumn
from mcz.sources.tables.token_signal import read_signal
from mcz.sources.text.rows import Rows

RUN_BITS = 48  # of one more run of grids in CLIP, and of what its heads need
EXCEPTION_BITS = 200
TEXT = "text"  # the signal of the numbers in text columns
MAX_NOTE = 200
_TEXT_NOTE = re.compile(r"(?:^|; )[0-9]+ columns? (?:is|are) text: ([^;]*)")
MOST_TRIED = 2048  # columns; of more each may take long, and has little to gain


def of_columns(rows: Rows, columns: Sequence[int]) -> Rows:
    """``rows`` with these columns alone; their layout is not theirs any more."""
    chosen = list(columns)
    start, stop = rows.start[:, chosen], rows.stop[:, chosen]
    return replace(rows, start=np.ascontiguousarray(start), stop=np.ascontiguousarray(stop))


def read_columns(data: bytes, rows: Rows, columns: Sequence[int], n_each: int = 1) -> Signal:
    """The signal of these columns, ``n_each`` rows a frame; SourceError for what is no number."""
    rows = of_columns(rows, columns)
    signal = read_signal(data, rows, n_each)
    tried = range(min(len(columns), MOST_TRIED))
    better_columns = {c: better for c in tried if (better := _better(data, rows, signal, c))}
    if not better_columns:
        return signal
    grids = list(signal.grids)
    exceptions = signal.exceptions
    kept = ~np.isin(exceptions.channels, list(better_columns))
    entries = [
        *zip(
            exceptions.rows[kept].tolist(),
            exceptions.channels[kept].tolist(),
            [text for text, keep in zip(exceptions.texts, kept.tolist(), strict=True) if keep],
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
    data: bytes, rows: Rows, texts: Sequence[TextColumn], labels: Sequence[str], at: tuple[int, int]
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
    """The names of the columns of text of a table that was read; "" where it has none."""
    match = _TEXT_NOTE.search(metadata.get("source-note", ""))
    return match[1] if match else ""


def table_metadata(encoding: str, notes: Sequence[str]) -> dict[str, str]:
    """The metadata of a clip about its source: the encoding of its names, oddities."""
    metadata = {
        "name-encoding": encoding if encoding != "utf-8" else "",
        "source-note": "; ".join(filter(None, notes)),
    }
    return {key: value for key, value in metadata.items() if value}


def _better(
    data: bytes, rows: Rows, signal: Signal, column: int
) -> tuple[Grid, list[tuple[int, bytes]]] | None:
    """A grid that suits the column better than that of the signal, with what it does not print."""
    present = np.flatnonzero(rows.stop[:, column])
    tokens = scan(data, rows.start[present, column], rows.stop[present, column])
    values = signal.values[present, column]
    tokens.known.append(values)
    if not len(values) or (values == values[0]).all():
        return None  # a constant costs nothing
    grid, _, known = fit(tokens)
    n_odd = int(np.count_nonzero(signal.exceptions.channels == column))
    now = bits_of(signal.grids[column]) * len(tokens) + EXCEPTION_BITS * n_odd
    odd = np.flatnonzero(~known)
    then = bits_of(grid) * len(tokens) + EXCEPTION_BITS * len(odd)
    if grid == signal.grids[column] or len(odd) > n_odd or then + RUN_BITS >= now:
        return None
    texts = tokens[odd].texts().tolist() if len(odd) else []
    return grid, list(zip(present[odd].tolist(), texts, strict=True))
