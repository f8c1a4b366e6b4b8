"""The motions that the vectors hold: small, with every number written out or counted."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np

from mcz.model.motion import Channel, Exceptions, Joint, Motion, Signal, Skeleton
from mcz.model.numbers import Grid, GridKind

HUNDREDTHS = Grid(GridKind.FIXED, 2)
INFINITE, NOT_A_NUMBER = float("inf"), float("nan")
INFINITE, NOT_A_NUMBER = float("inf"), float("nan")


def channels(kinds: str) -> tuple[Channel, ...]:
    return tuple(map(Channel, kinds.split()))


def puppet() -> Skeleton:
    """Three joints of 4, 2 and 0 channels."""
    return Skeleton(
        (
            Joint("hips", -1, (0.0, 0.9, 0.0), channels=channels("tx ty tz rz")),
            Joint("spine", 0, (0.0, 0.2, -0.0), channels=channels("rx ry")),
            Joint("tip", 1, (0.0, 0.3, 0.0), ((0.0, 0.1, 0.0),)),
        ),
        name="puppet",
        up_axis="y",
    )


def numbers(n_rows: int, n_columns: int) -> np.ndarray:
    """Hundredths from -97 to 102, none twice in a row."""
    counted = np.arange(n_rows * n_columns) * 37 % 200 - 97
    return (counted / 100).reshape(n_rows, n_columns)


def dance(n_frames: int = 4, **changes: Any) -> Motion:
    """The motion of most vectors: 6 channels of hundredths at 120 frames a second."""
    signal = Signal(numbers(n_frames, 6), (HUNDREDTHS,) * 6)
    fields: dict[str, Any] = {"skeleton": puppet(), "signals": (signal,), "name": "dance"}
    return Motion(**(fields | {"frame_rate": Fraction(120)} | changes))


def column(values: Any, grid: Grid, **changes: Any) -> Motion:
    """One plain scalar on ``grid``, named after it."""
    dtype = np.int64 if grid.kind == GridKind.INTEGER else np.float64
    table = np.array(values, dtype).reshape(-1, 1)
    skeleton = Skeleton((Joint("dial", channels=(Channel("", "needle", "V"),)),), name="dial")
    signal = Signal(table, (grid,), **changes)
    return Motion(skeleton, (signal,), name=grid.kind.name.lower())


def panel(
    columns: Sequence[Sequence[Any]], grids: Sequence[Grid], split: Sequence[int] = (), **more: Any
) -> Motion:
    """Plain scalars, column by column: one joint of all, or joints of ``split`` channels each."""
    dtype = np.int64 if all(g.kind == GridKind.INTEGER for g in grids) else np.float64
    table = np.array(columns, dtype).T
    names = [Channel("", f"needle {c}") for c in range(len(columns))]
    ends = np.cumsum(split or [len(columns)]).tolist()
    joints = tuple(
        Joint(f"panel {j}", channels=tuple(names[a:b]))
        for j, (a, b) in enumerate(zip([0, *ends], ends, strict=False))
    )
    signal = Signal(table, tuple(grids), **more)
    return Motion(Skeleton(joints), (signal,), name="panel")


def wave(n_rows: int, seed: int = 0) -> list[float]:
    """Hundredths of a smooth curve with some noise: about -60 to 60, no two alike by ``seed``."""
    places = [(row + 7 * seed) % 96 - 48 for row in range(n_rows)]
    smooth = [x * (48 - abs(x)) * 10 for x in places]
    return [(s + (row * row * 37 + seed * 11) % 23) / 100 for row, s in enumerate(smooth)]


def with_exceptions() -> Motion:
    spelled: list[tuple[int, int, bytes, float]] = [
        (0, 0, b"1e3", 1e3),
        (0, 5, b"-NaN", NOT_A_NUMBER),
        (1, 0, b"+5", 5.0),
        (1, 1, b"Infinity", INFINITE),
        (1, 4, b"-1.#INF00", -INFINITE),
        (2, 3, b"007", 7.0),
        (3, 0, b".1", 0.1),
        (3, 3, b"1e-400", 0.0),
        (3, 5, b"12.", 12.0),
    ]
    rows, columns, texts, meant = zip(*spelled, strict=True)
    values = numbers(4, 6)
    values[rows, columns] = meant
    exceptions = Exceptions(np.array(rows), np.array(columns), texts)
    return dance(signals=(Signal(values, (HUNDREDTHS,) * 6, exceptions=exceptions),))


def with_grid_changes() -> Motion:
    """Seven frames; frames 2 to 4 become a segment of their own."""
    values = numbers(7, 6)
    values[2:5, 1] = [0.1, -0.0, 1e-9]
    values[2:5, 5] = [3.0, -4.0, 5.0]
    changes = (
        (2, 1, Grid(GridKind.TEXT64)),
        (2, 5, Grid(GridKind.FIXED, 0)),
        (5, 1, HUNDREDTHS),
        (5, 5, HUNDREDTHS),
    )
    return dance(signals=(Signal(values, (HUNDREDTHS,) * 6, grid_changes=changes),))


def with_mask() -> Motion:
    mask = np.ones((4, 6), np.bool_)
    mask[0:2, 4], mask[2, 5] = False, False
    return dance(signals=(Signal(numbers(4, 6), (HUNDREDTHS,) * 6, mask=mask),))
