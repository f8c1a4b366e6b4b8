"""The model of posewave, counting the bits that it codes; see ``train_posewave.py``.

Models and coders that count have an array three times as long: behind what they know there is how
many zeros, then how many ones each context has seen, at the same places.
"""

from __future__ import annotations

import os

# Functions that count take the places of others only where kernels are plain Python.
os.environ["MCZ_LOOPS"] = "interpreted"

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.coding import mixing
from mcz.codecs.posewave import decision_kernels, row_coder, segment
from mcz.codecs.posewave.model import Prior, Start, make_model, start_coder
from mcz.codecs.posewave.model_state import N_OPINIONS, Model

Ints = NDArray[np.int64]

plain_learn, plain_learn_small = decision_kernels.learn_bit, mixing._learn


def counting_learn(
    model: Model, slot: int, one: Ints, other: Ints, second: Ints, bit: int, chance: int, x: int
) -> None:
    """``decision_kernels.learn``, counting."""
    plain_learn(model, slot, one, other, second, bit, chance, x)
    slots, at = model.slots, model.at
    for k in range(N_OPINIONS):
        slots[len(slots) // 3 * (1 + bit) + at[k] + slot] += 1


def counting_learn_small(state: Ints, context: int, target: int) -> None:
    """``mixing._learn``, counting."""
    plain_learn_small(state, context, target)
    state[len(state) // 3 * (2 if target else 1) + context] += 1


def triple_states(states: Ints) -> Ints:
    return np.concatenate([states, np.zeros(2 * len(states), np.int64)])


class Counting:
    """Makes the codec's coders count, and keeps the model of the last segment."""

    def __init__(self) -> None:
        fresh = start_coder
        decision_kernels.learn_bit = counting_learn
        mixing._learn = counting_learn_small
        segment.start_coder = lambda start: triple_states(fresh(start))
        row_coder.make_model = self.make_model

    def make_model(self, classes: Ints, start: Start, coder: Ints, prior: Prior | None) -> Model:
        model = make_model(classes, start, coder, prior)
        self.model = model._replace(slots=triple_states(model.slots))
        return self.model
