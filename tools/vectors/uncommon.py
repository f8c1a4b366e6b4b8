"""Uncommon: rare but legal; a decoder may answer 3 to most, but must not misread."""

from __future__ import annotations

import struct
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from mcz.codecs import raw
from mcz.container import payloads
from mcz.container.chunks import ANCILLARY
from mcz.motion import Channel, Motion, Signal
from mcz.numbers import Grid, GridKind
from mcz.schema import build, inflate, parse
from tools.vectors.craft import OK, UNSUPPORTED, Crafter, Vector, Whole, file_of, finished
from tools.vectors.edits import Made, at, both, headed, plus, put
from tools.vectors.motions import dance
from tools.vectors.sources import PLAIN, take

LATER = b"more, from a later version"


def vectors() -> Iterable[Vector]:
    shelf = Whole("uncommon/container", exit=(OK, UNSUPPORTED))
    _unknown(shelf)
    _extensions(shelf)
    _appended(shelf)
    _shared(shelf)
    _open_data(shelf)
    _segments(shelf)
    _needs_more(shelf)
    return shelf.vectors


def _unknown(shelf: Whole) -> None:
    motions = dance(), dance(2, name="encore")
    crafter = Crafter()
    crafter.ancillary(b"xtra", b"before any clip")
    crafter.clip(motions[0])
    crafter.ancillary(b"xtra", b"after a clip, to be kept")
    crafter.ancillary(b"zvol", b"", safe_to_copy=False)
    data = finished(crafter, motions[1])
    purpose = "Ancillary chunks of unknown type, safe to copy and not, one of them empty."
    shelf.hold("unknown-ancillary", "Chunks; Grammar", purpose, data, *motions)

    def within(made: Made) -> Made:
        crafter.plain_chunk(b"note", b"between CLIP and DATA", ANCILLARY)
        return made

    crafter = Crafter(segments=within)
    data = finished(crafter, dance())
    purpose = "An unknown ancillary chunk inside a clip: the gap before its segment is longer."
    shelf.hold("unknown-ancillary-in-clip", "Grammar; INDX", purpose, data, dance())
    data = file_of(dance(), SKEL=put(payloads.SKEL, "joints.0.channels.3.kind", b"\xc8"))
    purpose = "A channel kind beyond the registry is a plain scalar."
    shelf.hold("unknown-channel-kind", "SKEL; Registry", purpose, data, dance())


def _extensions(shelf: Whole) -> None:
    def index(fields: Any) -> Any:
        fields.extension = LATER
        return fields

    crafter = Crafter()
    crafter.clip(dance())
    crafter.ancillary(b"QUAL", build(payloads.QUAL, {"entries": [], "extension": LATER}, "QUAL"))
    signal = put(payloads.CLIP, "signals.0.extension", bytes((len(LATER),)) + LATER)
    cases = (
        ("HEAD", "HEAD", file_of(dance(), HEAD=plus(LATER))),
        ("SKEL", "SKEL", file_of(dance(), SKEL=plus(LATER))),
        ("CLIP", "CLIP", file_of(dance(), CLIP=plus(LATER))),
        ("signal", "CLIP", file_of(dance(), CLIP=signal)),
        ("CEND", "CEND", file_of(dance(), CEND=plus(LATER))),
        ("INDX", "INDX", file_of(dance(), table=index)),
        ("QUAL", "QUAL", finished(crafter)),
    )
    for name, heading, data in cases:
        purpose = f"Bytes behind the known fields are ignored: {name}."
        shelf.hold(f"extension-{name}", f"Conventions; {heading}", purpose, data, dance())


def _appended(shelf: Whole) -> None:
    motions = dance(), dance(3, name="encore"), dance(2, name="finale")
    data = file_of(dance(), index=False)
    shelf.hold("no-index", "Grammar; FOOT", "A file without INDX.", data, dance())
    crafter = Crafter()
    for motion in motions:
        data = finished(crafter, motion)
    purpose = "Two appends: three bodies, each with its own INDX and FOOT."
    shelf.hold("appended-twice", "Grammar; INDX", purpose, data, *motions)
    crafter = Crafter()
    finished(crafter, motions[0], index=False)
    data = finished(crafter, motions[1])
    purpose = "An append whose INDX covers a body that had none."
    shelf.hold("appended-to-no-index", "Grammar; INDX", purpose, data, *motions[:2])


