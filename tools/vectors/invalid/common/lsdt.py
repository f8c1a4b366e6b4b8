"""Faults of headers and models of lsdt-frame and lsdt-clip.

Where a reader can overlook the fault, the hash is that of what it then decodes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mcz.codecs.basis_models import Basis, build_bases
from mcz.motion import Channel, Joint, Skeleton
from mcz.schema import varint
from tools.vectors.build.edits import BAD_STEPS, Edit, binary64, flip, framed, says
from tools.vectors.build.files import Broken, rehash
from tools.vectors.build.spatial_clips import (
    FRAME,
    Lengths,
    Plan,
    basis_of,
    file_with,
    header,
    motion_of,
    still,
    values_of,
)
from tools.vectors.build.spatial_streams import Bits, silent, spec_of, stream_with, with_model

PAIR: Lengths = ((1, 1), (1, 1))  # codes of 0 and 1


def add(shelf: Broken, name: str) -> None:
    _headers(shelf, name)
    _codes(shelf, name)
    _models(shelf, name)


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


def _models(shelf: Broken, name: str) -> None:
    """Models that do not fit; a reader may take what it needs of them."""
    spec = spec_of(name, "Space", "Bases")
    plan = Plan(name, 4, (9,), bases=(basis_of(4, 3),))
    own = plan.bases[0]
    wide = Basis(own.shifts, np.pad(own.entries, ((0, 0), (0, 1))))
    narrow = Basis(own.shifts, own.entries[:, :3])
    padded = replace(own, entries=np.pad(narrow.entries, ((0, 0), (0, 1))))
    seen = values_of(replace(plan, bases=(padded,)))
    edits = {"model-points-3": {"CEND": rehash(seen)}}
    cases: dict[str, tuple[str, int, Sequence[Basis]]] = {
        "model-kind": ("A model of kind 2, with the bases that are due.", 2, plan.bases),
        "model-bases-2": ("A model of two bases, where one is due.", 1, (own, own)),
        "model-points-3": ("Vectors of 3 entries for 4 points.", 1, (narrow,)),
        "model-points-5": ("Vectors of 5 entries for 4 points, the last 0.", 1, (wide,)),
    }
    for case, (purpose, kind, bases) in cases.items():
        made = with_model(plan, kind, build_bases(bases), **edits.get(case, {}))
        shelf.add(case, spec, purpose, made)
    apart = Plan(name, 6, (9,), apart=True, bases=(basis_of(2, 2),) * 3)
    other = basis_of(3, 2)
    for case, purpose, bases in (
        ("model-bases-1", "A model of one basis, where three are due.", apart.bases[:1]),
        ("model-bases-4", "A model of four bases, where three are due.", (*apart.bases, other)),
        ("model-third", "The third basis has vectors of 3 entries.", (*apart.bases[:2], other)),
    ):
        shelf.add(case, spec, purpose, with_model(apart, 1, build_bases(bases)))
    changed = _changed_model()
    purpose = "A bit of the model is not as it was when its id was made; the checksum is right."
    shelf.add("model-changed", f"{spec}; MODL", purpose, file_with(plan, MODL_frame=changed))
    after = with_model(plan, 1, build_bases(plan.bases)[:-1])
    shelf.add("model-byte-missing", spec, "Bases without their last byte.", after)


def _changed_model() -> Edit:
    def edit(chunk: bytes) -> bytes:
        return framed(payload=flip(4)(chunk[16:-4]))(chunk)

    return edit
