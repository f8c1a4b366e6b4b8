"""Faults of clips of codecs 7 to 10: headers, signals, segments."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from mcz.container import payloads
from mcz.numbers import Grid, GridKind
from mcz.schema import varint
from tools.records import built
from tools.vectors.build import spatial_clips
from tools.vectors.build.edits import headed, plus, put, says, stream
from tools.vectors.build.files import Broken, file_of, rehash
from tools.vectors.build.spatial_clips import (
    CLIP,
    FRAME,
    PCA_RDO,
    Plan,
    basis_of,
    file_with,
    header,
)
from tools.vectors.build.spatial_streams import silent, sized, spec_of


def add(shelf: Broken, name: str) -> None:
    _flags(shelf, name)
    _signal(shelf, name)
    _segments(shelf, name)
    if name != FRAME:
        _windows(shelf, name)


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


def add_once(shelf: Broken, name: str) -> None:
    plan = spatial_clips.Plan(name, 4, (6,), bases=(basis_of(4, 2),))
    spec = spec_of(name, "Space")
    weighted = replace(plan, weights=bytes(4))
    heads: tuple[tuple[str, str, spatial_clips.Plan, dict[str, bytes]], ...] = (
        ("flags-16", "A flag that is reserved.", plan, {"flags": b"\x10"}),
        ("basis-2", "A basis of kind 2.", plan, {"basis": b"\2"}),
        ("coder-2", "Coder 2.", plan, {"coder": b"\2"}),
        ("model-absent", "Bases of a model, which is not named.", plan, {"model": b""}),
        ("weights-fewer", "3 weights of 4 channels.", weighted, {"weights": b"\3" + bytes(3)}),
        ("step-0", "A step of 0.0.", plan, {"step": bytes(8)}),
        ("step-NaN", "A step of nan.", plan, {"step": struct.pack("<d", math.nan)}),
        ("header-and-byte", "A byte behind the header.", plan, {"coder": b"\0\0"}),
    )
    for case, purpose, made, parts in heads:
        data = silent(made, CLIP=says(spatial_clips.header(made, **parts)))
        shelf.add(case, spec, purpose, data)
    short = spatial_clips.Plan(name, 4, (6,), bases=(basis_of(4, 2),))
    other = replace(short, bases=(basis_of(3, 2),))
    data = _with_model(short, other)
    shelf.add("model-points-3", spec_of(name, "Bases"), "Vectors of 3 entries for 4 points.", data)
    full = spatial_clips.Plan(name, 3, (20,))
    cases: tuple[tuple[str, str, Callable[[bytes], bytes]], ...] = (
        ("byte-behind", "A byte 255 behind the bits of the last window.", _longer(b"\xff")),
        ("byte-0-behind", "A byte 0 behind the bits of the last window.", _longer(b"\0")),
        ("byte-missing", "The last window without its last byte.", _longer(None)),
        ("window-behind", "A byte behind the last window.", plus(b"\0")),
        ("window-missing", "The third window is missing.", lambda data: sized(*_split(data)[:2])),
        ("stream-empty", "No window.", lambda data: b""),
    )
    for case, purpose, edit in cases:
        data = spatial_clips.file_with(full, segments=stream(0, edit))
        shelf.add(case, spec_of(name), purpose, data)


def _with_model(plan: spatial_clips.Plan, other: spatial_clips.Plan) -> bytes:
    """A file of zeros by ``plan``, whose header names the model of ``other``, which is there."""
    made = replace(plan, fill=spatial_clips.still)
    motion = spatial_clips.motion_of(made)
    model = other.model
    assert model is not None
    codec = spatial_clips.codec_of(made)

    def encode(source: Any, params: Any) -> Any:
        found = codec.encode(source, params)
        return replace(found, header=spatial_clips.header(other), models=(model,))

    def decode(header: bytes, layout: Any, spans: Any, request: Any, fetch: Any) -> Any:
        return np.zeros((request.stop - request.start, plan.n_channels))

    return file_of(motion, codec=replace(codec, encode=encode, decode=decode), grouping="all")


def _split(data: bytes) -> list[bytes]:
    """The windows of a stream, each shorter than 128 bytes."""
    found = []
    while data:
        assert data[0] < 128
        found.append(data[1 : 1 + data[0]])
        data = data[1 + data[0] :]
    return found


def _longer(more: bytes | None) -> Callable[[bytes], bytes]:
    """The last window with these bytes behind it, or without its last one."""

    def edit(data: bytes) -> bytes:
        *others, last = _split(data)
        return sized(*others, last[:-1] if more is None else last + more)

    return edit
