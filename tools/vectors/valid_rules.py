"""Legal files for rules that no other vector shows by itself."""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from mcz.container import payloads
from mcz.container.chunks import SIGNATURE, parse_header
from mcz.container.packets import END, Packet, build_packet
from mcz.formats import c3d
from mcz.motion import Channel, Exceptions, Joint, Motion, Signal, Skeleton
from mcz.numbers import Grid, GridKind
from mcz.schema import build
from tools.vectors.craft import (
    OK,
    UNSUPPORTED,
    Crafter,
    Vector,
    Whole,
    file_of,
    finished,
    partial,
)
from tools.vectors.edits import at, put
from tools.vectors.motions import HUNDREDTHS, column, dance, numbers
from tools.vectors.sources import BOTH, HEADING, ODD, PLAIN, take
from tools.vectors.sources_c3d import SPEC as C3D_SPEC
from tools.vectors.sources_c3d import made
from tools.vectors.sources_c3d import take as take_c3d
from tools.vectors.spatial import FRAME, Plan, basis_of, file_with, still
from tools.vectors.valid_cut import cut, shown

MARK = "\ufeff"


def vectors() -> Iterable[Vector]:
    container, notes = Whole("valid/container"), Whole("valid/notes")
    sources, numbers_ = Whole("valid/sources"), Whole("valid/numbers")
    odd = Whole("uncommon/container", exit=(OK, UNSUPPORTED))
    _names(container)
    _heads(container)
    _unknown(container)
    _appended(odd)
    _repeated(odd)
    _live(odd)
    _most(odd)
    _records(odd)
    _streams(notes)
    _columns(container)
    _unknown_sources(odd)
    _texts(sources)
    _ranges(sources)
    _words(numbers_)
    late = Whole("uncommon/lsdt-frame", exit=(UNSUPPORTED,))
    _late_model(late)
    shelves = container, notes, sources, numbers_, odd, late
    return [vector for shelf in shelves for vector in shelf.vectors]


def _names(shelf: Whole) -> None:
    plain, marked = dance(), dance(3, name=MARK + "dance")
    data = file_of(plain, marked)
    purpose = "Two clips whose names differ by a leading U+FEFF alone."
    parts = (partial(marked, (1, 3)),)
    shelf.hold("name-mark", "Conventions; CLIP", purpose, data, plain, marked, parts=parts)
    names = "\0", "a\0b", "e\u0301", "\u00e9", "\U0010ffff", " "
    motions = [dance(2, name=name) for name in names]
    purpose = "Names of clips with code points of every sort, NUL among them; none is normalized."
    shelf.hold("name-code-points", "Conventions; CLIP", purpose, file_of(*motions), *motions)


def _heads(shelf: Whole) -> None:
    data = file_of(dance(), HEAD=at(0, b"\x09\xff"))
    purpose = "A file that version 9.255 wrote and version 0.9 reads."
    shelf.hold("newer-writer", "HEAD", purpose, data, dance())
    for minor in (2, 3, 5):
        data = file_of(dance(), HEAD=at(2, bytes((0, minor))))
        purpose = f"A file that needs version 0.{minor}."
        shelf.hold(f"needs-0-{minor}", "HEAD; Versions", purpose, data, dance())


def _unknown(shelf: Whole) -> None:
    """What a reader that does not know it passes over."""
    crafter = Crafter()
    crafter.ancillary(b"note", b"before any clip", safe_to_copy=False)
    crafter.clip(dance())
    crafter.ancillary(b"tAGS", b"behind a clip")
    data = finished(crafter, dance(2, name="encore"))
    purpose = "Ancillary chunks of unknown types, safe to copy and not."
    motions = dance(), dance(2, name="encore")
    shelf.hold("unknown-ancillary", "Chunks", purpose, data, *motions)
    motion = dance(metadata={"weather": "fair", "": "", "x-\0": "\ufeff"})
    purpose = "Keys of the metadata that nobody knows, one of them empty."
    shelf.hold("metadata-unknown", "CLIP; Registry", purpose, file_of(motion), motion)


