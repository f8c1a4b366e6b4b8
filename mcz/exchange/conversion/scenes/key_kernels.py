"""Compiled: keys chosen among frames, interpolation between them, and the resulting places of
nodes.

Keys are vectors of 3, with linear interpolation, or quaternions of 4, x y z w, with spherical
interpolation, as in glTF. Imported on first use only.
"""

from __future__ import annotations

import math

import numpy as np

from mcz.kernels import kernel
from mcz.kernels.types import Bytes, Floats, Floats2, Ints

STRAIGHT = 1e-12  # square of the distance of two quaternions between which all is linear


@kernel
def choose(times: Floats, exact: Floats2, rounded: Floats2, limits: Floats, kept: Bytes) -> None:
    """Mark in ``kept`` (n_frames,) the frames that become keys: from each the farthest possible.

    ``exact`` (n_frames, 3 or 4) are the targets, ``rounded`` the values of keys; ``limits``
    (n_frames,) are the greatest distances of interpolated values from their targets.
    """
    n = len(exact)
    interpolated = np.empty(4)
    kept[:] = 0
    kept[0] = 1
    first = 0
    while first < n - 1:
        low, step = first + 1, 2
        while first + step < n and _fits(
            times, exact, rounded, limits, first, first + step, interpolated
        ):
            low = first + step
            step *= 2
        high = min(first + step, n)
        while high - low > 1:
            middle = (low + high) // 2
            if _fits(times, exact, rounded, limits, first, middle, interpolated):
                low = middle
            else:
                high = middle
        first = low
        kept[first] = 1


def _fits(
    times: Floats,
    exact: Floats2,
    rounded: Floats2,
    limits: Floats,
    first: int,
    last: int,
    interpolated: Floats,
) -> bool:
    """Return True if all frames between two keys of one hemisphere are near enough."""
    width = exact.shape[1]
    angle = _angle(rounded[first], rounded[last], width)
    if angle < 0.0:
        return False
    span = times[last] - times[first]
    for frame in range(first + 1, last):
        share = (times[frame] - times[first]) / span
        _between(rounded[first], rounded[last], width, angle, share, interpolated)
        square = 0.0
        for k in range(width):
            square += (interpolated[k] - exact[frame, k]) ** 2
        if not square <= limits[frame] * limits[frame]:
            return False
    return True


def _angle(one: Floats, other: Floats, width: int) -> float:
    """Angle between quaternions, 0 if linear interpolation suffices; -1 beyond 90 degrees."""
    if width == 3:
        return 0.0
    dot, square = 0.0, 0.0
    for k in range(4):
        dot += one[k] * other[k]
        square += (one[k] - other[k]) ** 2
    if dot < 0.0:
        return -1.0
    if square < STRAIGHT:
        return 0.0
    half = 0.5 * math.exp(0.5 * math.log(square))  # the sine of half the angle
    angle = half
    for _ in range(4):
        angle -= (math.sin(angle) - half) / math.cos(angle)
    return 2.0 * angle


def _between(
    one: Floats, other: Floats, width: int, angle: float, share: float, out: Floats
) -> None:
    """Write the interpolation at ``share`` to ``out``; quaternions get the length 1."""
    start, end = 1.0 - share, share
    if angle > 0.0:
        sine = math.sin(angle)
        start, end = math.sin(start * angle) / sine, math.sin(end * angle) / sine
    square = 0.0
    for k in range(width):
        out[k] = start * one[k] + end * other[k]
        square += out[k] * out[k]
    if width == 4:
        for k in range(4):
            out[k] *= 1.5 - 0.5 * square  # as good as 1 / sqrt(square), so near to 1


@kernel
def fill(times: Floats, frames: Ints, keys: Floats2, first: int, key: int, out: Floats2) -> None:
    """Write the interpolation of keys from frame ``first`` on to ``out`` (n, 3 or 4).

    ``frames`` (n_keys,) and ``keys`` (n_keys, 3 or 4); key number ``key`` is the last one at or
    before frame ``first``. After the last key its value stays.
    """
    width = keys.shape[1]
    interpolated = np.empty(4)
    angle = -2.0
    for number in range(len(out)):
        frame = first + number
        while key + 1 < len(frames) and frames[key + 1] <= frame:
            key += 1
            angle = -2.0
        last = min(key + 1, len(frames) - 1)
        if angle < -1.5:
            angle = _angle(keys[key], keys[last], width)
        share = 0.0
        if last > key:
            start = times[frames[key]]
            share = (times[frame] - start) / (times[frames[last]] - start)
        _between(keys[key], keys[last], width, angle, share, interpolated)
        for k in range(width):
            out[number, k] = interpolated[k]


@kernel
def hang(
    above_turns: Floats2,
    above_places: Floats2,
    turns: Floats2,
    shifts: Floats2,
    out_turns: Floats2,
    out_places: Floats2,
) -> None:
    """Compute a node's turns and places in the world from its parent's.

    ``out_turns`` (n, 4) and ``out_places`` (n, 3); the others have n rows, or one for all frames.
    """
    for frame in range(len(out_places)):
        a = min(frame, len(above_turns) - 1)
        t = min(frame, len(turns) - 1)
        s = min(frame, len(shifts) - 1)
        p = min(frame, len(above_places) - 1)
        x, y, z, w = above_turns[a, 0], above_turns[a, 1], above_turns[a, 2], above_turns[a, 3]
        i, j, k, r = turns[t, 0], turns[t, 1], turns[t, 2], turns[t, 3]
        out_turns[frame, 0] = w * i + x * r + y * k - z * j
        out_turns[frame, 1] = w * j - x * k + y * r + z * i
        out_turns[frame, 2] = w * k + x * j - y * i + z * r
        out_turns[frame, 3] = w * r - x * i - y * j - z * k
        u, v, q = shifts[s, 0], shifts[s, 1], shifts[s, 2]
        # 2 (axis x shift), for shift + w c + axis x c
        c, d, e = 2.0 * (y * q - z * v), 2.0 * (z * u - x * q), 2.0 * (x * v - y * u)
        out_places[frame, 0] = above_places[p, 0] + u + w * c + y * e - z * d
        out_places[frame, 1] = above_places[p, 1] + v + w * d + z * c - x * e
        out_places[frame, 2] = above_places[p, 2] + q + w * e + x * d - y * c
