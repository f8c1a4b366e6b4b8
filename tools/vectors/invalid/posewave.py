"""Invalid, one fault each: headers, segments, heads, rows and notes of ``posewave``.

Where a reader can overlook the fault, the hash is that of what it then decodes.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from mcz.codecs.posewave.header import PosewaveHeader
from mcz.codecs.posewave.pyramid import Pyramid
from mcz.codecs.posewave.rows import RowCoder, Stream, code_head, fresh_coder
from mcz.codecs.posewave.segment import classes_of, kinds_of
from mcz.codecs.posewave.walk import Walk
from mcz.container import payloads
from mcz.errors import FormatError
from mcz.motion import Joint, Skeleton
from mcz.schema import varint
from tools.vectors.build.edits import all_integers, both, headed, plus, put, says, stream, two_rows
from tools.vectors.build.files import Broken, Vector, rehash
from tools.vectors.build.motions import channels
from tools.vectors.build.pose_clips import (
    HEADING,
    Floats,
    Plan,
    acclaim,
    biovision,
    chain,
    file_with,
    header_of,
    motion_of,
    parsed,
    segments_of,
    waves,
)
from tools.vectors.invalid import posewave_contacts
from tools.vectors.invalid.common import every_codec

ORDERS = f"{HEADING}; Axis orders"
CHAINS = f"{HEADING}; Segments that go on"
EXACT = f"{HEADING}; Exact channels"
ROWS = f"{HEADING}; Rows in the metric"
ROOM = 2**16  # bytes, more than any crafted stream has


def vectors() -> Iterable[Vector]:
    shelf = Broken("invalid/posewave")
    _headers(shelf)
    _counts(shelf)
    _own_orders(shelf)
    _signal(shelf)
    _nothing(shelf)
    _segments(shelf)
    _chains(shelf)
    _exact(shelf)
    _streams(shelf)
    _numbers(shelf)
    _notes(shelf)
    posewave_contacts.add(shelf)
    every_codec.add(shelf, "posewave")
    return shelf.vectors


def _still(skeleton: Skeleton | None = None, n_frames: int = 8, **fields: Any) -> Plan:
    """A clip of zeros, which any header but a wrong one would give."""
    skeleton = acclaim() if skeleton is None else skeleton
    return Plan(skeleton, np.zeros((n_frames, skeleton.n_channels)), fields)


def _binary32(value: float) -> bytes:
    return struct.pack("<f", value)


def _headers(shelf: Broken) -> None:
    beyond, below = _binary32(2.0**60 * (1 + 2.0**-23)), _binary32(2.0**-60 * (1 - 2.0**-24))
    cases: dict[str, tuple[str, str, bytes]] = {
        "borrowing-3": ("Borrowing of 3 levels of 2", "borrowing", b"\3"),
        "borrowing-255": ("Borrowing of 255 levels", "borrowing", b"\xff"),
        "start-2": ("Start table 2", "start", b"\2"),
        "start-255": ("Start table 255", "start", b"\xff"),
        "refining-2": ("Whole turns in a signal of version 0", "flags", b"\2"),
        "step-0": ("A step of 0", "step", _binary32(0.0)),
        "step-minus": ("A negative step", "step", _binary32(-1.0)),
        "step-NaN": ("A step that is no number", "step", _binary32(math.nan)),
        "step-infinite": ("An infinite step", "step", _binary32(math.inf)),
        "step-tiny": ("A step below 2^-60", "step", below),
        "step-huge": ("A step beyond 2^60", "step", beyond),
        "radius-minus": ("A negative radius", "radius", _binary32(-1.0)),
        "radius-NaN": ("A radius that is no number", "radius", _binary32(math.nan)),
        "radius-infinite": ("An infinite radius", "radius", _binary32(math.inf)),
        "radius-huge": ("A radius beyond 2^60", "radius", beyond),
        "shell-17": ("17 sixteenths of shell", "shell", b"\x11"),
        "first-25": ("25 halvings of first values", "first", b"\x19"),
        "constant-25": ("25 halvings of constants", "constant", b"\x19"),
    }
    plan = _still()
    for name, (purpose, path, new) in cases.items():
        header = put(PosewaveHeader, path, new)(header_of(plan))
        data = file_with(plan, CLIP=says(header))
        shelf.add(name, HEADING, f"{purpose}, over nothing but zeros.", data)
    whole = _still(flags=3)
    header = put(PosewaveHeader, "flags", b"\4")(header_of(whole))
    shelf.add("flags-4", HEADING, "Flags of 4.", file_with(whole, CLIP=says(header)))
    many = _still(levels=8)
    header = put(PosewaveHeader, "levels", b"\x09")(header_of(many))
    shelf.add("levels-9", HEADING, "9 levels.", file_with(many, CLIP=says(header)))
    good = header_of(plan)
    for name, header in (
        ("header-none", b""),
        ("header-and-byte", good + b"\0"),
        ("header-cut", good[:-1]),
    ):
        data = file_with(plan, CLIP=says(header))
        shelf.add(name, HEADING, f"A header of {len(header)} bytes, not {len(good)}.", data)


def _counts(shelf: Broken) -> None:
    skeleton = chain(["tx rx sx", "length rz", "qx"])
    plan = _still(skeleton)
    for path, due in (("plain", 3), ("weights", 3), ("orders", 3)):
        for n in (1, due - 1, due + 1, due + 300):
            code = b"\0" if path == "orders" else b"\x80"
            header = put(PosewaveHeader, path, varint(n) + n * code)(header_of(plan))
            purpose = f"{n} of {path} in the place of {due}."
            shelf.add(f"{path}-{n}", HEADING, purpose, file_with(plan, CLIP=says(header)))


def _own_orders(shelf: Broken) -> None:
    quaternion = chain(["rz rx ry", "rx ry rz qw qx qy qz"])
    cases: tuple[tuple[str, str, Skeleton, list[int]], ...] = (
        ("order-7", "A code of 7.", biovision(), [0, 7, 0, 0, 0]),
        ("order-255", "A code of 255.", biovision(), [0, 0, 0, 0, 255]),
        ("order-of-two", "An order of a joint with two rotations.", acclaim(), [0, 0, 0, 1]),
        ("order-of-none", "An order of a joint without channels.", _with(""), [0, 1]),
        ("order-of-four", "An order of four rotations.", _with("rx ry rz rx"), [0, 3]),
        ("order-of-twice", "An order of a joint that has ry twice.", _with("rx ry ry"), [0, 3]),
        ("order-of-quaternion", "An order beside a quaternion.", quaternion, [0, 2]),
        ("order-angle-unknown", "An order of an unknown angle unit.", biovision(""), [1] * 5),
    )
    for name, purpose, skeleton, codes in cases:
        plan = _still(skeleton)
        header = put(PosewaveHeader, "orders", varint(len(codes)) + bytes(codes))(header_of(plan))
        edits = {"CLIP": says(header), "segments": stream(0, lambda data: b"\0" + data)}
        shelf.add(name, ORDERS, purpose, file_with(plan, **edits))


def _with(kinds: str) -> Skeleton:
    joints = (Joint("root", channels=channels("tx")), Joint("bone", 0, channels=channels(kinds)))
    return Skeleton(joints, angle_unit="deg", intrinsic=True)


def _signal(shelf: Broken) -> None:
    plan = _still(levels=0)
    spec = f"{HEADING}; CLIP"
    n = plan.skeleton.n_channels
    twice = put(payloads.Clip, "signals.0.samples_per_frame", b"\2")
    grouped = put(payloads.Clip, "signals.0.groups", b"\3\2\6\6")
    by_joint = put(payloads.Clip, "signals.0.groups", b"\1")
    resolved = put(payloads.Clip, "signals.0.n_resolutions", b"\2")
    hashed = rehash(np.zeros((16, n)))
    cases: tuple[tuple[str, str, dict[str, Any]], ...] = (
        ("samples", "Two rows a frame.", {"CLIP": twice, "CEND": hashed, "row": two_rows}),
        ("groups", "Two groups.", {"CLIP": grouped, "segments": _more(1)}),
        ("groups-joint", "A group for each joint.", {"CLIP": by_joint, "segments": _more(3)}),
        ("own-channels", "As many channels, of its own.", {"CLIP": _own_channels(n)}),
        ("resolutions", "Two resolutions, no levels.", {"CLIP": resolved, "segments": _more(1)}),
        (
            "integers",
            "All grids are INTEGER, but the codec decodes no ordinals.",
            {"CLIP": all_integers(n), "CEND": rehash(np.zeros((8, n), np.int64))},
        ),
    )
    for name, purpose, edits in cases:
        shelf.add(name, spec, purpose, file_with(plan, **edits))


def _own_channels(count: int) -> Callable[[bytes], bytes]:
    """As many rotations in the place of the skeleton's channels."""
    flags = bytes([payloads.OWN_CHANNELS])
    own = put(payloads.Clip, "signals.0.channels", varint(count) + b"\0\4" * count)
    return both(own, put(payloads.Clip, "signals.0.flags", flags))


