"""The studies of bases alone as tasks: what ``training.py`` computes, kept as JSON."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from typing import Any

from mcz.bench.cases import load
from mcz.bench.measure import Record
from mcz.codecs.basis_models import known_models, parse_bases
from mcz.codecs.training import frames_of, training_set
from tools.papers.curves import Clips, reference_cases
from tools.papers.hou2016.training import (
    convergence,
    convergence_table,
    distortion_table,
    fixed_transforms,
    positions_of,
)

P_ROWS = "P = "  # how the names of bases begin that were trained with another sparsity


def measured_convergence(clips: Clips, iterations: int, every: int) -> Record:
    """Fig. 3: its table, and each objective a frame and point, for a plot."""
    found = training_set(load(case).motion for case in reference_cases(clips))
    frames = frames_of(found, every)
    curves = convergence(frames, iterations=iterations)
    size = max(1, len(frames) * len(found.names))
    lines = [[c.axis, c.growth, c.start, (c.objective / size).tolist()] for c in curves]
    return {
        "table": convergence_table(curves, len(frames), len(found.names)).to_cache(),
        "lines": lines,
    }


def measured_distortions(clips: Clips, named: Sequence[Sequence[str]]) -> Record:
    """Fig. 5, and its like for each P; ``named`` are pairs of a name and bases as text."""
    positions = {case.name: positions_of(case) for case in reference_cases(clips)}
    learned = {name: _transform(data) for name, data in named}
    n_points = next(iter(positions.values())).shape[1]
    others = {n: t for n, t in learned.items() if not n.startswith(P_ROWS)} | _shipped_bases(
        n_points
    )
    by_sparsity = {n: t for n, t in learned.items() if n.startswith(P_ROWS)}
    title = "Hou 2016, Fig. 4: P, for the transform alone"
    return {
        "fig_5": distortion_table(positions, others | fixed_transforms(n_points)).to_cache(),
        "by_sparsity": distortion_table(positions, by_sparsity, title).to_cache(),
    }


def _shipped_bases(n_points: int) -> dict[str, Any]:
    """The well-known bases for so many points."""
    found: dict[str, Any] = {}
    for model in known_models().values():
        vectors = [basis.vectors for basis in parse_bases(model.data)]
        if [v.shape for v in vectors] == [(n_points, n_points)] * 3:
            found["LSDT, as shipped" + (f" {len(found) + 1}" if found else "")] = vectors
    return found


def _transform(data: str) -> Any:
    return [basis.vectors for basis in parse_bases(base64.b64decode(data))]