def _appended(shelf: Whole) -> None:
    motions = dance(), dance(3, name="encore")
    crafter = Crafter()
    finished(crafter, motions[0], index=False)
    data = finished(crafter, motions[1], index=False)
    purpose = "An append to a file without INDX that has none either."
    shelf.hold("appended-no-index", "Grammar", purpose, data, *motions)
    crafter = Crafter()
    finished(crafter, motions[0])
    data = finished(crafter, index=False)
    purpose = "An append of nothing, without INDX: the last FOOT points to none."
    shelf.hold("appended-nothing", "Grammar; FOOT", purpose, data, motions[0])


def _repeated(shelf: Whole) -> None:
    plain = take(PLAIN, "plain")
    crafter = Crafter()
    crafter.clip(plain)
    for kind in (b"SRCE", b"SKEL"):
        places = crafter.directory.shared.items()
        place = next(chunk for (other, _), chunk in places if other == kind)
        assert place.length is not None
        crafter.plain_chunk(kind, crafter.data[place.payload_offset :][: place.length])
    again = replace(plain, name="again", source=None)
    data = finished(crafter, again)
    purpose = "The same SRCE and SKEL twice: INDX lists the first."
    sources = (("plain.bvh", PLAIN),)
    shelf.hold(
        "repeated-template", "Grammar; INDX", purpose, data, plain, again,
        sources=sources, modes=BOTH,
    )  # fmt: skip


def _live(shelf: Whole) -> None:
    end = {"end_packet": lambda data: build_packet(replace(_end(data), fresh=False))}
    data = file_of(dance(), packets=True, **end)
    purpose = "An end packet whose bit 7 is clear, which says nothing."
    shelf.hold("end-not-fresh", "Open DATA and packets", purpose, data, dance())
    crafter = Crafter(packets=True, REPT=lambda payload: b"no chunk at all", repeat=(0,))
    data = finished(crafter, dance())
    purpose = "A REPT whose payload is nothing like chunks: who has the beginning skips it."
    shelf.hold("REPT-of-nothing", "REPT", purpose, data, dance())
    empty = Motion(Skeleton((Joint("rock"),)), (Signal(np.empty((3, 0))),), name="rock")
    data = file_of(empty, packets=True, segment_frames=1)
    purpose = "Packets of kind 1 of a clip without channels."
    shelf.hold("packets-of-nothing", "Open DATA and packets", purpose, data, empty)


def _end(data: bytes) -> Packet:
    assert data[1] < 128
    return Packet(END, data[1], b"")


def _most(shelf: Whole) -> None:
    """Limits of the base profile, which are themselves legal."""
    joints = tuple(Joint("") for _ in range(4096))
    motion = Motion(Skeleton(joints), (Signal(np.empty((1, 0))),), name="crowd")
    spec = "Limits and profiles"
    shelf.hold("most-joints", spec, "4,096 joints in the base profile.", file_of(motion), motion)
    names = (Channel("", ""),) * 16384
    wide = Skeleton((Joint("wall", channels=names),))
    motion = Motion(wide, (Signal(np.zeros((0, 16384)), (HUNDREDTHS,) * 16384),), name="wide")
    purpose = "16,384 channels in the base profile."
    shelf.hold("most-channels", spec, purpose, file_of(motion, grouping="all"), motion)


def _records(shelf: Whole) -> None:
    entries = [("codec", "none"), ("mean_error_cm", "none of your business"), ("codec", "raw")]
    fields = {"entries": [{"key": k, "value": v} for k, v in entries], "extension": b""}
    record = build(payloads.QUAL, fields, "QUAL")
    crafter = Crafter()
    crafter.ancillary(b"QUAL", record)
    crafter.clip(dance())
    for _ in range(2):
        crafter.ancillary(b"QUAL", record)
    purpose = "Quality records before any clip and twice behind one, a key twice, no number."
    shelf.hold("quality-nonsense", "QUAL", purpose, finished(crafter), dance())


