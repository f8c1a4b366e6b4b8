"""Streams of bits around compiled loops, and the start states of their coders.

SPEC.md, "Entropy coding", is normative. A loop gets the coder's state and the bytes, codes or
decodes, and returns True on success. Start states are from the start tables of SPEC.md's annexes.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import cache

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.coding import mixing
from mcz.codecs.coding.mixing import rate_table, squash_table, stretch_table
from mcz.errors import FormatError
from mcz.model.extras import annex_bytes
from mcz.model.types import Ints, Params

Loop = Callable[[Ints, NDArray[np.uint8]], bool]


def bare_state() -> Ints:
    """The state of a coder of numbers with equally likely bits, without contexts."""
    return np.zeros(mixing.SQUASH, np.int64)


def encode_stream(start: Ints, size: int, loop: Loop, label: str) -> bytes:
    """The bytes that ``loop`` writes from the state ``start``; about ``size`` are expected."""
    while True:
        data, state = np.zeros(size, np.uint8), start.copy()
        mixing.start(state, data, 1)
        if not loop(state, data):
            raise AssertionError(f"{label} has no code")
        used = mixing.finish(state, data)
        if used <= size:
            return data[:used].tobytes()
        size = used + 256


def decode_stream(stream: bytes, start: Ints, loop: Loop, label: str, *, whole: bool) -> None:
    """Run ``loop`` on ``stream``; ``whole``: all its bytes must be needed.

    Raises FormatError, with ``label`` in front, for a bad code or extra bytes.
    """
    data = np.frombuffer(stream, np.uint8).copy()  # compiled once: for writable bytes
    state = start.copy()
    mixing.start(state, data, 0)
    if not loop(state, data):
        raise FormatError(f"{label} is out of range")
    if whole and mixing.coded_size(state) != len(data):  # RANGE-04
        raise FormatError(f"{label}: the stream should not have {len(data)} bytes")


def scale_of(halves: int) -> int:
    """The scale of a number of half octaves, about 2^(halves / 2)."""
    return (2 + (halves & 1)) << (halves >> 1) >> 1


def halves_of(typical: float, most: int) -> int:
    """The half octaves, at most ``most``, of the least scale that is at least ``typical``."""
    return next((h for h in range(most) if scale_of(h) >= typical), most)


MAX_SCALE = 62  # in half octaves


def choose_predictor(band: Ints) -> tuple[int, int]:
    """The predictor with the smallest errors, and their mean in half octaves."""
    steps = np.diff(band, prepend=band[:1])
    before = np.concatenate([[0], steps[:-1]])
    earlier = np.concatenate([[0, 0], steps[:-2]])
    guesses = (0 * before, before >> 1, before, (3 * before - 2 * earlier) >> 2)
    errors = [np.abs(steps - guess)[1:] for guess in guesses]
    costs = [float(np.log2(e + 1 + e.mean() / 4).sum()) for e in errors]
    best = int(np.argmin(costs))
    return best, halves_of(float(errors[best].mean()), MAX_SCALE)


@cache
def start_states(name: str) -> tuple[Ints, ...]:
    """States of the annex ``NAME_start.json``, one per set, read-only."""
    document = json.loads(annex_bytes(f"{name}_start.json"))
    return tuple(start_state(table) for table in document.get("sets", [document]))


def start_state(table: Params) -> Ints:
    """``state`` of ``coding.mixing`` with the ``weights``, ``probabilities`` and ``counts`` given.

    The last two are lines of hexadecimal digits, one byte a context.
    """
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
