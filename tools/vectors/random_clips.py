"""Clips made at random, one codec each: headers and streams that no encoder of ours would choose.

Everything is drawn from one ``random.Random``, so a seed gives the same bytes anywhere; what is
coded is integers.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcz.codecs import by_name, lossless, raw
from mcz.codecs._lossy import SCALED
from mcz.codecs.base import Codec, Encoded, Segment
from mcz.motion import CHANNEL_KINDS, Channel, Exceptions, Joint, Motion, Signal, Skeleton
from mcz.numbers import Grid, GridFlag, GridKind
from mcz.transforms.wavelets import Wavelet
from tools.vectors import coded, components, curved, grouped, grouped_files, spatial, waved
from tools.vectors.edits import raw_stream
from tools.vectors.spatial import FRAME, PCA_RDO

Chance = random.Random
Ints = NDArray[np.int64]
MOST = 2**40  # of an integer that a lossy codec codes
NAMES = tuple("raw lossless mrdwt qbc pca dwt awt lsdt-frame lsdt-clip mdtt pca-rdo online".split())
LETTERS = "abc\u00e4\u00df 0\u03c9\U0001f6b6\ufeff"


@dataclass(frozen=True, slots=True)
class Clip:
    """A clip and the codec that has its content."""

    codec: Codec
    motion: Motion
    grouping: str


def clip(chance: Chance, name: str, codec: str) -> Clip:
    """A clip of ``codec`` called ``name``."""
    if codec in ("raw", "lossless"):
        made = _ordinals(chance, codec)
    elif codec in _MAKERS:
        made = _MAKERS[codec](chance, codec)
    else:
        made = _space(chance, codec)
    return replace(made, motion=replace(made.motion, name=name))


# What is common


def integer(chance: Chance, most: int = MOST) -> int:
    """An integer of any length, often small, often 0."""
    if chance.random() < 0.3:
        return 0
    n = chance.randrange(1, most.bit_length() + 1 if chance.random() < 0.2 else 9)
    return min(chance.getrandbits(n), most) * chance.choice((-1, 1))


def integers(chance: Chance, n: int, most: int = MOST) -> list[int]:
    """So many: noise, a walk, or all alike."""
    how = chance.randrange(3)
    if how == 0:
        return [integer(chance, most) for _ in range(n)]
    if how == 1:
        return [integer(chance, most)] * n
    found, at = [], 0
    for _ in range(n):
        at = max(-most, min(most, at + chance.randrange(-9, 10)))
        found.append(at)
    return found


def split(chance: Chance, n: int, unit: int = 1) -> list[int]:
    """``n`` in parts, all but the last multiples of ``unit``, now and then all of one unit."""
    parts: list[int] = []
    sizes = (1,) if chance.random() < 0.3 else (1, 1, 2, 3, 5, 9)
    while n:
        part = min(n, unit * chance.choice(sizes))
        parts.append(part)
        n -= part
    return parts


def ends(parts: Sequence[int]) -> tuple[int, ...]:
    """Where parts end, but the last."""
    return tuple(np.cumsum(parts).tolist()[:-1])


def text(chance: Chance, most: int = 9) -> str:
    return "".join(chance.choice(LETTERS) for _ in range(chance.randrange(most)))


def skeleton(chance: Chance, sizes: Sequence[int]) -> Skeleton:
    """Joints of so many channels, others without any between them."""
    joints: list[Joint] = []
    for size in sizes:
        for own in (*[0] * chance.choice((0, 0, 1)), size):
            channels = tuple(_channel(chance) for _ in range(own))
            parent = chance.randrange(-1, len(joints))
            joints.append(_joint(chance, parent, channels))
    return Skeleton(
        tuple(joints),
        text(chance),
        chance.choice((None, 0.1, 2.54 / 0.45)),
        chance.choice(("", "deg", "rad")),
        chance.choice(("", "x", "y", "z")),
        intrinsic=chance.random() < 0.5,
    )


def _channel(chance: Chance) -> Channel:
    kind = chance.choice(("", *CHANNEL_KINDS))
    return Channel(kind, text(chance, 4), text(chance, 3))


def _joint(chance: Chance, parent: int, channels: tuple[Channel, ...]) -> Joint:
    def vector() -> tuple[float, float, float]:
        x, y, z = (chance.randrange(-40, 41) / 8 for _ in range(3))
        return x, y, z

    order = chance.choice(("XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX"))
    turned = chance.random() < 0.3
    return Joint(
        text(chance),
        parent,
        vector() if chance.random() < 0.6 else (0.0, 0.0, 0.0),
        tuple(vector() for _ in range(chance.choice((0, 0, 1, 3)))),
        axis=vector() if turned else (0.0, 0.0, 0.0),
        axis_order=order if turned else "XYZ",
        channels=channels,
        adds_to_offset=chance.random() < 0.5,
    )


def partition(chance: Chance, n: int) -> list[int]:
    """Sizes of joints with ``n`` channels together."""
    found: list[int] = []
    while n:
        found.append(chance.randrange(1, min(n, 4) + 1))
        n -= found[-1]
    return found


# Codecs of ordinals


def _grids(chance: Chance, n: int, *, whole: bool) -> tuple[Grid, ...]:
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
        limit = min(limit, 2**43)  # which codec 1 holds as plain numbers
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
    """Where the grid of a channel becomes another."""
    at, before = 0, grid
    for now, n in zip(own, rows, strict=True):
        if now != before:
            yield at, channel, now
        at, before = at + n, now


def _signal(
    chance: Chance, parts: Sequence[int], n: int, **about: Any
) -> tuple[Signal, dict[int, int]]:
    per_frame = about.get("samples_per_frame", 1)
    grids = _grids(chance, n, whole=n > 0 and chance.random() < 0.15)
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
    return signal if whole else _noted(chance, signal), made.copies


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


def _noted(chance: Chance, signal: Signal) -> Signal:
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


def _ordinals(chance: Chance, name: str) -> Clip:
    n_frames = chance.choice((0, 1, 2, 5, 11, 26))
    n = chance.choice((0, 1, 3, 6, 9))
    parts = [split(chance, n_frames) for _ in range(chance.choice((1, 1, 2, 3)))]
    found = [_signal(chance, parts[0], n)]
    for number, own in enumerate(parts[1:]):
        size = chance.randrange(1, 4)
        about: dict[str, Any] = {
            "name": chance.choice(("analog", "residuals", f"more {number}")),
            "samples_per_frame": chance.choice((1, 2, 5)),
            "channels": tuple(_channel(chance) for _ in range(size)),
        }
        found.append(_signal(chance, own, size, **about))
    bones = skeleton(chance, partition(chance, n))
    motion = Motion(bones, tuple(signal for signal, _ in found))
    grouping = chance.choice(("all", "joint", "channel"))
    write = _raw_streams if name == "raw" else _lossless_streams
    count = iter(range(len(found)))

    def encode(source: Any, params: Any) -> Encoded:
        which = next(count)
        made = _segments(chance, source, parts[which], found[which][1], write)
        return Encoded(b"", iter(made))

    codec = replace(by_name(name), encode=encode, parameters=raw.CODEC.parameters)
    return Clip(codec, motion, grouping)


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


def _lossless_streams(
    chance: Chance, layout: Any, grids: Sequence[Grid], block: Ints, copies: dict[int, int]
) -> tuple[bytes, ...]:
    """Constants, copies where the ordinals allow it, and coded channels with any taps."""
    place = {c: (g, k) for g, group in enumerate(layout.groups) for k, c in enumerate(group)}
    heads: list[coded.Head] = []
    for c in range(layout.n_channels):
        column = block[:, c]
        twin = copies.get(c)
        if twin is not None and (column == block[:, twin]).all() and chance.random() < 0.8:
            heads.append(coded.Copy(*place[twin]))
        elif (column == column[0]).all() and chance.random() < 0.7:
            heads.append(coded.Constant())
        else:
            form = lossless.form_of_grid(grids[c])
            own = form != lossless.form_of_grid(layout.grids[c]) or chance.random() < 0.1
            heads.append(_coded(chance, form if own else None))
    return coded._streams(layout, block, heads)


def _coded(chance: Chance, form: int | None) -> coded.Coded:
    wild = chance.random() < 0.2
    taps = [chance.randrange(-511, 512) if wild else chance.randrange(-9, 40) for _ in range(8)]
    return coded.Coded(
        form,
        scale=chance.choice((0, 3, 8, 40, 77, 172)),
        from_last=chance.randrange(2),
        taps=tuple(taps[: chance.randrange(9)]),
    )


# Codecs of values


def _lossy(chance: Chance, codec: Codec, values: Any, grouping: str, sizes: Sequence[int]) -> Clip:
    n_rows, n = values.shape
    grids = _grids(chance, n, whole=False)
    grids = tuple(Grid(GridKind.FIXED, 2) if g.kind == GridKind.INTEGER else g for g in grids)
    signal = Signal(values, grids, mask=mask_of(chance, (n_rows, n)))
    return Clip(codec, Motion(skeleton(chance, sizes), (signal,)), grouping)


def _as(name: str, made: Codec) -> Codec:
    """The content of another codec under the id of ``name``."""
    own = by_name(name)
    return replace(own, encode=made.encode, parameters=raw.CODEC.parameters, dial=None)


def _waves(chance: Chance, name: str) -> Clip:
    n_frames = chance.choice((1, 2, 3, 9, 24, 45))
    levels = chance.choice((0, 1, 2, 3, 5))
    unit = 2.0 ** chance.randrange(-30, 31)
    wavelet: int | Wavelet = chance.randrange(1, 11)
    if chance.random() < 0.2:
        lo, hi = ([chance.randrange(-64, 65) / 37 for _ in range(6)] for _ in range(2))
        wavelet = Wavelet(tuple(lo), tuple(hi))
    plan = waved.Plan(
        n_frames,
        wavelet,
        levels,
        chance.choice((0, 1, 6, 15, SCALED, SCALED)),
        unit,
        chance.choice((1, 1, 2, 700, 2**39)),
        ends(split(chance, n_frames, 2**levels)),
        n_resolutions=chance.randrange(1, levels + 2),
    )
    made = [_wave(chance, plan) for _ in range(chance.randrange(1, 4))]
    values = waved.values_of(plan, made)
    codec = _as(name, waved.codec_of(plan, made))
    return _lossy(chance, codec, values, "channel", partition(chance, len(made)))


def _wave(chance: Chance, plan: waved.Plan) -> waved.Wave:
    bands: list[list[int]] = [integers(chance, plan.lengths[-1])]
    for level in range(plan.levels, 0, -1):
        made = []
        for value in integers(chance, plan.lengths[level], MOST - plan.least):
            sign = (value > 0) - (value < 0)
            made.append(sign * (abs(value) - 1 + plan.least))
        bands.append(made if chance.random() < 0.7 else [0] * len(made))
    alike = len(set(bands[0])) == 1 and chance.random() < 0.5
    heads = tuple(
        waved.Head(chance.randrange(256), 0, 63)
        if alike
        else waved.Head(chance.randrange(256), chance.randrange(4), chance.randrange(63))
        for _ in range(3)
    )
    spoken = [band for band in range(1, plan.levels + 1) if chance.random() < 0.3]
    return waved.Wave(bands, heads, (0, *spoken))


def _curves(chance: Chance, name: str) -> Clip:
    n_frames = chance.choice((1, 2, 9, 30))
    delta = chance.choice((1, 2, 5, 8, 40))
    plan = curved.Plan(
        n_frames,
        delta,
        chance.choice((0, 2, 15, SCALED)),
        2.0 ** chance.randrange(-20, 21),
        ends=ends(split(chance, n_frames, delta)),
        n_resolutions=chance.randrange(1, 3),
    )
    sizes = [chance.randrange(1, 5) for _ in range(chance.randrange(1, 4))]
    made = [_path(chance, plan, size) for size in sizes]
    values = curved.values_of(plan, made)
    return _lossy(chance, _as(name, curved.codec_of(plan, made)), values, "joint", sizes)


def _path(chance: Chance, plan: curved.Plan, size: int) -> curved.Path:
    marks = list(zip(*[integers(chance, len(plan.marks)) for _ in range(size)], strict=True))
    pieces = {}
    for mark in range(len(plan.marks) - 1):
        if chance.random() < 0.7:
            pieces[mark] = [
                curved.Piece(n, _point(chance, size), _point(chance, size))
                for n in split(chance, plan.between(mark))
            ]
    scales = chance.randrange(64), chance.randrange(64), chance.randrange(64)
    spoken = tuple(k for k in range(2) if chance.random() < 0.3)
    return curved.Path(marks, pieces, scales, spoken, size)


def _point(chance: Chance, size: int) -> tuple[int, ...] | None:
    if chance.random() < 0.3:
        return None
    return tuple(integer(chance, 2**39) for _ in range(size))


def _parts(chance: Chance, name: str) -> Clip:
    n = chance.randrange(1, 6)
    parts, empty = [], []
    for number, n_frames in enumerate(split(chance, chance.choice((1, 3, 12, 20)))):
        count = chance.randrange(min(n, n_frames + 1) + 1)
        scale, forms = chance.randrange(63), [chance.randrange(4) for _ in range(count)]
        columns = [integers(chance, n_frames) for _ in range(count)]
        parts.append(
            components.Part(
                [integer(chance) for _ in range(n)],
                [integers(chance, n) for _ in range(count)],
                [tuple(column[f] for column in columns) for f in range(n_frames)],
                chance.randrange(256),
                scale,
                [chance.randrange(41) for _ in range(count)],
                [64 * form + chance.randrange(63) for form in forms],
                n_frames=n_frames,
            )
        )
        empty += [number] * (chance.random() < 0.1)
    plan = components.Plan(tuple(parts), chance.choice((0, 2, 15, SCALED)), tuple(empty))
    values = components.values_of(plan)
    codec = _as(name, components.codec_of(plan))
    return _lossy(chance, codec, values, "all", partition(chance, n))


def _basis(chance: Chance, n_points: int, most: int) -> Any:
    n = chance.randrange(1, most + 1)
    entries = [integers(chance, n_points) for _ in range(n)]
    shifts = [chance.choice((0, 7, 7, 12, 40)) for _ in range(n)]
    return spatial.basis_of(n_points, n, entries=entries, shifts=shifts)


def _fill(chance: Chance) -> Callable[[int, int, int], Ints]:
    """Coefficients of a table by its number, the same whenever they are asked for."""
    seed = chance.getrandbits(32)

    def fill(number: int, n_rows: int, n: int) -> Ints:
        own = random.Random(1_000_003 * seed + number)
        table = [integers(own, n) for _ in range(n_rows)]
        return np.array(table, np.int64).reshape(n_rows, n)

    return fill


def _about(chance: Chance) -> dict[str, Any]:
    """What codecs 7 to 11 have in common."""
    apart = chance.random() < 0.4
    n = 3 * chance.randrange(1, 4) if apart else chance.randrange(1, 8)
    bases = ()
    if chance.random() < 0.6:
        points = n // 3 if apart else n
        bases = tuple(_basis(chance, points, points) for _ in range(3 if apart else 1))
    weights = bytes(chance.randrange(256) for _ in range(n)) if chance.random() < 0.4 else None
    step = chance.choice((1.0, 1 / 3, 2.0**-100, 2.0 ** chance.randrange(-20, 21)))
    about = {"n_channels": n, "apart": apart, "bases": bases, "weights": weights, "step": step}
    return about | {"fill": _fill(chance)}


def _space(chance: Chance, name: str) -> Clip:
    about = _about(chance)
    segments = tuple(split(chance, chance.choice((1, 2, 13, 30))))
    window = chance.choice((1, 2, 4, 8, 20))
    frequencies = chance.randrange(1, window + 1)
    fresh: tuple[bool, ...] = ()
    more: dict[str, Any] = {}
    if name == FRAME:
        fresh = (True, *(chance.random() < 0.4 for _ in segments[1:]))
    if name == PCA_RDO and chance.random() < 0.5:
        more["mean"] = _basis(chance, about["n_channels"], 1)
    if name == PCA_RDO and chance.random() < 0.5:
        n_points = chance.randrange(1, window + 1)
        courses = _basis(chance, n_points, n_points)
        frequencies = len(courses.entries)
        more["courses"] = courses
    plan = spatial.Plan(
        name,
        segments=segments,
        fresh=fresh,
        window=window,
        frequencies=frequencies,
        prefix=chance.random() < 0.4,
        **about,
        **more,
    )
    values = spatial.values_of(plan)
    return _lossy(chance, spatial.codec_of(plan), values, "all", partition(chance, plan.n_channels))


def _online(chance: Chance, name: str) -> Clip:
    about = _about(chance)
    order = 0 if about["apart"] or about["n_channels"] % 3 else chance.randrange(2)
    parts = split(chance, chance.choice((1, 2, 13, 30)))
    units = []
    for number, n_frames in enumerate(parts):
        own = []
        for k, n in enumerate(split(chance, n_frames)):
            own.append("I" if number == k == 0 else chance.choice("ILSS"))
            own[-1] += str(n)
        units.append(" ".join(own))
    codes = [chance.randrange(512) if chance.random() < 0.5 else 256 for _ in range(sum(parts))]
    plan = grouped.Plan(
        tuple(units),
        coder=chance.randrange(2),
        order=order,
        steps=grouped_files.numbered(codes),
        said=tuple(f for f in range(sum(parts)) if chance.random() < 0.2),
        **about,
    )
    values = grouped_files.values_of(plan)
    codec = grouped_files.codec_of(plan)
    return _lossy(chance, codec, values, "all", partition(chance, plan.n_channels))


_MAKERS: dict[str, Callable[[Chance, str], Clip]] = {
    "mrdwt": _waves,
    "dwt": _waves,
    "awt": _waves,
    "qbc": _curves,
    "pca": _parts,
    "online": _online,
}