def _streams(shelf: Whole) -> None:
    """A segment with streams of every sort."""
    odd = take(ODD, "odd")
    mask = np.ones(odd.signals[0].values.shape, np.bool_)
    mask[1, 2], mask[2:, 7] = False, False
    motion = replace(odd, signals=(replace(odd.signals[0], mask=mask),))
    data = file_of(motion)
    purpose = "Frame notes, group notes and masks, in this order before the codec's streams."
    parts = (partial(motion, (1, 3), (1,)),)
    shelf.hold(
        "all-sorts", "DATA; Frame notes; Group notes; Masks", purpose, data, motion,
        sources=(("odd.bvh", ODD),), modes=BOTH, parts=parts,
    )  # fmt: skip
    sorts = "qnan", "NAN(a_1)", "-1.#IND", "9.#snan7", "+iNf", "-INFINITY", "1.#INF"
    meant = [np.nan] * 4 + [np.inf, -np.inf, np.inf]
    texts = [b"nan", *(word.encode() for word in sorts[1:])]
    values = np.array(meant).reshape(-1, 1)
    _hold_tokens(shelf, "words", "Words for NaN and infinities, in any case.", texts, values)
    numbers_ = b"-0", b"-.0e9", b"+0.", b"1e999", b"-1e999", b"-1e-999", b"2.4e-324", b"2.5e-324"
    meant = [-0.0, -0.0, 0.0, np.inf, -np.inf, -0.0, 0.0, 5e-324]
    more = (b"9007199254740993", b"9007199254740992.9999999999999999999999", b"1E+05", b"0.1e-007")
    meant += [9007199254740992.0, 9007199254740992.0, 1e5, 1e-8]
    purpose = "Numbers beyond both ends of binary64, zeros with a sign, ties."
    _hold_tokens(shelf, "ends", purpose, [*numbers_, *more], np.array(meant).reshape(-1, 1))


def _hold_tokens(
    shelf: Whole, name: str, purpose: str, texts: list[bytes], values: np.ndarray
) -> None:
    """One channel of exceptions alone, which decode to ``values``."""
    rows = np.arange(len(texts))
    noted = Exceptions(rows, np.zeros_like(rows), tuple(texts))
    motion = column(values, HUNDREDTHS, exceptions=noted)
    data = file_of(motion)
    shelf.hold(f"tokens-{name}", "Group notes; Ordinal to text", purpose, data, motion)


def _columns(shelf: Whole) -> None:
    """The columns of each joint, alone."""
    names = [tuple(Channel("", f"{j}.{c}") for c in range(n)) for j, n in enumerate((2, 0, 3, 1))]
    joints = tuple(Joint("twin", j - 1, channels=found) for j, found in enumerate(names))
    motion = Motion(Skeleton(joints), (Signal(numbers(3, 6), (HUNDREDTHS,) * 6),), name="twins")
    data = file_of(motion, grouping="channel")
    purpose = "Columns in the order of joints of one name, of which each is asked for alone."
    parts = tuple(partial(motion, (0, 3), (j,)) for j in range(4))
    shelf.hold("columns", "SKEL", purpose, data, motion, parts=parts)


def _unknown_sources(shelf: Whole) -> None:
    """Formats of sources that nobody knows: the values are there, the file is not."""
    plain = take(PLAIN, "plain")
    edits = {
        "SRCE": put(payloads.SRCE, "format", b"\x63"),
        "CLIP": put(payloads.CLIP, "source.0.format", b"\x63"),
    }
    data = file_of(plain, **edits)
    purpose = "A source of a format beyond the registry, which nobody can restore."
    shelf.add(
        "unknown-source", "Conventions; Registry", purpose, data,
        exit=(UNSUPPORTED,), modes=("sources",),
    )  # fmt: skip
    spec = "Source reconstruction; Registry"
    purpose = "A source of a format beyond the registry: what is decoded needs none."
    shelf.hold("unknown-source-beside", spec, purpose, data, plain)
    binary = replace(plain.signals[0], grids=(Grid(GridKind.BINARY64),) * 9)
    head, _, _ = PLAIN.rpartition(b"0.0083333\n")
    rows = [[repr(v).removesuffix(".0") for v in row] for row in binary.values.tolist()]
    text = head + b"0.0083333\n" + "".join(" ".join(row) + "\n" for row in rows).encode()
    assert plain.source is not None
    digest = hashlib.sha256(text).digest()
    source = replace(plain.source, size=len(text), sha256=digest)
    motion = replace(plain, signals=(binary,), source=source)
    purpose = "A text source of numbers on a grid without text, which no writer should choose."
    shelf.hold(
        "grids-without-text", f"Number grids; {HEADING}", purpose, file_of(motion), motion,
        sources=(("plain.bvh", text),), modes=BOTH,
    )  # fmt: skip


