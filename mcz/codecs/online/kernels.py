"""Compiled: frames of a group, each predicted, quantized with a step of its own, and coded.

SPEC.md, "Codec 21: online", is normative and has the steps below in the same order. One function
serves encoder and decoder. Imported on first use only.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mcz.codecs.coding import mixing, residuals
from mcz.codecs.coding.mixing import code_adaptive, code_bits
from mcz.codecs.coding.residuals import bits
from mcz.codecs.online.rate_kernels import MOD as FIXED
from mcz.codecs.online.rate_kernels import (
    MODE,
    NEVER,
    begin_group,
    largest_of,
    ltr_step,
    settle,
    str_step,
)
from mcz.codecs.online.units import GOLOMB, INTRA, LTR, STR
from mcz.codecs.space import (
    LAST,
    MAX_INDEX,
    TRACK_SIZE,
    Transform,
    add_frame,
    code_frame,
    coefficient_of,
    index_of,
)
from mcz.kernels import kernel
from mcz.kernels.types import Bytes, Floats, Floats2, IntColumn, Ints, Ints2

__all__ = ["N_MEMORY", "TRACK_SIZE", "Choice", "Past", "decode_frames", "encode_frames"]


N_STEPS = 512
FIRST_STEP = 256  # the code of 1

# Contexts after those of residuals, or before all others.
C_PRESENT, C_SAME, C_LONGER, N_FLAGS = 0, 4, 6, 15
MIXED_FLAGS = 3 * residuals.N_CONTEXTS
GOLOMB_FLAGS = 0
C_PREFIX = N_FLAGS
CLASSES, PREFIX_BITS = 16, 4
MOST_ONES = 16  # of a Golomb-Rice prefix; then the rest follows in plain bits (ONLINE-20)

LAST_STEP, LTR_STEP, PRESENT, N_MEMORY = range(4)


class Past(NamedTuple):
    """Memory from frame to frame.

    ``values`` and ``reference`` (n_channels,) are the last frame and the last LTR; ``memory``
    (N_MEMORY,), ``lengths`` (n_matrices,), ``tracks`` (n_rows, TRACK_SIZE).
    """

    values: Floats
    reference: Floats
    memory: Ints
    lengths: Ints
    tracks: Ints2


class Choice(NamedTuple):
    """Encoder settings: ``analysis`` (n_rows, n_points) turns points into coefficients.

    ``n_group`` are the frames of the group; ``plan`` and the two tables of rates are those of
    ``rate_kernels``.
    """

    analysis: Floats2
    threshold: float
    n_group: int
    plan: Floats
    laplace: Floats
    gauss: Floats


def _ratio(code: int) -> float:
    """Step of a step code, about 2^((code - 256) / 8)."""
    return math.ldexp(float(8 + (code & 7)), int((code >> 3) - 35))  # ONLINE-24


def _code_step(state: Ints, data: Bytes, step: int, kind: int, memory: Ints, flags: int) -> int:
    """Code the step of a frame relative to the previous one; N_STEPS if it is invalid."""
    if kind == INTRA:
        return code_bits(state, data, step, 9)
    before = memory[LTR_STEP] if kind == LTR else memory[LAST_STEP]  # ONLINE-16
    change = step - before
    # ONLINE-16
    if code_adaptive(state, data, 1 if change == 0 else 0, flags + C_SAME + (1 if kind else 0)):
        return int(before)
    negative = code_bits(state, data, 1 if change < 0 else 0, 1)
    size, length = abs(change), 1
    while code_adaptive(
        state, data, 1 if bits(size) > length else 0, flags + C_LONGER + length - 1
    ):
        length += 1
        if length > 9:
            return N_STEPS  # ONLINE-17
    size = 1 << (length - 1) | code_bits(state, data, size, length - 1)
    coded = before - size if negative else before + size
    return int(coded) if 0 <= coded < N_STEPS else N_STEPS  # ONLINE-17, ONLINE-18


def _code_golomb(
    state: Ints, data: Bytes, indices: Ints, sizes: IntColumn, starts: Ints, kind: int
) -> int:
    """Code ``indices`` (n_rows,) in place, ``sizes`` those before; 1 if that is impossible."""
    for m in range(len(starts) - 1):
        one = two = 0
        for r in range(starts[m], starts[m + 1]):
            activity = 2 * one + two + 2 * sizes[r]  # ONLINE-20
            if r + 1 < starts[m + 1]:  # ONLINE-20
                activity += sizes[r + 1]
            size = _code_size(state, data, abs(indices[r]), activity, kind)
            if size > MAX_INDEX:  # ONLINE-22
                return 1
            indices[r] = -size if indices[r] < 0 else size
            two, one = one, size
    for r in range(len(indices)):
        size = abs(indices[r])
        if size and code_bits(state, data, 1 if indices[r] < 0 else 0, 1):  # ONLINE-20
            indices[r] = -size
        sizes[r] = 0 if kind else size  # ONLINE-20
    return 0


def _code_size(state: Ints, data: Bytes, size: int, activity: int, kind: int) -> int:
    """Code an absolute value by a Golomb-Rice code whose prefix is coded bit by bit."""
    rice = max(0, bits(activity) - 3)
    klass = activity if rice == 0 else 7 + min(rice, 8)
    context = C_PREFIX + (CLASSES * (1 if kind else 0) + klass) * PREFIX_BITS
    prefix, ones = size >> rice, 0
    while code_adaptive(
        state, data, 1 if prefix > ones else 0, context + min(ones, PREFIX_BITS - 1)
    ):
        ones += 1
        if ones == MOST_ONES:
            length = code_bits(state, data, bits(prefix - ones + 1), 6)
            if length == 0 or length > 42:  # ONLINE-21
                return MAX_INDEX + 1
            ones += (1 << (length - 1) | code_bits(state, data, prefix - ones + 1, length - 1)) - 1
            break
    if ones > MAX_INDEX >> rice:  # ONLINE-21, ONLINE-22
        return MAX_INDEX + 1
    return ones << rice | code_bits(state, data, size, rice)


def _code_frame(
    state: Ints,
    data: Bytes,
    coder: int,
    kind: int,
    indices: Ints,
    step: int,
    starts: Ints,
    past: Past,
) -> int:
    """Code ``indices`` (n_rows,) in place; return the code of their step, N_STEPS at a fault."""
    memory, lengths, tracks = past.memory, past.lengths, past.tracks
    flags = GOLOMB_FLAGS if coder == GOLOMB else MIXED_FLAGS
    if kind:
        lengths[:] = 0
        tracks[:] = 0  # ONLINE-19
    present = 0
    for index in indices:
        present |= 1 if index != 0 else 0
    context = kind + 1 if kind else memory[PRESENT]  # ONLINE-16
    present = code_adaptive(state, data, present, flags + C_PRESENT + context)
    memory[PRESENT] = 0 if kind else present  # ONLINE-16
    if present:
        step = _code_step(state, data, step, kind, memory, flags)
        if step == N_STEPS:
            return N_STEPS
        if coder == GOLOMB:
            fault = _code_golomb(state, data, indices, tracks[:, LAST], starts, kind)
        else:
            # ONLINE-19
            fault = code_frame(state, data, indices, starts, lengths, tracks, 1 if kind else 0)
        if fault:
            return N_STEPS
    elif kind == INTRA:  # ONLINE-16
        step = FIRST_STEP
    else:
        step = memory[LTR_STEP] if kind else memory[LAST_STEP]
    memory[LAST_STEP] = step
    if kind:
        memory[LTR_STEP] = step
    return step


def _predict(kind: int, values: Floats, reference: Floats) -> None:
    """Overwrite ``values`` with the prediction of a frame."""
    if kind == INTRA:
        values[:] = 0.0
    elif kind == LTR:
        values[:] = reference  # ONLINE-24


@kernel
def decode_frames(
    state: Ints, data: Bytes, coder: int, kind: int, out: Floats2, past: Past, transform: Transform
) -> int:
    """Decode the frames of a unit, (frames, n_channels), to ``out``; return a faulty one, or -1.

    ``kind`` is that of the first, all others are STR.
    """
    values, starts = past.values, transform.starts
    indices = np.zeros(len(transform.vectors), np.int64)
    sums = np.empty(transform.vectors.shape[1])
    for at in range(len(out)):
        indices[:] = 0
        code = _code_frame(state, data, coder, kind, indices, 0, starts, past)
        if code == N_STEPS:
            return at
        _predict(kind, values, past.reference)
        used = transform.step * _ratio(code)  # ONLINE-24
        add_frame(values, indices, transform, used, sums)
        out[at] = values
        if kind:  # ONLINE-24
            past.reference[:] = values
        kind = STR
    return -1


def _bits_of(state: Ints) -> float:
    """The bits that an encoder has written so far, with those that are still in the interval."""
    width = float(state[mixing.HIGH] - state[mixing.LOW]) + 1.0
    return float(8.0 * state[mixing.POSITION] + 32.0 - np.log2(width))


def _transform(
    coefficients: Floats,
    frame: Floats,
    values: Floats,
    transform: Transform,
    analysis: Floats2,
    points: Floats,
) -> None:
    """Coefficients (n_rows,) of the difference of ``frame`` and ``values``, in steps."""
    _, starts, columns, step, weights = transform
    for m in range(len(starts) - 1):
        for j in range(len(points)):
            c = columns[m, j]
            points[j] = (frame[c] - values[c]) / weights[c] / step
        for r in range(starts[m], starts[m + 1]):
            coefficients[r] = coefficient_of(points, analysis[r])


def _quantize(indices: Ints, coefficients: Floats, ratio: float, threshold: float) -> float:
    """Fill ``indices`` (n_rows,); return the mean square of their values, -1 at a fault."""
    squares = 0.0
    for r in range(len(indices)):
        indices[r] = index_of(coefficients[r] / ratio, threshold)
        if abs(indices[r]) > MAX_INDEX:
            return -1.0
        squares += (indices[r] * ratio) ** 2
    return squares / max(1, len(indices))


def _choose(
    indices: Ints, coefficients: Floats, target: float, threshold: float, is_fixed: bool
) -> tuple[int, float]:
    """Choose the step code next to ``target``, fill ``indices``; also return the mean square.

    If the step is not fixed, it grows until no coefficient is too large.
    """
    if target >= NEVER:
        indices[:] = 0
        return FIRST_STEP, 0.0
    code = int(min(max(np.rint(8.0 * target) + FIRST_STEP, 0), N_STEPS - 1))
    variance = _quantize(indices, coefficients, _ratio(code), threshold)
    while variance < 0 and not is_fixed and code < N_STEPS - 8:
        code += 8
        variance = _quantize(indices, coefficients, _ratio(code), threshold)
    return code, variance


@kernel
def encode_frames(
    state: Ints,
    data: Bytes,
    coder: int,
    kind: int,
    frames: Floats2,
    past: Past,
    transform: Transform,
    choice: Choice,
) -> int:
    """Code frames (frames, n_channels) of a group; otherwise as ``decode_frames``.

    Returns the frame with a value that is too large, which is neither coded nor remembered, or -1.
    """
    plan, n_group = choice.plan, choice.n_group
    values, vectors = past.values, transform.vectors
    indices = np.zeros(len(vectors), np.int64)
    coefficients = np.empty(len(vectors))
    sums, points = np.empty(vectors.shape[1]), np.empty(vectors.shape[1])
    predicted = np.empty(len(values))
    for at in range(len(frames)):
        predicted[:] = values
        _predict(kind, predicted, past.reference)
        _transform(coefficients, frames[at], predicted, transform, choice.analysis, points)
        if not largest_of(coefficients) < 2.0**80:  # NaN too
            return at
        if kind:
            begin_group(plan, n_group)
            target = ltr_step(plan, coefficients, kind == INTRA, n_group, choice.laplace)
        else:
            target = str_step(plan, len(coefficients), n_group, choice.gauss)
        code, variance = _choose(
            indices, coefficients, target, choice.threshold, plan[MODE] == FIXED
        )
        if variance < 0:
            return at
        if target < NEVER:
            target = np.log2(_ratio(code))
        before = _bits_of(state)
        code = _code_frame(state, data, coder, kind, indices, code, transform.starts, past)
        values[:] = predicted
        add_frame(values, indices, transform, transform.step * _ratio(code), sums)
        if kind:
            past.reference[:] = values
        settle(plan, kind, target, _bits_of(state) - before, variance)
        kind = STR
    return -1
