"""The states in which coders begin a stream, from the start tables of SPEC.md's annexes."""

from __future__ import annotations

import json
from functools import cache

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.coding.logistic import rate_table, squash_table, stretch_table
from mcz.model.annexes import annex_bytes
from mcz.model.types import Params


@cache
def start_states(name: str) -> tuple[NDArray[np.int64], ...]:
    """States of the annex ``NAME_start.json``, one per set, read-only."""
    document = json.loads(annex_bytes(f"{name}_start.json"))
    return tuple(start_state(table) for table in document.get("sets", [document]))


def start_state(table: Params) -> NDArray[np.int64]:
    """``state`` of ``coding.mixing`` with the ``weights``, ``probabilities`` and ``counts`` given.

    The last two are lines of hexadecimal digits, one byte a context.
    """
    from mcz.codecs.coding import mixing

    probabilities = np.frombuffer(bytes.fromhex("".join(table["probabilities"])), "u1")
    counts = np.frombuffer(bytes.fromhex("".join(table["counts"])), "u1")
    state = np.zeros(mixing.MODELS + 2 * len(probabilities), np.int64)
    state[mixing.SQUASH : mixing.SQUASH + 4096] = squash_table()
    state[mixing.STRETCH : mixing.STRETCH + 4096] = stretch_table()
    rates = rate_table()
    state[mixing.RATES : mixing.RATES + len(rates)] = rates
    state[mixing.WEIGHTS : mixing.WEIGHTS + len(table["weights"])] = table["weights"]
    state[mixing.MODELS :: 2] = probabilities.astype(np.int64) * 256 + 128
    state[mixing.MODELS + 1 :: 2] = counts
    return state
