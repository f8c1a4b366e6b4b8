"""Valid: exceptions, grid changes, masks."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from mcz.container.segments import MASKS
from mcz.motion import Exceptions, Motion, Signal
from mcz.numbers import Grid, GridKind
from tools.vectors.craft import Vector, Whole, file_of, partial
from tools.vectors.edits import Made
from tools.vectors.motions import HUNDREDTHS, dance, numbers

INFINITE, NOT_A_NUMBER = float("inf"), float("nan")


def vectors() -> Iterable[Vector]:
    shelf = Whole("valid/notes")
    motion = with_exceptions()
    shelf.hold(
        "exceptions",
        "Group notes; Number grids",
        "Tokens that a grid does not print decode to their own value, in any spelling.",
        file_of(motion),
        motion,
        parts=(partial(motion, (1, 3), (1, 0)),),
    )
    motion = with_grid_changes()
    purpose = "Channels whose grid differs in one segment and is the clip's again in the next."
    part = partial(motion, (3, 6), (1,))
    shelf.hold("grid-changes", "Group notes", purpose, file_of(motion), motion, parts=(part,))
    motion = with_mask()
    purpose = "Invalid values keep their coordinates; one group is valid throughout."
    part = partial(motion, (1, 3), (1,))
    shelf.hold("masks", "Masks; CEND", purpose, file_of(motion), motion, parts=(part,))

    def all_ones(made: Made) -> Made:
        ((header, streams),) = made
        return [(replace(header, flags=header.flags | MASKS), [b"\x10", b"", *streams])]

    purpose = "A mask in which every value is valid is no part of the hash."
    data = file_of(dance(), segments=all_ones)
    shelf.hold("mask-of-ones", "Masks; CEND", purpose, data, dance())
    return shelf.vectors


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
