"""Valid: codecs 4 to 6, ``pca``, ``dwt`` and ``awt``: heads, tables, segments, wavelets."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from mcz.codecs import awt, dwt, raw
from mcz.codecs._pca_streams import MAX_INDEX, MAX_SCALE, MAX_SHIFT
from mcz.codecs.base import Codec
from mcz.codecs.pca import SCALED
from tools.vectors import waved
from tools.vectors.components import Part, Parts, Plan, part_of
from tools.vectors.craft import Vector, Whole, file_of


def vectors() -> Iterable[Vector]:
    shelf = Parts("valid/pca")
    _grids(shelf)
    _counts(shelf)
    _heads(shelf)
    _sizes(shelf)
    _segments(shelf)
    return [*shelf.vectors, *_waves("dwt", dwt.CODEC), *_waves("awt", awt.CODEC)]


def _grids(shelf: Parts) -> None:
    for decimals in (0, 1, 2, 15):
        plan = Plan((part_of(20, 4, 2),), decimals)
        shelf.hold_plan(f"decimals-{decimals}", f"{decimals} decimals.", plan, [(3, 9)])
    for step in (0, 1, 127, 128, 130, 255):
        plan = Plan((part_of(20, 4, 2, step=step),), SCALED)
        shelf.hold_plan(f"step-{step}", f"The step code {step}.", plan, [(3, 9)])
    many = part_of(9, 5, 5, shifts=(0, 3, 17, 29, 40))
    purpose = "Sums that another order, or a fused product, would round to another number."
    shelf.hold_plan("rounding", purpose, Plan((many,), 1))


def _counts(shelf: Parts) -> None:
    for n_frames in (1, 2, 3, 4, 5):
        plan = Plan((part_of(n_frames, 3, min(3, n_frames + 1)),))
        purpose = f"{n_frames} frames, as many components as there may be."
        shelf.hold_plan(f"frames-{n_frames}", purpose, plan)
    plan = Plan((Part((5, -3, 0), n_frames=6),))
    shelf.hold_plan("no-components", "Means alone.", plan, [(1, 2)])
    shelf.hold_plan("one-channel", "One channel, one component.", Plan((part_of(12, 1, 1),)))
    plan = Plan((part_of(7, 3, 2),), empty=(0,))
    shelf.hold_plan("empty", "An empty stream: all values are 0.", plan)
    plan = Plan((Part((0, 0), ((0, 0),), ((0,),) * 4, shifts=(3,), forms=(4,), n_frames=4),))
    shelf.hold_plan("zeros-written", "Zeros that are written with bits.", plan)
    plan = Plan((part_of(3, 200, 4),))
    shelf.hold_plan("wide", "200 channels.", plan)


def _heads(shelf: Parts) -> None:
    for scale in (0, 1, 31, MAX_SCALE):
        part = part_of(30, 3, 2, mean_scale=scale, forms=(scale, 64 + scale))
        purpose = f"First scales of {scale} half octaves."
        shelf.hold_plan(f"scale-{scale}", purpose, Plan((part,)))
    for predictor in range(4):
        part = part_of(40, 3, 2, forms=(64 * predictor + 9,) * 2)
        purpose = f"Predictor {predictor}, of coefficients that stay, go on and turn."
        shelf.hold_plan(f"predictor-{predictor}", purpose, Plan((part,)), [(0, 7)])
    for shift in (0, 1, MAX_SHIFT):
        part = part_of(8, 5, 2, shifts=(shift, 7))
        shelf.hold_plan(f"shift-{shift}", f"A basis with {shift} binary digits.", Plan((part,)))


def _sizes(shelf: Parts) -> None:
    most = MAX_INDEX
    rows = [(most,), (-most,), (0,), (most,), (most - 1,), (1,), (-1,)]
    part = Part((most, -most), ((most, -most),), rows, shifts=(40,), forms=(0,), n_frames=7)
    shelf.hold_plan("greatest", "The greatest means, basis and coefficients.", Plan((part,)))
    shelf.hold_plan(
        "greatest-step",
        "The same with the greatest step, over no binary digits.",
        Plan((replace(part, step=255, shifts=(0,)),), SCALED),
    )


def _segments(shelf: Parts) -> None:
    parts = (part_of(5, 3, 2), part_of(1, 3, 1, 1), part_of(9, 3, 3, 2), part_of(4, 3, 0, 3))
    plan = Plan(parts, empty=(1,))
    requests = [(0, 5), (4, 7), (6, 19), (18, 19)]
    shelf.hold_plan("segments", "Four segments of any length, one empty.", plan, requests)


def _waves(name: str, codec: Codec) -> Iterable[Vector]:
    """What codec 2 reads, under another id."""
    shelf = Whole(f"valid/{name}")
    heading = f"Codec {codec.id}: {name}"
    cases = (
        (
            "scaled",
            "Scaled coefficients in three segments.",
            waved.Plan(45, waved.BIOR, levels=2, decimals=SCALED, unit=0.01, ends=(16, 32)),
        ),
        (
            "decimals",
            "Coefficients of 2 decimals.",
            waved.Plan(45, waved.DB2, levels=4, decimals=2),
        ),
    )
    for case, purpose, plan in cases:
        made = waved.waves(plan)
        motion = waved.motion_of(plan, made)
        encode = waved.codec_of(plan, made).encode
        own = replace(codec, encode=encode, parameters=raw.CODEC.parameters, dial=None)
        data = file_of(motion, codec=own, grouping="channel")
        requests = [(0, (7, 30), None), (1, (0, 45), None)]
        parts = tuple(waved.request(plan, made, motion, *request) for request in requests)
        shelf.hold(case, heading, purpose, data, motion, parts=parts)
    return shelf.vectors
