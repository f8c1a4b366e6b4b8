"""The initial model for coding the levels of a clip, and its priors.

SPEC.md, "Rows in the metric" and its annexes, are normative. Priors describe how channels of
well-known skeletons move together; ``tools/train_priors.py`` computed them.
"""

from __future__ import annotations

import json
import math
from functools import cache
from typing import NamedTuple

import numpy as np

from mcz.codecs.coding import mixing
from mcz.codecs.coding.mixing import rate_table, squash_table, stretch_table
from mcz.codecs.posewave.model_state import (
    BLOCK,
    LANES,
    N_FEATURES,
    N_INPUTS,
    N_LEVELS,
    N_OWN,
    N_PATH,
    N_SCALES,
    N_SETS,
    N_SHARED,
    N_SLOTS,
    N_SMALL_MIXERS,
    N_STATES,
    N_TAPS,
    USUAL,
    Model,
)
from mcz.model.extras import annex_bytes
from mcz.model.motion import Skeleton
from mcz.model.types import Floats, Ints, JsonObject, Params

N_SECOND = 33
START_ENERGY = 500.0

N_LOGS = 1024
VARIANCE = 2.0  # initial variance of a channel
N_MIXER_WEIGHTS = mixing.MODELS - mixing.WEIGHTS


class Start(NamedTuple):
    """A start table: initial statistics of channels by class.

    ``shared`` and ``own`` are slots, the latter (classes, slots); ``small`` the mixers and contexts
    of ``coder``, those of a segment's head too; ``weights`` (sets, slots, inputs) and
    ``own_weights`` (classes, slots, inputs); ``second`` (slots, 33); ``taps`` (2 levels, 5);
    ``level_sizes`` (levels, 16), ``own_sizes`` and ``usual`` by class.
    """

    shared: Ints
    own: Ints
    small: Ints
    weights: Ints
    own_weights: Ints
    second: Ints
    taps: Floats
    level_sizes: Floats
    own_sizes: Floats
    usual: Floats


@cache
def start_tables() -> tuple[Start, ...]:
    """The start tables of the annex, read-only."""
    document = json.loads(annex_bytes("posewave_start.json"))
    counts = np.array(document["counts"], np.int64)
    return tuple(start_of(table, counts) for table in document["sets"])


def start_of(table: Params, counts: Ints) -> Start:
    """Convert a start table to arrays; ``counts`` (16,) are the values of its digits of counts."""
    slots = _bytes(table["probabilities"]) * 65536 + 32768 + counts[_digits(table["counts"])]
    own = slots[N_SHARED * N_SLOTS :].reshape(-1, N_OWN * N_SLOTS)
    mixers = np.zeros(N_MIXER_WEIGHTS, np.int64)
    mixers[: 3 * N_SMALL_MIXERS] = table["small_weights"]
    contexts = [
        _bytes(table["small_probabilities"]) * 256 + 128,
        counts[_digits(table["small_counts"])],
    ]
    small = np.concatenate([mixers, np.stack(contexts, axis=1).ravel()])
    weights = (_bytes(table["weights"]) - 128).reshape(-1, N_SLOTS, N_INPUTS) * 1024
    return Start(
        shared=slots[: N_SHARED * N_SLOTS],
        own=own,
        small=small,
        weights=weights[:N_SETS],
        own_weights=weights[N_SETS:],
        second=_bytes(table["second"]).reshape(N_SLOTS, N_SECOND) * 256 + 128,
        taps=np.array(table["taps"]).reshape(2 * N_LEVELS, N_TAPS) / 1024,
        level_sizes=np.array(table["level_sizes"]).reshape(N_LEVELS, N_FEATURES) / 1024,
        own_sizes=np.array(table["own_sizes"]).reshape(-1, N_FEATURES) / 1024,
        usual=np.array(table["usual"]) / 1024,
    )


def _bytes(lines: list[str]) -> Ints:
    return np.frombuffer(bytes.fromhex("".join(lines)), "u1").astype(np.int64)


def _digits(lines: list[str]) -> Ints:
    text = np.frombuffer("".join(lines).encode(), "u1").astype(np.int64)
    return np.where(text < ord("a"), text - ord("0"), text - ord("a") + 10)


