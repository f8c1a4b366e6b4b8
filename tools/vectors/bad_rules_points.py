"""Invalid, one fault each: rules of codecs 8, 10 and 11 that no other vector shows by itself.

The hash is that of what a reader decodes that overlooks the fault.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from mcz.codecs.base import Model, id_of
from mcz.container import payloads
from mcz.container.chunks import build_chunk
from mcz.motion import Channel, Joint, Skeleton
from mcz.schema import build, varint
from tools.vectors.bad_lsdt_models import coded_entries, with_model
from tools.vectors.bad_online_units import SIX, SPLIT, head_of, only_units
from tools.vectors.craft import Broken, Vector, rehash
from tools.vectors.edits import says, stream
from tools.vectors.grouped import HEADING, INTRA, ONE, Plan
from tools.vectors.grouped_files import both, file_with, numbered, values_of
from tools.vectors.spatial import CLIP, PCA_RDO, basis_of, header, listed, motion_of, still
from tools.vectors.spatial import Plan as Windows
from tools.vectors.spatial import file_with as windows_with
from tools.vectors.spatial_faults import Bits, spec_of, stream_with

WIDE = 2049  # channels


def vectors() -> Iterable[Vector]:
    clip, pca_rdo, online = (Broken(f"invalid/{name}") for name in (CLIP, PCA_RDO, "online"))
    _bases(clip)
    _bits(clip)
    _mean(pca_rdo)
    _units(online)
    _step(online)
    return [*clip.vectors, *pca_rdo.vectors, *online.vectors]


def _bases(shelf: Broken) -> None:
    plan = Windows(CLIP, 3, (1,), window=1, bases=(basis_of(3, 2),), prefix=True, fill=still)
    data = b"\x11\3\2\6\7" + 16 * b"\1\1\0"
    data += coded_entries([(1, 3, 6), (1, 3, 7), *16 * [(1, 1, 0)]])
    purpose = "17 bases, of which the first is the one that is due."
    shelf.add("bases-17-first", spec_of(CLIP, "Bases"), purpose, with_model(plan, 1, data))


def _bits(shelf: Broken) -> None:
    pair = (1, 1), (1, 1)
    row = Bits(pair).sparse(6, (0, 2))
    plan = Windows(CLIP, 4, (6,), prefix=True, lengths=pair, fill=listed([[2]]), window=6)
    data = row.plain(0, 9).data()
    assert data[1:] == b"\0"
    purpose = "Bits of prefix codes without their last byte, which is 0."
    bits = {"segments": stream_with(plan, data[:1])}
    made = windows_with(plan, **bits)
    shelf.add("byte-missing-0-prefix", spec_of(CLIP, "Bits"), purpose, made)


def _mean(shelf: Broken) -> None:
    """A mean that fits the channels, which are more than a basis may have entries."""
    plan = Windows(PCA_RDO, WIDE, (1,), window=1, apart=True, prefix=True, fill=still)
    data = b"\1" + varint(WIDE) + b"\1\0" + coded_entries([(1, WIDE, 0)])
    model = build_chunk(b"MODL", build(payloads.MODL, {"kind": 1, "data": data}, "MODL"))
    said = says(header(plan, flags=b"\5", model=id_of(Model(1, data))))
    skeleton = Skeleton((Joint("", channels=(Channel(""),) * WIDE),))
    made = windows_with(
        plan,
        motion_of(plan, skeleton=skeleton),
        index=False,
        CLIP=said,
        CLIP_frame=lambda chunk: model + chunk,
    )
    shelf.add("mean-2049", spec_of(PCA_RDO, "Bases"), "A mean of 2049 entries.", made)


def _with(plan: Plan, data: bytes, seen: np.ndarray) -> bytes:
    """The file of ``plan`` with another stream, of which a lax reader makes the values ``seen``."""
    return file_with(plan, segments=stream(0, lambda _: data), CEND=rehash(seen))


def _units(shelf: Broken) -> None:
    """Streams that end too early: what is missing is taken for zeros."""
    quiet = replace(SIX, fill=still)
    purpose = "A stream of no bytes, of a clip of zeros."
    shelf.add("stream-empty-zeros", HEADING, purpose, _with(quiet, b"", values_of(quiet)))
    first, _ = only_units(SPLIT)
    seen = values_of(SPLIT)
    seen[3:] = 0.0
    for case, purpose, more in (
        (
            "unit-missing-zeros",
            "A stream that ends behind the first of two units; the rest is zeros.",
            0,
        ),
        ("size-beyond-zeros", "The same, where the unit has a byte more than the stream.", 1),
    ):
        data = head_of(INTRA, 3) + varint(len(first.data) + more) + first.data
        shelf.add(case, HEADING, purpose, _with(SPLIT, data, seen))


def _step(shelf: Broken) -> None:
    plan = Plan(("I2",), steps=numbered((ONE, ONE + 512)))
    said = "A change of a step by 512, taken for none"
    for name, purpose, made in both("step-length-10-wrapped", said, plan):
        seen = values_of(replace(made, steps=numbered((ONE, ONE))))
        shelf.add(name, HEADING, purpose, file_with(made, CEND=rehash(seen)))
