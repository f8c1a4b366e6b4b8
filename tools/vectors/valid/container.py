"""Valid: clips and their names, attachments, raw deflate, quality records, versions."""

from __future__ import annotations

import zlib
from collections.abc import Iterable
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np

from mcz.clock import MAX_NUMBER
from mcz.codecs import raw
from mcz.container import payloads
from mcz.container.chunks import SIGNATURE, ChunkType
from mcz.container.limits import LARGE
from mcz.container.metadata import Record
from mcz.motion import Channel, Joint, Motion, Signal, Skeleton
from tools.records import built
from tools.vectors.build import wavelet_clips
from tools.vectors.build.copies import content_of, copies_of, payload_of
from tools.vectors.build.deflate import END, Bits, code_of, own_lengths
from tools.vectors.build.edits import at, both, put
from tools.vectors.build.files import Crafter, Vector, Whole, attached, file_of, finished, partial
from tools.vectors.build.metadata import meta_of
from tools.vectors.build.motions import HUNDREDTHS, dance, numbers
from tools.vectors.build.source_files import BOTH, PLAIN, take
from tools.vectors.build.words import after_words, packed

MARK = "\ufeff"


def vectors() -> Iterable[Vector]:
    shelf = Whole("valid/container")
    _clips(shelf)
    _attachments(shelf)
    _quality(shelf)
    _copies(shelf)
    _metadata(shelf)
    _names(shelf)
    _versions(shelf)
    _unknown(shelf)
    _columns(shelf)
    _presets(shelf)
    _deflate(shelf)
    _words(shelf)
    _frame_numbers(shelf)
    return shelf.vectors


def _clips(shelf: Whole) -> None:
    purpose = "A file may hold nothing at all."
    shelf.hold("minimal", "Grammar; HEAD; FOOT", purpose, file_of())
    two = dance(), dance(3, name="encore", frame_rate=None)
    purpose = "Two clips share a skeleton; the second has an unknown frame rate."
    parts = (partial(two[1], (0, 3)), partial(two[0], (3, 4)))
    shelf.hold("two-clips", "Grammar; CLIP", purpose, file_of(*two), *two, parts=parts)
    metadata = {"subject": "Åsa", "x-mood": ""}
    ntsc = dance(name="ntsc", frame_rate=Fraction(30000, 1001), frame_rate_exact=False)
    ntsc = replace(ntsc, metadata=metadata)
    purpose = "A rounded rational frame rate, metadata of the registry and private ones."
    shelf.hold("metadata", "CLIP; Registry", purpose, file_of(ntsc), ntsc)
    numbered = dance(frame_numbers=np.array([-3, -2, 10, 11]))
    purpose = "Frame numbers that do not begin at 1 and have a gap."
    shelf.hold("frame-numbers", "Time", purpose, file_of(numbered), numbered)
    data = finished(Crafter(profile=LARGE), dance())
    shelf.hold("archive-profile", "Limits and profiles", "The archive profile.", data, dance())


def _presets(shelf: Whole) -> None:
    for preset, of in ((1, "a codec that has none"), (255, "an unknown preset")):
        data = file_of(dance(), codec=replace(raw.CODEC, preset=preset))
        purpose = f"Preset {preset}: of {of}, which a reader ignores."
        shelf.hold(f"preset-{preset}", "Codecs", purpose, data, dance())
    plan = wavelet_clips.Plan(8)
    made = wavelet_clips.waves(plan, 6)
    for preset in (0, 99):
        codec = replace(wavelet_clips.codec_of(plan, made), preset=preset)
        motion = wavelet_clips.dance_of(plan, made)
        data = file_of(motion, codec=codec, grouping="channel")
        purpose = f"A clip of wavelet whose preset is {preset}."
        shelf.hold(f"preset-wavelet-{preset}", "Codecs; Codec 16: wavelet", purpose, data, motion)


