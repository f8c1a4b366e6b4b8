"""Invalid, one fault each: models of codecs 7 to 10.

Where a reader can overlook the fault, the hash is that of what it then decodes.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mcz.codecs import _bases
from mcz.codecs._bases import Basis, build_bases
from mcz.codecs.base import Model, id_of
from mcz.coding.streams import code
from mcz.container import payloads
from mcz.motion import Channel, Joint, Skeleton
from mcz.schema import build, varint
from tools.vectors.craft import Broken, Vector, rehash
from tools.vectors.edits import Edit, flip, framed, says, swap
from tools.vectors.spatial import (
    CLIP,
    FRAME,
    MDTT,
    PCA_RDO,
    Ints,
    Plan,
    basis_of,
    file_with,
    header,
    motion_of,
    still,
    values_of,
)
from tools.vectors.spatial_faults import (
    Bits,
    silent,
    spec_of,
    stream_with,
)

MOST = 2**40


def vectors() -> Iterable[Vector]:
    found: list[Vector] = []
    for name in (FRAME, CLIP, MDTT, PCA_RDO):
        shelf = Broken(f"invalid/{name}")
        if name in (FRAME, CLIP):
            _models(shelf, name)
        if name == CLIP:
            _bad_bases(shelf, name)
        if name == PCA_RDO:
            _courses(shelf, name)
            _too_many(shelf, name)
        found += shelf.vectors
    return found


def with_model(plan: Plan, kind: int, data: bytes, **edits: Any) -> bytes:
    """The file of ``plan`` with another model, which the clip names."""
    old = plan.model
    assert old is not None
    payload = build(payloads.MODL, {"kind": kind, "data": data}, "MODL")
    named = swap(id_of(old), id_of(Model(kind, data)))
    return file_with(plan, MODL=lambda _: payload, CLIP=named, **edits)


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


def _bad_bases(shelf: Broken, name: str) -> None:
    """Bytes that are no bases."""
    # A list for each row, in one byte for any number of them.
    plan = Plan(name, 3, (1,), window=1, bases=(basis_of(3, 2),), prefix=True, fill=still)
    good = build_bases(plan.bases)
    n_bases, n_points, n_vectors, shifts, rest = good[:1], good[1:2], good[2:3], good[3:5], good[5:]
    pair = (1, 3, 6), (1, 3, 7)  # the tables of good
    cases: dict[str, tuple[str, bytes]] = {
        "bases-none": ("A model of no bytes", b""),
        "bases-0": ("No bases", b"\0" + good[1:]),
        "bases-17": ("17 bases", b"\x11" + 17 * b"\1\1\0" + coded_entries(17 * [(1, 1, 0)])),
        "bases-varint": ("One basis, in two bytes", b"\x81\0" + good[1:]),
        "bases-points-0": ("Vectors of no entries", n_bases + b"\0" + good[2:]),
        "bases-points-2049": (
            "Vectors of 2049 entries",
            n_bases + varint(2049) + b"\1\0" + coded_entries([(1, 2049, 0)]),
        ),
        "bases-vectors-0": ("No vectors", n_bases + n_points + b"\0"),
        "bases-vectors-4": (
            "4 vectors of 3 entries",
            n_bases + n_points + b"\4" + bytes(4) + coded_entries([(4, 3, 0)]),
        ),
        "bases-shift-41": (
            "41 binary digits",
            good[:3] + b"\6\x29" + coded_entries([(1, 3, 6), (1, 3, 41)]),
        ),
        "bases-shifts-cut": ("A head that ends in its shifts", good[:4]),
        "bases-head-cut": ("A head that ends in a number", b"\1\x83"),
        "bases-byte-behind": ("A byte 255 behind the bits of the model", good + b"\xff"),
        "bases-byte-0-behind": ("A byte 0 behind the bits of the model", good + b"\0"),
        "bases-entry-beyond": (
            "An entry of 2^40 + 1",
            good[:5] + coded_entries(pair, [[1, 2, 3]], [[4, 5, MOST + 1]]),
        ),
        "bases-entry-below": (
            "An entry of -2^40 - 1",
            good[:5] + coded_entries(pair, [[1, 2, 3]], [[4, 5, -MOST - 1]]),
        ),
    }
    assert n_vectors + shifts + rest == good[2:]
    for case, (purpose, data) in cases.items():
        none = {"segments": stream_with(plan, b"")} if case == "bases-vectors-0" else {}
        made = with_model(plan, 1, data, **none)
        shelf.add(case, spec_of(name, "Bases"), f"{purpose}.", made)


def coded_entries(
    tables: Sequence[tuple[int, int, int]], *entries: Sequence[Sequence[int]]
) -> bytes:
    """The bits of tables of (vectors, points, shift), zeros unless they are given."""

    def loop(state: Ints, data: Any) -> bool:
        for at, (n_vectors, n_points, shift) in enumerate(tables):
            table = np.zeros((n_vectors, n_points), np.int64)
            if entries:
                table[:] = entries[at]
            scales = np.full(n_vectors, 1 << shift) >> n_points.bit_length() // 2
            _bases_kernels().code_table(state, data, table, scales, 1)
        return True

    size = sum(n_vectors * n_points for n_vectors, n_points, _ in tables)
    return code(_bases.basis_state(), 2 * size + 256, loop, "bases")


def _bases_kernels() -> Any:
    from mcz.codecs import _pca_kernels

    return _pca_kernels


def _courses(shelf: Broken, name: str) -> None:
    """A mean and courses that do not fit."""
    spec = spec_of(name, "Space", "Bases")
    mean, courses = basis_of(4, 1, 5), basis_of(8, 5, 3)
    plan = Plan(name, 4, (19,), frequencies=5, courses=courses)
    lean = Basis(courses.shifts[:4], courses.entries[:4])
    more = Basis(np.append(courses.shifts, 6), np.pad(courses.entries, ((0, 1), (0, 0))))
    wide = Basis(courses.shifts, np.pad(courses.entries, ((0, 0), (0, 1))))
    still_ = replace(courses, entries=np.pad(lean.entries, ((0, 1), (0, 0))))
    seen = values_of(replace(plan, courses=still_))  # as if the last course were zeros
    cases: dict[str, tuple[str, Sequence[Basis]]] = {
        "courses-4": ("4 courses, where 5 are due.", (lean,)),
        "courses-6": ("6 courses, where 5 are due.", (more,)),
        "courses-of-9": ("Courses of 9 cosines, of windows of 8 frames.", (wide,)),
        "courses-and-mean": ("A mean behind the courses, without its flag.", (courses, mean)),
    }
    for case, (purpose, bases) in cases.items():
        edits = {"CEND": rehash(seen)} if case == "courses-4" else {}
        shelf.add(case, spec, purpose, with_model(plan, 1, build_bases(bases), **edits))
    plan = replace(plan, courses=None, mean=mean)
    twice = Basis(np.array([6, 6]), np.concatenate([mean.entries] * 2))
    shift = mean.shifts
    for case, purpose, basis in (
        ("mean-3", "A mean of 3 entries for 4 channels.", Basis(shift, mean.entries[:, :3])),
        ("mean-5", "A mean of 5 entries.", Basis(shift, np.pad(mean.entries, ((0, 0), (0, 1))))),
        ("means", "A mean of two vectors.", replace(twice, shifts=np.repeat(shift, 2))),
    ):
        shelf.add(case, spec, purpose, with_model(plan, 1, build_bases([basis])))
    both_due = replace(plan, courses=courses)
    turned = build_bases([mean, courses])
    purpose = "The mean comes before the courses."
    shelf.add("mean-first", spec, purpose, with_model(both_due, 1, turned))
    apart = Plan(name, 9, (9,), apart=True, mean=basis_of(9, 1), fill=still)
    thirds = build_bases([basis_of(3, 3, entries=apart.mean.entries)] if apart.mean else [])
    purpose = "A mean of three vectors, of x, y and z apart."
    shelf.add("mean-apart", spec, purpose, with_model(apart, 1, thirds))
    said = says(header(plan, flags=b"\4", model=b""))
    shelf.add("mean-absent", spec, "A mean of a model that is not named.", silent(plan, CLIP=said))


def _too_many(shelf: Broken, name: str) -> None:
    spec = spec_of(name, "Bases")
    entries = np.zeros((257, 2048), np.int64)
    great = basis_of(2048, 257, entries=entries, shifts=[0] * 257)
    plan = Plan(name, 1, (3,), window=2048, frequencies=257, fill=still)
    slight = replace(plan, courses=basis_of(257, 257, entries=entries[:, :257], shifts=[0] * 257))
    purpose = "257 courses of 2048 cosines and as many frames, more than 2^30 products."
    shelf.add("courses-products", spec, purpose, with_model(slight, 1, build_bases([great])))
    points = basis_of(2048, 1, entries=np.zeros((1, 2048)), shifts=[0])
    plan = Plan(name, 2048, (1,), window=1, bases=(points,), mean=points, prefix=True, fill=still)
    skeleton = Skeleton((Joint("", channels=(Channel(""),) * 2048),))
    table = b"\2" + varint(2048) * 2 + bytes(2048) + varint(2048) + b"\1\0"
    table += coded_entries([(2048, 2048, 0), (1, 2048, 0)])
    empty = stream_with(plan, Bits().plain(0, 2048).data())
    motion = motion_of(plan, skeleton=skeleton)
    purpose = "A basis of 2^22 entries, and a mean of 2048 more."
    data = with_model(plan, 1, table, motion=motion, segments=empty)
    shelf.add("bases-entries", spec, purpose, data)
