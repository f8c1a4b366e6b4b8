"""Invalid, one fault each: means and courses of lsdt-clip, which its preset ``pca-rdo`` has."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from mcz.codecs.basis_models import Basis, build_bases
from mcz.codecs.contract import Model, id_of
from mcz.container import payloads
from mcz.container.chunks import build_chunk
from mcz.motion import Channel, Joint, Skeleton
from mcz.schema import varint
from tools.records import built
from tools.vectors.build.edits import says
from tools.vectors.build.files import Broken, Vector, rehash
from tools.vectors.build.spatial_clips import (
    PCA_RDO,
    Plan,
    basis_of,
    file_with,
    header,
    motion_of,
    still,
    values_of,
)
from tools.vectors.build.spatial_streams import (
    Bits,
    coded_entries,
    silent,
    spec_of,
    stream_with,
    with_model,
)

WIDE = 2049  # channels


def vectors() -> Iterable[Vector]:
    shelf = Broken(f"invalid/{PCA_RDO}")
    _courses(shelf, PCA_RDO)
    _too_many(shelf, PCA_RDO)
    _mean(shelf)
    return shelf.vectors


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


def _mean(shelf: Broken) -> None:
    """A mean that fits the channels, which are more than a basis may have entries."""
    plan = Plan(PCA_RDO, WIDE, (1,), window=1, apart=True, prefix=True, fill=still)
    data = b"\1" + varint(WIDE) + b"\1\0" + coded_entries([(1, WIDE, 0)])
    model = build_chunk(b"MODL", built(payloads.Modl, {"kind": 1, "data": data}, "MODL"))
    said = says(header(plan, flags=b"\5", model=id_of(Model(1, data))))
    skeleton = Skeleton((Joint("", channels=(Channel(""),) * WIDE),))
    made = file_with(
        plan,
        motion_of(plan, skeleton=skeleton),
        index=False,
        CLIP=said,
        CLIP_frame=lambda chunk: model + chunk,
    )
    shelf.add("mean-2049", spec_of(PCA_RDO, "Bases"), "A mean of 2049 entries.", made)
