"""Cost of parts of the online codec: entropy coders, bases, intra coded LTRs, resets, packets."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcz.bench.measure import Record
from mcz.codecs import codec_by_name
from mcz.codecs.online.coder import Coder
from mcz.codecs.online.units import INTRA, STR
from mcz.files.live.writer import LiveWriter
from mcz.model.motion import Motion
from tools.papers.kwak.clips import Clip, motion_in_positions
from tools.papers.kwak.losses import pushed_by
from tools.papers.kwak.measure import (
    NAME,
    STEP_CM,
    Coded,
    code,
    live_basis,
    rate_point,
    search_rates,
)

Ints = NDArray[np.int64]

MOST_ONES = 16  # of a prefix; SPEC.md, "Codec 21: online"
ESCAPE_BITS = 6  # the length of what follows such a prefix
GOLOMB, MIXED, RICE = "golomb", "mixed", "Rice alone"
PLACES: tuple[tuple[str, Mapping[str, Any]], ...] = (
    ("cosines, reordered", {"order": "reordered"}),
    ("cosines, apart", {"order": "apart", "basis": "cosines"}),
    ("known, apart", {"order": "apart", "basis": "known"}),
    ("learned from the clip, apart", {"order": "apart", "basis": "learned"}),
)
PERIODS = (1, 2, 4, 8, 0)
GOFS = (30, 60, 120, 2**20)


def coders(clip: Clip, targets: Sequence[float]) -> list[Record]:
    """kbps of entropy coders and transforms at the steps with which MOD has these rates."""
    motion = motion_in_positions(clip)
    rows = []
    for target in targets:
        step = _step(motion, {"preset": "mod"}, target)
        for label, place in PLACES:
            if place.get("basis") == "known" and live_basis(clip) != "known":
                continue
            base = {"preset": "mod", "step": step, **place}
            found = code(motion, base | {"coder": GOLOMB})
            mixed = rate_point(motion, base | {"coder": MIXED})
            golomb = rate_point(motion, base | {"coder": GOLOMB})
            per_second = float(motion.frame_rate or 1) / motion.n_frames / 1000
            rows.append(
                {
                    "target": target,
                    "place": label,
                    "rice": rice_bits(found, motion) * per_second,
                    "golomb": golomb["kbps"],
                    "mixed": mixed["kbps"],
                    "sqnr": golomb["sqnr"],
                }
            )
    return rows


def _step(motion: Motion, options: Mapping[str, Any], target: float) -> float:
    start = STEP_CM / (motion.skeleton.unit_cm or 1.0)

    def measure(step: float) -> Record:
        return rate_point(motion, {**options, "step": step})

    (found,) = search_rates(measure, start, [target])
    return float(found["setting"])


def rice_bits(found: Coded, motion: Motion) -> int:
    """Bits of the same indices by Golomb-Rice codes that no arithmetic coder follows.

    Their parameters are chosen as SPEC.md says for the coder ``golomb``, whole bytes a group of
    frames; a frame has a bit that says whether it is zero, and one that its step is the same.
    """
    indices, starts, kinds = indices_of(found)
    total = 0
    before = np.zeros(indices.shape[1], np.int64)
    bits = 0
    for row, kind in zip(np.abs(indices), kinds, strict=True):
        if kind:
            total += -(-bits // 8) * 8
            bits = 0
            before = np.zeros_like(before)
        bits += 1
        if row.any():
            bits += 1 + _frame_bits(row, before, starts)
        before = np.zeros_like(before) if kind else row
    return total + -(-bits // 8) * 8


def _frame_bits(sizes: Ints, before: Ints, starts: Ints) -> int:
    """Bits of absolute values (n_rows,), with their signs; ``before``: the frame before."""
    activity = 2 * before
    for a, b in zip(starts, starts[1:], strict=False):
        activity[a : b - 1] += before[a + 1 : b]
        activity[a + 1 : b] += 2 * sizes[a : b - 1]
        activity[a + 2 : b] += sizes[a : b - 2]
    rice = np.maximum(0, np.frexp(activity.astype(float))[1] - 3)
    ones = sizes >> rice
    long = ones >= MOST_ONES
    rest = [(int(value) - MOST_ONES + 1).bit_length() for value in ones[long]]
    escaped = sum(ESCAPE_BITS + length - 1 for length in rest)
    prefixes = np.where(long, MOST_ONES, ones + 1)
    return int(prefixes.sum() + rice.sum()) + escaped + int(np.count_nonzero(sizes))


def indices_of(found: Coded) -> tuple[Ints, Ints, list[int]]:
    """Indices of a clip with one step throughout, (n_frames, n_rows), starts, kinds."""
    space = Coder(found.encoded.header, found.layout).space
    kinds = [kind for u in found.units for kind in (u.kind, *[STR] * (u.n_frames - 1))]
    values = found.values / space.weights / space.step
    predicted = np.zeros_like(values)
    last_ltr = 0
    for at, kind in enumerate(kinds):
        if at and kind != INTRA:
            predicted[at] = values[last_ltr if kind else at - 1]
        if kind:
            last_ltr = at
    apart = values - predicted
    parts = [
        apart[:, columns] @ analysis.T
        for analysis, columns in zip(space.analysis(), space.columns, strict=True)
    ]
    return np.rint(np.concatenate(parts, axis=1)).astype(np.int64), space.starts, kinds


# Entry points, resets, frames by themselves


def periods(clip: Clip, target: float) -> list[Record]:
    """kbps at one step, with which ``intra_period`` 0 has the rate, and SQNR at that rate."""
    motion, base = motion_in_positions(clip), {"basis": live_basis(clip)}
    step = _step(motion, base | {"intra_period": 0}, target)
    rows = []
    for period in PERIODS:
        same = rate_point(motion, base | {"intra_period": period, "step": step})
        held = rate_point(motion, base | {"intra_period": period, "bitrate": target})
        row = {"period": period, "kbps": same["kbps"], "sqnr": same["sqnr"]}
        rows.append(row | {"held_kbps": held["kbps"], "held_sqnr": held["sqnr"]})
    return rows


def resets(clip: Clip, target: float) -> list[Record]:
    """kbps of both coders at one step by length of groups: each resets, and has an LTR."""
    motion = motion_in_positions(clip)
    base = {"intra_period": 0, "ltr_step": 1.0, "basis": live_basis(clip)}
    step = _step(motion, base, target)
    rows = []
    for gof in GOFS:
        given = base | {"step": step, "gof": gof}
        mixed, golomb = (rate_point(motion, given | {"coder": c}) for c in (MIXED, GOLOMB))
        row = {"gof": gof, "mixed": mixed["kbps"], "golomb": golomb["kbps"]}
        rows.append(row | {"sqnr": mixed["sqnr"]})
    return rows


def packets(clip: Clip, target: float) -> list[Record]:
    """kbps of one step: stored, terminated frame by frame, as packets; the latter of a whole file.

    The step is that with which what is stored has the rate.
    """
    motion = motion_in_positions(clip)
    rows = []
    ours = {"basis": live_basis(clip)}
    for label, base in (("default", ours), ("mod", {"preset": "mod"})):
        options: dict[str, Any] = {**base, "step": _step(motion, base, target)}
        stored = rate_point(motion, options)
        per_second = float(motion.frame_rate or 1) / motion.n_frames * 8 / 1000
        pushed = pushed_by(codec_by_name(NAME), motion, options)
        row = {
            "label": label,
            "stored": stored["kbps"],
            "framed": stored["framed_kbps"],
            "terminated": sum(pushed.payload) * per_second,
            "streams": sum(len(stream) for stream, _ in pushed.packets) * per_second,
        }
        for name, repeat in (("packets", 0), ("with_entries", 1)):
            row[name] = _live_bytes(motion, options, repeat) * per_second
        rows.append(row)
    return rows


def _live_bytes(motion: Motion, options: Mapping[str, Any], repeat: int) -> int:
    """Bytes of all frames in a live file, without what stands before the first."""
    out = io.BytesIO()
    skeleton = motion.skeleton
    # Whoever named it is not in this file.
    plain = type(skeleton)(skeleton.joints, skeleton.name, skeleton.unit_cm, "", skeleton.up_axis)
    writer = LiveWriter(
        out, plain, NAME, options, frame_rate=motion.frame_rate, name="a", repeat=repeat
    )
    before = len(out.getvalue())
    values, mask = motion.values, motion.signals[0].mask
    for row in values if mask is None else np.where(mask, values, np.nan):
        writer.push(row)
    size = len(out.getvalue()) - before
    writer.close()
    return size
