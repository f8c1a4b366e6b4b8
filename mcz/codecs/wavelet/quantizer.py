"""Encoder choice of thresholds and quantizer steps for wavelets.

Source: Khan 2016, eq. 2; mcz/codecs/wavelet/README.md describes it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mcz.codecs.parameters import code_of, ratio_of
from mcz.errors import OptionError
from mcz.model.types import Floats, Ints

DEAD_ZONE = 0.8  # of a step: what is smaller becomes 0, where the step follows the threshold
LEAST_UNIT = 2.0**-100
GREATEST_LEAST = 2**39
TOO_LARGE = 2.0**41  # in place of what is beyond all integers: the coder refuses it, by name


@dataclass(frozen=True, slots=True)
class Quantizer:
    """Thresholds (n_channels,) and how a coefficient becomes an integer.

    With ``decimals`` it is rounded to so many, halves away from zero; otherwise steps follow the
    thresholds, as ``unit`` times what each channel's ``codes`` stand for.
    """

    thresholds: Floats
    decimals: int | None
    unit: float
    codes: tuple[int, ...]

    @property
    def least(self) -> int:
        """No detail that is not zero has a smaller magnitude."""
        if self.decimals is None or not len(self.thresholds):
            return 1
        least = math.floor(float(self.thresholds.min()) * 10.0**self.decimals + 0.5)
        return min(max(1, least), GREATEST_LEAST)

    def indices(self, coefficients: Floats, channel: int, *, detail: bool) -> Ints:
        """The integers of one band of a channel."""
        sizes = np.abs(coefficients)
        with np.errstate(over="ignore"):
            if self.decimals is not None:
                scaled = sizes * 10.0**self.decimals
                small = sizes <= self.thresholds[channel]
            else:
                scaled = sizes / (self.unit * ratio_of(self.codes[channel]))
                small = scaled < DEAD_ZONE
        indices = np.floor(scaled + 0.5)
        if detail:
            indices[small] = 0
        # NaN, too, where sums have overflowed
        capped = np.where(indices <= TOO_LARGE, indices, TOO_LARGE)
        return np.where(coefficients < 0, -capped, capped).astype(np.int64)


def make_quantizer(
    weights: Floats, T_g: float, decimals: int | None, name: str = "T_g"
) -> Quantizer:
    """The quantizer whose thresholds are T_g times ``weights``; ``name`` is that of T_g."""
    thresholds = T_g * weights
    unit = T_g / DEAD_ZONE if T_g > 0 else 1.0
    codes = tuple(code_of(float(weight)) for weight in weights)
    if decimals is None and (not T_g > 0 or unit < LEAST_UNIT):
        raise OptionError(
            f"{name} is {T_g:g} and Q is not given, so that there is no quantizer step"
        )
    return Quantizer(thresholds, decimals, unit, codes)