def _nothing(shelf: Broken) -> None:
    """Faults of clips of no frames, in which a decoder has nothing to stumble over."""
    plan = _still(n_frames=0, levels=0)
    twice = put(payloads.Clip, "signals.0.samples_per_frame", b"\2")
    data = file_with(plan, CLIP=twice, row=two_rows)
    shelf.add("frames-0-samples", f"{HEADING}; CLIP", "Two rows a frame, no frames.", data)
    still = _still(_with("rx ry"), 0)
    header = put(PosewaveHeader, "orders", b"\2\0\1")(header_of(still))
    purpose = "An order of a joint with two rotations, no frames."
    shelf.add("frames-0-order", ORDERS, purpose, file_with(still, CLIP=says(header)))
    exact = replace(_still(n_frames=0), exact=(1,))
    header = put(PosewaveHeader, "exact", b"\2\1\3")(header_of(exact))
    purpose = "Exact groups 1, which is, and 3 of 3 groups, no frames."
    shelf.add("frames-0-exact-beyond", EXACT, purpose, file_with(exact, CLIP=says(header)))


def _more(count: int) -> Callable[[Any], Any]:
    """Empty streams more."""
    return lambda made: [(header, [*streams, *[b""] * count]) for header, streams in made]


def _segments(shelf: Broken) -> None:
    skeleton = acclaim()
    plan = Plan(skeleton, waves(10, skeleton), ends=(5,))
    motion = motion_of(plan)
    for name, purpose, edit in (
        ("segment-lead", "A lead, which no segment has.", headed(1, lead=1)),
        ("segment-tail", "A tail, which no segment has.", headed(0, tail=1)),
        ("segment-not-fresh", "A segment that needs the one before.", headed(1, flags=0)),
    ):
        shelf.add(name, f"{HEADING}; DATA", purpose, file_with(plan, motion, segments=edit))


