"""Uncommon: rare but legal; a decoder may answer 3 to most, but must not misread."""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Iterable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from mcz.codecs import raw
from mcz.codecs.basis_models import build_model
from mcz.codecs.contract import model_id
from mcz.container import payloads
from mcz.container.chunks import END, ChunkFlag, Packet, build_foot, build_packet
from mcz.model.motion import Channel, Joint, Motion, Signal, Skeleton
from mcz.model.numbers import Grid, GridKind
from mcz.model.schema import inflate, parse
from tools.records import build_record, extend
from tools.vectors.build import wavelet_clips
from tools.vectors.build.edits import Made, at, both, headed, plus, put, swap
from tools.vectors.build.files import (
    OK,
    UNSUPPORTED,
    Crafter,
    Vector,
    Whole,
    file_of,
    finish_file,
    live_file,
)
from tools.vectors.build.motions import HUNDREDTHS, dance
from tools.vectors.build.source_files import (
    BOTH,
    HEADING,
    PLAIN,
    TEXT_SPEC,
    lossy,
    path_of,
    restore_source,
    take,
)
from tools.vectors.build.spatial_clips import CLIP, Plan, basis_of, file_with
from tools.vectors.build.words import after_words, pack_skeleton

LATER = b"more, from a later version"


def vectors() -> Iterable[Vector]:
    shelf = Whole("uncommon/container", exit=(OK, UNSUPPORTED))
    _unknown(shelf)
    _extensions(shelf)
    _hold_appended(shelf)
    _appended_without_index(shelf)
    _hold_shared(shelf)
    _repeated_template(shelf)
    _open_data(shelf)
    _packets(shelf)
    _segments(shelf)
    _most(shelf)
    _records(shelf)
    _unknown_sources(shelf)
    _needs_more(shelf)
    later = Whole("uncommon/container", exit=(UNSUPPORTED,))
    _no_model_of_nothing(later)
    _other_index(later)
    _model_behind(later)
    return [*shelf.vectors, *later.vectors]


def _appended_without_index(shelf: Whole) -> None:
    motions = dance(), dance(3, name="encore")
    crafter = Crafter()
    finish_file(crafter, motions[0], index=False)
    data = finish_file(crafter, motions[1], index=False)
    purpose = "An append to a file without INDX that has none either."
    shelf.hold("appended-no-index", "Grammar", purpose, data, *motions)
    crafter = Crafter()
    finish_file(crafter, motions[0])
    data = finish_file(crafter, index=False)
    purpose = "An append of nothing, without INDX: the last FOOT points to none."
    shelf.hold("appended-nothing", "Grammar; FOOT", purpose, data, motions[0])


def _repeated_template(shelf: Whole) -> None:
    plain = take(PLAIN, "plain")
    again = replace(plain, name="again", source=None)
    edits = {b"SRCE": after_words, b"SKEL": pack_skeleton}
    cases = {
        "repeated-template": ({}, "The same SRCE and SKEL twice: INDX lists the first."),
        "one-id": (edits, "SRCE and SKEL twice, the second time with other compression: one id."),
    }
    for name, (others, purpose) in cases.items():
        crafter = Crafter()
        crafter.clip(plain)
        for kind in (b"SRCE", b"SKEL"):
            places = crafter.directory.shared.items()
            place = next(chunk for (other, _), chunk in places if other == kind)
            assert place.length is not None
            payload = crafter.data[place.payload_offset :][: place.length]
            crafter.plain_chunk(kind, others[kind](payload) if others else payload)
        data = finish_file(crafter, again)
        sources = (("plain.bvh", PLAIN),)
        shelf.hold(
            name, "Grammar; INDX; Conventions", purpose, data, plain, again,
            sources=sources, modes=BOTH,
        )  # fmt: skip


def _packets(shelf: Whole) -> None:
    end = {"end_packet": lambda data: build_packet(replace(_end(data), fresh=False))}
    data = file_of(dance(), packets=True, **end)
    purpose = "An end packet whose bit 7 is clear, which says nothing."
    shelf.hold("end-not-fresh", "Open DATA and packets", purpose, data, dance())
    crafter = Crafter(packets=True, REPT=lambda payload: b"no chunk at all", repeat=(0,))
    data = finish_file(crafter, dance())
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
    record = build_record(payloads.Qual, fields, "QUAL")
    crafter = Crafter()
    crafter.ancillary(b"QUAL", record)
    crafter.clip(dance())
    for _ in range(2):
        crafter.ancillary(b"QUAL", record)
    purpose = "Quality records before any clip and twice behind one, a key twice, no number."
    shelf.hold("quality-nonsense", "QUAL", purpose, finish_file(crafter), dance())


