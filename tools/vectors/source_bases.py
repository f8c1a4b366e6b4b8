"""Base files of faulty sources: tables, C3D files, arrays, Acclaim skeletons."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from mcz.container import payloads
from mcz.files.writing.clip_writer import write_skeleton
from mcz.model.motion import Motion
from mcz.model.schema import parse, varint
from mcz.sources import FORMATS
from mcz.sources.tables.layout import SectionFields, TableDetail, TableTemplate
from mcz.sources.text import amc, asf
from mcz.sources.text.layout import Detail, PatternFields
from tools.records import build_record
from tools.vectors.build.array_files import floats, npy, plain_npz, take_arrays
from tools.vectors.build.c3d_files import c3d_file, c3d_outputs, take_c3d
from tools.vectors.build.files import Crafter, finish_file
from tools.vectors.build.source_files import AMC, ASF, EXAMPLE, set_path, with_source
from tools.vectors.build.table_files import MARKERS, TIMES, VICON


def table(path: str) -> Motion:
    """A table that stands in ``table_files``."""
    texts = {"plain.trc": MARKERS, "times.trc": TIMES, "sections.csv": VICON}
    stem, _, suffix = path.partition(".")
    return set_path(FORMATS[suffix].read(texts[path], stem), path)


def c3d(**fields: Any) -> Motion:
    """A C3D file with these fields of ``c3d_file``."""
    return take_c3d(c3d_file(**fields).build(), "prop")


def outputs() -> Motion:
    """A C3D file of five points, of which two are outputs."""
    return take_c3d(c3d_outputs().build(), "prop")


def array() -> Motion:
    """An NPY file of four rows of two numbers."""
    return take_arrays(npy(floats(4, 2)), "plain.npy")


def long_array(n_rows: int = 256) -> Motion:
    """An NPY file of so many rows."""
    return take_arrays(npy(np.ones((n_rows, 1), np.int8)), "long.npy")


def two_arrays() -> Motion:
    """An NPZ file of two arrays."""
    return take_arrays(plain_npz({"a": floats(3, 2), "b": floats(3, 1)}), "many.npz")


def one() -> Motion:
    """An NPY file of a single 1."""
    return take_arrays(npy(np.ones((1, 1), np.int8)), "ones.npy")


def mannequin() -> bytes:
    """A skeleton with the ASF file that it came of."""
    crafter = Crafter()
    made = write_skeleton(crafter, asf.read(ASF, "mannequin"))
    crafter.alias("small.asf", payloads.OF_SKELETON, made)
    return finish_file(crafter)


def acclaim_take() -> Motion:
    """The AMC file of the mannequin."""
    return set_path(amc.read(AMC, "take", asf.read(ASF, "mannequin")), "take.amc")


def acclaim_example() -> Motion:
    """The worked example of SPEC.md."""
    return set_path(amc.read(EXAMPLE, "example"), "example.amc")


def many_sections(more: int) -> Motion:
    """The table of sections with so many more, whose rows print nothing."""
    plain = table("sections.csv")
    assert plain.source is not None
    fields = parse(TableTemplate, plain.source.template, "template")
    own = parse(TableDetail, plain.source.detail, "detail")
    first = fields.sections[0]
    nothing = replace(first, header=b"", gaps=[b""], patterns=[PatternFields(runs=[], tail=0)])
    blank = [replace(nothing, signals=[3 + k]) for k in range(more)]
    usual = {"count": b"", "rows": 0, "gaps": [], "patterns": [], "ends": 0, "ending": b""}
    every = [
        build_record(SectionFields, section, "section") for section in [*fields.sections, *blank]
    ]
    details = [build_record(Detail, detail, "detail") for detail in [*own.details, *[usual] * more]]
    template = varint(len(every)) + b"".join(every)
    detail = varint(len(details)) + b"".join(details)
    signals = [replace(plain.signals[2], name=str(k)) for k in range(more)]
    source = replace(plain.source, template=template, detail=detail)
    motion = replace(plain, signals=(*plain.signals, *signals), source=source)
    return with_source(motion, VICON)
