"""Step codes: quantizer steps and weights of channels in one byte, four to the octave.

SPEC.md, "Steps and scales", is normative.
"""

from __future__ import annotations

import math

MIDDLE_CODE = 128  # the step code of 1


def ratio_of(code: int) -> float:
    """Step of a step code, about 2^((code - 128) / 4)."""
    return math.ldexp(4 + code % 4, code // 4 - 34)


def code_of(ratio: float) -> int:
    """The step code nearest to a ratio."""
    if ratio <= 0:
        return 0
    if ratio == math.inf:
        return 255
    guess = int(4 * math.log2(ratio)) + MIDDLE_CODE
    near = range(max(0, guess - 2), min(255, guess + 3) + 1)
    return min(
        near, key=lambda c: abs(math.log(ratio_of(c) / ratio)), default=0 if guess < 0 else 255
    )