def _unknown_sources(shelf: Whole) -> None:
    """Formats of sources that nobody knows: the values are there, the file is not."""
    plain = take(PLAIN, "plain")
    edits = {
        "SRCE": put(payloads.Srce, "format", b"\x63"),
        "CLIP": put(payloads.Clip, "source.0.format", b"\x63"),
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
    _lossy_without_text(shelf)


def _lossy_without_text(shelf: Whole) -> None:
    """Values that are on no grid, where the grid has no text either: the value is printed."""
    kinds = GridKind.INTEGER, GridKind.BINARY32, GridKind.BINARY64, GridKind.VAX_F
    grids = [Grid(GridKind.SCALED, scale=0.5), *(Grid(kind) for kind in kinds)]
    numbers = [0, 5, -7, 100, 12_345_678, -(2**40), 2**40]  # thousandths
    plan = wavelet_clips.Plan(len(numbers), wavelet_clips.HAAR, 0, 3)
    columns = [(grid, numbers) for grid in [*grids, Grid(GridKind.FIXED, 1)]]
    motion, codec = lossy(plan, columns, "lossy")
    rows = motion.signals[0].values[:, :5].tolist()
    words = [" ".join(repr(v).removesuffix(".0") for v in row).encode() for row in rows]
    text = restore_source(motion)
    assert all(row + b" " in text for row in words)
    shelf.hold(
        "grids-without-text-lossy",
        f"Number grids; {TEXT_SPEC}; Value to ordinal",
        "A lossy clip on grids without text: its values as TEXT64 without a flag prints them.",
        file_of(motion, codec=codec, grouping="channel"),
        motion,
        sources=((path_of(motion), text),),
        modes=BOTH,
    )


def _unknown(shelf: Whole) -> None:
    motions = dance(), dance(2, name="encore")
    crafter = Crafter()
    crafter.ancillary(b"xtra", b"before any clip")
    crafter.clip(motions[0])
    crafter.ancillary(b"xtra", b"after a clip, to be kept")
    crafter.ancillary(b"zvol", b"", safe_to_copy=False)
    data = finish_file(crafter, motions[1])
    purpose = "Ancillary chunks of unknown type, safe to copy and not, one of them empty."
    shelf.hold("unknown-ancillary", "Chunks; Grammar", purpose, data, *motions)

    def within(made: Made) -> Made:
        crafter.plain_chunk(b"note", b"between CLIP and DATA", ChunkFlag.ANCILLARY)
        return made

    crafter = Crafter(segments=within)
    data = finish_file(crafter, dance())
    purpose = "An unknown ancillary chunk inside a clip: the gap before its segment is longer."
    shelf.hold("unknown-ancillary-in-clip", "Grammar; INDX", purpose, data, dance())
    data = file_of(dance(), SKEL=put(payloads.Skel, "joints.0.channels.3.kind", b"\xc8"))
    purpose = "A channel kind beyond the registry is a plain scalar."
    shelf.hold("unknown-channel-kind", "SKEL; Registry", purpose, data, dance())


def _extensions(shelf: Whole) -> None:
    def index(fields: Any) -> Any:
        fields.extension = LATER
        return fields

    crafter = Crafter()
    crafter.clip(dance())
    crafter.ancillary(
        b"QUAL", build_record(payloads.Qual, {"entries": [], "extension": LATER}, "QUAL")
    )
    signal = partial(extend, payloads.Clip, path="signals.0", more=LATER)
    cases = (
        ("HEAD", "HEAD", file_of(dance(), HEAD=plus(LATER))),
        ("SKEL", "SKEL", file_of(dance(), SKEL=plus(LATER))),
        ("CLIP", "CLIP", file_of(dance(), CLIP=plus(LATER))),
        ("signal", "CLIP", file_of(dance(), CLIP=signal)),
        ("CEND", "CEND", file_of(dance(), CEND=plus(LATER))),
        ("INDX", "INDX", file_of(dance(), table=index)),
        ("QUAL", "QUAL", finish_file(crafter)),
    )
    for name, heading, data in cases:
        purpose = f"Bytes behind the known fields are ignored: {name}."
        shelf.hold(f"extension-{name}", f"Conventions; {heading}", purpose, data, dance())


def _hold_appended(shelf: Whole) -> None:
    motions = dance(), dance(3, name="encore"), dance(2, name="finale")
    data = file_of(dance(), index=False)
    shelf.hold("no-index", "Grammar; FOOT", "A file without INDX.", data, dance())
    crafter = Crafter()
    for motion in motions:
        data = finish_file(crafter, motion)
    purpose = "Two appends: three bodies, each with its own INDX and FOOT."
    shelf.hold("appended-twice", "Grammar; INDX", purpose, data, *motions)
    crafter = Crafter()
    finish_file(crafter, motions[0], index=False)
    data = finish_file(crafter, motions[1])
    purpose = "An append whose INDX covers a body that had none."
    shelf.hold("appended-to-no-index", "Grammar; INDX", purpose, data, *motions[:2])


def _hold_shared(shelf: Whole) -> None:
    motions = dance(), dance(3, name="encore")
    crafter = Crafter()
    crafter.clip(motions[0])
    (place,) = crafter.directory.shared.values()
    assert place.length is not None
    payload = crafter.data[place.payload_offset :][: place.length]
    crafter.plain_chunk(b"SKEL", payload)
    data = finish_file(crafter, motions[1])
    purpose = "The same SKEL twice: the first counts."
    shelf.hold("repeated-skeleton", "Grammar; SKEL", purpose, data, *motions)
    crafter = Crafter()
    crafter.shared(b"MODL", build_record(payloads.Modl, {"kind": 77, "data": b"learned"}, "MODL"))
    data = finish_file(crafter, dance())
    shelf.hold("unused-model", "MODL", "A model that no clip refers to.", data, dance())
    plain = take(PLAIN, "plain")
    shelf.hold(
        "stored-blocks",
        "SRCE; Conventions",
        "A template in stored blocks of raw deflate, one of them empty.",
        file_of(plain, SRCE=_stored_blocks),
        plain,
        sources=(("plain.bvh", PLAIN),),
        modes=("arrays", "sources"),
    )


def _stored_blocks(payload: bytes) -> bytes:
    fields = parse(payloads.Srce, payload, "SRCE")
    text = inflate(fields.data, fields.size, "SRCE")
    half = len(text) // 2
    blocks = [(0, text[:half]), (0, b""), (1, text[half:])]
    fields.data = b"".join(
        struct.pack("<BHH", last, len(block), len(block) ^ 0xFFFF) + block for last, block in blocks
    )
    return build_record(payloads.Srce, fields, "SRCE")


def _open_data(shelf: Whole) -> None:
    long = dance(8)
    for name, purpose, index in (
        ("open-data", "Three segments as packets of one open DATA.", True),
        ("open-data-no-index", "Packets are found without INDX too.", False),
    ):
        data = file_of(long, packets=True, segment_frames=3, index=index)
        shelf.hold(name, "Open DATA and packets", purpose, data, long)
    _frames(shelf)
    opened = both(put(payloads.Clip, "flags", b"\1"), put(payloads.Clip, "n_frames", b"\0"))
    purpose = "A clip that does not know its frames in advance: CEND tells."
    shelf.hold("open-clip", "CLIP; CEND", purpose, file_of(long, CLIP=opened), long)


def _frames(shelf: Whole) -> None:
    long = dance(8)
    mask = np.ones(long.signals[0].values.shape, np.bool_)
    mask[4, 1:] = False
    masked = replace(long, signals=(replace(long.signals[0], mask=mask),))
    gap = np.ones(mask.shape, np.bool_)
    gap[2:6, 1] = gap[4:7, 3:] = False
    gapped = replace(long, signals=(replace(long.signals[0], mask=gap),))
    cases = (
        ("frame-packets", "Packets of kind 2 behind one of kind 1.", long, True),
        ("frame-packets-no-index", "Packets of kind 2 are found without INDX too.", long, False),
        (
            "frame-packets-mask",
            "A frame with a mask, of kind 1, among those of kind 2.",
            masked,
            True,
        ),
        ("frame-packets-gap", "Frames that imply the mask of that before.", gapped, True),
        ("frame-packets-gap-no-index", "The same without INDX.", gapped, False),
        (
            "frame-packets-grid",
            "A frame on another grid, of kind 1, among those of kind 2.",
            _on_two_grids(long),
            True,
        ),
    )
    for name, purpose, motion, index in cases:
        data = live_file(motion, index=index)
        shelf.hold(name, "Open DATA and packets; INDX", purpose, data, motion)
    samples = np.arange(8).reshape(8, 1) * 3 - 9
    channels = (Channel("", "emg", "V"),)
    analog = Signal(
        samples, (Grid(GridKind.INTEGER),), "analog", samples_per_frame=2, channels=channels
    )
    both_signals = replace(dance(), signals=(*dance().signals, analog))
    data = live_file(
        both_signals, segments=lambda made: sorted(made, key=lambda part: part[0].first)
    )
    purpose = "Packets of kind 2 among those of another signal."
    spec = "Open DATA and packets; INDX"
    shelf.hold("frame-packets-signals", spec, purpose, data, both_signals)


def _on_two_grids(motion: Motion) -> Motion:
    """Frame 3 with another grid of a channel than all others."""
    signal = motion.signals[0]
    values, fine = signal.values.copy(), Grid(GridKind.TEXT64)
    values[3, 2] = 1e-9
    changes = ((3, 2, fine), (4, 2, signal.grids[2]))
    return replace(motion, signals=(replace(signal, values=values, grid_changes=changes),))


def _segments(shelf: Whole) -> None:
    long = dance(8)
    support = both(headed(0, tail=7), headed(1, lead=2, tail=1), headed(2, lead=3))
    data = file_of(long, segment_frames=3, segments=support)
    purpose = "Segments that bear upon more frames than they hold; raw makes no use of it."
    shelf.hold("lead-and-tail", "DATA; INDX", purpose, data, long)
    data = file_of(long, segment_frames=3, segments=headed(1, flags=0))
    purpose = "A segment that says to need the one before; raw makes no use of it."
    shelf.hold("not-fresh", "DATA; INDX", purpose, data, long)


def _needs_more(shelf: Whole) -> None:
    """A reader of this version must say that it lacks something."""
    crafters = tuple(Crafter() for _ in range(5))
    crafters[0].clip(dance(), codec=replace(raw.CODEC, id=2**20))
    crafters[1].clip(dance(), codec=replace(raw.CODEC, version=9))
    crafters[3].clip(dance(), codec=replace(raw.CODEC, id=5))
    crafters[4].clip(dance(), codec=replace(raw.CODEC, id=255))
    crafters[2].plain_chunk(b"ROOM", b"what the room looked like")
    crafters[2].clip(dance())
    cases = (
        ("unknown-codec", "Codecs", "A codec id beyond the registry.", finish_file(crafters[0])),
        ("old-codec", "Codecs", "Codec 5, which was dwt in 0.9.", finish_file(crafters[3])),
        ("private-codec", "Codecs", "A codec for private use.", finish_file(crafters[4])),
        ("newer-codec", "Codecs", "A later version of a known codec.", finish_file(crafters[1])),
        (
            "unknown-critical",
            "Chunks",
            "A critical chunk of unknown type.",
            finish_file(crafters[2]),
        ),
        ("newer-major", "HEAD", "A later major version.", file_of(dance(), HEAD=at(2, b"\2\0"))),
        ("unknown-profile", "HEAD", "A later profile.", file_of(dance(), HEAD=at(4, b"\7"))),
    )
    for name, spec, purpose, data in cases:
        shelf.add(name, spec, purpose, data, exit=(UNSUPPORTED,))


def _no_model_of_nothing(later: Whole) -> None:
    plan = Plan(CLIP, 4, (), bases=(basis_of(4, 3),))
    other = swap(model_id(build_model(plan.bases)), bytes(range(16)))
    purpose = "A clip of no frames whose model is not there."
    later.add(
        "frames-0-model-missing",
        "Bases; MODL",
        purpose,
        file_with(plan, CLIP=other),
        exit=later.exit,
    )


def _other_index(shelf: Whole) -> None:
    """An index that this version cannot read, in a file that says that it needs a later one."""
    edit = at(0, b"\xff" * 9)
    crafter = Crafter(INDX=edit)
    crafter.plain_chunk(b"ROOM", b"what the room looked like")
    crafter.clip(dance())
    purpose = "A critical chunk of unknown type, and an INDX that this version cannot read."
    shelf.add(
        "unknown-critical-index", "Chunks; INDX", purpose, finish_file(crafter), exit=shelf.exit
    )
    data = file_of(dance(), HEAD=at(2, b"\2\0"), INDX=edit)
    purpose = "A later major version, and an INDX that this one cannot read."
    shelf.add("newer-major-index", "HEAD; INDX", purpose, data, exit=shelf.exit)


def _model_behind(shelf: Whole) -> None:
    """A model that comes behind the clip that names it."""
    data = file_with(Plan(CLIP, 4, (9,), bases=(basis_of(4, 3),)), index=False)
    start = data.index(b"MODL")
    size = 20 + int.from_bytes(data[start + 8 : start + 16], "little")
    model, rest = data[start : start + size], data[:start] + data[start + size :]
    moved = rest[:-32] + model + build_foot(0, 0)
    purpose = "A model behind the only clip that names it is not there for it."
    shelf.add("model-behind", "Grammar; MODL", purpose, moved, exit=(UNSUPPORTED,))
