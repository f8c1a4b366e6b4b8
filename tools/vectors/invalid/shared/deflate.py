"""Attachments whose raw deflate is at fault."""

from __future__ import annotations

from tools.vectors.build.deflate import END, Bits, code_of, own_lengths
from tools.vectors.build.files import Broken, attached


def add(shelf: Broken) -> None:
    _deflate(shelf)


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
        "lengths-less": (
            "a code of lengths with codes left over",
            Bits()
            .dynamic(257, 1, own_lengths(s0=2, s1=2, s18=2), [*head, 1, 0])
            .symbols(a_code, {}, [65, END]),
            b"A",
        ),
        "literals-less": (
            "a code of literals with codes left over",
            Bits()
            .dynamic(257, 1, three, [*head[:1], 2, *head[2:], 2, 0])
            .symbols(code_of([*[0] * 65, 2, *[0] * 190, 2]), {}, [65, END]),
            b"A",
        ),
        "end-of-2-bits": (
            "a code of the end alone, of two bits",
            Bits()
            .dynamic(257, 1, three, [(18, 127), (18, 107), 2, 0])
            .symbols(code_of([*[0] * 256, 2]), {}, [END]),
            b"",
        ),
        "distances-less": (
            "a code of two distances with codes left over",
            Bits()
            .dynamic(286, 2, three, [*head, 2, (18, 17), 2, 2, 2])
            .symbols(with_match, code_of([2, 2]), [65, 65, (285, 0, 0, 0), END]),
            b"AA" + b"A" * 258,
        ),
        "distance-of-2-bits": (
            "a code of one distance, of two bits",
            Bits()
            .dynamic(286, 1, three, [*head, 2, (18, 17), 2, 2])
            .symbols(with_match, code_of([2]), [65, 65, (285, 0, 0, 0), END]),
            b"AA" + b"A" * 258,
        ),
        "distance-without-code": (
            "a match, where there is no code of distances",
            Bits()
            .dynamic(286, 1, three, [*head, 2, (18, 17), 2, 0])
            .code(with_match, 65, 65, 285)
            .add(0, 1)
            .code(with_match, END),
            b"AA" + b"A" * 258,
        ),
        "literals-287": (
            "lengths of 287 literals and lengths, of which there are 286",
            Bits().dynamic(287, 1, usual, [*head, 1, (18, 19), 0]).symbols(a_code, {}, [65, END]),
            b"A",
        ),
        "end-missing": ("a block that does not end", Bits().fixed(*b"abc"), b"abc"),
    }
    for name, (purpose, bits, whole) in cases.items():
        stream = bits.data()[: -1 if name == "stored-cut" else None]
        purpose = f"Raw deflate: {purpose}."
        data = attached(stream, len(whole), whole)
        shelf.add(f"deflate-{name}", "Conventions; ATTA", purpose, data)
