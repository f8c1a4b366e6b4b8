"""Compiled: the coefficients of one segment, coded as residuals, and their synthesis.

SPEC.md, "Codec 18: pca", is normative and has the steps below in the same order. One function
serves encoder and decoder. Imported on first use only.
"""

from __future__ import annotations

import numpy as np

from mcz.codecs.coding import residuals
from mcz.codecs.coding.residuals import FAULT, bits, clamp, code_first, code_residual, side_of
from mcz.kernels import kernel
from mcz.kernels.types import Bytes, Floats, Floats2, Ints, Ints2

MAX_INDEX = 1 << 40
COEFFICIENTS = 2 * residuals.N_CONTEXTS, 2 * residuals.N_MIXERS
N_SETS = 3

FAST, SLOW, SIDE_1, SIDE_2, MOVED, TRACK_SIZE = range(6)  # remembered of a component


def predict(rows: Ints2, at: int, i: int, predictor: int) -> int:
    """Predict a coefficient from earlier ones of its component, by one of the four predictors."""
    step = rows[at - 1, i] - rows[at - 2, i] if at > 1 else 0
    if predictor == 0:
        return int(rows[at - 1, i])
    if predictor == 1:
        return int(rows[at - 1, i] + (step >> 1))
    if predictor == 2:
        return int(rows[at - 1, i] + step)
    before = rows[at - 2, i] - rows[at - 3, i] if at > 2 else 0
    return int(rows[at - 1, i] + ((3 * step - 2 * before) >> 2))  # PCA-11


@kernel
def code_coefficients(state: Ints, data: Bytes, rows: Ints2, predictors: Ints, scales: Ints) -> int:
    """Code coefficients (frames, components) in place; return the frame of a fault or -1."""
    count = rows.shape[1]
    tracks = np.zeros((count, TRACK_SIZE), np.int64)
    for i in range(count):
        tracks[i, FAST] = tracks[i, SLOW] = scales[i] << 4
    for i in range(count if len(rows) else 0):
        rows[0, i] = code_first(state, data, rows[0, i])
        if abs(rows[0, i]) > MAX_INDEX:
            return 0
    for at in range(1, len(rows)):
        near = 0
        for i in range(count):
            track = tracks[i]
            predicted = predict(rows, at, i, predictors[i])
            error = code_residual(
                state,
                data,
                rows[at, i] - predicted,
                (track[FAST], track[SLOW]),
                clamp(near + 3, 0, 7),
                (track[SIDE_1], track[SIDE_2], track[MOVED]),
                COEFFICIENTS,
            )
            if error == FAULT or abs(predicted + error) > MAX_INDEX:  # PCA-13
                return at
            rows[at, i] = predicted + error
            size = abs(error) << 4
            near = (near + bits(size) - bits(track[SLOW])) >> 1
            track[FAST] += (size - track[FAST]) >> 1
            track[SLOW] += (size - track[SLOW]) >> 5
            track[SIDE_2] = track[SIDE_1]
            track[SIDE_1] = side_of(error)
            if rows[at, i] != rows[at - 1, i]:  # PCA-11
                track[MOVED] = side_of(rows[at, i] - rows[at - 1, i])
    return -1


@kernel
def evaluate(out: Floats2, means: Floats, basis: Floats2, coefficients: Floats2) -> None:
    """Write means + coefficients (frames, components) times basis (components, channels)."""
    for f in range(len(out)):
        for c in range(out.shape[1]):
            out[f, c] = means[c]
        for i in range(len(basis)):  # PCA-17
            y = coefficients[f, i]
            for c in range(out.shape[1]):
                out[f, c] = out[f, c] + y * basis[i, c]  # CODEC-02
