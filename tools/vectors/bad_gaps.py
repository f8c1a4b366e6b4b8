"""Invalid, one fault each: raw deflate, attachments in parts, counts, records."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from mcz.container import payloads
from mcz.container.chunks import build_foot
from mcz.formats.c3d_layout import C3D_TEMPLATE
from mcz.schema import build, parse, varint
from tools.vectors import waved
from tools.vectors.bad_bounds import _Nth
from tools.vectors.bad_sources import Unrestorable, _srce
from tools.vectors.craft import UNSUPPORTED, Broken, Crafter, Vector, Whole, file_of, finished
from tools.vectors.deflated import END, Bits, code_of, own_lengths
from tools.vectors.edits import headed, put
from tools.vectors.motions import dance
from tools.vectors.sources_c3d import SPEC as C3D_SPEC
from tools.vectors.sources_c3d import made, take
from tools.vectors.sources_gaps import restored
from tools.vectors.spatial import CLIP, basis_of, file_with
from tools.vectors.spatial import Plan as Spatial
from tools.vectors.valid_cut import shown, window
from tools.vectors.valid_gaps import attached
from tools.vectors.waved import DB2, Plan

RECORD = {"entries": [{"key": "codec", "value": "raw"}], "extension": b""}


def vectors() -> Iterable[Vector]:
    shared, clip, chunks = (Broken(f"invalid/{name}") for name in ("shared", "clip", "chunks"))
    mrdwt, sources = Broken("invalid/mrdwt"), Unrestorable("invalid/sources")
    later = Whole("uncommon/container", exit=(UNSUPPORTED,))
    _deflate(shared)
    _parts(shared)
    _lists(clip)
    _records(chunks)
    _hidden(mrdwt)
    _range(sources)
    _models(later)
    shelves = shared, clip, chunks, mrdwt, sources, later
    return [vector for shelf in shelves for vector in shelf.vectors]


def _deflate(shelf: Broken) -> None:
    """Attachments whose streams are at fault; their size and hash are those of what comes out."""
    usual = own_lengths(s0=1, s1=2, s18=2)
    over = own_lengths(s0=1, s1=1, s18=1)
    repeat = own_lengths(s0=2, s1=2, s16=2, s18=2)
    head = [(18, 54), 1, (18, 127), (18, 41)]  # "A" has one bit, what follows is 256
    three = own_lengths(s0=2, s1=2, s2=2, s18=2)
    a_code = code_of([*[0] * 65, 1, *[0] * 190, 1])
    with_match = code_of([*[0] * 65, 1, *[0] * 190, 2, *[0] * 28, 2])
    cases: dict[str, tuple[str, Bits, bytes]] = {
        "kind-3": ("a block of kind 3", Bits().stored(b"ab", last=False).block(3), b"ab"),
        "stored-check": (
            "a stored block whose lengths disagree",
            Bits().stored(b"ab", check=0xFFFC),
            b"ab",
        ),
        "stored-cut": (
            "a stored block longer than its bytes",
            Bits().stored(b"ab").add(0, 0),
            b"ab",
        ),
        "distance-before": (
            "a match 4 bytes back behind 3",
            Bits().fixed(*b"abc", (257, 0, 3, 0), END),
            b"abc\0ab",
        ),
        "distance-first": ("a match before anything", Bits().fixed((257, 0, 0, 0), END), b"\0\0\0"),
        "distance-30": (
            "distance 30 of a fixed code",
            Bits().fixed(*b"abc", (257, 0, 30, 0), END),
            b"abcabc",
        ),
        "length-286": ("length 286 of a fixed code", Bits().fixed(*b"abc", 286, END), b"abc"),
        "over-subscribed": (
            "three codes of one bit for lengths",
            Bits().dynamic(257, 1, over, [0] * 258),
            b"",
        ),
        "literals-over": (
            "three codes of one bit for literals",
            Bits().dynamic(257, 1, usual, [(18, 53), 1, 1, (18, 127), (18, 41), 1, 0]),
            b"",
        ),
        "repeat-of-nothing": (
            "a first length that repeats the one before",
            Bits().dynamic(257, 1, repeat, [(16, 0), *head[1:], 1, 0]).symbols(a_code, {}, [END]),
            b"",
        ),
        "repeat-beyond": (
            "lengths that are repeated beyond the last",
            Bits().dynamic(257, 1, usual, [*head, 1, (18, 0)]).symbols(a_code, {}, [65, END]),
            b"A",
        ),
        "no-end": (
            "a code without an end of the block",
            Bits()
            .dynamic(257, 1, usual, [(18, 54), 1, 1, (18, 127), (18, 41), 0, 0])
            .symbols(code_of([*[0] * 65, 1, 1]), {}, b"AB"),
            b"AB",
        ),
        "code-missing": (
            "a distance of which its code has nothing",
            Bits()
            .dynamic(286, 1, three, [*head, 2, (18, 17), 2, 1])
            .code(with_match, 65, 65, 285)
            .add(1, 1)
            .code(with_match, END),
            b"AA" + b"A" * 258,
        ),
        "end-missing": ("a block that does not end", Bits().fixed(*b"abc"), b"abc"),
    }
    for name, (purpose, bits, whole) in cases.items():
        stream = bits.data()[: -1 if name == "stored-cut" else None]
        purpose = f"Raw deflate: {purpose}."
        data = attached(stream, len(whole), whole)
        shelf.add(f"deflate-{name}", "Conventions; ATTA", purpose, data)


def _parts(shelf: Broken) -> None:
    crafter = Crafter(ATTA_frame=_Nth(1, lambda chunk: build_foot(0, 0) + chunk))
    crafter.parts("a.bin", b"first", b"second")
    purpose = "A FOOT between the two parts of a file, both of which are there."
    shelf.add("ATTA-parts-FOOT", "ATTA; Grammar", purpose, finished(crafter, index=False))
    crafter = Crafter(ATTA_frame=_Nth(1, _after_note))
    crafter.parts("a.bin", b"first", b"second")
    purpose = "An ancillary chunk between the two parts of a file."
    shelf.add("ATTA-parts-ancillary", "ATTA; Grammar", purpose, finished(crafter, index=False))
    infinite = b"\1" + np.array([np.inf], "<f8").tobytes()
    edit = put(payloads.SKEL, "unit_cm", infinite)
    shelf.edited("unit-infinite", "SKEL", "An infinite length unit.", SKEL=edit)


def _after_note(chunk: bytes) -> bytes:
    crafter = Crafter()
    before = len(crafter.data)
    crafter.ancillary(b"note", b"between")
    return crafter.data[before:] + chunk


def _lists(shelf: Broken) -> None:
    """Counts of more than there are bytes, in places where a list may be empty."""
    many = varint(2**40)
    for name, path, purpose in (
        ("count-metadata", "metadata", "2^40 pairs of metadata."),
        ("count-signals", "signals", "2^40 signals."),
        ("count-grids", "signals.0.grids", "2^40 runs of grids."),
    ):
        edit = put(payloads.CLIP, path, many)
        shelf.edited(name, "CLIP; Conventions", purpose, CLIP=edit)
    edit = put(payloads.CEND, "value_sha256", many)
    shelf.edited("count-hashes", "CEND; Conventions", "2^40 hashes.", CEND=edit)


def _records(shelf: Broken) -> None:
    record = build(payloads.QUAL, RECORD, "QUAL")
    cases = {
        "cut": ("ends within its last value", record[:-1]),
        "empty": ("has no bytes", b""),
        "UTF-8": ("has a value that is not UTF-8", record[:-1] + b"\xff"),
        "count": ("has 2^40 entries", varint(2**40) + record[1:]),
    }
    for name, (what, payload) in cases.items():
        crafter = Crafter()
        crafter.clip(dance())
        crafter.ancillary(b"QUAL", payload)
        purpose = f"A quality record that {what}."
        shelf.add(f"QUAL-{name}", "QUAL; Conventions", purpose, finished(crafter))


def _hidden(shelf: Broken) -> None:
    """A segment that is stored, not shown, and says of itself what the codec does not allow."""
    plan = Plan(24, DB2, 1, ends=(8, 16))
    channels = waved.waves(plan)
    motion = waved.motion_of(plan, channels)
    edits = window(motion, 20, 24)
    data = waved.file_with(plan, channels, motion, **edits, segments=headed(1, lead=1))
    purpose = "A lead of a frame less than the filters reach, of a segment that nobody needs."
    shelf.add("segment-lead-hidden", "Codec 2: mrdwt; CLIP; DATA", purpose, data)


def _range(shelf: Unrestorable) -> None:
    """A part of a C3D file whose parameters lie behind the data."""
    motion = take(made(4).build(), "prop")
    left = replace(shown(motion, 1, 3), frame_numbers=None)
    text = restored(left)
    assert left.source is not None and text[0] == 2
    far = bytes((len(text) // 512 + 2,))
    whole = far + text[1:]

    def moved(template: bytes) -> bytes:
        fields = parse(C3D_TEMPLATE, template, "template")
        fields.update({"head": far + fields["head"][1:]})
        return build(C3D_TEMPLATE, fields, "template")

    digest = hashlib.sha256(whole).digest()
    source = replace(left.source, size=len(whole), sha256=digest)
    data = file_of(replace(left, source=source), SRCE=_srce(moved))
    purpose = "Two of four frames of a C3D file whose header says that parameters follow the data."
    shelf.add("c3d-range-parameters-behind", C3D_SPEC, purpose, data)


def _models(shelf: Whole) -> None:
    """A model that comes behind the clip that names it."""
    data = file_with(Spatial(CLIP, 4, (9,), bases=(basis_of(4, 3),)), index=False)
    start = data.index(b"MODL")
    size = 20 + int.from_bytes(data[start + 8 : start + 16], "little")
    model, rest = data[start : start + size], data[:start] + data[start + size :]
    moved = rest[:-32] + model + build_foot(0, 0)
    purpose = "A model behind the only clip that names it is not there for it."
    shelf.add("model-behind", "Grammar; MODL", purpose, moved, exit=(UNSUPPORTED,))
