"""Valid: ``pca-rdo``."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from tools.vectors.build.files import Vector
from tools.vectors.build.spatial_clips import (
    CLIP,
    PCA_RDO,
    UNLIKE,
    WEIGHTS,
    Plan,
    Spaces,
    basis_of,
    noise,
    still,
)
from tools.vectors.valid.common import every_codec, spatial
from tools.vectors.valid.common.spatial import REQUESTS, SEGMENTS

MOST = 2**40


def vectors() -> Iterable[Vector]:
    shelf = Spaces(PCA_RDO)
    spatial.add(shelf)
    spatial.add_own_vectors(shelf)
    spatial.add_longer(shelf)
    spatial.add_ends(shelf, CLIP)
    _courses(shelf)
    _courses_between(shelf)
    every_codec.add(shelf, PCA_RDO)
    return shelf.vectors


def _courses(shelf: Spaces) -> None:
    mean, courses = basis_of(4, 1, 5, shifts=[3]), basis_of(8, 5, 3)
    own, plan = basis_of(4, 3), Plan(n_channels=4, segments=(19, 6, 8), frequencies=5)
    cases: dict[str, tuple[str, Plan]] = {
        "mean": ("A mean, cosines", replace(plan, mean=mean)),
        "courses": (
            "Courses, cosines in space; short windows have cosines",
            replace(plan, courses=courses),
        ),
        "mean-learned": ("A mean and a basis", replace(plan, mean=mean, bases=(own,))),
        "courses-learned": ("Courses and a basis", replace(plan, courses=courses, bases=(own,))),
        "both": ("Courses and a mean", replace(plan, courses=courses, mean=mean)),
        "both-learned": (
            "A basis, courses and a mean, in prefix codes",
            replace(plan, courses=courses, mean=mean, bases=(own,), prefix=True),
        ),
        "courses-of-few": (
            "Courses of 5 of the 8 cosines",
            replace(plan, courses=basis_of(5, 5, 2), bases=(own,)),
        ),
        "courses-all": (
            "As many courses as frames",
            replace(plan, courses=basis_of(8, 8, 2), frequencies=8),
        ),
        "courses-unused": (
            "One short window, so no courses",
            replace(plan, segments=(7,), courses=courses),
        ),
        "courses-window-1": (
            "A course of one frame",
            replace(plan, segments=(5,), window=1, frequencies=1, courses=basis_of(1, 1, 4)),
        ),
        "all-flags": (
            "Three matrices, weights, courses and a mean",
            Plan(
                n_channels=9,
                segments=(19,),
                frequencies=5,
                apart=True,
                weights=WEIGHTS[3:],
                bases=UNLIKE,
                courses=courses,
                mean=basis_of(
                    9, 1, 2, entries=[[MOST, -MOST, 0, 1, -1, 5, 99, -7, 8]], shifts=[40]
                ),
            ),
        ),
        "mean-apart": (
            "A mean of the channels in their order, three matrices",
            Plan(n_channels=6, segments=(9,), apart=True, mean=basis_of(6, 1, 3), step=0.1),
        ),
        "mean-great": (
            "A mean of up to 2^40 under coefficients of 0",
            Plan(
                segments=(5,),
                mean=basis_of(3, 1, entries=[[MOST, -MOST, 1]], shifts=[0]),
                fill=still,
            ),
        ),
    }
    for name, (purpose, made) in cases.items():
        n = made.n_frames
        shelf.plan(name, f"{purpose}.", made, [(n // 3, n - n // 4), (n - 1, n)])
    entries = np.zeros((3, 2048), np.int64)
    entries[0, 0], entries[1, 2047], entries[2, 7] = 64, -5, 9
    plan = Plan(
        n_channels=1,
        segments=(2048,),
        window=2048,
        frequencies=3,
        courses=basis_of(2048, 3, entries=entries, shifts=[6] * 3),
    )
    shelf.plan("window-2048", "Courses of 2048 cosines.", plan, [(2047, 2048)])


def _courses_between(shelf: Spaces) -> None:
    """Windows with cosines between others with courses."""
    plan = Plan(
        n_channels=9,
        segments=SEGMENTS,
        frequencies=5,
        apart=True,
        courses=basis_of(8, 5, 3),
        mean=basis_of(9, 1, 5, shifts=[3]),
    )
    purpose = "Courses and a mean, three matrices, windows of 8, 4, 8, 8, 8, 1 and 8 frames."
    shelf.plan("courses-longer", purpose, plan, REQUESTS)
    one = replace(plan, segments=(7, 8, 3, 8), apart=False, fill=noise)
    purpose = "Courses and a mean, one matrix, windows of 7, 8, 3 and 8 frames."
    shelf.plan("courses-between", purpose, one, [(5, 10), (15, 20)])
