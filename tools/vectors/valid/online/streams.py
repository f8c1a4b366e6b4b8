"""Streams of online: units, predictors, matrices, steps, models."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from mcz.motion import Joint, Motion, Signal, Skeleton
from tools.vectors.build.files import Crafter, finished
from tools.vectors.build.motions import puppet
from tools.vectors.build.online_clips import Groups, both, codec_of, motion_of, numbered
from tools.vectors.build.online_units import (
    GOLOMB,
    HEADING,
    INTRA,
    LTR,
    MIXED,
    MOST,
    ONE,
    REORDERED,
    STR,
    Plan,
)
from tools.vectors.build.spatial_clips import (
    SCATTERED,
    UNLIKE,
    WEIGHTS,
    Ints,
    basis_of,
    listed,
    markers,
    noise,
)

Fill = Callable[[int, int, int], Ints]


def add(shelf: Groups) -> None:
    _lengths(shelf)
    _presets(shelf)
    _periods(shelf)
    _matrices(shelf)
    _steps(shelf)
    _silence(shelf)
    _sizes(shelf)
    _models(shelf)


def gentle(number: int, n_rows: int, n: int) -> Ints:
    """Mostly zeros, large ones in every tenth frame."""
    i, k = np.ogrid[:n_rows, :n]
    sizes = (i * 5 + k * 7 + i * k) % 11 - 5
    table = np.where((np.abs(sizes) < 3) & (k < 5), sizes, 0)
    table[::10] = 5 * sizes[::10]
    return table.astype(np.int64)


def _lengths(shelf: Groups) -> None:
    shelf.plan("frames-0", "A clip of no frames.", Plan(()))
    shelf.plan("frames-3", "Three frames, two groups.", Plan(("I2 L1",)), [(1, 3)])
    for n_frames in (1, 2):
        plan = Plan((f"I{n_frames}",), 3)
        of = "one frame" if n_frames == 1 else "two frames"
        for name, purpose, made in both(f"frames-{n_frames}", f"A channel over {of}", plan):
            shelf.plan(name, purpose, replace(made, n_channels=1), [(0, 1)])
        plan = Plan((f"I{n_frames}",), 6, apart=True)
        for name, purpose, made in both(f"markers-{n_frames}", f"Two markers over {of}", plan):
            shelf.plan(name, purpose, made, motion=motion_of(made, skeleton=markers(2)))
    motion = Motion(Skeleton((Joint("rock"),)), (Signal(np.zeros((9, 0))),), name="still")
    plan = Plan(("I6", "I3"), 0)
    shelf.plan("no-channels", "Nine frames without a channel.", plan, motion=motion)


def _presets(shelf: Groups) -> None:
    """What the presets write: matrices, coder, periods; steps that follow from rates change."""
    reordered = Plan(n_channels=9, coder=GOLOMB, order=REORDERED, fill=gentle, step=0.25)
    plans = {
        "default": Plan(("I10 L10 L10 L10 I10 L4",), 9, apart=True, fill=gentle, step=0.25),
        "mod": replace(reordered, units=("I30 L30 L9",), steps=lambda number, kind: ONE),
        "rc": replace(reordered, units=("I15 L15 L15",), steps=_wandering),
        "rca": replace(reordered, units=("I15 L15 L7",), steps=_far_apart),
    }
    for number, (preset, made) in enumerate(plans.items()):
        plan = replace(made, preset=number)
        motion = motion_of(plan, skeleton=markers(3))
        frames = sum(plan.segments)
        shelf.plan(
            f"preset-{preset}",
            f"Three markers in the form that the preset {preset} has.",
            plan,
            [(0, 9), (frames - 5, frames)],
            motion=motion,
        )


def _wandering(number: int, kind: int) -> int:
    return ONE + number * number % 23 - (12 if kind else 4)


def _far_apart(number: int, kind: int) -> int:
    return 200 + number if kind else 290 - number % 9


def _periods(shelf: Groups) -> None:
    """How many frames a group has, and which LTRs are intra coded."""
    cases = {
        "group-1": ("Groups of one frame", "I1 L1 L1 L1 I1 L1"),
        "group-2": ("Groups of two frames, the last of one", "I2 L2 L2 L2 I2 L1"),
        "group-30": ("Groups of 30 frames, the last of one", "I30 L1"),
        "group-only": ("One group, whatever its frames might have been", "I41"),
        "groups-mixed": ("Groups of 1 to 9 frames", "I3 L1 L9 I1 I5 L2 I2 L7"),
        "intra-1": ("Every LTR is intra coded", "I4 I4 I4 I3"),
        "intra-2": ("Every second LTR is intra coded", "I4 L4 I4 L4 I2"),
        "intra-0": ("The first LTR alone is intra coded", "I4 L4 L4 L4 L4 L4 L4"),
    }
    for case, (said, units) in cases.items():
        plan = Plan((units,), 6, apart=True)
        n_frames = sum(plan.segments)
        for name, purpose, made in both(case, said, plan):
            shelf.plan(name, purpose, made, [(n_frames // 2, n_frames), (0, 2)])


def _matrices(shelf: Groups) -> None:
    learned = (basis_of(3, 3), basis_of(3, 3, 1), basis_of(3, 3, 2))
    plan = Plan(("I7 L5",))
    cases: dict[str, tuple[str, Plan]] = {
        "cosines": ("Cosines, one matrix", replace(plan, n_channels=7)),
        "cosines-apart": ("Cosines, three matrices", replace(plan, n_channels=15, apart=True)),
        "reordered": (
            "Cosines of all channels, x before y before z",
            replace(plan, n_channels=15, order=REORDERED),
        ),
        "reordered-weights": (
            "A basis and weights of channels that are reordered",
            replace(
                plan,
                n_channels=12,
                order=REORDERED,
                bases=(basis_of(12, 5),),
                weights=WEIGHTS[::-1],
            ),
        ),
        "learned-apart": ("Three bases", replace(plan, n_channels=9, apart=True, bases=learned)),
        "learned-unlike": (
            "Three bases, of one, three and two vectors",
            replace(plan, n_channels=9, apart=True, bases=UNLIKE),
        ),
        "weights": (
            "Weights from the least to the greatest",
            replace(plan, n_channels=12, weights=WEIGHTS),
        ),
    }
    for case, (said, case_plan) in cases.items():
        for name, purpose, made in both(case, said, case_plan):
            shelf.plan(name, purpose, made, [(5, 9)], spec="Space")
    angles = replace(plan, n_channels=6, weights=bytes((128, 128, 128, 140, 136, 133)), step=0.125)
    for name, purpose, made in both("channels", "Channels of a skeleton, with weights", angles):
        motion = motion_of(made, skeleton=puppet())
        shelf.plan(name, purpose, made, [(6, 12)], motion=motion, spec="Space")
    rough = Plan(("I20 L20",), 9, step=0.1, fill=noise, weights=bytes(range(120, 129)))
    rough = replace(rough, bases=(basis_of(9, 9, shifts=SCATTERED),))
    purpose = "Sums that another order, or a fused product, would round to another number"
    for name, said, made in both("rounding", purpose, rough):
        shelf.plan(name, said, made, spec="Space")


def _steps(shelf: Groups) -> None:
    for case, step in (("third", 1 / 3), ("least", 2.0**-100), ("greatest", 2.0**100)):
        purpose = f"Coefficients are multiples of {step!r}."
        shelf.plan(f"step-{case}", purpose, Plan(("I5 L4",), step=step), [(2, 9)], spec="Space")
    every = Plan(("I512",), 1, steps=numbered(range(512)), fill=_ones)
    for name, purpose, made in both("steps-all", "Steps of every code, ascending", every):
        shelf.plan(name, purpose, made, [(300, 301)])
    jumps = [511, 0, 511, *(256 + d for n in range(9) for d in (2**n - 1, 0, 1 - 2**n, 0)), 0, 1]
    plan = Plan((f"I{len(jumps)}",), 2, steps=numbered(jumps), fill=_ones)
    for name, purpose, made in both("steps-far", "Steps that change by 1 to 511", plan):
        shelf.plan(name, purpose, made, [(11, 13)])
    own = {INTRA: (0, 511, 300), LTR: (5, 5, 511, 0, 256), STR: (9, 9, 8, 400, 400)}
    plan = Plan(
        ("I3 L3 L3 I2 I1 L2 L2",),
        2,
        steps=lambda f, kind: own[kind][f % len(own[kind])],
        fill=_ones,
    )
    purpose = "The step of an LTR is told by that of the LTR before, that of an intra coded one not"
    for name, said, made in both("steps-ltr", purpose, plan):
        shelf.plan(name, said, made, [(4, 7)])


def _ones(number: int, n_rows: int, n: int) -> Ints:
    """1 and -1, in every frame."""
    i, k = np.ogrid[:n_rows, :n]
    table: Ints = ((i // 3 + k) % 3 - 1).astype(np.int64)
    table[:, 0] = 1 - 2 * (np.arange(n_rows) // 2 % 2)
    return table


def _silence(shelf: Groups) -> None:
    """Frames with nothing, and frames that say their zeros."""
    cases: dict[str, tuple[str, Sequence[int]]] = {
        "quiet": ("No frame has a coefficient", range(12)),
        "quiet-intra": ("Nothing is here in an intra coded LTR", (0,)),
        "quiet-ltr": ("Nothing is here in an LTR", (4,)),
        "quiet-str": ("Nothing is here in some STRs", (1, 2, 5, 7)),
        "quiet-ltrs": ("Nothing is here in any LTR", (0, 4, 8)),
        "quiet-strs": ("Nothing is here in any STR", (1, 2, 3, 5, 6, 7, 9, 10, 11)),
    }
    for case, (said, silent) in cases.items():
        plan = Plan(("I4 L4 L4",), fill=_without(silent), steps=_wandering)
        for name, purpose, made in both(case, said, plan):
            shelf.plan(name, purpose, made, [(3, 6)])
    plan = Plan(("I4 L4 L4",), fill=_without(range(0, 12, 2)), steps=_wandering)
    plan = replace(plan, said=(0, 2, 4, 6, 8, 10))
    purpose = "Frames whose coefficients are here, with a step, and all 0"
    for name, said, made in both("zeros", purpose, plan):
        shelf.plan(name, said, made, [(4, 12)])
    constant = Plan(("I70000", "L2"), 1, fill=_without(range(1, 70_001)))
    for name, purpose, made in both("constant", "One value in a group of 70,000 frames", constant):
        shelf.plan(name, purpose, made, [(65_530, 65_540), (69_999, 70_002)])


def _without(silent: Sequence[int]) -> Fill:
    def fill(number: int, n_rows: int, n: int) -> Ints:
        table = gentle(number, n_rows, n)
        table[:, 0] |= 1
        table[list(silent)] = 0
        return table

    return fill


def _sizes(shelf: Groups) -> None:
    sizes = [1 + (2**k * 4 // 3 if k else 0) for k in range(40)] + [2**k for k in range(41)]
    sizes += [*range(13, 35), MOST, MOST - 1, 1, MOST, 2, MOST // 3, 3]
    signed = [(-1) ** (k * k // 2) * size for k, size in enumerate(sizes)]
    rows = [signed[i : i + 8] for i in range(0, len(signed), 8)]
    plan = Plan((f"I{len(rows)} L{len(rows)}",), 8, fill=listed([*rows, *rows[::-1]]))
    for name, purpose, made in both("sizes", "Coefficients of all sizes to 2^40", plan):
        shelf.plan(name, purpose, made)
    # After zeros a Golomb-Rice code has no plain bits: its prefix is the value.
    rows = [row for size in sizes for row in ([0, 0, 0, size], [0, 0, 0, 0], [0, 0, 0, 0])]
    plan = Plan((f"I{len(rows) // 2} L{len(rows) - len(rows) // 2}",), 4, GOLOMB, fill=listed(rows))
    purpose = "Prefixes of 0 to 2^40 ones, which are counted in bits from 16 on."
    shelf.plan("prefixes", purpose, plan)
    row = [k % 5 for k in range(7)]
    rows = [[(2 << (i + k) % 40) - 1 for k in row] for i in range(0, 84, 2)]
    plan = Plan((f"I{len(rows)}",), len(row), GOLOMB, fill=listed(rows))
    purpose = "Golomb-Rice codes of 0 to 40 plain bits."
    shelf.plan("plain-bits", purpose, plan)
    great = [[MOST, -MOST, MOST], [-MOST, MOST], [0, MOST, -MOST], [MOST, MOST, MOST]]
    plan = Plan(("I3 L1",), step=2.0**100, fill=listed(great), weights=b"\xff\xfe\xfd")
    plan = replace(plan, steps=lambda number, kind: 511)
    purpose = "The greatest coefficients with the greatest steps and weights"
    for name, said, made in both("greatest", purpose, plan):
        shelf.plan(name, said, made)


def _models(shelf: Groups) -> None:
    spec = "Bases; Space"
    for known, n_joints, what in (
        ("cmu31", 31, "31 markers"),
        ("cmu31_virtual", 124, "31 markers and the virtual ones"),
    ):
        plan = Plan(("I5 L3",), 3 * n_joints, apart=True, known=known, fill=gentle)
        motion = motion_of(plan, skeleton=markers(n_joints))
        purpose = f"A well-known model of {what}, which the file has not."
        shelf.plan(f"known-{n_joints}", purpose, plan, [(4, 7)], motion=motion, spec=spec)
        if n_joints == 31:
            made = replace(plan, embedded=True, coder=GOLOMB)
            purpose = "A well-known model that the file has, too, Golomb."
            shelf.plan("known-embedded", purpose, made, [(4, 7)], motion=motion, spec=spec)
    plans = [
        Plan((units,), 9, coder, apart=True, bases=UNLIKE)
        for coder, units in ((MIXED, "I6 L4"), (GOLOMB, "I3"))
    ]
    motions = [motion_of(plan, name=f"wave {i}") for i, plan in enumerate(plans)]
    crafter = Crafter()
    for plan, motion in zip(plans, motions, strict=True):
        crafter.clip(motion, codec=codec_of(plan), grouping="all", segment_frames=0)
    data = finished(crafter)
    assert sum(kind == b"MODL" for kind, _ in crafter.directory.shared) == 1
    purpose = "Two clips with one model, the second Golomb."
    shelf.hold("model-shared", f"{HEADING}; MODL", purpose, data, *motions)
