"""Invalid, one fault each: contacts of ``posewave``, in headers and streams."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from mcz.codecs.posewave import displacement_kernels as coding
from mcz.codecs.posewave.contact_plan import MOST_STEPS
from mcz.codecs.posewave.contacts import Coder
from mcz.codecs.posewave.head_kernels import code_number
from mcz.codecs.posewave.header import PosewaveHeader
from mcz.codecs.posewave.rows import RowCoder, Stream, code_head, fresh_coder
from mcz.codecs.posewave.segment import classes_of, kinds_of
from mcz.coding.mixing import adaptive
from mcz.motion import Joint, Skeleton
from mcz.schema import varint
from tools.vectors.build.edits import headed, plus, put, says, stream
from tools.vectors.build.files import Broken, rehash
from tools.vectors.build.motions import channels
from tools.vectors.build.pose_clips import HEADING, Plan, acclaim, file_with, header_of, parsed

CONTACTS = f"{HEADING}; Held contacts"
ROOM = 2**16
N_FRAMES = 4


def add(shelf: Broken) -> None:
    _headers(shelf)
    _streams(shelf)


def _point(joint: int = 2, tail: int = 0, step: float = 0.01, follows: int = 0) -> bytes:
    return varint(joint) + varint(tail) + struct.pack("<f", step) + varint(follows)


def _contacts(*points: bytes, rounds: int = 4, ramp: int = 5, count: int = 1) -> bytes:
    return varint(count) + (bytes([rounds, ramp]) + varint(len(points)) + b"".join(points)) * max(
        count, 1
    )


def _headers(shelf: Broken) -> None:
    good = _point()
    cases: dict[str, tuple[str, bytes]] = {
        "rounds-0": ("No round.", _contacts(good, rounds=0)),
        "rounds-7": ("7 rounds.", _contacts(good, rounds=7)),
        "ramp-65": ("A ramp of 65 frames.", _contacts(good, ramp=65)),
        "points-0": ("No point.", _contacts()),
        "points-9": ("9 points.", _contacts(*[good] * 9)),
        "joint-4": ("A point of joint 4 of 4.", _contacts(_point(joint=4))),
        "joint-far": ("A point of joint 2^40.", _contacts(_point(joint=2**40))),
        "tail-2": ("A point of tail 2 of 1.", _contacts(_point(tail=2))),
        "follows-itself": ("A point that follows itself.", _contacts(_point(follows=1))),
        "follows-later": ("A point that follows a later one.", _contacts(_point(follows=2), good)),
        "twice": ("CONTACTS twice.", _contacts(good, count=2)),
    }
    for name, step in (
        ("0", 0.0),
        ("minus", -1.0),
        ("NaN", math.nan),
        ("infinite", math.inf),
        ("tiny", 2.0**-60 * (1 - 2.0**-24)),
        ("huge", 2.0**60 * (1 + 2.0**-23)),
    ):
        cases[f"step-{name}"] = (f"A step that is {name}.", _contacts(_point(step=step)))
    plan = Plan(acclaim(), np.zeros((8, acclaim().n_channels)), {})
    for name, (purpose, new) in cases.items():
        header = put(PosewaveHeader, "contacts", new)(header_of(plan))
        data = file_with(plan, CLIP=says(header))
        shelf.add(f"contacts-{name}", CONTACTS, f"{purpose} Nothing is kept.", data)
    exact = replace(plan, exact=(1,))
    header = put(PosewaveHeader, "contacts", _contacts(_point()))(header_of(exact))
    purpose = "Contacts beside an exact joint. Nothing is kept."
    data = file_with(exact, CLIP=says(header))
    shelf.add("exact-and-contacts", f"{HEADING}; Exact channels", purpose, data)


class Script:
    """What stands in a stream of contacts, number by number."""

    def __init__(self, coder: Coder) -> None:
        self.state, self.data = coder.state, coder.stream.data

    def number(self, own: int, value: int) -> None:
        code_number(self.state, self.data, 0, own, value)

    def contact(self, gap: int, length: int, *start: int) -> None:
        self.number(coding.GAP, gap)
        self.number(coding.LENGTH, length - 1)
        adaptive(self.state, self.data, int(bool(start)), coding.C_MOVED)
        for value in start:
            self.number(coding.START, value)


def _streams(shelf: Broken) -> None:
    cases: dict[str, tuple[str, Callable[[Script], Any]]] = {
        "count-5": ("5 contacts in 4 frames", lambda s: s.number(coding.COUNT, 5)),
        "count-minus": ("-1 contacts", lambda s: s.number(coding.COUNT, -1)),
        "number-40-bits": ("A number of 40 bits", lambda s: s.number(coding.COUNT, 2**39)),
        "gap-minus": ("A contact before the first frame", lambda s: _one(s, -1, 1)),
        "gap-4": ("A contact behind the last frame", lambda s: _one(s, 4, 1)),
        "length-0": ("A contact of no frame", lambda s: _one(s, 1, 0)),
        "length-4": ("A contact that ends behind the last frame", lambda s: _one(s, 1, 4)),
        "overlap": ("A contact before the end of another", _overlap),
        "start-far": (
            "A contact that begins 2^30 + 1 away",
            lambda s: _one(s, 1, 1, 2**30 + 1, 0, 0),
        ),
        "start-below": (
            "One that begins -2^30 - 1 away",
            lambda s: _one(s, 1, 1, 0, 0, -(2**30) - 1),
        ),
    }
    plan = _plan()
    for name, (purpose, script) in cases.items():
        data = _stream(plan, script)
        made = file_with(plan, segments=stream(0, _instead(data)))
        shelf.add(f"contacts-{name}", CONTACTS, f"{purpose}.", made)
    for name, value in (("far", 2**30 + 2), ("below", -(2**30) - 2)):
        data = _stream(plan, partial(_moving, value=value))
        taken = np.zeros((N_FRAMES, 1))
        taken[2] = math.copysign(MOST_STEPS * parsed(plan).greatest[0], value)
        made = file_with(plan, segments=stream(0, _instead(data)), CEND=rehash(taken))
        purpose = f"A displacement of {value} steps."
        shelf.add(f"contacts-displacement-{name}", CONTACTS, purpose, made)
    data = _stream(plan, lambda s: _moving(s, 2**32))
    made = file_with(plan, segments=stream(0, _instead(data)))
    purpose = "A residual of more than 2^30 + 16."
    shelf.add("contacts-displacement-residual", CONTACTS, purpose, made)
    good = _stream(plan, lambda s: _one(s, 1, 2))
    for name, purpose, edit in (
        ("byte-behind", "A byte 255 behind the bits.", plus(b"\xff")),
        ("byte-0-behind", "A byte 0 behind the bits.", plus(b"\0")),
        ("byte-missing", "Bits without their last byte.", lambda data: data[:-1]),
    ):
        data = edit(good)
        made = file_with(plan, segments=stream(0, _instead(data)))
        shelf.add(f"contacts-{name}", f"{CONTACTS}; Entropy coding", purpose, made)
    two = Plan(plan.skeleton, np.zeros((8, 1)), plan.fields, (4,))
    made = file_with(two, segments=headed(1, flags=0))
    purpose = "A segment that goes on, with contacts."
    shelf.add("contacts-not-fresh", f"{HEADING}; Segments that go on", purpose, made)


def _instead(data: bytes) -> Callable[[bytes], bytes]:
    return lambda _: data


def _one(script: Script, gap: int, length: int, *start: int) -> None:
    script.number(coding.COUNT, 1)
    script.contact(gap, length, *start)


def _overlap(script: Script) -> None:
    script.number(coding.COUNT, 2)
    script.contact(0, 1)
    script.contact(-1, 1)


def _moving(script: Script, value: int) -> None:
    """A contact in frames 1 and 2, from which the point moves along x."""
    _one(script, 1, 2)
    for residual, other in ((value, 0.0), (0, 1024.0), (0, 512.0)):
        sizes = np.full(2, 2.0)
        coding._code_residual(script.state, script.data, residual, sizes, other, 2)


def _plan() -> Plan:
    """A joint that goes along x, and stays."""
    skeleton = Skeleton((Joint("one", channels=channels("tx")),), angle_unit="deg")
    point = {"joint": 0, "tail": 0, "step": 0.01, "follows": 0}
    fields = {"levels": 0, "contacts": [{"rounds": 1, "ramp": 0, "points": [point]}]}
    return Plan(skeleton, np.zeros((N_FRAMES, 1)), fields)


def _stream(plan: Plan, script: Callable[[Script], None]) -> bytes:
    """Rows of zeros of the only channel, then contacts."""
    header, kept = parsed(plan), np.ones(1, np.int64)
    out = Stream(fresh_coder(header.start), ROOM, None)
    code_head(out, kinds_of(plan.skeleton), kept, np.zeros(1, np.int64), "")
    rows = RowCoder(classes_of(plan.skeleton), header.start, out.coder, "", refining=False)
    rows.begin(0, 0, N_FRAMES, out)
    rows.encode(0.0, 0, np.zeros((N_FRAMES, 1)))
    coder = Coder(out)
    script(Script(coder))
    coder.close()
    return out.finish()
