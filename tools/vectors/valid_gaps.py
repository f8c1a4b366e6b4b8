"""Valid: raw deflate of every sort, motions with channels of their own, frame numbers."""

from __future__ import annotations

import zlib
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from mcz.container import payloads
from mcz.motion import Channel, Signal
from mcz.schema import build, parse, varint
from tools.vectors.craft import Crafter, Vector, Whole, file_of, finished, partial
from tools.vectors.deflated import END, Bits, code_of, own_lengths
from tools.vectors.edits import put
from tools.vectors.motions import HUNDREDTHS, dance, numbers
from tools.vectors.sources import BOTH, PLAIN, take


def vectors() -> Iterable[Vector]:
    container, raw, sources = Whole("valid/container"), Whole("valid/raw"), Whole("valid/sources")
    _deflate(container)
    _frame_numbers(container)
    _signals(raw)
    _rows(sources)
    return [*container.vectors, *raw.vectors, *sources.vectors]


def attached(stream: bytes, size: int, whole: bytes | None = None) -> bytes:
    """A file of one attachment, deflated to ``stream``; ``whole``: what it says that it is."""
    content = b"" if whole is None else whole

    def edit(payload: bytes) -> bytes:
        fields = parse(payloads.ATTA, payload, "ATTA")
        fields.update({"encoding": 1, "size": size, "part_size": size, "data": stream})
        return build(payloads.ATTA, fields, "ATTA")

    def row(fields: Any) -> Any:
        fields.attachments[0].size = size
        return fields

    crafter = Crafter(ATTA=edit, table=row)
    crafter.parts("a.bin", content)
    return finished(crafter)


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
    """The text says more than it must, or more than 2^53 - 1."""
    motion = dance(frame_numbers=np.array([5, 6, 9, 10]))
    for name, text, purpose in (
        ("more", "5 1:6 2:9 3:10", "Frame numbers that follow anyway are listed, too."),
        ("great", "-9999999999999999 1:-1 2:9999999999999998", "Frame numbers of 16 digits."),
    ):
        data = file_of(motion, CLIP=_number_text(text))
        shelf.hold(f"frame-numbers-{name}", "Registry; CLIP", purpose, data, motion)


def _number_text(text: str) -> Any:
    return put(payloads.CLIP, "metadata.0.value", varint(len(text)) + text.encode())


def _signals(shelf: Whole) -> None:
    own = tuple(Channel("", name, "V") for name in ("emg", "force", "light"))
    first = Signal(numbers(4, 3), (HUNDREDTHS,) * 3, channels=own)
    motion = dance(signals=(first,))
    purpose = "A motion with channels of its own, beside a skeleton that has others."
    data = file_of(motion, grouping="channel")
    shelf.hold(
        "own-channels", "CLIP; SKEL", purpose, data, motion, parts=(partial(motion, (1, 3)),)
    )
    again = Signal(numbers(8, 6)[::-1].copy(), (HUNDREDTHS,) * 6, "again", samples_per_frame=2)
    motion = dance(signals=(*dance().signals, again))
    data = file_of(motion, segment_frames=3)
    purpose = "A second signal with the skeleton's channels, in groups by joint."
    parts = (partial(motion, (1, 3)),)
    shelf.hold("skeleton-twice", "CLIP; SKEL", purpose, data, motion, parts=parts)
    motion = dance(signals=(first, *dance().signals))
    data = file_of(motion, grouping="channel")
    purpose = "A motion with channels of its own, and a signal with the skeleton's."
    shelf.hold("skeleton-second", "CLIP; SKEL", purpose, data, motion)


def _rows(shelf: Whole) -> None:
    """A BVH clip of two rows a frame: it has no frame numbers to print."""
    plain = take(PLAIN, "plain")
    motion = replace(plain, signals=(replace(plain.signals[0], samples_per_frame=2),))
    shelf.hold(
        "bvh-two-rows", "Source reconstruction; The text of AMC and BVH",
        "Two rows a frame: the rows of the file are those of the signal.",
        file_of(motion), motion, sources=(("plain.bvh", PLAIN),), modes=BOTH,
    )  # fmt: skip
