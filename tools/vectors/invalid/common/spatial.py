"""Faults of clips of lsdt-frame and lsdt-clip: headers, signals, segments."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from mcz.container import payloads
from mcz.numbers import Grid, GridKind
from mcz.schema import varint
from tools.records import built
from tools.vectors.build.edits import headed, put, says
from tools.vectors.build.files import Broken, rehash
from tools.vectors.build.spatial_clips import (
    FRAME,
    Plan,
    basis_of,
    file_with,
    header,
)
from tools.vectors.build.spatial_streams import silent, spec_of


def add(shelf: Broken, name: str) -> None:
    _signal(shelf, name)
    _segments(shelf, name)
    if name == FRAME:
        _flags(shelf, name)
    else:
        _windows(shelf, name)


def _flags(shelf: Broken, name: str) -> None:
    """A mean and courses, of a codec that has none."""
    nothing = basis_of(1, 1, entries=[[0]])
    plan = Plan(name, 1, (6,), window=1, bases=(nothing,))
    for case, purpose, flag in (
        ("flags-mean", "A mean, of zeros, which the codec has not.", b"\4"),
        ("flags-courses", "Courses, which the codec has not.", b"\x08"),
    ):
        said = says(header(plan, flags=flag, basis=b"\0"))
        shelf.add(case, spec_of(name, "Space"), purpose, silent(plan, CLIP=said))


def _windows(shelf: Broken, name: str) -> None:
    plan = Plan(name, 2, (12,), frequencies=4)
    cases: dict[str, tuple[str, dict[str, bytes]]] = {
        "window-0": ("Windows of 0 frames.", {"window": b"\0", "n_frequencies": b"\0"}),
        "frequencies-0": ("No frequencies.", {"n_frequencies": b"\0"}),
        "frequencies-9": ("9 frequencies of 8 frames.", {"n_frequencies": b"\x09"}),
        "window-varint": ("A window of 8 frames, in two bytes.", {"window": b"\x88\0"}),
        "frequencies-varint": ("4 frequencies, in two bytes.", {"n_frequencies": b"\x84\0"}),
    }
    for case, (purpose, parts) in cases.items():
        made = replace(plan, frequencies=8) if case == "frequencies-9" else plan
        data = silent(made, CLIP=says(header(made, **parts)))
        shelf.add(case, spec_of(name), purpose, data)
    one = replace(plan, segments=(9,), window=2048)
    said = says(header(one, window=varint(2049)))
    shelf.add("window-2049", spec_of(name), "Windows of 2049 frames.", silent(one, CLIP=said))


def _signal(shelf: Broken, name: str) -> None:
    plan = Plan(name, 6, (8,))
    spec = spec_of(name, "CLIP")
    twice = put(payloads.Clip, "signals.0.samples_per_frame", b"\2")

    def rows(found: Any) -> Any:
        return replace(found, signals=(replace(found.signals[0], samples_per_frame=2),))

    still_ = np.zeros((16, 6))
    data = silent(plan, CLIP=twice, CEND=rehash(still_), row=rows)
    shelf.add("samples", spec, "Two rows a frame.", data)
    more = put(payloads.Clip, "signals.0.n_resolutions", b"\2")
    data = silent(plan, CLIP=more, segments=lambda made: [(h, [*s, b""]) for h, s in made])
    shelf.add("resolutions", spec, "Two resolutions.", data)
    listed_ = put(payloads.Clip, "signals.0.groups", b"\3\2\3\3")
    data = silent(plan, CLIP=listed_, segments=lambda made: [(h, [*s, *s]) for h, s in made])
    shelf.add("groups", spec, "Two groups.", data)
    run = built(payloads.GridRun, {"n_channels": 6, "grid": Grid(GridKind.INTEGER)}, "grids")
    integers = put(payloads.Clip, "signals.0.grids", b"\1" + run)
    data = silent(plan, CLIP=integers, CEND=rehash(np.zeros((8, 6), np.int64)))
    purpose = "All grids are INTEGER, but the codec decodes no ordinals."
    shelf.add("integers", f"{spec}; Codecs", purpose, data)


def _segments(shelf: Broken, name: str) -> None:
    plan = Plan(name, 3, (8, 8))
    spec = spec_of(name, "DATA")
    cases: list[tuple[str, str, Any]] = [
        ("segment-lead", "A lead, which no segment has.", headed(1, lead=1)),
        ("segment-tail", "A tail, which no segment has.", headed(0, tail=1)),
    ]
    if name != FRAME:
        cases += [("segment-not-fresh", "A segment that does not start fresh.", headed(1, flags=0))]
    else:
        cases += [("segment-first", "The first segment is not fresh.", headed(0, flags=0))]
    for case, purpose, edit in cases:
        shelf.add(case, spec, purpose, file_with(plan, segments=edit))
