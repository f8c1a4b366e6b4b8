"""Hou 2016's figures as plots, with ours beside them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from mcz.bench.cases import Variant
from mcz.bench.tables import ResultTable
from tools.papers.curves import HIGH, LOW
from tools.papers.hou2016.tasks import (
    CLIP,
    OWN,
    PRESET,
    RDO,
    REFERENCE,
    Found,
    channel_variants,
    in_channels,
    variants,
)
from tools.papers.hou2016.training import SPARSITIES
from tools.papers.panels import Line, Panels


def panels(found: Found) -> Iterator[Panels]:
    axes = ("CR", "D, mean distance of points (cm)")
    for preset in (False, True):
        lines = tuple((clip, tuple(_lines(found, clip, preset))) for clip in found.cases)
        coder = f"preset {PRESET}" if preset else "our coder"
        name = f"hou2016_rates_{PRESET}" if preset else "hou2016_rates"
        yield Panels(name, f"Hou 2016, Fig. 6 and 7: {coder}", axes, lines)
    yield Panels("hou2016_domains", "Channels against positions", axes, tuple(_domain_lines(found)))
    yield Panels("hou2016_sparsity", "Hou 2016, Fig. 4: P", axes, tuple(_sparsity_lines(found)))
    if kept := found.get(found.spatial()):
        table = ResultTable.from_cache(kept["fig_5"])
        axes = ("coefficients that are not zero (%)", "mean distance of points (cm)")
        spatial = tuple(_spatial_lines(table))
        yield Panels("hou2016_spatial", "Hou 2016, Fig. 5", axes, spatial, (False, True))
    if kept := found.get(found.convergence()):
        axes = ("1 + iterations", "objective (cm², a frame and point)")
        starts = tuple(_convergence_lines(kept["lines"]))
        title = "Hou 2016, Fig. 3: convergence, P = 8"
        yield Panels("hou2016_convergence", title, axes, starts, (True, True))


def _pairs(points: Sequence[dict[str, Any]], key: str = "cr") -> tuple[tuple[float, float], ...]:
    inside = [p for p in points if LOW / 1.5 <= p["cm"] <= HIGH * 1.5]
    return tuple((p[key], p["cm"]) for p in inside)


def _lines(found: Found, clip: str, preset: bool) -> Iterator[Line]:
    for variant in variants(preset=preset):
        yield from _line(found.curve(clip, variant), variant, variant in (REFERENCE,))


def _line(points: Any, variant: Variant, dashed: bool, label: str = "") -> Iterator[Line]:
    if pairs := _pairs(points):
        yield Line(label or variant.label, pairs, dashed)


def _domain_lines(found: Found) -> Iterator[tuple[str, tuple[Line, ...]]]:
    for clip in found.cases:
        lines: list[Line] = []
        for variant in (CLIP, RDO):
            lines += _line(found.curve(clip, variant), variant, False)
            given = in_channels(variant)
            if given in channel_variants():
                lines += _line(found.curve(clip, given), given, True)
        yield clip, tuple(lines)


def _sparsity_lines(found: Found) -> Iterator[tuple[str, tuple[Line, ...]]]:
    for variant in OWN.values():
        for clip in found.papers:
            lines = []
            for P in SPARSITIES:
                data = found.data_of(found.bases_of(P))
                points = found.curve(clip, variant, data) if data else []
                if pairs := _pairs(points, "cr_without_models"):
                    lines.append(Line(f"P = {P}", pairs))
            yield f"{clip}, {variant.codec}", tuple(lines)


def _spatial_lines(table: ResultTable) -> Iterator[tuple[str, tuple[Line, ...]]]:
    shares = [float(head.rstrip("%")) for head, _ in table.columns[2:]]
    for clip in dict.fromkeys(str(row[0]) for row in table.rows):
        rows = [row for row in table.rows if row[0] == clip]
        yield (
            clip,
            tuple(
                Line(str(row[1]), tuple(zip(shares, map(float, row[2:]), strict=True)))  # type: ignore[arg-type]
                for row in rows
            ),
        )


def _convergence_lines(lines: Sequence[Any]) -> Iterator[tuple[str, tuple[Line, ...]]]:
    for axis in dict.fromkeys(line[0] for line in lines):
        found = []
        for of, growth, start, values in lines:
            if of == axis:
                points = tuple((k + 1.0, value) for k, value in enumerate(values) if value > 0)
                label = f"{start}, " + ("P grows before" if growth else "as published")
                found.append(Line(label, points, bool(growth), marked=False))
        yield axis, tuple(found)