def _attachments(shelf: Whole) -> None:
    first, second = b"notes, notes, notes, notes\n" * 9, bytes(range(60))
    crafter = Crafter()
    crafter.parts("takes/notes.txt", first, second)
    crafter.parts("empty.txt", b"")
    crafter.alias("copy.txt", payloads.OF_ATTACHMENT, b"takes/notes.txt")
    shelf.hold(
        "attachments",
        "ATTA; ALIA",
        "An attachment in a deflated and a stored part, an empty one, and a second name of one.",
        finished(crafter),
        sources=(
            ("takes/notes.txt", first + second),
            ("empty.txt", b""),
            ("copy.txt", first + second),
        ),
        modes=("arrays", "sources"),
    )


def _quality(shelf: Whole) -> None:
    crafter = Crafter()
    crafter.clip(dance())
    entries = [{"key": "position_error_cm", "value": "0.0"}, {"key": "encoder", "value": "none"}]
    crafter.ancillary(b"QUAL", built(payloads.Qual, {"entries": entries, "extension": b""}, "QUAL"))
    shelf.hold("quality", "QUAL", "A quality record behind CEND.", finished(crafter), dance())


def _copies(shelf: Whole) -> None:
    plain, spec = take(PLAIN, "plain"), "COPY; INDX"
    given: dict[str, Any] = {"sources": (("plain.bvh", PLAIN),), "modes": BOTH}
    for name, stored, purpose in (
        ("copies", False, "Everything but DATA a second time before INDX, deflated."),
        ("copies-stored", True, "The same, stored."),
    ):
        crafter = Crafter()
        crafter.clip(plain)
        crafter.clip(dance())
        content = content_of(copies_of(crafter), crafter.offset)
        payload = payload_of(content, stored=stored)
        crafter.ancillary(ChunkType.COPY, payload, safe_to_copy=False)
        shelf.hold(name, spec, purpose, finished(crafter), plain, dance(), **given)
    crafter = Crafter()
    for motion in (plain, dance()):
        before = crafter.offset if crafter.directory.clips else len(SIGNATURE)
        crafter.clip(motion)
        content = content_of(copies_of(crafter, before), crafter.offset)
        crafter.ancillary(ChunkType.COPY, payload_of(content), safe_to_copy=False)
        data = finished(crafter)
    purpose = "Two bodies, each with copies of its own chunks, none of HEAD in the second."
    shelf.hold("copies-appended", spec, purpose, data, plain, dance(), **given)
    crafter = Crafter()
    crafter.ancillary(ChunkType.COPY, payload_of(b""), safe_to_copy=False)
    crafter.clip(dance())
    first = copies_of(crafter)[:1]
    crafter.ancillary(
        ChunkType.COPY, payload_of(content_of(first, crafter.offset)), safe_to_copy=False
    )
    crafter.ancillary(
        ChunkType.COPY, payload_of(content_of(first, crafter.offset)), safe_to_copy=False
    )
    purpose = "A COPY of nothing before any clip, and two of the same chunk behind it."
    shelf.hold("copies-few", spec, purpose, finished(crafter), dance())


def _metadata(shelf: Whole) -> None:
    two, spec = (dance(), dance(3, name="encore")), "META; Registry"
    many = [
        Record("dance", {"subject": "05", "x-mood": ""}),
        Record("encore", {"subject": "06"}, ("nothing",)),
        Record("dance", {"place": "Åbo"}, ("x-mood",)),
        Record("", {"rights-holder": "all of us"}),
        Record("nobody", {"subject": "07"}),
    ]
    for name, stored in (("metadata-behind", False), ("metadata-behind-stored", True)):
        crafter = Crafter()
        for motion in two:
            crafter.clip(motion)
        crafter.ancillary(ChunkType.META, meta_of(many, stored=stored))
        purpose = "A META that says something of two clips, of the file and of a clip not there"
        purpose += ", stored." if stored else "."
        shelf.hold(name, spec, purpose, finished(crafter), *two)
    crafter = Crafter()
    crafter.clip(two[0])
    crafter.ancillary(ChunkType.META, meta_of(many))
    crafter.clip(two[1])
    crafter.ancillary(ChunkType.META, meta_of(many[1:2]))
    crafter.ancillary(ChunkType.META, meta_of([]))
    purpose = "A META before a clip that it names, one that repeats it behind, and an empty one."
    shelf.hold("metadata-between", spec, purpose, finished(crafter), *two)
    crafter = Crafter()
    crafter.clip(two[0])
    words = meta_of([Record("dance", {"description": "Xrotation Yrotation " * 3})], after=True)
    crafter.ancillary(ChunkType.META, words)
    purpose = "A META deflated after words."
    shelf.hold("metadata-words", "META; Conventions", purpose, finished(crafter), two[0])


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


