"""Compiled: integers of roughly known size, coded by their bit length, and tables of them.

One function serves encoder and decoder. SPEC.md, "Residuals" and "Bases", are normative; a codec
defines the scales and neighbors of an integer, and has contexts of its own. Imported on first use
only.
"""

from __future__ import annotations

from mcz.codecs.coding.mixing import code_bits, code_mixed
from mcz.kernels import kernel
from mcz.kernels.types import Bytes, Ints, Ints2

# First context of each kind of bit, and its mixer; "more" has twelve, by how far the length is.
C_BELOW, C_LESS, C_MORE, C_SECOND, C_THIRD, C_SIDE, N_CONTEXTS = 0, 72, 152, 2072, 2232, 2552, 2568
M_BELOW, M_LESS, M_MORE, M_SECOND, M_THIRD, M_SIDE, N_MIXERS = 0, 1, 2, 14, 15, 16, 17

FAULT = -(1 << 62)
LENGTH_BITS = 6  # of the length of a first number


def bits(value: int) -> int:
    """Bits of ``value`` >= 0 without leading zeros."""
    n = 0
    for half in (32, 16, 8, 4, 2, 1):  # far quicker than bit by bit
        if value >> half:
            value >>= half
            n += half
    return n + value


def quarters(value: int) -> int:
    """Approximate 4 log2(value), value >= 1, at most 111."""
    n = bits(value)
    return min(4 * (n - 1) + ((value << 2) >> (n - 1) & 3), 111)  # RESID-01


def clamp(value: int, low: int, high: int) -> int:
    """``value``, or the nearer bound if it is outside of [low, high]."""
    return min(max(value, low), high)


def side_of(value: int) -> int:
    """0 for 0, 1 above it, 2 below."""
    return 0 if value == 0 else 1 if value > 0 else 2


def code_first(state: Ints, data: Bytes, value: int) -> int:
    """Code a number of unknown size: its length, its bits, its sign."""
    length = code_bits(state, data, bits(abs(value)), LENGTH_BITS)
    if length > 41:  # QBC-19
        return FAULT
    if length == 0:
        return 0
    size = 1 << (length - 1) | code_bits(state, data, abs(value), length - 1)  # QBC-17
    return -size if code_bits(state, data, 1 if value < 0 else 0, 1) else size  # QBC-17


def code_residual(
    state: Ints,
    data: Bytes,
    residual: int,
    scales: tuple[int, int],
    near: int,
    sides: tuple[int, int, int],
    first: tuple[int, int],
) -> int:
    """Code an integer of about the size of ``scales``, in sixteenths; FAULT if it is too long.

    ``near`` (0 to 7) and ``sides`` (0 none, 1 above, 2 below; the third also 3) depend on its
    neighbors; ``first`` are the first context and mixer of the codec's residuals.
    """
    kf, ks = quarters(scales[0] + 1), quarters(scales[1] + 1)
    size = abs(residual)
    length = code_length(state, data, bits(size), kf, ks, near, first)
    if length < 0:
        return FAULT
    if length == 0:
        return 0
    coded_size = code_size(state, data, size, length, kf, ks, first)
    at = first[0] + C_SIDE
    b = at + 3 + 3 * sides[0] + sides[1]
    side = 1 if residual < 0 else 0
    side = code_mixed(state, data, side, first[1] + M_SIDE, at + sides[0], b, at + 12 + sides[2])
    return -coded_size if side == 1 else coded_size


def code_length(
    state: Ints, data: Bytes, length: int, kf: int, ks: int, near: int, first: tuple[int, int]
) -> int:
    """Code the bit length of a residual: first if it is below a usual least length."""
    contexts, mixers = first
    cf, cs = kf if kf < 28 else 28 + (kf & 3), ks if ks < 28 else 28 + (ks & 3)
    bf, bs = octave(kf), octave(ks)
    base = max(0, min(bf, bs) - 2)
    if base > 0:
        below = 1 if length < base else 0
        a, b = contexts + C_BELOW + cf, contexts + C_BELOW + 32 + cs
        if code_mixed(state, data, below, mixers + M_BELOW, a, b, contexts + C_BELOW + 64 + near):
            at = base - 1
            while at > 0:
                less = 1 if length < at else 0
                # RESID-01
                a, b = contexts + C_LESS + min(base - at, 15), contexts + C_LESS + 16 + cf
                c = contexts + C_LESS + 48 + cs
                if not code_mixed(state, data, less, mixers + M_LESS, a, b, c):
                    break
                at -= 1
            return at
    at = base
    while at <= 53:  # RESID-02
        f, s = clamp(at - bf + 4, 0, 23), clamp(at - bs + 4, 0, 23)
        a, b = contexts + C_MORE + 24 * cf + f, contexts + C_MORE + 768 + 24 * cs + s
        c = contexts + C_MORE + 1536 + 2 * (24 * near + f) + (1 if bf > bs else 0)  # RESID-01
        more = 1 if length > at else 0
        if not code_mixed(state, data, more, mixers + M_MORE + min(f, 11), a, b, c):
            return at
        at += 1
    return -1


def octave(quarter: int) -> int:
    """Octave of a size in quarters of octaves, see ``quarters``; 0 up to 27 of them."""
    return 0 if quarter < 28 else (quarter - 24) >> 2


def code_size(
    state: Ints, data: Bytes, size: int, length: int, kf: int, ks: int, first: tuple[int, int]
) -> int:
    """Code all but the first of the ``length`` >= 1 bits of an absolute value."""
    contexts, mixers = first
    f, s = clamp(length - octave(kf) + 4, 0, 15), clamp(length - octave(ks) + 4, 0, 15)
    e, qf, qs = min(length, 31), kf & 3, ks & 3
    code = 1
    if length > 1:
        at = contexts + C_SECOND
        a, b = at + 4 * f + qf, at + 64 + 4 * s + qs  # RESID-01
        bit = size >> (length - 2) & 1
        code = 2 + code_mixed(state, data, bit, mixers + M_SECOND, a, b, at + 128 + e)
    if length > 2:
        at = contexts + C_THIRD + (code & 1)
        a, b = at + 8 * f + 2 * qf, at + 128 + 8 * s + 2 * qs  # RESID-01
        bit = size >> (length - 3) & 1
        code = 2 * code + code_mixed(state, data, bit, mixers + M_THIRD, a, b, at + 256 + 2 * e)
    if length > 3:
        code = code << (length - 3) | code_bits(state, data, size, length - 3)
    return code


MAX_INDEX = 1 << 40
MEANS = 0, 0  # residuals of a stream
BASIS = N_CONTEXTS, N_MIXERS


@kernel
def code_table(state: Ints, data: Bytes, table: Ints2, scales: Ints, is_basis: int) -> int:
    """Code a table (rows, channels) in place, rows from ``scales`` on; 1 for a fault."""
    for row in range(len(table)):
        fast = slow = scales[row] << 4
        near = side_1 = side_2 = 0
        for c in range(table.shape[1]):
            error = code_residual(
                state,
                data,
                table[row, c],
                (fast, slow),
                clamp(near + 3, 0, 7),
                (side_1, side_2, 3),
                BASIS if is_basis else MEANS,  # PCA-09
            )
            if error == FAULT or abs(error) > MAX_INDEX:  # PCA-12
                return 1
            table[row, c] = error
            size = abs(error) << 4
            near = (near + bits(size) - bits(slow)) >> 1
            fast += (size - fast) >> 2  # PCA-10
            slow += (size - slow) >> 4
            side_2, side_1 = side_1, side_of(error)
    return 0
