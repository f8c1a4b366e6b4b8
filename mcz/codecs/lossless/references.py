"""The choice of the channels that ``best`` predicts a channel from.

mcz/codecs/lossless/README.md describes it. Nothing here is normative: any references decode.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Words = NDArray[np.int32]
Floats = NDArray[np.float64]

WINDOW = 96  # rows in which a channel is compared with others
CANDIDATES = 64  # channels that are compared at all
LEAST_GAIN, GAIN_ROWS = 0.05, 5.0  # octaves that one more must save; and in all rows together


def choose_references(leads: Words, most: int, most_in_all: int) -> list[tuple[int, ...]]:
    """The references of each channel of ``leads`` (rows, channels), all before it.

    At most ``most`` of one channel, and ``most_in_all`` together.
    """
    steps = np.diff(leads.astype(np.float64), axis=0, prepend=leads[:1])
    bends = _windows(np.diff(steps, axis=0, prepend=steps[:1]))
    found: list[tuple[int, ...]] = []
    for channel in range(leads.shape[1]):
        found.append(_explain(bends, channel, min(most, most_in_all)))
        most_in_all -= len(found[-1])
    return found


def _windows(values: Floats) -> Floats:
    """(windows, channels, rows of a window)."""
    n = len(values) // WINDOW
    parts = values[: n * WINDOW].reshape(n, WINDOW, -1) if n else values[None]
    return np.ascontiguousarray(parts.transpose(0, 2, 1))


def _explain(bends: Floats, channel: int, most: int) -> tuple[int, ...]:
    """Channels before ``channel`` that explain most of it, chosen one after the other."""
    rest, floor = bends[:, channel].copy(), bends.shape[2] * 0.5
    others = _candidates(bends, channel, rest, floor)
    least = LEAST_GAIN + GAIN_ROWS / (bends.shape[0] * bends.shape[2])
    left = bends[:, others].copy()
    chosen: list[int] = []
    while len(chosen) < min(most, len(others)):
        sizes = np.einsum("nkw,nkw->nk", left, left) + 1e-18
        gains = _gains(rest, left, sizes, floor)
        gains[[others.index(one) for one in chosen]] = 0
        best = int(np.argmin(gains))
        if -gains[best] < least:
            break
        chosen.append(others[best])
        direction = left[:, best] / np.sqrt(sizes[:, best])[:, None]
        rest = rest - direction * np.einsum("nw,nw->n", direction, rest)[:, None]
        shares = np.einsum("nw,nkw->nk", direction, left)
        left = left - direction[:, None] * shares[:, :, None]
    return tuple(chosen)


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
