"""How an encoder of ``best`` chooses: units, and which channels a channel looks at.

mcz/codecs/lossless/README.md describes it. Nothing here is normative: any links decode.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mcz.coding.forms.lattice import Lattice
from mcz.coding.ordinals.choices import fixed_point

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]

MAX_UNIT, MAX_REACH = 44, 15
WINDOW = 96  # rows in which a channel is compared with others
CANDIDATES = 64  # channels that are compared at all
MOST = 8  # channels that one looks at
WORTH = -0.03  # octaves by which one more must make the rest smaller


def choose_links(
    coded: Ints, plans: Sequence[Ints], most: int
) -> list[tuple[int, int, tuple[int, ...]]]:
    """Of each coded channel the exponents of its units, and the channels that it looks at.

    ``coded`` (rows, channels) are the numbers that are coded; ``most`` is how many links all
    channels may have together.
    """
    shapes = [Lattice(*plan[:4].tolist()) for plan in plans]
    values = np.stack([fixed_point(c, s) for c, s in zip(coded.T, shapes, strict=True)], axis=1)
    grains = np.array([_grain(v, s) for v, s in zip(values.T, shapes, strict=True)])
    steps = np.diff(values, axis=0, prepend=values[:1])
    bends = _windows(np.diff(steps, axis=0, prepend=steps[:1]) / grains)
    found, left = [], most
    for channel in range(values.shape[1]):
        size = float(np.median(np.abs(steps[:, channel]))) * 1.5 + 1
        unit = min(round(np.log2(size)), MAX_UNIT)
        spread = round(np.log2(float(np.std(values[:, channel])) + 1))
        reach = min(max(spread, unit), unit + MAX_REACH)
        seen = _look(bends, channel, min(MOST, left))
        left -= len(seen)
        found.append((unit, reach, seen))
    return found


def _grain(values: Floats, shape: Lattice) -> float:
    """The step of a channel's numbers where they mostly are."""
    if shape.base != 10:
        return 1.0
    n_digits = np.floor(np.log10(np.maximum(np.abs(values), 1)) + 1e-12) + 1
    return float(np.median(10.0 ** np.maximum(n_digits - shape.digits, 0)))


def _windows(values: Floats) -> Floats:
    """(windows, channels, rows of a window)."""
    n = len(values) // WINDOW
    parts = values[: n * WINDOW].reshape(n, WINDOW, -1) if n else values[None]
    return np.ascontiguousarray(parts.transpose(0, 2, 1))


def _look(bends: Floats, channel: int, most: int) -> tuple[int, ...]:
    """Channels before ``channel`` that explain most of it, chosen one after the other."""
    rest, floor = bends[:, channel].copy(), bends.shape[2] * 0.5
    others = _candidates(bends, channel, rest, floor)
    left = bends[:, others].copy()
    seen: list[int] = []
    while len(seen) < min(most, len(others)):
        sizes = np.einsum("nkw,nkw->nk", left, left) + 1e-18
        gains = _gains(rest, left, sizes, floor)
        gains[[others.index(one) for one in seen]] = 0
        best = int(np.argmin(gains))
        if gains[best] > WORTH:
            break
        seen.append(others[best])
        direction = left[:, best] / np.sqrt(sizes[:, best])[:, None]
        rest = rest - direction * np.einsum("nw,nw->n", direction, rest)[:, None]
        shares = np.einsum("nw,nkw->nk", direction, left)
        left = left - direction[:, None] * shares[:, :, None]
    return tuple(seen)


def _candidates(bends: Floats, channel: int, rest: Floats, floor: float) -> list[int]:
    """The channels before ``channel`` that explain most of it alone."""
    if channel <= CANDIDATES:
        return list(range(channel))
    before = bends[:, :channel]
    gains = _gains(rest, before, np.einsum("nkw,nkw->nk", before, before) + 1e-18, floor)
    return sorted(np.argsort(gains, kind="stable")[:CANDIDATES].tolist())


def _gains(rest: Floats, others: Floats, sizes: Floats, floor: float) -> Floats:
    """Octaves by which each of ``others`` (windows, channels, rows) makes ``rest`` smaller."""
    products = np.einsum("nw,nkw->nk", rest, others)
    whole = np.einsum("nw,nw->n", rest, rest)[:, None]
    smaller = np.maximum(whole - products * products / sizes, 0)
    logs = np.log2(smaller + floor) - np.log2(whole + floor)
    return np.asarray(logs.mean(axis=0) * 0.5)
