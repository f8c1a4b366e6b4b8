"""Bases of frames: the orthonormal discrete cosine transform, and bases learned from motions.

SPEC.md, "Cosines", is normative for ``dct_matrix`` and has its steps in the same order, + - * /
only: every machine computes the same numbers, within 1e-15 of the true ones.

Learned spatial decorrelation is Algorithm 1 of J. Hou, L.-P. Chau, N. Magnenat-Thalmann, Y. He,
"Low-latency compression of mocap data using learned spatial decorrelation transform", CAGD 2016:
orthogonal bases that make the frames of a motion sparse. A basis B (J, J) holds its vectors as
rows; the coefficients of a frame m (J,) are B m. The algorithm seeks the B for which the squares
of all but the P largest coefficients of every frame sum to the least.

The problem is not convex. Started as published, from DCT or Haar and with the final P, the
algorithm stops in minima that differ by up to a factor of two; it is the start that decides which.
So P grows here from 1 to its final value, some iterations each: the strongest directions are found
first, and then the start matters much less (``mcz.codecs.training.Trained.better`` takes the
best of several). ``growth`` 0 is the algorithm as published.

Only encoders learn: a basis travels in a file, or is known by its hash, as integers.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from mcz.errors import OptionError
from mcz.kernels import kernel
from mcz.kernels.types import Floats2
from mcz.model.types import Floats

HALF_PI = 1.5707963267948966
NEWTON_STEPS = 40  # for a square root; half would suffice


@lru_cache(maxsize=16)
def dct_matrix(n: int) -> Floats:
    """The DCT-II of ``n`` points, (n, n), read-only: row k is the k-th basis vector."""
    if not n:
        return np.zeros((0, 0))
    cosine = _quarter(n)
    root = _root(2.0 / n)
    k, at = np.ogrid[:n, :n]
    turn = (2 * at + 1) * k % (4 * n)  # a full turn is 4 n
    turn = np.where(turn > 2 * n, 4 * n - turn, turn)
    matrix: Floats = np.where(
        turn > n, -cosine[np.minimum(2 * n - turn, n)], cosine[np.minimum(turn, n)]
    )
    matrix *= root
    matrix[:1] = _root(1.0 / n)
    matrix.setflags(write=False)
    return matrix


def _quarter(n: int) -> Floats:
    """cos(m pi / (2 n)) for m = 0 to n."""
    m = np.arange(n + 1)
    x = (np.minimum(m, n - m) * HALF_PI) / n  # COS-01
    square = x * x
    cosine, sine = np.ones(n + 1), np.ones(n + 1)
    for i in range(9, 0, -1):
        cosine = 1.0 - square * cosine / ((2 * i - 1) * (2 * i))
        sine = 1.0 - square * sine / ((2 * i) * (2 * i + 1))
    return np.where(2 * m <= n, cosine, x * sine)  # COS-01


def _root(value: float) -> float:
    """The square root of a number from 2^-20 to 2."""
    root = 1.0
    for _ in range(NEWTON_STEPS):
        root = (root + value / root) / 2.0
    return root  # COS-01


BLOCK = 128  # frames; coefficients, magnitudes and ranks of 31 points then fit the second cache


@kernel
def truncate(
    columns: Floats2, rows: Floats2, basis: Floats2, n_kept: int, n_counted: int, products: Floats2
) -> float:
    """Keep the ``n_kept`` largest coefficients of every frame.

    ``columns`` (J, N) and ``rows`` (N, J) are the same frames m; ``basis`` (J, J) has the basis
    vectors as rows. ``products`` (J, J) becomes the sum over frames of e m^T, e being what is kept
    of basis @ m. Among equal magnitudes the lower index is kept. Returns the sum of the squares of
    all but the ``n_counted`` largest.
    """
    n_points, n_frames = columns.shape
    coefficients = np.empty((n_points, BLOCK))
    magnitudes = np.empty((n_points, BLOCK))
    ranks = np.empty((n_points, BLOCK), np.int64)
    products[:] = 0.0
    dropped = 0.0
    for start in range(0, n_frames, BLOCK):
        width = min(BLOCK, n_frames - start)
        for k in range(n_points):
            line = coefficients[k]
            line[:] = 0.0
            for j in range(n_points):
                factor = basis[k, j]
                source = columns[j, start : start + width]
                for i in range(width):
                    line[i] += factor * source[i]
            for i in range(width):
                magnitudes[k, i] = abs(line[i])
                ranks[k, i] = 0
        for k in range(1, n_points):
            for l in range(k):  # noqa: E741
                for i in range(width):
                    first = int(magnitudes[l, i] >= magnitudes[k, i])
                    ranks[k, i] += first
                    ranks[l, i] += 1 - first
        for i in range(width):
            frame = rows[start + i]
            for k in range(n_points):
                value = coefficients[k, i]
                if ranks[k, i] >= n_counted:
                    dropped += value * value
                if ranks[k, i] < n_kept:
                    for j in range(n_points):
                        products[k, j] += value * frame[j]
    return dropped


Progress = Callable[[int, int], None]  # iterations done, iterations at most

SPARSITY = 8  # coefficients kept of each frame of 31 points; the paper's best, Fig. 4
ITERATIONS = 300
GROWTH = 40  # iterations with each smaller sparsity, before these
SETTLED = 1e-9  # least relative gain, over PATIENCE iterations, that justifies going on
PATIENCE = 10
HAAR_LEVELS = 3


@dataclass(frozen=True, slots=True, eq=False)
class Learned:
    """A basis, and the history of its search.

    ``basis`` float64 (J, J), orthogonal, its rows by falling energy of their coefficients over the
    training frames, the entry of greatest magnitude of each positive. ``objective`` (K + 1,): the
    squares that are left out, in squared units of the frames, summed over all frames, with the
    start and after each of K iterations, always for the final sparsity.
    """

    basis: Floats
    objective: Floats
    # of the first iterations, while P grew: only later ones never increase the objective
    n_growth: int

    @property
    def n_iterations(self) -> int:
        return len(self.objective) - 1


def learn_basis(
    frames: Floats,
    *,
    sparsity: int = SPARSITY,
    iterations: int = ITERATIONS,
    growth: int = GROWTH,
    start: str | Floats = "dct",
    progress: Progress | None = None,
) -> Learned:
    """A basis for ``frames``, float64 (N, J): N frames of one coordinate of J points.

    ``sparsity`` is the paper's P, the number of coefficients kept of each frame, 1 to J; ``start``
    is "dct", "haar" or an orthogonal matrix (J, J) with basis vectors as rows. At most
    ``iterations`` with that sparsity, fewer if the objective has settled, after ``growth`` with
    each smaller one. The same input gives the same bytes on the same machine. Raises OptionError
    if there is no frame or a value is not finite, and for a sparsity, a number or a start that
    does not fit.
    """
    rows = _checked_frames(frames)
    n_points = rows.shape[1]
    _check_options(sparsity, iterations, growth, n_points)
    basis = start_basis(start, n_points)
    columns = np.ascontiguousarray(rows.T)
    products = np.empty((n_points, n_points))
    kept = [n for n in range(1, sparsity) for _ in range(growth)]
    n_growth, at_most = len(kept), len(kept) + iterations
    kept += [sparsity] * (iterations + 1)
    objective: list[float] = []
    for done, n_kept in enumerate(kept):
        objective.append(truncate(columns, rows, basis, n_kept, sparsity, products))
        if progress is not None:
            progress(done, at_most)
        if done == at_most or has_converged(objective[n_growth:]):
            break
        basis = procrustes(products)
    return Learned(order_basis(basis, rows), np.array(objective), n_growth)


def learn_bases(
    positions: Floats,
    *,
    sparsity: int = SPARSITY,
    iterations: int = ITERATIONS,
    growth: int = GROWTH,
    start: str | Floats = "dct",
    progress: Progress | None = None,
) -> tuple[Learned, ...]:
    """A basis for each coordinate of ``positions``, float64 (N, J, D); D is 3 for x, y and z.

    ``progress`` counts the iterations of all. Otherwise as ``learn_basis``.
    """
    if positions.ndim != 3:
        raise OptionError(
            f"positions have shape {positions.shape}; it must be (frames, points, axes)"
        )
    n_axes = positions.shape[2]
    bases: list[Learned] = []
    while len(bases) < n_axes:

        def report(done: int, at_most: int, before: int = len(bases)) -> None:
            if progress is not None:
                progress(before * at_most + done, n_axes * at_most)

        bases.append(
            learn_basis(
                positions[:, :, len(bases)],
                sparsity=sparsity,
                iterations=iterations,
                growth=growth,
                start=start,
                progress=report,
            )
        )
    return tuple(bases)


def procrustes(products: Floats) -> Floats:
    """The orthogonal B (J, J) for which the sum of |B m - e|^2 is the least.

    ``products`` (J, J) is the sum of e m^T over the frames. With its decomposition V S U^T, the
    transpose of equation 10, B is V U^T (equation 11).
    """
    left, _, right = np.linalg.svd(products)
    return np.ascontiguousarray(left @ right)


def has_converged(objective: Sequence[float]) -> bool:
    """Return True if the last ``PATIENCE`` iterations gained next to nothing."""
    if len(objective) <= PATIENCE:
        return False
    before = objective[-1 - PATIENCE]
    return before - objective[-1] <= SETTLED * before


def order_basis(basis: Floats, frames: Floats) -> Floats:
    """``basis`` with its rows by falling energy over ``frames`` (N, J), and with fixed signs.

    The entry of greatest magnitude of a row, the first of equal ones, becomes positive.
    """
    energy = np.einsum("ki,ij,kj->k", basis, frames.T @ frames, basis)
    basis = basis[np.argsort(-energy, kind="stable")]
    peaks = np.take_along_axis(basis, np.abs(basis).argmax(axis=1)[:, None], axis=1)
    return np.ascontiguousarray(np.where(peaks < 0, -basis, basis))


def start_basis(start: str | Floats, n_points: int) -> Floats:
    """The orthogonal matrix (J, J) that ``start`` names or is."""
    if not isinstance(start, str):
        matrix = np.ascontiguousarray(start, np.float64)
        if matrix.shape != (n_points, n_points):
            raise OptionError(f"start has shape {matrix.shape}; expected {n_points} x {n_points}")
        if not np.abs(matrix @ matrix.T - np.eye(n_points)).max(initial=0.0) <= 1e-6:
            raise OptionError("start is not an orthogonal matrix")
        return matrix
    if start not in STARTS:
        raise OptionError(f"start is {start!r}; it must be one of {', '.join(STARTS)}")
    return STARTS[start](n_points)


def haar_basis(n_points: int) -> Floats:
    """The orthonormal Haar transform of three levels, (J, J), for any number of points.

    A level turns neighbors a, b into (a + b) / sqrt(2) and (a - b) / sqrt(2); if the number is
    odd, the last goes on to the next level as it is. Rows: what is left after the last level, then
    the differences from the last level to the first. Fewer levels if one point is left.
    """
    approx: list[Floats] = list(np.eye(n_points))
    details: list[Floats] = []
    for _ in range(HAAR_LEVELS):
        pairs = list(zip(approx[::2], approx[1::2], strict=False))
        last = approx[2 * len(pairs) :]
        approx = [(a + b) / np.sqrt(2) for a, b in pairs] + last
        details = [(a - b) / np.sqrt(2) for a, b in pairs] + details
    return np.array(approx + details)


STARTS: dict[str, Callable[[int], Floats]] = {"dct": dct_matrix, "haar": haar_basis}


def _check_options(sparsity: int, iterations: int, growth: int, n_points: int) -> None:
    if not 1 <= sparsity <= n_points:
        raise OptionError(
            f"sparsity is {sparsity}; it must be 1 to {n_points}, the number of points"
        )
    if iterations < 0 or growth < 0:
        raise OptionError(
            f"iterations is {iterations} and growth {growth}; neither may be negative"
        )


def _checked_frames(frames: Floats) -> Floats:
    """``frames`` as float64 (N, J) in row order; raises OptionError for unusable ones."""
    if frames.ndim != 2 or not frames.size:
        raise OptionError(
            f"frames have shape {frames.shape}; at least one frame of one point is needed"
        )
    rows = np.ascontiguousarray(frames, np.float64)
    if not np.isfinite(rows).all():
        raise OptionError("a value of the training frames is not finite")
    return rows
