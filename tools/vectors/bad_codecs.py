"""Invalid, one fault each: what the folders of codecs 4, 5, 6, 9 and 10 have of their own.

A decoder may read these codecs by other code than their kin, so each kind of fault is there once.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from mcz.codecs import by_name, raw
from mcz.codecs._lossy import SCALED
from mcz.container import payloads
from mcz.numbers import Grid, GridKind
from mcz.schema import build, varint
from tools.vectors import components, spatial, waved
from tools.vectors.components import part_of
from tools.vectors.craft import Broken, Vector, file_of, rehash
from tools.vectors.edits import Edit, headed, plus, put, says, stream
from tools.vectors.spatial import MDTT, PCA_RDO, basis_of
from tools.vectors.spatial_faults import silent, sized, spec_of

BEYOND = 2**40 + 1


def vectors() -> Iterable[Vector]:
    shelves = {name: Broken(f"invalid/{name}") for name in ("pca", "dwt", "awt", MDTT, PCA_RDO)}
    _pca(shelves["pca"])
    for name in ("dwt", "awt"):
        _waves(shelves[name], name)
    for name in (MDTT, PCA_RDO):
        _windows(shelves[name], name)
    return [vector for shelf in shelves.values() for vector in shelf.vectors]


def _integers(n_channels: int) -> Edit:
    run = {"n_channels": n_channels, "grid": Grid(GridKind.INTEGER)}
    return put(payloads.CLIP, "signals.0.grids", b"\1" + build(payloads.GRID_RUN, run, "grids"))


def _two_rows(found: Any) -> Any:
    return replace(found, signals=(replace(found.signals[0], samples_per_frame=2),))


def _pca(shelf: Broken) -> None:
    plan = components.Plan((part_of(8, 4, 1),), empty=(0,))
    motion = components.motion_of(plan)
    spec = f"{components.HEADING}; CLIP"
    twice = put(payloads.CLIP, "signals.0.samples_per_frame", b"\2")
    grouped = put(payloads.CLIP, "signals.0.groups", b"\3\2\2\2")
    resolved = put(payloads.CLIP, "signals.0.n_resolutions", b"\2")
    cases: tuple[tuple[str, str, dict[str, Any]], ...] = (
        ("samples", "Two rows a frame.", {"CLIP": twice, "CEND": rehash(np.zeros((16, 4)))}),
        ("groups", "Two groups.", {"CLIP": grouped, "segments": _more}),
        ("resolutions", "Two resolutions.", {"CLIP": resolved, "segments": _more}),
        (
            "integers",
            "All grids are INTEGER, but the codec decodes no ordinals.",
            {"CLIP": _integers(4), "CEND": rehash(np.zeros((8, 4), np.int64))},
        ),
    )
    for name, purpose, edits in cases:
        row = {"row": _two_rows} if name == "samples" else {}
        shelf.add(name, spec, purpose, components.file_with(plan, motion, **edits, **row))


def _more(made: Any) -> Any:
    """An empty stream more."""
    return [(header, [*streams, b""]) for header, streams in made]


def _waves(shelf: Broken, name: str) -> None:
    codec = by_name(name)
    spec = f"Codec {codec.id}: {name}"
    plan = waved.Plan(16, waved.DB2, ends=(8,))
    scaled = replace(plan, decimals=SCALED)
    silent_ = [waved.zeros(plan)]

    def add(case: str, purpose: str, plan: waved.Plan, made: Any, **edits: Any) -> None:
        motion = waved.motion_of(plan, made)
        encode = waved.codec_of(plan, made).encode
        own = replace(codec, encode=encode, parameters=raw.CODEC.parameters, dial=None)
        data = file_of(motion, codec=own, grouping=edits.pop("grouping", "channel"), **edits)
        shelf.add(case, spec, purpose, data)

    said: tuple[tuple[str, str, waved.Plan, dict[str, bytes]], ...] = (
        ("wavelet-11", "A wavelet beyond the registry.", plan, {"wavelet": b"\x0b"}),
        ("levels-17", "17 levels.", plan, {"levels": b"\x11"}),
        ("decimals-16", "16 decimals.", plan, {"decimals": b"\x10"}),
        ("least-0", "A least detail of 0.", plan, {"least": b"\0"}),
        ("frames-fewer", "Fewer coded frames than are stored.", plan, {"coded_frames": b"\x0f"}),
        ("unit-NaN", "A unit of nan.", scaled, {"unit": struct.pack("<d", math.nan)}),
        ("header-and-byte", "A byte behind the header.", plan, {"least": b"\1\0"}),
        ("header-none", "A header of no bytes.", plan, dict.fromkeys(_FIELDS, b"")),
    )
    for case, purpose, made, parts in said:
        add(case, purpose, made, silent_, CLIP=says(waved.header(made, **parts)))
    samples = put(payloads.CLIP, "signals.0.samples_per_frame", b"\2")
    edits = {"CLIP": samples, "CEND": rehash(np.zeros((32, 1))), "row": _two_rows}
    add("samples", "Two rows a frame.", plan, silent_, **edits)
    edits = {"CLIP": _integers(1), "CEND": rehash(np.zeros((16, 1), np.int64))}
    purpose = "All grids are INTEGER, but the codec decodes no ordinals."
    add("integers", purpose, plan, silent_, **edits)
    for case, purpose, edit in (
        ("segment-lead-less", "A lead of a frame less than the filters reach.", headed(1, lead=5)),
        ("segment-tail", "A tail, which no segment has.", headed(0, tail=1)),
        ("segment-not-fresh", "A segment that needs the one before.", headed(1, flags=0)),
    ):
        add(case, purpose, plan, silent_, segments=edit)
    made = waved.waves(plan)
    bits: tuple[tuple[str, str, int, Edit], ...] = (
        ("byte-0-behind", "A byte 0 behind the bits of an approximation.", 0, plus(b"\0")),
        ("byte-missing", "An approximation without its last byte.", 0, lambda data: data[:-1]),
        ("detail-byte-behind", "A byte 255 behind the bits of a detail.", 2, plus(b"\xff")),
    )
    for case, purpose, place, edit in bits:
        add(case, purpose, plan, made, segments=stream(place, edit))
    flat = waved.Plan(4, waved.HAAR, 0, decimals=0)
    first = b"\x3f" + varint(2 * BEYOND)
    zeros = [waved.zeros(flat)]
    purpose = f"A first coefficient of {BEYOND}."
    edits = {"segments": stream(0, lambda _: first), "CEND": rehash(np.full((4, 1), float(BEYOND)))}
    add("first-beyond", purpose, flat, zeros, **edits)


_FIELDS = ("wavelet", "lo", "hi", "levels", "coded_frames", "decimals", "unit", "least")


def _windows(shelf: Broken, name: str) -> None:
    plan = spatial.Plan(name, 4, (6,), bases=(basis_of(4, 2),))
    spec = spec_of(name, "Space")
    weighted = replace(plan, weights=bytes(4))
    heads: tuple[tuple[str, str, spatial.Plan, dict[str, bytes]], ...] = (
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
        data = silent(made, CLIP=says(spatial.header(made, **parts)))
        shelf.add(case, spec, purpose, data)
    short = spatial.Plan(name, 4, (6,), bases=(basis_of(4, 2),))
    other = replace(short, bases=(basis_of(3, 2),))
    data = _with_model(short, other)
    shelf.add("model-points-3", spec_of(name, "Bases"), "Vectors of 3 entries for 4 points.", data)
    full = spatial.Plan(name, 3, (20,))
    cases: tuple[tuple[str, str, Callable[[bytes], bytes]], ...] = (
        ("byte-behind", "A byte 255 behind the bits of the last window.", _longer(b"\xff")),
        ("byte-0-behind", "A byte 0 behind the bits of the last window.", _longer(b"\0")),
        ("byte-missing", "The last window without its last byte.", _longer(None)),
        ("window-behind", "A byte behind the last window.", plus(b"\0")),
        ("window-missing", "The third window is missing.", lambda data: sized(*_split(data)[:2])),
        ("stream-empty", "No window.", lambda data: b""),
    )
    for case, purpose, edit in cases:
        data = spatial.file_with(full, segments=stream(0, edit))
        shelf.add(case, spec_of(name), purpose, data)


def _with_model(plan: spatial.Plan, other: spatial.Plan) -> bytes:
    """A file of zeros by ``plan``, whose header names the model of ``other``, which is there."""
    made = replace(plan, fill=spatial.still)
    motion = spatial.motion_of(made)
    model = other.model
    assert model is not None
    codec = spatial.codec_of(made)

    def encode(source: Any, params: Any) -> Any:
        found = codec.encode(source, params)
        return replace(found, header=spatial.header(other), models=(model,))

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
