"""Encoder choice of the joints whose axes ``posewave`` reorders."""

from __future__ import annotations

from collections.abc import Container, Iterator

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.contract import SignalSource
from mcz.codecs.gaps import FrameReader
from mcz.codecs.posewave.header import NAME
from mcz.codecs.posewave.orders import N_ORDERS, Orders, columns_by_axis, own_sequence
from mcz.codecs.segments import skeleton_of

Floats = NDArray[np.float64]

KEPT = 0  # among scores by code: the order of the source
RUNS, RUN_FRAMES = 16, 128  # what is looked at of a long clip
DUE = 0.985  # an order is taken where its score is less than this share of the source's
STILL = 1e-4  # of a turn: a joint whose steps change by less keeps its order
GREATEST = 2.0**20  # of an angle, whose sine is exact enough in any unit


def choose_orders(source: SignalSource, exact: Container[int] = ()) -> dict[int, int]:
    """Codes of orders by joint, of joints that are calmer in another than the source's.

    Joints with ``exact`` channels keep that of the source.

    Angles that jump or turn fast cost bytes: bits by the logarithms of their second differences,
    of which roots are near enough.
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
    for values in _runs(source):
        n_rows += len(values)
        highest = np.maximum(highest, np.abs(values[:, columns]).max(axis=(0, 2), initial=0.0))
        values = np.clip(values, -GREATEST, GREATEST)
        for code in range(1 + N_ORDERS):
            codes = dict.fromkeys(joints, code) if code != KEPT else {}
            coded = Orders(codes, skeleton).to_coded_order(values)[:, columns]
            scores[code] += np.sqrt(np.abs(np.diff(coded, 2, axis=0))).sum(axis=(0, 2))
    full = Orders({}, skeleton).full
    moves = (scores[KEPT] > np.sqrt(STILL * full) * n_rows) & (highest < GREATEST)
    worth = moves & (scores.min(axis=0) < DUE * scores[KEPT])
    best = np.where(worth, scores.argmin(axis=0), KEPT).tolist()
    return {joint: code for joint, code in zip(joints, best, strict=True) if code != KEPT}


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
