"""Valid: ``pca``: heads, tables, segments, groups."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from mcz.codecs.parameters import SCALED
from mcz.codecs.pca.streams import MAX_INDEX, MAX_SCALE, MAX_SHIFT
from mcz.container import payloads
from tools.vectors.build import pca_clips
from tools.vectors.build.edits import put
from tools.vectors.build.files import Vector
from tools.vectors.build.motions import UNROUNDED
from tools.vectors.build.pca_clips import Part, Parts, Plan, part_of
from tools.vectors.valid.common import every_codec


def vectors() -> Iterable[Vector]:
    shelf = Parts("valid/pca")
    _grids(shelf)
    _counts(shelf)
    _heads(shelf)
    _sizes(shelf)
    _segments(shelf)
    _stays(shelf)
    _grids_and_groups(shelf)
    every_codec.add(shelf, "pca")
    return shelf.vectors


def _stays(shelf: Parts) -> None:
    courses = [(f // 3 * 7, -(f // 4) * f) for f in range(24)]
    part = part_of(24, 3, 2, coefficients=courses, forms=(9, 73))
    purpose = "Coefficients that stay for some frames: what counts is where they moved last."
    shelf.hold_plan("stays", purpose, Plan((part,)))


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


def _grids_and_groups(shelf: pca_clips.Parts) -> None:
    plan = pca_clips.Plan((part_of(7, 3, 2), part_of(4, 3, 1, 2)))
    listed = put(payloads.Clip, "signals.0.groups", b"\3\1\3")
    purpose = "One group of all channels, that is listed."
    shelf.hold_plan("groups-listed", purpose, plan, [(2, 9)], CLIP=listed)
    joined = put(payloads.Clip, "signals.0.groups", b"\1")
    purpose = "One group of all channels, of the only joint."
    shelf.hold_plan("groups-joint", purpose, plan, [(2, 9)], CLIP=joined)
    motion = pca_clips.motion_of(plan)
    motion = replace(motion, signals=(replace(motion.signals[0], grids=UNROUNDED),))
    purpose = "Values are not rounded to the grids, one of which is INTEGER."
    spec = f"{pca_clips.HEADING}; Codecs; CLIP"
    shelf.hold("grids", spec, purpose, pca_clips.file_with(plan, motion), motion)
