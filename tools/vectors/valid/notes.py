"""Valid: exceptions, grid changes, masks."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from mcz.container.segments import MASKS
from mcz.motion import Exceptions
from tools.vectors.build.edits import Made
from tools.vectors.build.files import Vector, Whole, file_of, partial
from tools.vectors.build.motions import (
    HUNDREDTHS,
    column,
    dance,
    with_exceptions,
    with_grid_changes,
    with_mask,
)
from tools.vectors.build.source_files import BOTH, ODD, take


def vectors() -> Iterable[Vector]:
    shelf = Whole("valid/notes")
    _notes(shelf)
    _every_sort(shelf)
    return shelf.vectors


def _notes(shelf: Whole) -> None:
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


def _every_sort(shelf: Whole) -> None:
    """A segment with streams of every sort."""
    odd = take(ODD, "odd")
    mask = np.ones(odd.signals[0].values.shape, np.bool_)
    mask[1, 2], mask[2:, 7] = False, False
    motion = replace(odd, signals=(replace(odd.signals[0], mask=mask),))
    data = file_of(motion)
    purpose = "Frame notes, group notes and masks, in this order before the codec's streams."
    parts = (partial(motion, (1, 3), (1,)),)
    shelf.hold(
        "all-sorts", "DATA; Frame notes; Group notes; Masks", purpose, data, motion,
        sources=(("odd.bvh", ODD),), modes=BOTH, parts=parts,
    )  # fmt: skip
    sorts = "qnan", "NAN(a_1)", "-1.#IND", "9.#snan7", "+iNf", "-INFINITY", "1.#INF"
    meant = [np.nan] * 4 + [np.inf, -np.inf, np.inf]
    texts = [b"nan", *(word.encode() for word in sorts[1:])]
    values = np.array(meant).reshape(-1, 1)
    _hold_tokens(shelf, "words", "Words for NaN and infinities, in any case.", texts, values)
    numbers_ = b"-0", b"-.0e9", b"+0.", b"1e999", b"-1e999", b"-1e-999", b"2.4e-324", b"2.5e-324"
    meant = [-0.0, -0.0, 0.0, np.inf, -np.inf, -0.0, 0.0, 5e-324]
    more = (b"9007199254740993", b"9007199254740992.9999999999999999999999", b"1E+05", b"0.1e-007")
    meant += [9007199254740992.0, 9007199254740992.0, 1e5, 1e-8]
    purpose = "Numbers beyond both ends of binary64, zeros with a sign, ties."
    _hold_tokens(shelf, "ends", purpose, [*numbers_, *more], np.array(meant).reshape(-1, 1))


def _hold_tokens(
    shelf: Whole, name: str, purpose: str, texts: list[bytes], values: np.ndarray
) -> None:
    """One channel of exceptions alone, which decode to ``values``."""
    rows = np.arange(len(texts))
    noted = Exceptions(rows, np.zeros_like(rows), tuple(texts))
    motion = column(values, HUNDREDTHS, exceptions=noted)
    data = file_of(motion)
    shelf.hold(f"tokens-{name}", "Group notes; Ordinal to text", purpose, data, motion)