def wide_of(n_channels: int) -> int:
    """Columns of a matrix of magnitudes, or of values: one a channel, the mean, zeros."""
    return -(-(n_channels + 1) // LANES) * LANES


def new_rows(n_rows: int, n_channels: int) -> Floats:
    """Magnitudes and values of the rows of a level, as ``code_rows`` takes them for ``here``.

    Three rows of zeros are in front; ``[3:]`` is the ``parent`` of a finer level.
    """
    return np.zeros((n_rows + 3, 2 * wide_of(n_channels)))


def no_rows(n_channels: int) -> Floats:
    """Placeholder for the rows of a coarser level where there is none."""
    return np.zeros((1, 2 * wide_of(n_channels)))


def make_model(
    classes: Ints, start: Start, coder: Ints | None = None, prior: Prior | None = None
) -> Model:
    """The model for channels of these ``classes`` (n,), before the first level.

    A class is 0 for channels other than rotations; 1 for a rotation of a root; otherwise by the
    joints of the subtree from the channel's joint on: 2 for one, 3 up to 3, 4 up to 7, 5 beyond.
    ``coder`` is a state that is already in use, for the parts before the rows; ``prior`` is of
    these channels.
    """
    n, wide = len(classes), wide_of(len(classes))
    n_blocks = -(-n // BLOCK)
    own_sizes, features = np.zeros((N_FEATURES, wide)), np.zeros((N_FEATURES, wide))
    own_sizes[:, :n] = start.own_sizes[classes].T
    features[USUAL, :n] = start.usual[classes]
    columns, variances = np.zeros((n_blocks, BLOCK, BLOCK)), np.full((n_blocks, BLOCK), VARIANCE)
    if prior is not None:
        for block in range(n_blocks):
            first, stop = block * n // n_blocks, (block + 1) * n // n_blocks
            known = prior.lower[first:stop, first:stop].T
            columns[block, : stop - first, : stop - first] = known
            variances[block, : stop - first] = prior.variances[first:stop]
    return Model(
        coder=start_coder(start) if coder is None else coder,
        classes=np.asarray(classes, np.int64),
        slots=np.concatenate([start.shared, start.own[classes].ravel()]),
        weights=np.concatenate([start.weights, start.own_weights[classes]]),
        second=np.tile(start.second, (N_SCALES, 1, 1)),
        at=np.zeros(N_INPUTS - 1, np.int64),
        inputs=np.zeros(N_INPUTS, np.int64),
        stretch=stretch_table(),
        squash=squash_table(),
        rates=rate_table(),
        trust=trust_table(),
        logs=log_table(),
        costs=cost_table(),
        columns=columns,
        variances=variances,
        seen=np.full(1, 0.0 if prior is None else PRIOR_ROWS),
        paths=np.zeros((2, N_STATES, N_PATH)),
        ways=np.zeros((n, N_STATES, 3), np.int64),
        taps=start.taps.copy(),
        tap_energy=np.full((2 * N_LEVELS, N_TAPS), START_ENERGY),
        timely=np.zeros(wide),
        sources=np.zeros((N_TAPS + 2, wide)),
        level_weights=start.level_sizes.copy(),
        own_weights=own_sizes,
        features=features,
        sizes=np.zeros((4, wide)),
    )


def start_coder(start: Start) -> Ints:
    """The state of the coder before the first stream."""
    coder = np.zeros(mixing.WEIGHTS + len(start.small), np.int64)
    coder[mixing.SQUASH : mixing.SQUASH + 4096] = squash_table()
    coder[mixing.STRETCH : mixing.STRETCH + 4096] = stretch_table()
    rates = rate_table()
    coder[mixing.RATES : mixing.RATES + len(rates)] = rates
    coder[mixing.WEIGHTS :] = start.small
    return coder


@cache
def trust_table() -> Ints:
    """Weight of a context that was used n times, in 65536ths."""
    n = np.arange(256, dtype=np.int64)
    return 65536 * (10 * n + 4) // (10 * n + 16)


@cache
def log_table() -> Ints:
    """floor(6 log2(1 + k / 4)) for k from 0 to 1023: the most e with 4^6 2^e <= (4 + k)^6."""
    powers = [4**6 << e for e in range(60)]
    table, e = [], 0
    for k in range(N_LOGS):
        while powers[e + 1] <= (4 + k) ** 6:
            e += 1
        table.append(e)
    return np.array(table, np.int64)


@cache
def cost_table() -> Ints:
    """4096 times the bits of an event of probability (k + 1/2) / 4096: for encoders."""
    bits = [round(-4096 * math.log2((k + 0.5) / 4096)) for k in range(4096)]
    return np.array([*bits, 0], np.int64)


PRIOR_ROWS = 25.0  # rows that a prior counts for
UNITS = 64  # of a number of L
VARIANCE_UNITS = 16


class Prior(NamedTuple):
    """L D L' of the rows of a skeleton.

    ``lower`` (n, n) is L, with zeros on and above the diagonal; ``variances`` (n,).
    """

    lower: Floats
    variances: Floats

    def of(self, kept: Ints) -> Prior:
        """Restrict it to some channels, ascending."""
        return Prior(self.lower[np.ix_(kept, kept)], self.variances[kept])


@cache
def priors() -> tuple[Prior, ...]:
    """The priors of the annex, read-only."""
    return tuple(
        _read("".join(table["lower"]), table["variances"]) for table in _document()["priors"]
    )


def number_of(skeleton: Skeleton) -> int:
    """Number, from 1, of the prior trained on skeletons like this one; 0 if there is none."""
    layout = layout_of(skeleton)
    for number, table in enumerate(_document()["priors"], 1):
        if layout == (table["parents"], table["channels"]):
            return number
    return 0


def layout_of(skeleton: Skeleton) -> tuple[list[int], list[str]]:
    """Parents and kinds of channels of all joints: the key of a prior."""
    joints = skeleton.joints
    kinds = [" ".join(channel.kind for channel in joint.channels) for joint in joints]
    return [joint.parent for joint in joints], kinds


@cache
def _document() -> JsonObject:
    result: JsonObject = json.loads(annex_bytes("posewave_priors.json"))
    return result


def _read(digits: str, variances: list[int]) -> Prior:
    n = len(variances)
    lower = np.zeros((n, n))
    lower[np.tril_indices(n, -1)] = np.frombuffer(bytes.fromhex(digits), np.int8) / UNITS
    return Prior(lower, np.array(variances) / VARIANCE_UNITS)
