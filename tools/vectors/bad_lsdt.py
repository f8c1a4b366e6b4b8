"""Invalid, one fault each: headers, signals and segments of codecs 7 to 10.

Where a reader can overlook the fault, the hash is that of what it then decodes.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mcz.container import payloads
from mcz.motion import Channel, Joint, Skeleton
from mcz.numbers import Grid, GridKind
from mcz.schema import build, varint
from tools.vectors.craft import Broken, Vector, rehash
from tools.vectors.edits import BAD_STEPS, binary64, headed, put, says
from tools.vectors.spatial import (
    CLIP,
    FRAME,
    MDTT,
    PCA_RDO,
    Lengths,
    Plan,
    basis_of,
    file_with,
    header,
    motion_of,
    still,
)
from tools.vectors.spatial_faults import (
    Bits,
    silent,
    spec_of,
    stream_with,
)

PAIR: Lengths = ((1, 1), (1, 1))  # codes of 0 and 1


def vectors() -> Iterable[Vector]:
    found: list[Vector] = []
    for name in (FRAME, CLIP, MDTT, PCA_RDO):
        shelf = Broken(f"invalid/{name}")
        _flags(shelf, name)
        _signal(shelf, name)
        _segments(shelf, name)
        if name != FRAME:
            _windows(shelf, name)
        if name in (FRAME, CLIP):
            _headers(shelf, name)
            _codes(shelf, name)
        found += shelf.vectors
    return found


def _headers(shelf: Broken, name: str) -> None:
    plan = Plan(name, 4, (6,), bases=(basis_of(4, 2),))
    weighted = replace(plan, weights=bytes(4))
    cosines = replace(plan, bases=())
    cases: dict[str, tuple[str, Plan, dict[str, bytes]]] = {
        "flags-16": ("A flag that is reserved.", plan, {"flags": b"\x10"}),
        "flags-128": ("Another flag that is reserved.", plan, {"flags": b"\x80"}),
        "basis-2": ("A basis of kind 2.", plan, {"basis": b"\2"}),
        "model-absent": ("Bases of a model, which is not named.", plan, {"model": b""}),
        "model-cut": ("15 bytes of the id of a model.", plan, {"model": bytes(15)}),
        "model-beside": ("A model is named beside cosines.", cosines, {"model": bytes(16)}),
        "step-cut": ("Half of a step.", plan, {"step": bytes(4)}),
        "weights-absent": ("Weights, of which there are none.", weighted, {"weights": b""}),
        "weights-0": ("Weights, 0 of them.", weighted, {"weights": b"\0"}),
        "weights-fewer": ("3 weights of 4 channels.", weighted, {"weights": b"\3" + bytes(3)}),
        "weights-more": ("5 weights of 4 channels.", weighted, {"weights": b"\5" + bytes(5)}),
        "weights-varint": (
            "4 weights, said in two bytes.",
            weighted,
            {"weights": b"\x84\0" + bytes(4)},
        ),
        "weights-beside": ("Weights, but no flag.", plan, {"weights": b"\4" + bytes(4)}),
        "coder-2": ("Coder 2.", plan, {"coder": b"\2"}),
        "coder-255": ("Coder 255.", plan, {"coder": b"\xff"}),
        "coder-absent": ("A header without its last field.", plan, {"coder": b""}),
        "header-and-byte": ("A byte behind the header.", plan, {"coder": b"\0\0"}),
        "codes-beside": ("Codes beside adaptive bits.", plan, {"coder": b"\0\0\0"}),
    }
    for case, (purpose, made, parts) in cases.items():
        data = silent(made, CLIP=says(header(made, **parts)))
        shelf.add(case, spec_of(name, "Space"), purpose, data)
    data = silent(plan, CLIP=says(b""))
    shelf.add("header-none", spec_of(name, "Space"), "A header of no bytes.", data)
    for case, step in BAD_STEPS.items():
        data = silent(plan, CLIP=says(header(plan, step=binary64(step))))
        shelf.add(f"step-{case}", spec_of(name, "Space"), f"A step of {step!r}.", data)
    _points(shelf, name)


def _points(shelf: Broken, name: str) -> None:
    """Channels that make no points."""
    plan = Plan(name, 4, (1,), window=1, prefix=True)  # one byte for 3 rows as for 4
    data = silent(plan, CLIP=says(header(plan, flags=b"\1")))
    purpose = "x, y and z apart, of 4 channels."
    shelf.add("channels-4", spec_of(name, "Space"), purpose, data)
    if name == FRAME:
        return  # the skeleton is large, and once is enough
    skeleton = Skeleton((Joint("", channels=(Channel(""),) * 2049),))
    wide = Plan(name, 2049, (1,), window=1, fill=still, apart=True, prefix=True)
    bits = Bits().plain(0, 2049).data()
    edits = {"CLIP": says(header(wide, flags=b"\0")), "segments": stream_with(wide, bits)}
    data = file_with(wide, motion_of(wide, skeleton=skeleton), **edits)
    shelf.add("points-2049", spec_of(name, "Space"), "A matrix of 2049 points.", data)


def _flags(shelf: Broken, name: str) -> None:
    """A mean and courses, of a codec that has none."""
    if name == PCA_RDO:
        return
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
    }
    if name == CLIP:
        cases |= {
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


def _codes(shelf: Broken, name: str) -> None:
    """Lengths that make no code."""
    plan = Plan(name, 2, (6,), prefix=True, lengths=PAIR)
    spec = spec_of(name, "Space", "Prefix codes")
    cases: dict[str, tuple[str, Sequence[int]]] = {
        "length-16": ("a code of 16 bits", (*range(1, 16), 16, 16)),
        "length-255": ("a code of 255 bits", (1, 1, 255)),
        "lengths-91": ("91 lengths", (1, 1) + (0,) * 89),
        "sum-less": ("lengths that leave codes over", (1, 2)),
        "sum-more": ("lengths for which there are not codes enough", (1, 1, 15)),
        "single-2": ("one code alone, of 2 bits", (0, 2)),
    }
    for case, (purpose, lengths) in cases.items():
        for place in ("gap", "value"):
            part = {f"{place}_lengths": varint(len(lengths)) + bytes(lengths)}
            data = silent(plan, CLIP=says(header(plan, **part)))
            shelf.add(f"{place}-{case}", spec, f"Of a {place}: {purpose}.", data)
    for case, purpose, parts in (
        ("codes-varint", "2 lengths, said in two bytes", {"gap_lengths": b"\x82\0\1\1"}),
        ("codes-cut", "3 lengths, of which there are 2", {"value_lengths": b"\3\1\1"}),
        ("codes-absent", "no codes of values", {"value_lengths": b""}),
    ):
        data = silent(plan, CLIP=says(header(plan, **parts)))
        shelf.add(case, spec, f"A header with {purpose}.", data)


def _signal(shelf: Broken, name: str) -> None:
    plan = Plan(name, 6, (8,))
    spec = spec_of(name, "CLIP")
    twice = put(payloads.CLIP, "signals.0.samples_per_frame", b"\2")

    def rows(found: Any) -> Any:
        return replace(found, signals=(replace(found.signals[0], samples_per_frame=2),))

    still_ = np.zeros((16, 6))
    data = silent(plan, CLIP=twice, CEND=rehash(still_), row=rows)
    shelf.add("samples", spec, "Two rows a frame.", data)
    more = put(payloads.CLIP, "signals.0.n_resolutions", b"\2")
    data = silent(plan, CLIP=more, segments=lambda made: [(h, [*s, b""]) for h, s in made])
    shelf.add("resolutions", spec, "Two resolutions.", data)
    listed_ = put(payloads.CLIP, "signals.0.groups", b"\3\2\3\3")
    data = silent(plan, CLIP=listed_, segments=lambda made: [(h, [*s, *s]) for h, s in made])
    shelf.add("groups", spec, "Two groups.", data)
    run = build(payloads.GRID_RUN, {"n_channels": 6, "grid": Grid(GridKind.INTEGER)}, "grids")
    integers = put(payloads.CLIP, "signals.0.grids", b"\1" + run)
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
