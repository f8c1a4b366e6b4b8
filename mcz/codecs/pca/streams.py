"""The stream of one segment of principal components: means, basis, coefficients.

SPEC.md, "Codec 18: pca", is normative and has the steps below in the same order; names of fields
are its own. Coding and synthesis of coefficients are compiled: one function encodes and decodes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.coding import residuals
from mcz.codecs.coding.residuals import (
    FAULT,
    bits,
    clamp,
    code_first,
    code_residual,
    code_table,
    side_of,
)
from mcz.codecs.coding.streams import (
    choose_predictor,
    decode_stream,
    encode_stream,
    halves_of,
    scale_of,
    start_states,
)
from mcz.errors import FormatError, MotionError
from mcz.kernels import kernel
from mcz.kernels.types import Bytes, Floats, Floats2, Ints, Ints2
from mcz.model.schema import read_varint, varint

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


MAX_SHIFT = 40
MAX_SCALE = 62


@dataclass(frozen=True, slots=True)
class Components:
    """One segment in integers: means, basis (count, channels), shifts, coefficients, step code."""

    step: int
    means: Ints
    shifts: Ints
    basis: Ints
    coefficients: Ints


def build_stream(components: Components, *, scaled: bool) -> bytes:
    """The stream of a segment; raises MotionError for too large an integer."""
    parts = (components.means, components.basis, components.coefficients)
    if any(len(part) and np.abs(part).max(initial=0) > MAX_INDEX for part in parts):
        raise MotionError("pca: a coefficient exceeds 2^40 quantizer steps")
    if not components.means.any() and not len(components.basis):
        return b""
    mean_scale = halves_of(float(np.abs(components.means).mean()), MAX_SCALE)
    several = len(components.coefficients) > 1  # a first coefficient is not predicted
    forms = [
        choose_predictor(column) if several else (0, 0) for column in components.coefficients.T
    ]
    head = bytes((components.step,)) if scaled else b""
    sides = bytes(components.shifts.tolist())
    sides += bytes(min(halves, MAX_SCALE) | predictor << 6 for predictor, halves in forms)
    head += bytes((mean_scale,)) + varint(len(components.basis)) + sides
    count = components.means.size + components.basis.size + components.coefficients.size
    return head + encode_stream(
        start_states("pca")[0],
        4 * count + 256,
        lambda state, data: _loop(
            state,
            data,
            components.means.copy(),
            components.basis.copy(),
            components.coefficients.copy(),
            sides,
            mean_scale,
        ),
        "pca: a coefficient",
    )


def parse_stream(
    stream: bytes, n_channels: int, n_frames: int, n_decoded: int, *, scaled: bool
) -> Components:
    """The first ``n_decoded`` of ``n_frames`` frames; raises FormatError on bad bytes."""
    means = np.zeros(n_channels, np.int64)
    if not stream:
        nothing = np.zeros(0, np.int64)
        return Components(0, means, nothing, nothing.reshape(0, n_channels), nothing.reshape(0, 0))
    at = 1 if scaled else 0
    step, mean_scale = _byte(stream, 0) if scaled else 0, _byte(stream, at)
    count, at = read_varint(stream, at + 1)
    if count > min(n_channels, n_frames + 1):  # PCA-06
        raise FormatError(
            f"pca: {count} components are too many for {n_channels} channels and {n_frames} frames"
        )
    sides = stream[at : at + 2 * count]
    if len(sides) < 2 * count:
        raise FormatError(f"pca: a stream of {len(stream)} bytes is truncated in its head")
    if max(sides[:count], default=0) > MAX_SHIFT or mean_scale > MAX_SCALE:  # PCA-07, PCA-08
        raise FormatError(f"pca: a scale of {mean_scale} or a shift is out of range")
    if any(form & 63 > MAX_SCALE for form in sides[count:]):  # PCA-07
        raise FormatError("pca: the form of a component has the scale 63")
    basis = np.zeros((count, n_channels), np.int64)
    rows = np.zeros((n_decoded, count), np.int64)
    decode_stream(
        stream[at + 2 * count :],
        start_states("pca")[0],  # PCA-09
        lambda state, data: _loop(state, data, means, basis, rows, sides, mean_scale),
        "pca: a mean, a basis or a coefficient",
        whole=n_decoded == n_frames,  # PCA-14
    )
    shifts = np.frombuffer(sides[:count], "u1").astype(np.int64)
    return Components(step, means, shifts, basis, rows)


def _loop(
    state: Ints,
    data: NDArray[np.uint8],
    means: Ints,
    basis: Ints,
    rows: Ints,
    sides: bytes,
    mean_scale: int,
) -> bool:
    """Code all of a segment; ``sides`` are its shifts and forms."""
    count, n_channels = basis.shape
    scales = np.array([scale_of(mean_scale)])
    if code_table(state, data, means[None], scales, 0):
        return False
    # PCA-10
    scales = np.array([(1 << b) >> (n_channels.bit_length() // 2) for b in sides[:count]], np.int64)
    if code_table(state, data, basis, scales, 1):
        return False
    forms = sides[count:]
    predictors = np.array([form >> 6 for form in forms], np.int64)
    scales = np.array([scale_of(form & 63) for form in forms], np.int64)
    return bool(code_coefficients(state, data, rows, predictors, scales) < 0)


def _byte(stream: bytes, at: int) -> int:
    if at >= len(stream):
        raise FormatError(f"pca: a stream of {len(stream)} bytes is truncated in its head")
    return stream[at]