def _shared(shelf: Whole) -> None:
    motions = dance(), dance(3, name="encore")
    crafter = Crafter()
    crafter.clip(motions[0])
    (place,) = crafter.directory.shared.values()
    assert place.length is not None
    payload = crafter.data[place.payload_offset :][: place.length]
    crafter.plain_chunk(b"SKEL", payload)
    data = finished(crafter, motions[1])
    purpose = "The same SKEL twice: the first counts."
    shelf.hold("repeated-skeleton", "Grammar; SKEL", purpose, data, *motions)
    crafter = Crafter()
    crafter.shared(b"MODL", build(payloads.MODL, {"kind": 77, "data": b"learned"}, "MODL"))
    data = finished(crafter, dance())
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
    fields = parse(payloads.SRCE, payload, "SRCE")
    text = inflate(fields.data, fields.size, "SRCE")
    half = len(text) // 2
    blocks = [(0, text[:half]), (0, b""), (1, text[half:])]
    fields.data = b"".join(
        struct.pack("<BHH", last, len(block), len(block) ^ 0xFFFF) + block for last, block in blocks
    )
    return build(payloads.SRCE, fields, "SRCE")


def _open_data(shelf: Whole) -> None:
    long = dance(8)
    for name, purpose, index in (
        ("open-data", "Three segments as packets of one open DATA.", True),
        ("open-data-no-index", "Packets are found without INDX too.", False),
    ):
        data = file_of(long, packets=True, segment_frames=3, index=index)
        shelf.hold(name, "Open DATA and packets", purpose, data, long)
    _frames(shelf)
    opened = both(put(payloads.CLIP, "flags", b"\1"), put(payloads.CLIP, "n_frames", b"\0"))
    purpose = "A clip that does not know its frames in advance: CEND tells."
    shelf.hold("open-clip", "CLIP; CEND", purpose, file_of(long, CLIP=opened), long)


def live_file(motion: Motion, **edits: Any) -> bytes:
    """The clip as a live one: packets of one frame, of kind 2 or 3 where that can be."""
    given = {"packets": True, "frames": 1, "segment_frames": 1, "grouping": "all"}
    return file_of(motion, **given | edits)


def _frames(shelf: Whole) -> None:
    long = dance(8)
    mask = np.ones(long.signals[0].values.shape, np.bool_)
    mask[4, 1:] = False
    masked = replace(long, signals=(replace(long.signals[0], mask=mask),))
    cases = (
        ("frame-packets", "Packets of kind 2 behind one of kind 1.", long, True),
        ("frame-packets-no-index", "Packets of kind 2 are found without INDX too.", long, False),
        (
            "frame-packets-mask",
            "A frame with a mask, of kind 1, among those of kind 2.",
            masked,
            True,
        ),
        (
            "frame-packets-grid",
            "A frame on another grid, of kind 1, among those of kind 2.",
            _on_two_grids(long),
            True,
        ),
    )
    for name, purpose, motion, index in cases:
        for kind in (2, 3):
            named = name if kind == 2 else name.replace("frame", "numbered")
            data = live_file(motion, index=index, numbered=kind == 3)
            said = purpose.replace("kind 2", f"kind {kind}")
            shelf.hold(named, "Open DATA and packets; INDX", said, data, motion)
    samples = np.arange(8).reshape(8, 1) * 3 - 9
    channels = (Channel("", "emg", "V"),)
    analog = Signal(
        samples, (Grid(GridKind.INTEGER),), "analog", samples_per_frame=2, channels=channels
    )
    both_signals = replace(dance(), signals=(*dance().signals, analog))
    for name, kind in (("frame", 2), ("numbered", 3)):
        data = live_file(
            both_signals,
            segments=lambda made: sorted(made, key=lambda part: part[0].first),
            numbered=kind == 3,
        )
        purpose = f"Packets of kind {kind} among those of another signal."
        spec = "Open DATA and packets; INDX"
        shelf.hold(f"{name}-packets-signals", spec, purpose, data, both_signals)


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
    crafters = Crafter(), Crafter(), Crafter()
    crafters[0].clip(dance(), codec=replace(raw.CODEC, id=2**20))
    crafters[1].clip(dance(), codec=replace(raw.CODEC, version=9))
    crafters[2].plain_chunk(b"ROOM", b"what the room looked like")
    crafters[2].clip(dance())
    cases = (
        ("unknown-codec", "Codecs", "A codec id beyond the registry.", finished(crafters[0])),
        ("newer-codec", "Codecs", "A later version of a known codec.", finished(crafters[1])),
        ("unknown-critical", "Chunks", "A critical chunk of unknown type.", finished(crafters[2])),
        ("newer-minor", "HEAD", "A later minor version.", file_of(dance(), HEAD=at(3, b"\xff"))),
        ("older-minor", "HEAD", "Minor version 1 of 0.", file_of(dance(), HEAD=at(3, b"\1"))),
        ("newer-major", "HEAD", "Another major version.", file_of(dance(), HEAD=at(2, b"\1\0"))),
        ("unknown-profile", "HEAD", "A later profile.", file_of(dance(), HEAD=at(4, b"\7"))),
    )
    for name, spec, purpose, data in cases:
        shelf.add(name, spec, purpose, data, exit=(UNSUPPORTED,))
