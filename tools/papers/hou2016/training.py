"""Hou 2016's Fig. 3 and Fig. 5, and its choice of P, for bases alone: no codec takes part.

A transform is three orthogonal matrices, one a coordinate, with basis vectors as rows; positions
are float64 (n_frames, J, 3) in centimeters.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcz.bench.cases import Case, load
from mcz.bench.tables import ResultTable
from mcz.codecs.training import frames_of, training_set
from mcz.codecs.transforms.bases import GROWTH, ITERATIONS, dct_matrix, haar_basis, learn_bases
from mcz.errors import MotionError

Floats = NDArray[np.float64]
Transform = Sequence[Floats]

AXES = "xyz"
# What the bases of this package were trained on: none of the test clips, and of their subjects 86
# alone, as in the paper.
TRAINING_CLIPS = (
    *("02_01", "02_03", "02_05", "02_08", "05_01", "05_02", "05_03", "05_07", "05_11", "05_18"),
    *("07_05", "09_01", "09_06", "09_12", "10_03", "13_29", "16_01", "16_02", "16_05", "16_08"),
    *("16_11", "16_15", "16_30", "16_41", "16_57", "16_58", "86_01", "131_04"),
)
SHARES = (0.05, 0.1, 0.2, 0.3, 0.4, 0.5)  # of coefficients that are not zero
SPARSITIES = (2, 5, 8, 11)
MARKS = (1, 10, 50, 100, 200, 300)  # iterations that the table of Fig. 3 shows


@dataclass(frozen=True, slots=True)
class Curve:
    """The objective of one coordinate after each iteration, (K + 1,), in cm^2 of all frames."""

    axis: str
    start: str
    growth: int
    objective: Floats
    begin: float  # the objective with the start itself, before any growth

    def at(self, iteration: int) -> float:
        """After so many iterations of the final sparsity; where it had settled, at the end."""
        return float(self.objective[min(iteration, len(self.objective) - 1)])


def convergence(
    positions: Floats, *, iterations: int = ITERATIONS, growths: Sequence[int] = (0, GROWTH)
) -> list[Curve]:
    """Fig. 3: how the objective falls from either start, as published (growth 0) and with growth.

    A curve begins with the iterations of the final sparsity; what growth came before is left out.
    """
    curves = []
    for growth in growths:
        for start in ("dct", "haar"):
            found = learn_bases(positions, iterations=iterations, growth=growth, start=start)
            for axis, learned in zip(AXES, found, strict=False):
                objective = learned.objective
                falling = objective[learned.n_growth :]
                curves.append(Curve(axis, start, growth, falling, float(objective[0])))
    return curves


def convergence_table(curves: Sequence[Curve], n_frames: int, n_points: int) -> ResultTable:
    """Both starts beside each other.

    ``haar / dct`` compares where they end; "of the fall" is their difference as a share of how far
    the objective has fallen from its start with DCT, which is what a plot of it shows.
    """
    marks = [mark for mark in MARKS if mark < max(len(curve.objective) for curve in curves)]
    columns = (
        *(("coordinate", ""), ("growth", "d"), ("start", ""), ("iterations", "d")),
        ("at the start", ".4g"),
        *((f"after {mark}", ".4g") for mark in marks),
        *(("haar / dct", ".4f"), ("of the fall", ".3%")),
    )
    caption = (
        f"{n_frames:,} training frames of {n_points} points, P = 8. Objective of equation 6 in "
        "cm^2, a frame and point. growth: iterations with each smaller P before; 0 is Algorithm 1 "
        "as published. haar / dct: at the end; of the fall: their difference there, as a share of "
        "how far the objective has fallen."
    )
    table = ResultTable("Hou 2016, Fig. 3: convergence", caption, columns)
    size = max(1, n_frames * n_points)
    by_start = {(c.axis, c.growth, c.start): c for c in curves}
    for curve in curves:
        dct = by_start.get((curve.axis, curve.growth, "dct"))
        ratio = share = None
        if curve.start == "haar" and dct is not None:
            end, other = float(curve.objective[-1]), float(dct.objective[-1])
            if 0 < other < dct.begin:  # else there was nothing to learn
                ratio, share = end / other, abs(end - other) / (dct.begin - other)
        table.rows.append(
            (
                *(curve.axis, curve.growth, curve.start, len(curve.objective) - 1),
                curve.begin / size,
                *(curve.at(mark) / size for mark in marks),
                *(ratio, share),
            )
        )
    return table


def fixed_transforms(n_points: int) -> dict[str, Transform]:
    """The transforms that nobody learns, three times the same matrix."""
    return {"DCT": [dct_matrix(n_points)] * 3, "Haar": [haar_basis(n_points)] * 3}


def distortions(
    positions: Floats, transform: Transform, shares: Sequence[float] = SHARES
) -> list[float]:
    """Mean distance of points, in cm, where only so many coefficients of the whole clip are kept.

    The largest are kept, of all frames and coordinates together.
    """
    matrices = np.stack(transform)
    coefficients = np.einsum("akj,fja->fka", matrices, positions, optimize=True)
    flat = coefficients.reshape(-1)
    order = np.argsort(-np.abs(flat), kind="stable")
    found = []
    for share in shares:
        kept = np.zeros_like(flat)
        chosen = order[: round(share * len(flat))]
        kept[chosen] = flat[chosen]
        # The matrices are orthogonal up to rounding, so the inverse is the transpose.
        back = np.einsum("akj,fka->fja", matrices, kept.reshape(coefficients.shape), optimize=True)
        found.append(float(np.sqrt(((back - positions) ** 2).sum(axis=2)).mean()))
    return found


def distortion_table(
    clips: Mapping[str, Floats], transforms: Mapping[str, Transform], title: str = ""
) -> ResultTable:
    """Fig. 5: rows of clips and transforms, columns of shares; last the mean over the clips."""
    columns = (("clip", ""), ("transform", ""), *((f"{share:.0%}", ".3f") for share in SHARES))
    caption = (
        "Mean distance of points in cm, where that share of all coefficients of the clip is kept, "
        "the largest; every coordinate of every frame is transformed by itself. LSDT: learned from "
        "frames, as in the paper; as shipped: from steps between frames, as codecs code them. "
        "mean: over clips."
    )
    table = ResultTable(title or "Hou 2016, Fig. 5: spatial decorrelation", caption, columns)
    sums = {name: np.zeros(len(SHARES)) for name in transforms}
    for clip, positions in clips.items():
        for name, transform in transforms.items():
            row = distortions(positions, transform)
            sums[name] += row
            table.rows.append((clip, name, *row))
    for name, total in sums.items():
        table.rows.append(("mean", name, *(total / max(1, len(clips))).tolist()))
    return table


def positions_of(case: Case) -> Floats:
    """The positions of a clip in cm; raises MotionError where its unit is unknown."""
    found = training_set([load(case).motion])
    if found.unit != "cm":
        raise MotionError(f"{case.name}: its length unit is unknown")
    return frames_of(found)
