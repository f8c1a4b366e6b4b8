"""The encoder's choice of axis orders, on sampled frames.

mcz/codecs/posewave/README.md describes it; decoders do not need it.
"""

from __future__ import annotations

import math
from collections.abc import Container, Iterator

import numpy as np

from mcz.codecs.contract import SignalSource
from mcz.codecs.posewave.header import NAME
from mcz.codecs.posewave.orders import (
    N_ORDERS,
    VECTOR_CODE,
    Orders,
    columns_by_axis,
    own_sequence,
)
from mcz.codecs.segments import skeleton_of
from mcz.codecs.source_readers import FrameReader
from mcz.model.types import Floats

SOURCE_ORDER = 0  # code of the order of the source
RUNS, RUN_FRAMES = 8, 128  # sampled runs of a long clip
DUE = 0.985  # an order is chosen if its score is below this share of the source's
VECTOR_SHARE = 0.96  # of their score: vectors suit the metric better than angles
STILL = 1e-4  # of a turn: a joint whose steps change by less keeps its order
GREATEST = 2.0**20  # of an angle, whose sine is exact enough in any unit


def choose_orders(source: SignalSource, exact: Container[int] = ()) -> dict[int, int]:
    """Codes of orders by joint, of joints that are calmer in another than the source's.

    Joints with ``exact`` channels keep the source's order. Angles that jump or turn fast cost
    bytes: bits by the logarithms of their second differences, approximated by roots.
    """
    skeleton = skeleton_of(NAME, source.layout)
    joints = [
        index
        for index, joint in enumerate(skeleton.joints)
        if own_sequence(joint, skeleton) is not None
        and not any(channel in exact for channel in skeleton.columns(index))
    ]
    if not joints:
        return {}
    columns = np.array([columns_by_axis(skeleton, index) for index in joints])
    scores, highest, n_rows = np.zeros((1 + N_ORDERS, len(joints))), np.zeros(len(joints)), 0
    roots = [skeleton.joints[joint].parent < 0 for joint in joints]
    orders = [
        Orders(dict.fromkeys(joints, code) if code != SOURCE_ORDER else {}, skeleton)
        for code in range(1 + N_ORDERS)
    ]
    for values in _runs(source):
        n_rows += len(values)
        highest = np.maximum(highest, np.abs(values[:, columns]).max(axis=(0, 2), initial=0.0))
        values = np.clip(values, -GREATEST, GREATEST)
        for code, order in enumerate(orders):
            coded = order.to_coded_order(values)[:, columns]
            scores[code] += np.sqrt(np.abs(np.diff(coded, 2, axis=0))).sum(axis=(0, 2))
    scores[VECTOR_CODE] = np.where(roots, math.inf, VECTOR_SHARE * scores[VECTOR_CODE])
    full = orders[SOURCE_ORDER].full
    moves = (scores[SOURCE_ORDER] > np.sqrt(STILL * full) * n_rows) & (highest < GREATEST)
    worth = moves & (scores.min(axis=0) < DUE * scores[SOURCE_ORDER])
    best = np.where(worth, scores.argmin(axis=0), SOURCE_ORDER).tolist()
    return {joint: code for joint, code in zip(joints, best, strict=True) if code != SOURCE_ORDER}


def _runs(source: SignalSource) -> Iterator[Floats]:
    """Runs of frames, evenly spread; the whole of a short clip."""
    n_frames = source.layout.n_frames
    starts, length = np.zeros(1, np.int64), n_frames
    if n_frames > RUNS * RUN_FRAMES:
        starts, length = np.linspace(0, n_frames - RUN_FRAMES, RUNS).astype(np.int64), RUN_FRAMES
    for start in starts.tolist():
        reader = FrameReader(NAME, source)
        reader.at = start
        yield reader.next(start + length)
