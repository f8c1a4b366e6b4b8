"""Clips of raw, fast and best made at random: grids, changes of grid, exceptions, masks, copies."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcz.codecs import codec_by_name, raw
from mcz.codecs.coding.forms import form_of_grid
from mcz.codecs.contract import Encoded, Segment
from mcz.model.motion import Exceptions, Motion, Signal
from mcz.model.numbers import Grid, GridFlag, GridKind
from tools.vectors.build import (
    best_clips,
    fast_clips,
)
from tools.vectors.build.edits import raw_stream
from tools.vectors.build.random_parts import (
    SPELLED,
    Chance,
    Clip,
    Ints,
    any_channel,
    integers,
    partition,
    skeleton,
    split_count,
)


def any_grids(chance: Chance, n: int, *, whole: bool) -> tuple[Grid, ...]:
    return tuple(Grid(GridKind.INTEGER) if whole else _grid(chance) for _ in range(n))


def _grid(chance: Chance) -> Grid:
    flag = GridFlag
    printed = chance.choice((flag(0), flag.POINT_ZERO, flag.NO_ZERO | flag.PLUS, flag.POINT))
    choices = (
        Grid(GridKind.FIXED, chance.randrange(1, 23), flag.PLUS),
        Grid(GridKind.FIXED, 2),
        Grid(GridKind.TRIMMED, chance.randrange(1, 23), printed),
        Grid(GridKind.GENERAL, chance.randrange(1, 16), printed | flag.EXPONENT3),
        Grid(GridKind.TEXT64, chance.choice((0, 1, 16, 17)), printed | flag.UPPER),
        Grid(GridKind.TEXT64, chance.randrange(74, 105)),
        Grid(GridKind.TEXT32, 0, printed),
        Grid(GridKind.INTEGER),
        Grid(GridKind.SCALED, scale=chance.choice((0.1, 2.0**-200, 2.0**200, 1 / 3))),
        Grid(GridKind.BINARY32),
        Grid(GridKind.BINARY64),
        Grid(GridKind.VAX_F),
    )
    return chance.choice(choices)


def _column(chance: Chance, grid: Grid, n: int) -> list[int]:
    """Ordinals of a grid: small, or anywhere up to its ends."""
    limit = grid.limit
    if grid.kind in (GridKind.FIXED, GridKind.TRIMMED, GridKind.SCALED, GridKind.INTEGER):
        limit = min(limit, 2**43)  # which best holds as plain numbers
    if chance.random() < 0.6:
        return [max(-limit, min(limit, value)) for value in integers(chance, n, limit)]
    return [chance.randrange(-limit, limit + 1) for _ in range(n)]


@dataclass(frozen=True, slots=True)
class Table:
    """Ordinals (rows, channels) in segments of ``parts`` frames; ``copies``: of which column."""

    ordinals: Ints
    values: NDArray[np.float64]
    changes: tuple[tuple[int, int, Grid], ...]
    copies: dict[int, int]


def _table(chance: Chance, grids: Sequence[Grid], parts: Sequence[int], per_frame: int) -> Table:
    """Columns of all sorts, some on another grid in some segments, some copies of others."""
    rows = [n * per_frame for n in parts]
    columns, values, changes = [], [], []
    copies: dict[int, int] = {}
    for place, grid in enumerate(grids):
        twins = [p for p in range(place) if grids[p] == grid and p not in copies]
        if twins and chance.random() < 0.4:
            copies[place] = chance.choice(twins)
            columns.append(columns[copies[place]])
            values.append(values[copies[place]])
            continue
        own = [grid] * len(rows)
        if grid.is_text and not any(g == grid for g in grids[place + 1 :]):
            own = [_text_grid(chance) if chance.random() < 0.2 else grid for _ in rows]
        changes += _changes(place, grid, own, rows)
        found = [_column(chance, g, n) for g, n in zip(own, rows, strict=True)]
        if len(set(own)) <= 1:
            own = own[:1] or [grid]
            found = [_column(chance, own[0], sum(rows))]
        columns.append([o for part in found for o in part])
        meant = [g.values(np.array(o, np.int64)) for g, o in zip(own, found, strict=True)]
        values.append(np.concatenate([*meant, np.empty(0)]))
    shape = len(grids), sum(rows)
    return Table(
        np.array(columns, np.int64).reshape(shape).T.copy(),
        np.array(values, np.float64).reshape(shape).T.copy(),
        tuple(sorted(changes, key=lambda change: change[:2])),
        copies,
    )


def _text_grid(chance: Chance) -> Grid:
    while not (grid := _grid(chance)).is_text:
        pass
    return grid


def _changes(
    channel: int, grid: Grid, own: Sequence[Grid], rows: Sequence[int]
) -> Iterable[tuple[int, int, Grid]]:
    """Frames at which the grid of a channel changes."""
    at, before = 0, grid
    for now, n in zip(own, rows, strict=True):
        if now != before:
            yield at, channel, now
        at, before = at + n, now


def any_signal(
    chance: Chance, parts: Sequence[int], n: int, **about: Any
) -> tuple[Signal, dict[int, int]]:
    per_frame = about.get("samples_per_frame", 1)
    grids = any_grids(chance, n, whole=n > 0 and chance.random() < 0.15)
    made = _table(chance, grids, parts, per_frame)
    whole = bool(n) and all(grid.kind == GridKind.INTEGER for grid in grids)
    signal = Signal(
        made.ordinals if whole else made.values,
        grids,
        ordinals=None if whole else made.ordinals,
        mask=mask_of(chance, made.ordinals.shape),
        grid_changes=made.changes,
        **about,
    )
    return signal if whole else _add_exceptions(chance, signal), made.copies


def mask_of(chance: Chance, shape: tuple[int, int]) -> NDArray[np.bool_] | None:
    if chance.random() < 0.6:
        return None
    mask = np.ones(shape, np.bool_)
    for _ in range(chance.randrange(4)):
        if mask.size:
            row, channel = chance.randrange(shape[0]), chance.randrange(shape[1])
            mask[row : row + chance.randrange(5), channel] = False
    return mask


TOKENS = (b"1e3", b"-NaN", b"+5", b"Infinity", b"-1.#INF00", b"007", b".1", b"1e-400", b"12.")
MEANT = (1e3, np.nan, 5.0, np.inf, -np.inf, 7.0, 0.1, 0.0, 12.0)


def _add_exceptions(chance: Chance, signal: Signal) -> Signal:
    """``signal`` with some exceptions."""
    odd = {channel for _, channel, _ in signal.grid_changes}
    shown = [c for c, grid in enumerate(signal.grids) if grid.is_text and c not in odd]
    if not shown or not signal.n_rows or chance.random() < 0.6:
        return signal
    n_rows, n = signal.n_rows, chance.randrange(5)
    places = sorted({(chance.randrange(n_rows), chance.choice(shown)) for _ in range(n)})
    values, texts = signal.values.copy(), []
    for row, channel in places:
        which = chance.randrange(len(TOKENS))
        values[row, channel] = MEANT[which]
        texts.append(TOKENS[which])
    rows, channels = (np.array([p[k] for p in places], np.int64) for k in range(2))
    return replace(signal, values=values, exceptions=Exceptions(rows, channels, tuple(texts)))


def clip_of_ordinals(chance: Chance, name: str) -> Clip:
    n_frames = chance.choice((0, 1, 2, 5, 11, 26))
    n = chance.choice((0, 1, 3, 6, 9))
    parts = [split_count(chance, n_frames) for _ in range(chance.choice((1, 1, 2, 3)))]
    found = [any_signal(chance, parts[0], n)]
    for number, own in enumerate(parts[1:]):
        size = chance.randrange(1, 4)
        about: dict[str, Any] = {
            "name": chance.choice(("analog", "residuals", f"more {number}")),
            "samples_per_frame": chance.choice((1, 2, 5)),
            "channels": tuple(any_channel(chance) for _ in range(size)),
        }
        found.append(any_signal(chance, own, size, **about))
    bones = skeleton(chance, partition(chance, n))
    motion = Motion(bones, tuple(signal for signal, _ in found))
    grouping = chance.choice(("all", "joint", "channel"))
    write = _WRITERS[name]
    count = iter(range(len(found)))

    def encode(source: Any, params: Any) -> Encoded:
        which = next(count)
        made = _segments(chance, source, parts[which], found[which][1], write)
        return Encoded(b"", iter(made), version=0)

    codec = replace(
        codec_by_name("fast" if name == SPELLED else name),
        encode=encode,
        parameters=raw.CODEC.parameters,
    )
    return Clip(codec, motion, "all" if name == "best" else grouping)


Streams = Callable[[Chance, Any, Sequence[Grid], Ints, dict[int, int]], tuple[bytes, ...]]


def _segments(
    chance: Chance, source: Any, parts: Sequence[int], copies: dict[int, int], write: Streams
) -> list[Segment]:
    """Segments of these frames."""
    found, start = [], 0
    for part in parts:
        block, grids = source.ordinals(start, start + part), source.grids(start)
        found.append(Segment(start, part, write(chance, source.layout, grids, block, copies)))
        start += part
    return found


def _raw_streams(
    chance: Chance, layout: Any, grids: Sequence[Grid], block: Ints, copies: dict[int, int]
) -> tuple[bytes, ...]:
    """Offsets of any width that is enough."""
    streams = []
    for group in layout.groups:
        columns = [[int(o) for o in block[:, c]] for c in group]
        least = [(max(column) - min(column)).bit_length() for column in columns]
        widths = [chance.randrange(-(-bits // 8), 9) for bits in least]
        streams.append(raw_stream(columns, widths))
    return tuple(streams)


def _best_streams(
    chance: Chance, layout: Any, grids: Sequence[Grid], block: Ints, copies: dict[int, int]
) -> tuple[bytes, ...]:
    """Streams with any references."""
    _heads(chance, layout, grids, block, copies)  # what follows is drawn as when best had these
    references: list[list[int]] = []
    method = 0
    for group in layout.groups:
        references += [_references(chance, channel) for channel in range(len(group))]
        method |= int(chance.random() < 0.8)
    args = block, tuple(grids), layout.grids, references
    return tuple(best_clips.build_stream(*args, method=method) for _ in layout.groups)


def _references(chance: Chance, channel: int) -> list[int]:
    found = [chance.randrange(channel) for _ in range(chance.randrange(9))] if channel else []
    chance.randrange(45), chance.randrange(16)  # as when channels had units
    return found


def _heads(
    chance: Chance, layout: Any, grids: Sequence[Grid], block: Ints, copies: dict[int, int]
) -> list[Drawn | fast_clips.Constant | fast_clips.Copy]:
    """Constants, copies where the ordinals allow it, and coded channels with any taps."""
    place = {c: (g, k) for g, group in enumerate(layout.groups) for k, c in enumerate(group)}
    heads: list[Drawn | fast_clips.Constant | fast_clips.Copy] = []
    for c in range(layout.n_channels):
        column = block[:, c]
        twin = copies.get(c)
        if twin is not None and (column == block[:, twin]).all() and chance.random() < 0.8:
            heads.append(fast_clips.Copy(*place[twin]))
        elif (column == column[0]).all() and chance.random() < 0.7:
            heads.append(fast_clips.Constant())
        else:
            form = form_of_grid(grids[c])
            own = form != form_of_grid(layout.grids[c]) or chance.random() < 0.1
            heads.append(_draw_coded(chance, form if own else None))
    return heads


def _fast_streams(
    chance: Chance,
    layout: Any,
    grids: Sequence[Grid],
    block: Ints,
    copies: dict[int, int],
    *,
    more: bool = False,
) -> tuple[bytes, ...]:
    """The same of fast, with any taps and parents; long ordinals of 64 bits are plain or not.

    ``more``: heads may say the form that their grid has.
    """
    place = {c: (g, k) for g, group in enumerate(layout.groups) for k, c in enumerate(group)}
    heads: list[fast_clips.Head] = []
    own = Chance(block.tobytes())  # of what other codecs have not
    for c in range(layout.n_channels):
        column, twin, form = block[:, c], copies.get(c), form_of_grid(grids[c])
        if twin is not None and (column == block[:, twin]).all() and chance.random() < 0.8:
            heads.append(fast_clips.Copy(*place[twin]))
        elif (column == column[0]).all() and chance.random() < 0.7:
            heads.append(fast_clips.Constant())
        else:
            spelled = form != form_of_grid(layout.grids[c]) or (more and chance.random() < 0.1)
            made = _draw_coded(chance, form if spelled else None)
            is_steps = own.random() < 0.1
            heads.append(fast_clips.Steps() if is_steps else _lane(own, made, column, form))
    return fast_clips.streams_of(layout, block, _with_parents(own, layout, place, heads))


def _lane(own: Chance, made: Drawn, column: Ints, form: int) -> fast_clips.Coded:
    """A coded channel of fast, with perhaps an exception."""
    numbers, row = column.tolist(), own.randrange(len(column))
    exceptions: tuple[tuple[int, int], ...] = ()
    if own.random() < 0.2:
        exceptions = ((row, numbers[row]),)
        numbers[row] = numbers[row - 1]
    longest = max((o if o >= 0 else -1 - o).bit_length() for o in numbers)
    wide = form == fast_clips.PLAIN or (longest > 44 and own.random() < 0.3)
    drop = max(0, longest - 31) if wide else 0
    return fast_clips.Coded(
        fast_clips.PLAIN if wide and (drop or form) else made.form,
        drop,
        scale=min(made.scale, 120),
        predictor=own.randrange(4),
        taps=tuple(max(-128, min(127, tap)) for tap in (*made.taps, 0, 0, 0, 0)[:4]),
        exceptions=exceptions,
        numbers=tuple(numbers),
    )


def _with_parents(
    own: Chance, layout: Any, place: dict[int, tuple[int, int]], heads: list[fast_clips.Head]
) -> list[fast_clips.Head]:
    """Give some heads parents, each a channel without one: of their groups or of two others."""
    found = list(heads)
    coded = [c for c, head in enumerate(heads) if isinstance(head, fast_clips.Coded)]
    roots = [c for c in coded if own.random() < 0.4]
    for group in range(len(layout.groups)):
        others = own.sample(range(len(layout.groups)), min(2, len(layout.groups)))
        near = [c for c in roots if place[c][0] in (group, *others)]
        for c in coded:
            head = heads[c]
            if place[c][0] == group and c not in roots and near and own.random() < 0.7:
                parent = (*place[own.choice(near)], own.choice((256, -3, 999, -32768, 32767)))
                assert isinstance(head, fast_clips.Coded)
                found[c] = replace(head, parent=parent)
    return found


@dataclass(frozen=True, slots=True)
class Drawn:
    """Random choices for the head of a coded channel; ``form`` None: that of the grid."""

    form: int | None
    scale: int
    taps: tuple[int, ...]


def _draw_coded(chance: Chance, form: int | None) -> Drawn:
    wild = chance.random() < 0.2
    taps = [chance.randrange(-511, 512) if wild else chance.randrange(-9, 40) for _ in range(8)]
    scale = chance.choice((0, 3, 8, 40, 77, 172))
    chance.randrange(2)  # what follows is as it was when heads had this bit
    return Drawn(form, scale, tuple(taps[: chance.randrange(9)]))


_WRITERS: dict[str, Streams] = {
    "raw": _raw_streams,
    "best": _best_streams,
    "fast": _fast_streams,
    SPELLED: partial(_fast_streams, more=True),
}