def _versions(shelf: Whole) -> None:
    data = file_of(dance(), HEAD=at(0, b"\x09\xff"))
    purpose = "A file that version 9.255 wrote and this version reads."
    shelf.hold("newer-writer", "HEAD", purpose, data, dance())


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


def _columns(shelf: Whole) -> None:
    """The columns of each joint, alone."""
    names = [tuple(Channel("", f"{j}.{c}") for c in range(n)) for j, n in enumerate((2, 0, 3, 1))]
    joints = tuple(Joint("twin", j - 1, channels=found) for j, found in enumerate(names))
    motion = Motion(Skeleton(joints), (Signal(numbers(3, 6), (HUNDREDTHS,) * 6),), name="twins")
    data = file_of(motion, grouping="channel")
    purpose = "Columns in the order of joints of one name, of which each is asked for alone."
    parts = tuple(partial(motion, (0, 3), (j,)) for j in range(4))
    shelf.hold("columns", "SKEL", purpose, data, motion, parts=parts)


def _deflate(shelf: Whole) -> None:
    two = own_lengths(s0=1, s1=2, s18=2)
    runs = own_lengths(s0=3, s1=3, s2=3, s4=3, s16=3, s17=3, s18=2)
    literals = [0] * 65 + [1] + [0] * 190 + [2] + [0] * 28 + [2]  # "A", the end, 285
    long = [0] * 286
    for place, size in enumerate([*range(1, 15), 15, 15]):
        long[END if place == 15 else 65 + place] = size
    deep = own_lengths(s0=2, s18=2, s15=4, **{f"s{k}": 5 for k in range(1, 15)})
    across = [(18, 54), 4, 4, (16, 3), (17, 7), (18, 127), (18, 24), 2, 2, (16, 1)]
    cases: dict[str, tuple[str, Bits, int]] = {
        "matches": (
            "matches of 3 to 258 bytes, from 1 byte back on, that overlap themselves",
            Bits().fixed(
                *b"ab",
                (257, 0, 0, 0),
                (285, 0, 1, 0),
                (284, 31, 0, 0),
                (284, 30, 2, 0),
                *b"c",
                (265, 1, 4, 1),
                (269, 3, 15, 15),
                END,
            ),
            0,
        ),
        "far": (
            "a match of 32,768 bytes back",
            Bits().fixed(*b"xyz", *[(285, 0, 2, 0)] * 127, (257, 0, 29, 8191), END),
            0,
        ),
        "blocks": (
            "blocks of all kinds, two of them empty, and ones behind the last",
            Bits()
            .fixed(END, last=False)
            .stored(b"", last=False)
            .stored(b"stored", last=False)
            .fixed(*b"fixed", END, last=False)
            .dynamic(286, 1, two, [(18, 54), 1, (18, 127), (18, 41), 1, *[0] * 29, 0])
            .symbols(code_of([*literals[:66], *[0] * 190, 1]), {}, [65, 65, END]),
            1,
        ),
        "one-distance": (
            "a code of one distance, of one bit",
            Bits()
            .dynamic(286, 2, runs, [(18, 54), 1, (18, 127), (18, 41), 2, (18, 17), 2, 0, 1])
            .symbols(code_of(literals), code_of([0, 1]), [65, 65, (285, 0, 1, 0), END]),
            0,
        ),
        "no-distance": (
            "no code of distances, of which none is used",
            Bits()
            .dynamic(257, 1, two, [(18, 54), 1, (18, 127), (18, 41), 1, 0])
            .symbols(code_of([*[0] * 65, 1, *[0] * 190, 1]), {}, [65] * 9 + [END]),
            0,
        ),
        "one-literal": (
            "a code of the end alone, of one bit",
            Bits()
            .dynamic(257, 1, two, [(18, 127), (18, 107), 1, 0])
            .symbols(code_of([*[0] * 256, 1]), {}, [END]),
            0,
        ),
        "repeats": (
            "lengths that are repeated from those of the literals into those of the distances",
            Bits()
            .dynamic(258, 4, runs, across)
            .symbols(
                code_of([0] * 65 + [4] * 8 + [0] * 183 + [2, 2]),
                code_of([2] * 4),
                [*b"ABCABC", (257, 0, 2, 0), (257, 0, 3, 0), END],
            ),
            0,
        ),
        "15-bits": (
            "codes of 1 to 15 bits",
            Bits()
            .dynamic(257, 1, deep, [(18, 54), *range(1, 16), (18, 127), (18, 27), 15, 0])
            .symbols(
                code_of(long),
                {},
                [
                    *range(65, 80),
                    END,
                ],
            ),
            0,
        ),
    }
    for name, (purpose, bits, behind) in cases.items():
        stream = bits.data(behind)
        whole = zlib.decompress(stream, -15)
        shelf.hold(
            f"deflate-{name}", "Conventions; ATTA", f"Raw deflate: {purpose}.",
            attached(stream, len(whole), whole), sources=(("a.bin", whole),), modes=BOTH,
        )  # fmt: skip