def _chains(shelf: Broken) -> None:
    """Segments that go on."""
    skeleton = acclaim()
    plan = Plan(skeleton, waves(10, skeleton), {"levels": 0}, (4, 5), on={1, 2})
    motion = motion_of(plan)
    for name, purpose, edit in (
        ("byte-behind", "A byte 255 behind the bits", plus(b"\xff")),
        ("byte-0-behind", "A byte 0 behind the bits", plus(b"\0")),
        ("byte-missing", "Bits without their last byte", lambda data: data[:-1]),
        ("bits-missing", "No bits", lambda data: b""),
    ):
        data = file_with(plan, motion, segments=stream(0, edit, segment=2))
        shelf.add(f"on-{name}", CHAINS, f"{purpose} of a segment that goes on.", data)
    bones = biovision()
    turned = _still(bones, 10, levels=0, orders=[0, 0, 1, 0, 0])
    turned = replace(turned, ends=(4,))
    data = file_with(turned, segments=headed(1, flags=0))
    shelf.add("on-orders", CHAINS, "A segment goes on, though a joint has another order.", data)
    first = segments_of(_still(skeleton, 4, levels=0))[0].streams
    still = _still(skeleton, 8, levels=0)
    still = replace(still, ends=(4,), streams={0: first, 1: (b"",)}, on={1})
    data = file_with(still, segments=stream(0, plus(b"\0"), segment=1))
    purpose = "A byte for nothing in a segment that goes on, where no channel is kept."
    shelf.add("on-none-kept-byte-for-nothing", CHAINS, purpose, data)