def _texts(shelf: Whole) -> None:
    """What restores texts, at the ends of its ranges."""
    for name, style in (("255", "255.2f"), ("255-left", "<255.2f")):
        text = padded(style)
        motion = take(text, f"width-{name}")
        purpose = f"Columns padded to 255 bytes, {'left' if 'left' in name else 'right'} justified."
        spec = f"{HEADING}; The text of AMC and BVH"
        sources = ((f"width-{name}.bvh", text),)
        data = file_of(motion)
        shelf.hold(f"bvh-width-{name}", spec, purpose, data, motion, sources=sources, modes=BOTH)


def padded(style: str) -> bytes:
    """A BVH file whose numbers are printed in a style of ``format``."""
    head = PLAIN.partition(b"Frames:")[0]
    values = [[(r * 31 + c * c * 7) % 100 - 50 for c in range(9)] for r in range(20)]
    rows = ["".join(format(float(v), style) for v in row) for row in values]
    return head + "\n".join(("Frames: 20", "Frame Time: 0.01", *rows, "")).encode()


def _ranges(shelf: Whole) -> None:
    """Files of a part of the frames, made of what is kept of the whole."""
    first = take_c3d(made(8, first=40, tail=b"behind" + bytes(506)).build(), "prop")
    data = cut(file_of(first, segment_frames=3), frames=(2, 6))
    purpose = "Frames 2 to 5 of a C3D file: its fields follow, what is behind its data is padded."
    motion = replace(shown(first, 2, 6), frame_numbers=np.arange(42, 46))
    text = c3d.write(motion)
    assert struct.unpack_from("<HH", text, 6) == (42, 45)
    shelf.hold(
        "c3d-range", f"Cutting without re-encoding; {C3D_SPEC}", purpose, data, motion,
        sources=(("prop.c3d", text),), modes=BOTH,
    )  # fmt: skip


def _words(shelf: Whole) -> None:
    """Values that a product with an inexact power of ten would miss."""
    for digits in (4, 17):
        grid = Grid(GridKind.FIXED, digits)
        found = [k for k in range(1, 4000) if k * 10.0**-digits != k / 10.0**digits][:40]
        values = [k / 10.0**digits for k in found]
        motion = column(values, grid)
        purpose = f"Numbers of {digits} digits that k times 1e-{digits} misses by a last place."
        spec = "Decimal and binary64; Ordinal to value"
        shelf.hold(f"fixed-{digits}-quotients", spec, purpose, file_of(motion), motion)


def _late_model(shelf: Whole) -> None:
    plan = Plan(FRAME, 4, (6,), bases=(basis_of(4, 2),), fill=still)
    data = file_with(plan, index=False)
    chunks, at = [], len(SIGNATURE)
    while data[at : at + 1].isalpha():
        chunk = parse_header(data[at : at + 16], at)
        chunks.append(data[at : at + chunk.size])
        at += chunk.size
    chunks.sort(key=lambda chunk: chunk[:4] == b"MODL")
    assert chunks[-1][:4] == b"MODL"
    purpose = "A model behind the CLIP that names it: it is not there for that clip."
    moved = SIGNATURE + b"".join(chunks) + data[at:]
    shelf.add("model-later", "Grammar; Bases", purpose, moved, exit=(UNSUPPORTED,))