def _frame_numbers(shelf: Whole) -> None:
    """Time bases: what follows anyway, the greatest numbers, a first time, runs in CEND."""
    motion = dance(frame_numbers=np.array([5, 6, 9, 10]))
    usual = dance(frame_numbers=np.array([2, 3, 4, 5]))
    data = file_of(usual, CLIP=put(payloads.Clip, "time_base.number", b"\2"))
    purpose = "A time base that says what holds without one."
    shelf.hold("frame-numbers-more", "Time; CLIP", purpose, data, usual)
    great = dance(frame_numbers=np.array([-MAX_NUMBER, -1, 0, MAX_NUMBER]))
    purpose = "Frame numbers up to 2^52 - 1, either sign."
    shelf.hold("frame-numbers-great", "Time; CLIP", purpose, file_of(great), great)
    timed = replace(motion, first_time=-0.1)
    purpose = "The time of the first frame, and a gap after the second."
    shelf.hold("first-time", "Time; CLIP", purpose, file_of(timed), timed)
    timed = replace(timed, frame_rate=None)
    purpose = "The time of the first frame where the frame rate is unknown."
    shelf.hold("first-time-no-rate", "Time; CLIP", purpose, file_of(timed), timed)
    runs = b"\2\1\1\2\7"
    opened = both(put(payloads.Clip, "flags", b"\1"), put(payloads.Clip, "n_frames", b"\0"))
    data = file_of(dance(), CLIP=opened, CEND=put(payloads.Cend, "missing", runs))
    purpose = (
        "Two runs of missing frames of an open clip, which CEND states; CLIP has no time base."
    )
    shelf.hold("missing-open", "Time; CEND", purpose, data, dance())
    based = put(payloads.Clip, "time_base.missing", b"\0")
    opened = both(based, put(payloads.Clip, "flags", b"\5"), put(payloads.Clip, "n_frames", b"\0"))
    data = file_of(timed, CLIP=opened, CEND=put(payloads.Cend, "missing", runs))
    purpose = "Runs of missing frames that CEND states behind a time base of CLIP."
    shelf.hold("missing-open-first-time", "Time; CEND", purpose, data, timed)


def _words(shelf: Whole) -> None:
    motion = dance()
    purpose = "The fields of a skeleton, packed: deflate after words."
    shelf.hold(
        "packed-skeleton", "SKEL; Conventions", purpose, file_of(motion, SKEL=packed), motion
    )
    motion = take(PLAIN, "plain")
    data = file_of(motion, SRCE=after_words, SKEL=packed)
    purpose = "A template that is deflated after words, and a packed skeleton."
    shelf.hold("after-words", "SRCE; SKEL; Conventions", purpose, data, motion)
