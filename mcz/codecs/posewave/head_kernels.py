"""Compiled: the head of a segment, which channels change and where all of them begin.

SPEC.md, "Codec 3: posewave", is normative. One function serves encoder and decoder. Imported on
first use only.
"""

from __future__ import annotations

from mcz.codecs.coding.mixing import code_adaptive, code_bits
from mcz.kernels import kernel
from mcz.kernels.types import Bytes, Ints

# First context of each kind of bit; each has one of every class of channel and one more.
MAX_LENGTH = 40  # bits of a number
N_CLASSES = 3  # rotations, positions, others
C_KEPT = 0  # 2 a class: by whether the channel before is kept
C_LENGTH = C_KEPT + 2 * N_CLASSES  # MAX_LENGTH a class, of kept channels and of constant ones
C_SIGN = C_LENGTH + 2 * N_CLASSES * MAX_LENGTH
C_SECOND = C_SIGN + 2 * N_CLASSES  # the bit after the first: MAX_LENGTH a class
N_CONTEXTS = C_SECOND + 2 * N_CLASSES * MAX_LENGTH


@kernel
def code_head(
    state: Ints, data: Bytes, first: int, classes: Ints, kept: Ints, numbers: Ints
) -> int:
    """Code ``kept`` and ``numbers``, (n_channels,) each, in place; 1 where that is impossible.

    ``classes`` are those of the channels, ``first`` is the context to begin with.
    """
    before = 1
    for c in range(len(classes)):
        before = code_adaptive(state, data, kept[c], first + C_KEPT + 2 * classes[c] + before)
        kept[c] = before  # PWAVE-18
        own = 2 * classes[c] + before
        number = code_number(state, data, first, own, numbers[c])
        if abs(number) >= 1 << MAX_LENGTH:
            return 1
        numbers[c] = number
    return 0


def code_number(state: Ints, data: Bytes, first: int, own: int, value: int) -> int:
    """Code an integer: how many bits it has, in unary, the bits after the first, its sign.

    ``own`` says whose contexts it has. Returns 2^MAX_LENGTH where it has too many bits.
    """
    size, length = abs(value), 0
    at = first + C_LENGTH + MAX_LENGTH * own
    while code_adaptive(state, data, 1 if size >> length else 0, at + length):
        length += 1
        if length == MAX_LENGTH:  # PWAVE-19, HOLD-08
            return 1 << MAX_LENGTH
    if length == 0:
        return 0
    coded = 1
    if length > 1:
        at = first + C_SECOND + MAX_LENGTH * own + length
        coded = 2 + code_adaptive(state, data, size >> (length - 2) & 1, at)
    if length > 2:
        coded = coded << (length - 2) | code_bits(state, data, size, length - 2)
    negative = code_adaptive(state, data, 1 if value < 0 else 0, first + C_SIGN + own)
    return -coded if negative else coded
