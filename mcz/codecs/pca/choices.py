"""Encoder search for principal components and their integer form.

Source: Khan 2014, section 4; mcz/codecs/pca/README.md describes it. Nothing here is the same to the
last bit on every machine; what is decoded is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.pca.streams import MAX_INDEX, MAX_SHIFT, Components
from mcz.codecs.step_codes import code_of, ratio_of
from mcz.errors import MotionError

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MEAN_STEPS = 4  # of means in one of coefficients, where there is no Q
NOISE = 1.0  # of quantizing, as a share of what the components that are left out take away
FINEST = 2.0**-16  # of the greatest component or mean: no step is finer
LARGEST = 2.0**80
NEGLIGIBLE = 1e-24  # of the greatest energy: what is smaller is rounding
WELL_CONDITIONED = 1e4


@dataclass(frozen=True, slots=True)
class Grid:
    """The steps of a segment; ``code`` is that of the step where it is scaled."""

    step: float
    mean_step: float
    code: int


def grid_of(code: int) -> Grid:
    """Grid of a scale code that names no decimals."""
    step = ratio_of(code)
    return Grid(step, step / MEAN_STEPS, code)


def components_of(values: Floats, q: int, decimals: int | None, *, by_frame: bool) -> Components:
    """The q greatest components of one segment, (frames, channels), in integers.

    ``by_frame``: of each frame the mean over its channels is taken away, and kept as a component
    more, instead of the mean of each channel. Raises MotionError for values that are too large.
    """
    if np.abs(values).max(initial=0.0) > LARGEST:
        raise MotionError("pca: a value exceeds 2^40 quantizer steps")
    n_frames, n_channels = values.shape
    if not values.size:
        empty = np.zeros((0, n_channels), np.int64)
        return Components(0, np.zeros(n_channels, np.int64), np.zeros(0, np.int64), empty, empty.T)
    means = np.zeros(n_channels) if by_frame else values.mean(axis=0)
    rest = values - (values.mean(axis=1, keepdims=True) if by_frame else means)
    vectors, energies = principal_components(rest)
    # Without their mean the channels of a frame have a dimension less.
    q = min(q, len(energies), n_channels - 1 if by_frame else n_channels)
    grid = _decimal_grid(decimals) if decimals is not None else _grid(energies, q, means, n_frames)
    vectors = vectors[:q]
    sizes = np.sqrt(energies[:q] / n_frames)
    if decimals is not None:  # not the usual size of a coefficient but the greatest
        sizes = np.abs(rest @ vectors.T).max(axis=0, initial=0.0)
    fine = math.sqrt(n_channels) * np.maximum(sizes, 1e-300) / grid.step
    shifts = np.clip(np.ceil(np.log2(fine)), 0, MAX_SHIFT)
    basis = np.rint(np.ldexp(vectors, shifts.astype(np.int64)[:, None]))
    if by_frame:
        basis = np.concatenate([np.ones((1, n_channels)), basis])
        shifts = np.concatenate([[0.0], shifts])
    some = basis.any(axis=1)
    basis, powers = basis[some], shifts[some].astype(np.int64)
    mean_indices = _round_components(means, grid.mean_step, decimals)
    left = values - _values(mean_indices, grid.mean_step, decimals)
    real = np.ldexp(basis, -powers[:, None])
    indices = _round_components(_fit_components(real, left), grid.step, decimals)
    used = indices.any(axis=0)
    return Components(
        grid.code,
        mean_indices,
        powers[used],
        basis[used].astype(np.int64),
        np.ascontiguousarray(indices[:, used]),
    )


def principal_components(rest: Floats) -> tuple[Floats, Floats]:
    """Unit vectors (components, channels) and the energies along them, the greatest first.

    The largest entry of each vector is positive.
    """
    n_frames, n_channels = rest.shape
    scale = float(np.abs(rest).max(initial=0.0))
    if not scale > 0:
        return np.zeros((0, n_channels)), np.zeros(0)
    # Not by singular values: those take several threads, and on a busy machine 100 times as long.
    scaled = rest / scale
    if n_channels <= n_frames:
        vectors = np.linalg.eigh(scaled.T @ scaled)[1].T
    else:
        # The longest first: where one is nothing but rounding, as there always is when means have
        # been taken away, it must not come back at unit length along another.
        spanned = (scaled.T @ np.linalg.eigh(scaled @ scaled.T)[1])[:, ::-1]
        vectors = np.linalg.qr(spanned)[0].T
    energies = ((scaled @ vectors.T) ** 2).sum(axis=0)  # more exact than eigenvalues
    order = np.argsort(-energies, kind="stable")
    order = order[energies[order] > energies[order[0]] * NEGLIGIBLE]
    vectors = vectors[order]
    largest = np.take_along_axis(vectors, np.abs(vectors).argmax(axis=1)[:, None], axis=1)
    return vectors * np.where(largest < 0, -1.0, 1.0), energies[order] * scale**2


def _fit_components(basis: Floats, left: Floats) -> Floats:
    """Coefficients (frames, components) of least squares upon ``basis`` (components, channels)."""
    gram = basis @ basis.T
    if len(gram) and np.linalg.cond(gram) < WELL_CONDITIONED:
        return np.asarray(np.linalg.solve(gram, basis @ left.T).T)
    return np.asarray(np.linalg.lstsq(basis.T, left.T, rcond=None)[0].T)


def _grid(energies: Floats, q: int, means: Floats, n_frames: int) -> Grid:
    """Steps whose noise is ``NOISE`` of the energy of the omitted components."""
    lost = float(energies[q:].sum()) / n_frames
    step = math.sqrt(12 * NOISE * lost / q) if q else 0.0
    greatest = math.sqrt(float(energies[0]) / n_frames) if len(energies) else 0.0
    floor = FINEST * max(greatest, float(np.abs(means).max(initial=0.0)) / 16)
    return grid_of(code_of(max(step, floor)))


def _decimal_grid(decimals: int) -> Grid:
    return Grid(10.0**-decimals, 10.0**-decimals, 0)


def _round_components(values: Floats, step: float, decimals: int | None) -> Ints:
    """Integers, halves away from zero; raises MotionError where one is too large."""
    sizes = np.abs(values) / step if decimals is None else np.abs(values) * 10.0**decimals
    rounded = np.floor(sizes + 0.5)
    if not (rounded <= MAX_INDEX).all():
        raise MotionError("pca: a coefficient exceeds 2^40 quantizer steps")
    return np.where(values < 0, -rounded, rounded).astype(np.int64)


def _values(indices: Ints, step: float, decimals: int | None) -> Floats:
    return np.asarray(indices * step if decimals is None else indices / 10.0**decimals)