def _exact(shelf: Broken) -> None:
    skeleton = acclaim()
    plan = Plan(skeleton, waves(10, skeleton), exact=(1, 3))  # groups 0 and 2 are lossy
    motion, good = motion_of(plan), parsed(plan)
    assert good.exact_groups == (1, 3)
    for name, purpose, numbers in (
        ("descending", "Exact groups 3 and 1, in this order.", b"\2\3\1"),
        ("twice", "Exact group 1 twice.", b"\2\1\1"),
        ("none", "Four groups, none of which is exact.", b"\0"),
    ):
        header = put(PosewaveHeader, "exact", numbers)(header_of(plan))
        shelf.add(f"exact-{name}", EXACT, purpose, file_with(plan, motion, CLIP=says(header)))
    one = replace(plan, exact=(1,))
    for name, number in (("beyond", 3), ("far-beyond", 2**40)):
        numbers = b"\2\1" + varint(number)
        header = put(PosewaveHeader, "exact", numbers)(header_of(one))
        purpose = f"Exact groups 1, which is, and {number} of 3 groups."
        shelf.add(f"exact-{name}", EXACT, purpose, file_with(one, CLIP=says(header)))
    copies = b"\1" + b"\2\1\0" * 2  # a constant 0, and two copies of it
    still = replace(plan, source=np.where(np.isin(np.arange(12), [6, 7, 8]), 0, plan.source))
    for name, purpose, own, place, edit in (
        ("rows-elsewhere", "A stream of the second lossy group.", plan, 2, lambda _: b"\0"),
        ("details-elsewhere", "Details of the second lossy group.", plan, 10, lambda _: b"\0"),
        ("detail", "A detail of an exact group.", plan, 5, lambda _: b"\0"),
        ("copies", "Copies in an exact group.", still, 1, lambda _: copies),
        ("absent", "An exact group without a stream.", still, 1, lambda _: b""),
    ):
        data = file_with(own, motion_of(own), segments=stream(place, edit))
        shelf.add(f"exact-{name}", EXACT, purpose, data)
    on = replace(_still(skeleton, 10, levels=0), ends=(4,), exact=(1,))
    data = file_with(on, segments=headed(1, flags=0))
    shelf.add("on-exact", CHAINS, "A segment goes on, though a joint is exact.", data)


def _streams(shelf: Broken) -> None:
    skeleton = acclaim()
    plan = Plan(skeleton, waves(20, skeleton), {"levels": 3})
    motion = motion_of(plan)
    for level in range(4):
        for name, purpose, edit in (
            ("byte-behind", "A byte 255 behind the bits", plus(b"\xff")),
            ("byte-0-behind", "A byte 0 behind the bits", plus(b"\0")),
            ("byte-missing", "Bits without their last byte", lambda data: data[:-1]),
            ("bits-missing", "No bits", lambda data: b""),
        ):
            data = file_with(plan, motion, segments=stream(level, edit))
            spec = f"{ROWS}; Entropy coding"
            shelf.add(f"level-{level}-{name}", spec, f"{purpose} of level {level}.", data)
    short = Plan(skeleton, waves(3, skeleton), {"levels": 4})
    for level in (1, 2):
        data = file_with(short, segments=stream(level, lambda _: b"\0"))
        purpose = f"A byte in stream {level}, of a level that 3 frames have not."
        shelf.add(f"stream-{level}-not-empty", HEADING, purpose, data)
    still = _still(n_frames=20, levels=3)
    for level in (0, 1, 3):
        data = file_with(still, segments=stream(level, plus(b"\0")))
        purpose = f"A byte for nothing in stream {level}, where no channel is kept."
        shelf.add(f"none-kept-{level}-byte-for-nothing", HEADING, purpose, data)


def _numbers(shelf: Broken) -> None:
    skeleton = Skeleton((Joint("one", channels=channels("tx rx sx")),), angle_unit="deg")
    plan = replace(_still(skeleton, 2, levels=0, first=0, constant=0, position=128))
    for column, kept in ((0, False), (1, True), (2, False)):
        data = _head_stream(plan, column, kept)
        name = f"number-{'kept' if kept else 'constant'}-{column}-40-bits"
        purpose = f"A number of 40 bits of channel {column}."
        shelf.add(name, HEADING, purpose, file_with(plan, segments=stream(0, lambda _, d=data: d)))
    plan = replace(plan, source=plan.source[:1])
    for value in (2**30 + 1, -(2**30) - 1, 2**31 + 5):
        data = _row_stream(plan, value)
        purpose = f"A coefficient of {value}."
        name = f"coefficient-{'below' if value < 0 else 'beyond'}-{abs(value):x}"
        edits = {"segments": stream(0, lambda _, d=data: d), "CEND": rehash(_taken(plan, value))}
        shelf.add(name, ROWS, purpose, file_with(plan, **edits))


