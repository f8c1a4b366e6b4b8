"""Compiled: the control points of one joint in one segment, coded as residuals, and the curves.

SPEC.md, "Codec 17: qbc", is normative and has the steps below in the same order. One function
serves encoder and decoder. The fit of curves to points binds no decoder. Imported on first use.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mcz.codecs.coding import residuals
from mcz.codecs.coding.mixing import code_mixed
from mcz.codecs.coding.residuals import FAULT, bits, clamp, code_first, code_residual, side_of
from mcz.kernels import kernel
from mcz.kernels.types import Bytes, Flags, FloatColumns, Floats, Floats2, Ints, Ints2

MAX_INDEX = 1 << 40  # of a control point

# Residuals of a detail stream: lengths of curves, inner breaks, middle points; then one flag.
LENGTHS = 0, 0
BREAKS = residuals.N_CONTEXTS, residuals.N_MIXERS
MIDDLES = 2 * residuals.N_CONTEXTS, 2 * residuals.N_MIXERS
C_LAST, M_LAST = 3 * residuals.N_CONTEXTS, 3 * residuals.N_MIXERS
N_DETAIL_MIXERS = M_LAST + 1

FAST, SLOW, SIDE_1, SIDE_2, TRACK_SIZE = range(5)  # state of a channel


def code_point(
    state: Ints, data: Bytes, point: Ints, predicted: Ints, tracks: Ints2, first: tuple[int, int]
) -> int:
    """Code the channels of one control point in place; 1 if that is impossible."""
    near, other_side = 0, 3
    for c in range(len(point)):
        track = tracks[c]
        sides = track[SIDE_1], track[SIDE_2], other_side
        scales = track[FAST], track[SLOW]
        error = code_residual(
            state, data, point[c] - predicted[c], scales, clamp(near + 3, 0, 7), sides, first
        )
        if error == FAULT or abs(predicted[c] + error) > MAX_INDEX:  # QBC-21
            return 1
        point[c] = predicted[c] + error
        size = abs(error) << 4
        near = (near + bits(size) - bits(track[SLOW])) >> 1
        track[FAST] += (size - track[FAST]) >> 1
        track[SLOW] += (size - track[SLOW]) >> 4  # QBC-18
        track[SIDE_2] = track[SIDE_1]
        track[SIDE_1] = other_side = side_of(error)  # QBC-18
    return 0


@kernel
def code_marks(state: Ints, data: Bytes, points: Ints2, count: int, scale: int) -> int:
    """Code points[:count], (n, channels), in place; return the index of a fault or -1."""
    n_channels = points.shape[1]
    tracks = np.zeros((n_channels, TRACK_SIZE), np.int64)
    tracks[:, FAST] = tracks[:, SLOW] = scale << 4
    for k in range(count):
        if k:
            fault = code_point(state, data, points[k], points[k - 1], tracks, LENGTHS)
            if fault:
                return k
            continue
        for c in range(n_channels):
            points[0, c] = code_first(state, data, points[0, c])
            if abs(points[0, c]) > MAX_INDEX:  # QBC-20
                return 0
    return -1


def towards(a: int, b: int, part: int, whole: int) -> int:
    """The integer nearest to a + (b - a) part / whole, halves up."""
    return int(a + (2 * (b - a) * part + whole) // (2 * whole))  # QBC-23


@kernel
def code_details(
    state: Ints,
    data: Bytes,
    marks: Ints2,
    frames: Ints,
    lengths: Ints,
    ends: Ints2,
    mids: Ints2,
    scales: Ints,
) -> int:
    """Code the curves between marks in place; return how many there are, or -1 for a fault.

    ``marks`` (k, channels) at ``frames`` (k,). ``lengths`` has the frames of each curve, ``ends``
    the control point at its end, ``mids`` its middle point; curve after curve.
    """
    n_channels = marks.shape[1]
    tracks = np.zeros((2, n_channels, TRACK_SIZE), np.int64)
    for kind in range(2):
        tracks[kind, :, FAST] = tracks[kind, :, SLOW] = scales[kind] << 4
    predicted = np.zeros(n_channels, np.int64)
    n_before = 0  # curves between the marks before
    curve = 0
    for k in range(len(frames) - 1):
        left = frames[k + 1] - frames[k]
        start = marks[k]
        n_here = 0
        while left:
            if curve >= len(lengths):
                return -1
            length = code_length(state, data, lengths[curve], left, n_here, n_before)
            if length < 1:
                return -1
            lengths[curve] = length
            for kind in range(2):
                point = ends[curve]
                if kind == 1:
                    point = mids[curve]
                for c in range(n_channels):
                    if kind == 0:
                        predicted[c] = towards(start[c], marks[k + 1, c], length, left)
                    else:
                        predicted[c] = (start[c] + ends[curve, c]) >> 1
                if (length == left) if kind == 0 else (length == 1):
                    for c in range(n_channels):
                        point[c] = predicted[c]
                elif code_point(
                    state,
                    data,
                    point,
                    predicted,
                    tracks[kind],
                    MIDDLES if kind else BREAKS,  # QBC-14
                ):
                    return -1
            start = ends[curve]
            left -= length
            n_here += 1
            curve += 1
        n_before = n_here  # QBC-23
    return curve


def code_length(
    state: Ints, data: Bytes, length: int, left: int, n_here: int, n_before: int
) -> int:
    """Code the length of a curve, at most ``left`` frames up to the next mark; 0 for a fault."""
    if left == 1:
        return 1
    a = C_LAST + min(bits(left), 15)
    b, c = C_LAST + 16 + min(n_here, 7), C_LAST + 24 + clamp(n_before - n_here, 0, 7)
    if code_mixed(state, data, 1 if length == left else 0, M_LAST, a, b, c):
        return left
    half = left >> 1
    error = code_residual(  # QBC-23
        state, data, length - half, (4 * left, left), min(n_here, 7), (0, 0, 3), LENGTHS
    )
    if error == FAULT or not 0 < half + error < left:  # QBC-24
        return 0
    return half + error


@kernel
def evaluate(
    out: FloatColumns,
    first: int,
    start: int,
    starts: Floats2,
    mids: Floats2,
    ends: Floats2,
    lengths: Ints,
) -> None:
    """Write the frames of curves that begin at ``start`` into ``out``, whose row 0 is ``first``.

    A curve gives its frames but the last, which is the first of the next.
    """
    at = start
    for k in range(len(lengths)):
        length = lengths[k]
        for i in range(max(0, first - at), min(length, first + len(out) - at)):
            t = i / length
            u = 1.0 - t
            a, b, c = u * u, 2.0 * t * u, t * t  # QBC-28
            row = at + i - first
            for channel in range(out.shape[1]):
                out[row, channel] = (
                    a * starts[k, channel] + b * mids[k, channel] + c * ends[k, channel]  # QBC-28
                )
        at += length


PUBLISHED, LEAST_SQUARES = 0, 1  # how a middle point is found


class Rule(NamedTuple):
    """Rule by which curves are fitted.

    ``closed``: ends and middle are rounded before the error is measured, so that the bound holds
    for decoded values. They are multiples of 1 / ``per``, or of ``step`` if ``per`` is 0.
    """

    method: int
    per: float
    step: float
    closed: int


def round_to_grid(value: float, per: float, step: float) -> float:
    """``value`` on the grid, halves away from zero; ``per`` 10^decimals, or 0 for ``step``."""
    scaled = abs(value) * per if per > 0 else abs(value) / step
    index = np.floor(scaled + 0.5)
    nearest = index / per if per > 0 else index * step
    return float(-nearest if value < 0 else nearest)


def middle(points: Floats2, a: int, b: int, ends: Floats2, method: int, out: Floats) -> None:
    """The middle control point of the curve over frames a to b, written to ``out``.

    ``ends`` are its end points, (2, channels).
    """
    n_channels = points.shape[1]
    length = b - a
    if length < 2:
        for c in range(n_channels):
            out[c] = ends[0, c]
        return
    if length == 2 and method == PUBLISHED:
        for c in range(n_channels):
            out[c] = points[a + 1, c]
        return
    for c in range(n_channels):
        out[c] = 0.0
    total = 0.0
    for i in range(1, length):
        t = i / length
        u = 1.0 - t
        weight = 2.0 * t * u
        share = 1.0 if method == PUBLISHED else weight
        total += share * weight
        for c in range(n_channels):
            rest = points[a + i, c] - u * u * ends[0, c] - t * t * ends[1, c]
            out[c] += share * rest
    for c in range(n_channels):
        out[c] /= total


def worst(
    points: Floats2, a: int, b: int, ends: Floats2, mid: Floats, enough: float
) -> tuple[float, int]:
    """The greatest squared distance from the curve, and its first frame.

    The search stops at the first distance above ``enough``.
    """
    n_channels = points.shape[1]
    length = b - a
    greatest, at = -1.0, a
    for i in range(length + 1):
        t = i / length if length else 0.0
        u = 1.0 - t
        square = 0.0
        for c in range(n_channels):
            curve = u * u * ends[0, c] + 2.0 * t * u * mid[c] + t * t * ends[1, c]
            square += (points[a + i, c] - curve) ** 2
        if square > greatest:
            greatest, at = square, a + i
            if greatest > enough:
                break
    return greatest, at


def fit(
    points: Floats2, exact: Floats2, a: int, b: int, rule: Rule, enough: float, work: Floats2
) -> tuple[float, int]:
    """Fit one curve; ``work`` (3, channels) then has its two ends and its middle.

    Ends come from ``exact``: the points, perhaps rounded.
    """
    for c in range(points.shape[1]):
        work[0, c], work[1, c] = exact[a, c], exact[b, c]
    middle(points, a, b, work[:2], rule.method, work[2])
    if rule.closed:
        for c in range(points.shape[1]):
            work[2, c] = round_to_grid(work[2, c], rule.per, rule.step)
    return worst(points, a, b, work[:2], work[2], enough)


@kernel
def breaks_by_splitting(
    points: Floats2, exact: Floats2, marks: Ints, limit: float, rule: Rule, is_break: Flags
) -> None:
    """Set ``is_break`` where curves meet between marks: split each at its worst frame."""
    work = np.zeros((3, points.shape[1]))
    stack = np.zeros((len(points) + 2, 2), np.int64)
    for k in range(len(marks) - 1):
        depth = 1
        stack[0, 0], stack[0, 1] = marks[k], marks[k + 1]
        while depth:
            depth -= 1
            a, b = stack[depth, 0], stack[depth, 1]
            greatest, at = fit(points, exact, a, b, rule, np.inf, work)
            if greatest <= limit or b - a < 2:
                continue
            if at == a or at == b:  # the ends themselves are rounded too far
                at = (a + b) // 2
            is_break[at] = True
            stack[depth, 0], stack[depth, 1] = a, at
            stack[depth + 1, 0], stack[depth + 1, 1] = at, b
            depth += 2


@kernel
def breaks_of_fewest(
    points: Floats2, exact: Floats2, marks: Ints, limit: float, rule: Rule, is_break: Flags
) -> None:
    """Set ``is_break`` at the fewest frames that keep the bound; the best fit of equal numbers.

    Dynamic programming between two marks: the work grows with the cube of their distance.
    """
    work = np.zeros((3, points.shape[1]))
    count, origin = np.empty(len(points), np.int64), np.empty(len(points), np.int64)
    error = np.empty(len(points))
    for k in range(len(marks) - 1):
        first, last = marks[k], marks[k + 1]
        size = last - first + 1
        count[:size] = size
        error[:size] = 0.0
        origin[:size] = 0
        count[0] = 0
        for b in range(1, size):
            for a in range(b - 1, -1, -1):
                if count[a] + 1 > count[b]:
                    continue
                greatest, _ = fit(points, exact, first + a, first + b, rule, limit, work)
                if greatest > limit and b - a > 1:
                    continue
                total = error[a] + greatest
                if count[a] + 1 < count[b] or total < error[b]:
                    count[b], error[b], origin[b] = count[a] + 1, total, a
        at = size - 1
        while at > 0:
            is_break[first + at] = True
            at = origin[at]


@kernel
def middles(out: Floats2, points: Floats2, exact: Floats2, breaks: Ints, method: int) -> None:
    """Write the middle point of every curve, unrounded, (curves, channels)."""
    ends = np.zeros((2, points.shape[1]))
    for k in range(len(breaks) - 1):
        for c in range(points.shape[1]):
            ends[0, c], ends[1, c] = exact[breaks[k], c], exact[breaks[k + 1], c]
        middle(points, breaks[k], breaks[k + 1], ends, method, out[k])
