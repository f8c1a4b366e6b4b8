"""A Reed-Solomon erasure code over GF(2^16): any lost blocks from as many recovery blocks.

Recovery block i is the sum over the data blocks j of ``weight(j) * block j / (i xor (M + j))``,
where M is the least power of two >= the number of recovery blocks. SPEC.md, "RECV", defines the
rest. The blocks are computed as polynomials through runs of M data blocks.

Elements of the field are 16-bit integers; their sum is exclusive or. No library fits: galois has
the field, but makes only some million products a second; fast ones (zfec, leopard) have GF(2^8),
other licenses, or no package on PyPI.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache

import numpy as np

from mcz.model.threads import map_in_order, thread_limit
from mcz.model.types import Ints

POLYNOMIAL = 0x1100B  # x^16 + x^12 + x^3 + x + 1, of which 2 is a generator
ORDER = (1 << 16) - 1  # number of elements other than 0
BITS = 16


@cache
def logarithms() -> tuple[Ints, Ints]:
    """``exp[i] = 2^i`` for 0 <= i < 2 ORDER, and ``log``, whose entry for 0 is unused."""
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


def multiply(a: int, b: int) -> int:
    """The product of two elements.

    >>> multiply(0x8000, 2) == 0x100B, multiply(7, 0)
    (True, 0)
    """
    if not a or not b:
        return 0
    exp, log = logarithms()
    return int(exp[log[a] + log[b]])


def divide(a: int, b: int) -> int:
    if not a:
        return 0
    exp, log = logarithms()
    return int(exp[(log[a] - log[b]) % ORDER])


def log_of_product(values: Ints) -> Ints:
    """Logarithms of the products of elements other than 0 along the first axis."""
    _, log = logarithms()
    return np.asarray(log[values].sum(0) % ORDER)


@cache
def skews() -> Ints:
    """(16, 16): entry [i, b] is the i-th normalized subspace polynomial at 2^b.

    s_0(x) = x, s_(i+1)(x) = s_i(x) (s_i(x) + s_i(2^i)); returned is s_i(x) / s_i(2^i). It is
    linear, so its value at x is a sum over the bits of x. Source: Lin, Chung and Han, "Novel
    polynomial basis and its application to Reed-Solomon erasure codes", FOCS 2014.
    """
    rows = [[1 << b for b in range(BITS)]]
    for i in range(BITS - 1):
        own = rows[i][i]
        rows.append([multiply(value, value ^ own) for value in rows[i]])
    table = [[divide(value, row[i]) for value in row] for i, row in enumerate(rows)]
    return np.array(table, np.int64)


LANE = 8  # bytes of a lane; the size of a block is a multiple
MOST_POINTS = 1 << 16

Read = Callable[[int, int], Ints]  # data blocks start <= j < stop, (stop - start, lanes)


def run_length(n_recovery: int) -> int:
    """M, the number of data blocks of one polynomial."""
    return 1 << max(0, n_recovery - 1).bit_length()


def encode_blocks(read: Read, n_blocks: int, n_recovery: int, lanes: int) -> Ints:
    """The recovery blocks (n_recovery, lanes) of the ``n_blocks`` that ``read`` returns."""
    from mcz.container.recovery.kernels import to_coefficients, to_values

    size = run_length(n_recovery)
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
    """Apply a transform, with the columns divided among threads."""
    lanes = blocks.shape[1]
    parts = max(1, min(thread_limit(), lanes // 64))
    edges = [lanes * part // parts for part in range(parts + 1)]

    def work(part: int) -> int:
        columns = blocks[:, edges[part] : edges[part + 1]]
        return transform(columns, levels, offset, skews(), np.zeros(512, np.int64))

    for _ in map_in_order(work, range(parts), parts):
        pass


def recover_blocks(rest: Ints, lost: Sequence[int], rows: Sequence[int], n_recovery: int) -> Ints:
    """Solve for the ``lost`` data blocks from the recovery blocks ``rows``, as many.

    ``rest`` (len(rows), lanes): these recovery blocks minus the contribution of the intact data
    blocks.
    """
    from mcz.container.recovery.kernels import add_product

    size = run_length(n_recovery)
    exp, _ = logarithms()
    inverse = _cauchy_inverse(np.array(rows, np.int64), size + np.array(lost, np.int64))
    weights = log_weights(np.array(lost, np.int64), size)
    solution = np.zeros((len(lost), rest.shape[1]), np.int64)

    def solve(at: int) -> None:
        table = np.zeros(512, np.int64)
        for row in range(len(rows)):
            factor = int(exp[(inverse[at, row] - weights[at]) % ORDER])
            add_product(solution[at], rest[row], factor, table)

    for _ in map_in_order(solve, range(len(lost)), thread_limit()):
        pass
    return solution


def log_weights(blocks: Ints, size: int) -> Ints:
    """Logarithms of weights of blocks j: product over l < M of (M + j) xor l, over prod l."""
    points = size + blocks
    products = np.array(
        [int(log_of_product(point ^ np.arange(size))) for point in points], np.int64
    )
    common = int(log_of_product(np.arange(1, size))) if size > 1 else 0
    return (products - common) % ORDER


def _cauchy_inverse(x: Ints, y: Ints) -> Ints:
    """Logarithms of the inverse of the matrix 1 / (x_i xor y_j); entry [j, i]."""
    _, log = logarithms()
    between = log[x[:, None] ^ y[None, :]]  # [i, j]
    rows = between.sum(1)  # prod over j of x_i xor y_j
    columns = between.sum(0)
    among_x = _log_differences(x)
    among_y = _log_differences(y)
    inverse = rows[None, :] + columns[:, None] - between.T - among_x[None, :] - among_y[:, None]
    return np.asarray(inverse % ORDER)


def _log_differences(points: Ints) -> Ints:
    _, log = logarithms()
    sums = np.zeros(len(points), np.int64)
    for at, point in enumerate(points):
        sums[at] = log[point ^ np.delete(points, at)].sum()
    return sums
