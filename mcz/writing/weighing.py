"""Quality by joint: what joints weigh, so that each keeps the mean error that was asked for.

A codec that takes part has a parameter ``quality``, mean errors in cm of joints or groups of them,
and one ``weights``, what each joint counts for in its metric.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.parameters import Dial
from mcz.errors import OptionError
from mcz.kinematics.words import joints_of
from mcz.types import JsonObject, Params
from mcz.writing.trials import Trials

Floats = NDArray[np.float64]
Limits = Sequence[tuple[str, float]]  # a joint or a group of joints, and its limit in cm

QUALITY, WEIGHTS = "quality", "weights"
MOST_ROUNDS = 8
OVER = 1.15  # by how much more a weight grows than the square of what is missed
MOST_WEIGHT = 2.0**24


def weighted(
    dial: Dial, trial: Trials, limits: Limits, found: Params
) -> tuple[JsonObject, dict[str, str]]:
    """Weights with which the joints keep their ``limits``, with the parameters ``found``.

    Also returns what the quality record says of it. Raises OptionError where they cannot be kept.
    """
    skeleton = trial.motion.skeleton
    groups = [(name, joints_of(skeleton, name, QUALITY), limit) for name, limit in limits]
    given = found.get(WEIGHTS)
    weights = np.ones(skeleton.n_joints) if given is None else np.array(given)
    for _ in range(MOST_ROUNDS):
        errors = trial.joint_errors({**found, WEIGHTS: weights})
        means = [float(errors[joints].mean()) for _, joints, _ in groups]
        if all(mean <= limit for mean, (_, _, limit) in zip(means, groups, strict=True)):
            remarks = {
                f"quality_reached.{name}": repr(mean)
                for mean, (name, _, _) in zip(means, groups, strict=True)
            }
            return {WEIGHTS: weights}, remarks
        for mean, (_, joints, limit) in zip(means, groups, strict=True):
            if mean > limit:
                factor = (mean / limit) ** 2 * OVER
                weights[joints] = np.minimum(weights[joints] * factor, MOST_WEIGHT)
    worst = max(zip(means, groups, strict=True), key=lambda pair: pair[0] / pair[1][2])
    raise OptionError(
        f"quality: {worst[1][0]}={worst[1][2]:g}cm cannot be kept with {dial.parameter} "
        f"{found.get(dial.parameter)}: {worst[0]:g} cm was reached"
    )
