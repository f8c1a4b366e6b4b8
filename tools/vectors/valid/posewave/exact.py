"""Exact channels beside lossy ones, each joint in a group of its own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mcz.motion import Exceptions, Signal
from mcz.numbers import Grid, GridKind
from tools.vectors.build.pose_clips import (
    HEADING,
    Plan,
    Poses,
    acclaim,
    biovision,
    values_of,
    waves,
)

EXACT = f"{HEADING}; Exact channels"
FIXED = Grid(GridKind.FIXED, 3)


def add(shelf: Poses) -> None:
    skeleton = acclaim()  # root 0 to 5, hip 6 to 8, knee 9, spine 10 and 11
    wave = waves(24, skeleton)
    joints = {
        "one": ("A joint in the middle", (1,)),
        "first": ("The root, so that the first group is exact", (0,)),
        "last": ("The last joint", (3,)),
        "two": ("Two joints side by side", (1, 2)),
        "apart": ("Two joints apart: two lossy groups, of which one has the rows", (1, 3)),
        "all": ("All joints: there are no rows", (0, 1, 2, 3)),
    }
    for name, (purpose, exact) in joints.items():
        requests = [(1, (0, 24), None), (0, (3, 9), exact), (2, (0, 24), (2,))]
        plan = Plan(skeleton, wave, exact=exact, ends=(10,))
        shelf.plan(f"exact-{name}", f"{purpose}.", plan, EXACT, requests)
    plan = Plan(skeleton, wave, {"levels": 0}, exact=(1,), ends=(7,))
    shelf.plan("exact-no-levels", "An exact joint, no levels.", plan, EXACT)
    plan = Plan(skeleton, wave, exact=(2,), cut=1)
    shelf.plan("exact-cut", "An exact joint where the finest details are left out.", plan, EXACT)
    plan = Plan(biovision(), waves(24, biovision()), {"orders": [0, 3, 5, 0, 0]}, exact=(2,))
    shelf.plan("exact-order", "An exact joint with an axis order, of no account.", plan, EXACT)
    plan = Plan(skeleton, np.where(np.arange(12) == 7, wave, wave[:1]), exact=(1,))
    shelf.plan("exact-beside-still", "All lossy channels stand still.", plan, EXACT)
    _of_text(shelf, Plan(skeleton, np.round(wave, 3), exact=(1, 3), ends=(12,)))


def _of_text(shelf: Poses, plan: Plan) -> None:
    """Grids of text, one of which changes; a token off its grid; values that are invalid."""
    source = plan.source.copy()
    source[12:, 7] = np.round(source[12:, 7] / 8, 6)
    source[4, 10], source[5, 11], source[6, 10] = 1e-9, -0.0, 0.0
    plan = replace(plan, source=source, grids=(FIXED,) * 12)
    mask = np.ones(source.shape, np.bool_)
    mask[8:11, 8] = mask[2:4, 1] = False
    signal = Signal(
        values_of(plan),
        plan.grids,
        mask=mask,
        grid_changes=((12, 7, Grid(GridKind.FIXED, 6)),),
        exceptions=Exceptions(np.array([4]), np.array([10]), (b"1e-09",)),
    )
    purpose = (
        "Exact channels on grids of text: a grid changes, a token is off its grid, some invalid."
    )
    more = {"signals": (signal,)}
    requests = [(0, (4, 20), (1, 3))]
    shelf.plan("exact-of-text", purpose, plan, f"{EXACT}; Codecs", requests, more)
