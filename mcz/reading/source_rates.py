"""Frame rates that sources state where a clip has another one: one that was corrected.

The file as it was is restored as it was. Whatever else is written in its style, a part or a lossy
copy, states the rate of the clip where its format has a place for that.
"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcz.clock import SAME_RATE, usual_step
from mcz.formats import FORMATS
from mcz.motion import Motion


def stating_rate(motion: Motion, numbers: NDArray[np.int64] | None = None) -> Motion:
    """``motion`` with a source that states its rate; as it is where it cannot, or states none.

    ``numbers``: all frame numbers of a clip that it is a part of. Raises FormatError on bad bytes.
    """
    source, rate = motion.source, motion.frame_rate
    if source is None or rate is None:
        return motion
    step = usual_step(motion.frame_numbers if numbers is None else numbers)
    found = contradiction(source.format, source.template, rate, step)
    if found is None:
        return motion
    return replace(motion, source=replace(source, template=found.template))


def is_one_of(ratio: Fraction, step: int) -> bool:
    """Return whether two rates of this ratio agree, where frame numbers rise by ``step``."""
    return any(abs(ratio - n) <= SAME_RATE * n for n in (1, step))


def contradiction(format_name: str, template: bytes, rate: Fraction, step: int) -> Any:
    """The result of ``Format.restate`` where the template states another rate; else None."""
    restate = FORMATS[format_name].restate
    found = restate(template, rate) if restate is not None else None
    return None if found is None or is_one_of(found.rate / rate, step) else found
