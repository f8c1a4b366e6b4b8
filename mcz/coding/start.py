"""The state in which a coder begins a stream, from a start table of one of SPEC.md's annexes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcz.coding.logistic import rate_table, squash_table, stretch_table


def start_state(table: Mapping[str, Any]) -> NDArray[np.int64]:
    """``state`` of ``coding.kernels`` with the ``weights``, ``probabilities`` and ``counts`` given.

    The last two are lines of hexadecimal digits, one byte a context.
    """
    from mcz.coding import kernels

    probabilities = np.frombuffer(bytes.fromhex("".join(table["probabilities"])), "u1")
    counts = np.frombuffer(bytes.fromhex("".join(table["counts"])), "u1")
    state = np.zeros(kernels.MODELS + 2 * len(probabilities), np.int64)
    state[kernels.SQUASH : kernels.SQUASH + 4096] = squash_table()
    state[kernels.STRETCH : kernels.STRETCH + 4096] = stretch_table()
    rates = rate_table()
    state[kernels.RATES : kernels.RATES + len(rates)] = rates
    state[kernels.WEIGHTS : kernels.WEIGHTS + len(table["weights"])] = table["weights"]
    state[kernels.MODELS :: 2] = probabilities.astype(np.int64) * 256 + 128
    state[kernels.MODELS + 1 :: 2] = counts
    return state