def _taken(plan: Plan, value: int) -> Floats:
    """The frame of a reader that takes such a coefficient."""
    kept = np.arange(plan.skeleton.n_channels) == 0
    walk = Walk(parsed(plan), plan.skeleton, Pyramid(1, 0, 0), kept, np.zeros(len(kept)))
    walk.take_coarsest(0, np.full((1, 1), float(value)), np.zeros(1, np.int64))
    return walk.values()


def _head_stream(plan: Plan, column: int, is_kept: bool) -> bytes:
    """A head that ends with a number of too many bits."""
    out = _opened(plan)
    kept, numbers = np.zeros((2, plan.skeleton.n_channels), np.int64)
    kept[column], numbers[column] = int(is_kept), 2**39 + 5
    with suppress(FormatError):
        code_head(out, kinds_of(plan.skeleton), kept, numbers, "")
    return out.finish()


def _row_stream(plan: Plan, value: int) -> bytes:
    """A row of the only channel that is kept, whose integer leaves its range."""
    out = _opened(plan)
    kept, numbers = np.zeros((2, plan.skeleton.n_channels), np.int64)
    kept[0] = 1
    code_head(out, kinds_of(plan.skeleton), kept, numbers, "")
    header = parsed(plan)
    classes = classes_of(plan.skeleton)[kept == 1]
    rows = RowCoder(classes, header.start, out.coder, "", refining=False)
    rows.begin(0, 0, 1, out)
    with suppress(FormatError):
        rows._wanted[:] = value
        rows._run(0, 1, 0.0)
    return out.finish()


def _opened(plan: Plan) -> Stream:
    return Stream(fresh_coder(parsed(plan).start), ROOM, None)


def _notes(shelf: Broken) -> None:
    """Notes in the place of those of a clip whose first joint is coded; its source is still."""
    skeleton = biovision()
    n_frames = 6
    plan = _still(skeleton, n_frames, orders=[1, 0, 0, 4, 0])
    coded = segments_of(plan)[0].streams[0]
    assert coded[:1] == b"\0"
    most = 2 * 4 * n_frames
    huge = 2**41
    cases: dict[str, tuple[str, bytes]] = {
        "beyond": ("The number of a note is one too many.", varint(1) + varint(most)),
        "beyond-second": (
            "The number of the second note is one too many.",
            varint(2) + varint(most - 4) + varint(3),
        ),
        "beyond-far": ("A gap of 2^52.", varint(1) + varint(2**52)),
        "turns-0": ("A note of no turns.", varint(1) + varint(1) + varint(0)),
        "turns-huge": ("A note of 2^40 turns.", varint(1) + varint(2) + varint(huge)),
        "turns-far": ("A note of -2^51 turns.", varint(1) + varint(3) + varint(2**52 - 1)),
        "count-varint": ("No notes, said in two bytes.", b"\x80\0"),
        "many": ("A note of each place and one more.", varint(most + 1) + _all_notes(most) + b"\0"),
    }
    for name, (purpose, notes) in cases.items():
        data = file_with(plan, segments=stream(0, lambda data, n=notes: n + data[1:]))
        shelf.add(f"notes-{name}", ORDERS, purpose, data)
    for name, purpose, own in (
        ("cut-in-count", "A stream that ends within the number of notes.", b"\x81"),
        ("cut-before-gap", "A stream that ends before a gap.", b"\1"),
        ("cut-before-turns", "A stream that ends before the turns of a note.", b"\1\1"),
    ):
        data = file_with(plan, segments=stream(0, lambda _, o=own: o))
        shelf.add(f"notes-{name}", ORDERS, purpose, data)
    data = file_with(plan, segments=stream(0, lambda _: b""))
    shelf.add("notes-stream-empty", ORDERS, "No bytes where the number of notes is.", data)


def _all_notes(most: int) -> bytes:
    return b"".join(b"\0" if number % 4 == 0 else b"\0\2" for number in range(most))
