"""Invalid, one fault each: units of online.

Where a reader can overlook the fault, the hash is that of what it then decodes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mcz.codecs.online.units import Unit, build_units
from mcz.schema import varint
from tools.vectors.build.edits import Made, stream
from tools.vectors.build.files import Broken, rehash
from tools.vectors.build.online_clips import file_with, head_of, only_units, values_of, with_stream
from tools.vectors.build.online_units import HEADING, INTRA, LTR, STR, Plan, units_of
from tools.vectors.build.spatial_clips import still

NO_KIND = 3
SIX = Plan(("I6",))
TWO = Plan(("I3 L3",))
SPLIT = Plan(("I3 S3",))


def add(shelf: Broken) -> None:
    _kinds(shelf)
    _sizes(shelf)
    _cut_heads(shelf)
    _distances(shelf)
    _live(shelf)
    _taken_for_zeros(shelf)


def _kinds(shelf: Broken) -> None:
    """A kind of 3, which a reader may take for any other."""
    for case, units, what in (
        ("first", "I6", "The only unit, whose data are those of an intra coded one"),
        ("intra", "I3 I3", "The last unit, whose data are those of an intra coded one"),
        ("ltr", "I3 L3", "The last unit, which has a distance,"),
        ("str", "I3 S3", "The last unit, whose data are those of STRs"),
    ):
        plan = Plan((units,))
        *others, last = only_units(plan)
        data = head_of(NO_KIND, last.n_frames)
        data += varint(last.distance) * (last.kind == LTR) + last.data
        if others:
            data = head_of(INTRA, 3) + varint(len(others[0].data)) + others[0].data + data
        shelf.add(f"kind-3-{case}", HEADING, f"{what} is of kind 3.", with_stream(plan, data))


def _sizes(shelf: Broken) -> None:
    """Numbers of frames that do not add up."""
    (six,) = only_units(SIX)
    first, last = only_units(SPLIT)
    none = Unit(STR, 0, b"")
    cases: dict[str, tuple[str, Plan, Sequence[Unit]]] = {
        "frames-0": ("A unit of no frames, between two.", SPLIT, (first, none, last)),
        "frames-0-first": (
            "A first unit, intra coded, of no frames.",
            SIX,
            (replace(none, kind=INTRA), six),
        ),
        "frames-7": ("A unit of 7 frames, where 6 are left.", SIX, only_units(Plan(("I7",)))),
        "frames-4": (
            "A second unit of 4 frames, where 3 are left.",
            SPLIT,
            only_units(Plan(("I3 S4",))),
        ),
        "frames-great": ("A unit of 2^40 frames.", SIX, (replace(six, n_frames=2**40),)),
        "unit-missing": ("One unit of 3 frames, where 6 are due.", SPLIT, (first,)),
    }
    for case, (purpose, plan, units) in cases.items():
        shelf.add(case, HEADING, purpose, with_stream(plan, build_units(units)))
    tail = head_of(STR, 3) + last.data
    for case, purpose, size in (
        ("size-beyond", "The first unit has a byte more than the stream.", len(tail) + 1),
        ("size-great", "The first unit has 2^40 bytes more than there are.", 2**40),
        ("size-less", "The first unit says a byte less than it has.", -1),
        ("size-more", "The first unit says a byte more than it has.", 1),
    ):
        data = head_of(INTRA, 3) + varint(len(first.data) + size) + first.data + tail
        shelf.add(case, HEADING, purpose, with_stream(SPLIT, data))
    purpose = "The last unit has a size, which it must not."
    data = head_of(INTRA, 6) + varint(len(six.data)) + six.data
    shelf.add("size-last", HEADING, purpose, with_stream(SIX, data))
    purpose = "A unit of one frame behind the last."
    data = build_units([six]) + head_of(STR, 1) + last.data
    shelf.add("unit-behind", HEADING, purpose, with_stream(SIX, data))
    purpose = "A unit without a size, which is not the last."
    data = head_of(INTRA, 3) + first.data + tail
    shelf.add("size-absent", HEADING, purpose, with_stream(SPLIT, data))


def _cut_heads(shelf: Broken) -> None:
    """Streams that end in a number, or have one in too many bytes."""
    (six,) = only_units(SIX)
    first, last = only_units(TWO)
    start = head_of(INTRA, 3) + varint(len(first.data)) + first.data
    assert len(first.data) < 128
    cases: dict[str, tuple[str, Plan, bytes]] = {
        "stream-empty": ("A stream of no bytes.", SIX, b""),
        "head-cut": ("A stream that ends in its head.", SIX, b"\x9a"),
        "head-varint": ("A head in two bytes, for which one is enough.", SIX, b"\x9a\0" + six.data),
        "head-absent": ("A stream that ends behind its first unit.", TWO, start),
        "distance-absent": ("A stream that ends behind a head.", TWO, start + head_of(LTR, 3)),
        "distance-varint": (
            "A distance in two bytes, for which one is enough.",
            TWO,
            start + head_of(LTR, 3) + b"\x83\0" + last.data,
        ),
        "size-varint": (
            "A size in two bytes, for which one is enough.",
            TWO,
            head_of(INTRA, 3)
            + bytes((len(first.data) | 128, 0))
            + first.data
            + build_units([last]),
        ),
        "size-none": ("A stream that ends before a size.", TWO, head_of(INTRA, 3)),
    }
    for case, (purpose, plan, data) in cases.items():
        shelf.add(case, HEADING, purpose, with_stream(plan, data))


def _distances(shelf: Broken) -> None:
    """Distances to what is not the last LTR."""
    plan = Plan(("I4 L2 S2 L4",))
    cases = {
        "0": ("A distance of 0.", 0),
        "less": ("A distance of one frame less than it is.", 3),
        "more": ("A distance of one frame more than it is.", 5),
        "unit": ("The distance is that to a unit of STRs.", 2),
        "older": ("The distance is that to the LTR before the last.", 8),
        "beyond": ("The distance is that to a frame before the first.", 9),
        "great": ("A distance of 2^52.", 2**52),
    }
    for case, (purpose, distance) in cases.items():
        units = only_units(plan)
        assert units[-1].distance == 4
        units[-1] = replace(units[-1], distance=distance)
        shelf.add(f"distance-{case}", HEADING, purpose, with_stream(plan, build_units(units)))
    plan = Plan(("I4 L4", "L4"))
    later = units_of(plan)[1]
    data = build_units([replace(later[0], distance=8)])

    def segments(made: Made) -> Made:
        return [made[0], (made[1][0], [data])]

    purpose = "The distance in a segment that is not fresh is that to the LTR before the last."
    shelf.add("distance-segment", HEADING, purpose, file_with(plan, segments=segments))


def _live(shelf: Broken) -> None:
    """Packets that have not one frame."""
    plan = Plan(tuple("I1 S1 L1 S1 S1".split()))
    *_, (two,), (three,) = units_of(plan)
    (pair,) = only_units(Plan(("S2",), fill=still))
    cases: dict[str, tuple[str, bytes]] = {
        "live-frames-2": ("A frame of kind 2 whose unit has two.", build_units([pair])),
        "live-units-2": ("A frame of kind 2 with two units.", build_units([two, three])),
        "live-empty": ("A frame of kind 2 without a unit.", b""),
    }
    for case, (purpose, data) in cases.items():

        def segments(made: Made, data: bytes = data) -> Made:
            return [*made[:3], (made[3][0], [data]), made[4]]

        made = file_with(plan, packets=True, frames=1, segments=segments)
        shelf.add(case, f"{HEADING}; Open DATA and packets", purpose, made)


def _with(plan: Plan, data: bytes, seen: np.ndarray) -> bytes:
    """The file of ``plan`` with another stream, of which a lax reader makes the values ``seen``."""
    return file_with(plan, segments=stream(0, lambda _: data), CEND=rehash(seen))


def _taken_for_zeros(shelf: Broken) -> None:
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
