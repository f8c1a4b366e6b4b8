"""A bound on the greatest error, met where it is missed and not by a finer step everywhere.

A codec that takes part has a parameter ``refinement``: of each frame, by how many octaves the steps
of what bears upon it are to be finer.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.parameters import Dial
from mcz.errors import MotionError, OptionError
from mcz.types import JsonObject
from mcz.writing.trials import Floats, Target, Trials

REFINEMENT = "refinement"
MOST_OCTAVES = 7
MOST_ROUNDS = 10  # with one step
MOST_STEPS = 6
FINER = 0.85  # from one step to the next
MARGIN = 0.3  # octaves that are added to what a frame misses


def bounded(dial: Dial, target: Target, trial: Trials) -> tuple[JsonObject, dict[str, str]]:
    """A step and the refinement of frames that meet the bound, and what the record says of it.

    Raises OptionError where none that was tried does.
    """
    step = (dial.guess and dial.guess(target.name, target.limit)) or 1.0
    step = min(max(step, dial.low), dial.high)
    for _ in range(MOST_STEPS):
        octaves: NDArray[np.int64] = np.zeros(trial.motion.n_frames, np.int64)
        for _ in range(MOST_ROUNDS):
            found = {dial.parameter: step, REFINEMENT: octaves}
            errors = _errors(trial, found, target)
            if not (errors > target.limit).any():
                reached = float(errors.max(initial=0.0))
                return found, {"target_reached": repr(reached)}
            octaves = _refined(octaves, errors / target.limit)
        missed = f"{dial.parameter} {step:g} gives {errors.max():g}"
        step = max(step * FINER, dial.low)
    raise OptionError(f"{target.name} {target.limit:g} cannot be met: {missed}")


def _errors(trial: Trials, found: JsonObject, target: Target) -> Floats:
    try:
        return trial.frame_errors(found)
    except MotionError as error:
        raise OptionError(f"{target.name} {target.limit:g} cannot be met: {error}") from error


def _refined(octaves: NDArray[np.int64], ratios: Floats) -> NDArray[np.int64]:
    """More octaves where ``ratios`` (n_frames,) of errors to the bound exceed 1, and beside it."""
    with np.errstate(divide="ignore"):
        missing = np.where(ratios > 1, np.ceil(np.log2(ratios) + MARGIN), 0.0).astype(np.int64)
    padded = np.pad(missing, 1)
    added = np.maximum(missing, np.maximum(padded[:-2], padded[2:]))
    return np.minimum(octaves + added, MOST_OCTAVES)
