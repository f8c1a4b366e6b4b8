"""Priors: how channels of well-known skeletons move together, known before the first row.

SPEC.md, "Rows in the metric" and its annex, are normative. ``tools/train_priors.py`` made the
annex.
"""

from __future__ import annotations

import json
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mcz.model.annexes import annex_bytes
from mcz.model.motion import Skeleton
from mcz.model.types import JsonObject

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SEEN = 25.0  # rows that a prior counts for
UNITS = 64  # of a number of L
VARIANCE_UNITS = 16


class Prior(NamedTuple):
    """L D L' of the rows of a skeleton.

    ``lower`` (n, n) is L, of which what lies on and above the diagonal is 0; ``variances`` (n,).
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
    """The number, from 1, of the prior that was trained on skeletons like this one; else 0."""
    layout = layout_of(skeleton)
    for number, table in enumerate(_document()["priors"], 1):
        if layout == (table["parents"], table["channels"]):
            return number
    return 0


def layout_of(skeleton: Skeleton) -> tuple[list[int], list[str]]:
    """The parents and the kinds of channels of joints, by which a prior is chosen."""
    joints = skeleton.joints
    kinds = [" ".join(channel.kind for channel in joint.channels) for joint in joints]
    return [joint.parent for joint in joints], kinds


@cache
def _document() -> JsonObject:
    document: JsonObject = json.loads(annex_bytes("posewave_priors.json"))
    return document


def _read(digits: str, variances: list[int]) -> Prior:
    n = len(variances)
    lower = np.zeros((n, n))
    lower[np.tril_indices(n, -1)] = np.frombuffer(bytes.fromhex(digits), np.int8) / UNITS
    return Prior(lower, np.array(variances) / VARIANCE_UNITS)
