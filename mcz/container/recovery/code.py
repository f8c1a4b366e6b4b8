"""A Reed-Solomon erasure code over GF(2^16): any lost blocks from as many recovery blocks.

Recovery block i is the sum over the data blocks j of ``weight(j) / (i ^ (M + j))`` times block j,
where M is the least power of two that is not below the number of recovery blocks and ``^`` is
exclusive or. SPEC.md, "RECV", defines the rest. The same blocks come of
polynomials through runs of M data blocks, which is how they are computed.

Elements of the field are 16-bit integers, and adding is exclusive or. No library fits: galois has
the field, at some million products a second in arrays of its own; the quick ones (zfec, leopard)
are of GF(2^8), under other licences, or not on PyPI.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

from mcz.model.threads import in_force, in_order

Ints = NDArray[np.int64]

POLYNOMIAL = 0x1100B  # x^16 + x^12 + x^3 + x + 1, of which 2 is a generator
ORDER = (1 << 16) - 1  # of the elements but 0
BITS = 16


@cache
def logarithms() -> tuple[Ints, Ints]:
    """``exp[i] = 2^i`` for 0 <= i < 2 ORDER, and ``log``, whose entry for 0 is of no use."""
    exp = np.zeros(2 * ORDER, np.int64)
    value = 1
    for power in range(ORDER):
        exp[power] = exp[power + ORDER] = value
        value <<= 1
        if value > ORDER:
            value ^= POLYNOMIAL
    log = np.zeros(ORDER + 1, np.int64)
    log[exp[:ORDER]] = np.arange(ORDER)
    return exp, log


def times(a: int, b: int) -> int:
    """The product of two elements.

    >>> times(0x8000, 2) == 0x100B, times(7, 0)
    (True, 0)
    """
    if not a or not b:
        return 0
    exp, log = logarithms()
    return int(exp[log[a] + log[b]])


def over(a: int, b: int) -> int:
    if not a:
        return 0
    exp, log = logarithms()
    return int(exp[(log[a] - log[b]) % ORDER])


def log_of_product(values: Ints, axis: int = 0) -> Ints:
    """Logarithms of the products of elements, none of which is 0, along an axis."""
    _, log = logarithms()
    return np.asarray(log[values].sum(axis) % ORDER)


@cache
def skews() -> Ints:
    """(16, 16): entry [i, b] is the i-th normalized subspace polynomial at 2^b.

    s_0(x) = x, s_(i+1)(x) = s_i(x) (s_i(x) + s_i(2^i)); what is given is s_i(x) / s_i(2^i). It is
    linear, so that its value anywhere is a sum of these. Source: Lin, Chung and Han, "Novel
    polynomial basis and its application to Reed-Solomon erasure codes", FOCS 2014.
    """
    rows = [[1 << b for b in range(BITS)]]
    for i in range(BITS - 1):
        own = rows[i][i]
        rows.append([times(value, value ^ own) for value in rows[i]])
    table = [[over(value, row[i]) for value in row] for i, row in enumerate(rows)]
    return np.array(table, np.int64)


LANE = 8  # bytes of a lane: blocks are that many, or a multiple
MOST_POINTS = 1 << 16

Read = Callable[[int, int], Ints]  # data blocks start <= j < stop, (stop - start, lanes)


def runs_of(n_recovery: int) -> int:
    """M, the number of data blocks that one polynomial goes through."""
    return 1 << max(0, n_recovery - 1).bit_length()


def encode_blocks(read: Read, n_blocks: int, n_recovery: int, lanes: int) -> Ints:
    """The recovery blocks (n_recovery, lanes) of ``n_blocks`` that ``read`` gives."""
    from mcz.container.recovery.kernels import to_coefficients, to_values

    size = runs_of(n_recovery)
    levels = size.bit_length() - 1
    total = np.zeros((size, lanes), np.int64)
    for start in range(0, n_blocks, size):
        stop = min(start + size, n_blocks)
        run = np.zeros((size, lanes), np.int64)
        run[: stop - start] = read(start, stop)
        _by_columns(to_coefficients, run, levels, size + start)
        total ^= run
    _by_columns(to_values, total, levels, 0)
    return total[:n_recovery]


def _by_columns(transform: Callable[..., int], blocks: Ints, levels: int, offset: int) -> None:
    """Apply a transform, columns shared out among threads."""
    lanes = blocks.shape[1]
    parts = max(1, min(in_force(), lanes // 64))
    edges = [lanes * part // parts for part in range(parts + 1)]

    def work(part: int) -> int:
        own = blocks[:, edges[part] : edges[part + 1]]
        return transform(own, levels, offset, skews(), np.zeros(512, np.int64))

    for _ in in_order(work, range(parts), parts):
        pass


def recover_blocks(rest: Ints, lost: Sequence[int], rows: Sequence[int], n_recovery: int) -> Ints:
    """Solve for the ``lost`` data blocks by as many recovery blocks, the ``rows``.

    ``rest`` (len(rows), lanes): these recovery blocks minus the contribution of the intact data
    blocks.
    """
    from mcz.container.recovery.kernels import add_product

    size = runs_of(n_recovery)
    exp, _ = logarithms()
    inverse = _cauchy_inverse(np.array(rows, np.int64), size + np.array(lost, np.int64))
    weights = log_weights(np.array(lost, np.int64), size)
    found = np.zeros((len(lost), rest.shape[1]), np.int64)

    def solve(at: int) -> None:
        table = np.zeros(512, np.int64)
        for row in range(len(rows)):
            factor = int(exp[(inverse[at, row] - weights[at]) % ORDER])
            add_product(found[at], rest[row], factor, table)

    for _ in in_order(solve, range(len(lost)), in_force()):
        pass
    return found


def log_weights(blocks: Ints, size: int) -> Ints:
    """The logarithm of the weight of each data block: prod (M + j + l) / prod l, l below M."""
    points = size + blocks
    own = np.array([int(log_of_product(point ^ np.arange(size))) for point in points], np.int64)
    common = int(log_of_product(np.arange(1, size))) if size > 1 else 0
    return (own - common) % ORDER


def _cauchy_inverse(x: Ints, y: Ints) -> Ints:
    """Logarithms of the inverse of the matrix 1 / (x_i + y_j); entry [j, i]."""
    _, log = logarithms()
    between = log[x[:, None] ^ y[None, :]]  # [i, j]
    rows = between.sum(1)  # prod over j of x_i + y_j
    columns = between.sum(0)
    among_x = _log_differences(x)
    among_y = _log_differences(y)
    inverse = rows[None, :] + columns[:, None] - between.T - among_x[None, :] - among_y[:, None]
    return np.asarray(inverse % ORDER)


def _log_differences(points: Ints) -> Ints:
    """Logarithm of the product of each point's differences from the others."""
    _, log = logarithms()
    found = np.zeros(len(points), np.int64)
    for at, point in enumerate(points):
        found[at] = log[point ^ np.delete(points, at)].sum()
    return found
