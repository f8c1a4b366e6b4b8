"""Invalid, one fault each: streams of ``best``."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from mcz.codecs.lossless import best_numbers as numbers
from mcz.codecs.lossless import best_streams
from mcz.codecs.lossless.best_streams import Link
from mcz.codecs.lossless.echoes import Echo, build_echoes
from mcz.coding.ordinals.counts import Law
from mcz.coding.ordinals.degrees import of_products
from mcz.coding.start import start_states
from mcz.container import payloads
from mcz.motion import Motion
from tools.vectors.build.best_clips import HEADING, build_stream, codec_of
from tools.vectors.build.edits import Edit, at, flip, plus, put, stream
from tools.vectors.build.files import Broken, Vector, file_of
from tools.vectors.build.lossless_clips import (
    COUNTS,
    MULTIPLES,
    PLAIN,
    PRODUCTS,
    SINGLE,
    SIX,
    UNEXAMINED,
    WHOLE,
    Coded,
    Constant,
)
from tools.vectors.build.motions import HUNDREDTHS, column, dance, panel, wave
from tools.vectors.invalid.common import every_codec
from tools.vectors.valid.lossless.counts import values_of


def vectors() -> Iterable[Vector]:
    shelf = Broken("invalid/best")
    _heads(shelf)
    _links(shelf)
    _echoes(shelf)
    _sizes(shelf)
    _numbers(shelf)
    _signal(shelf)
    every_codec.add(shelf, "best")
    return shelf.vectors


def _with(motion: Motion, data: bytes) -> bytes:
    """The file of ``motion``, the stream of its only group replaced."""
    constants = codec_of([Constant()] * motion.signals[0].n_channels)
    return file_of(motion, codec=constants, grouping="all", segments=stream(0, lambda _: data))


def _heads(shelf: Broken) -> None:
    motion = panel([[0.5] * 4], (HUNDREDTHS,))
    constant = build_stream([[50]] * 4, (HUNDREDTHS,), [Constant()])
    shelf.add("stream-missing", HEADING, "A stream of no bytes.", _with(motion, b""))
    data = _with(motion, b"\1" + constant[1:])
    shelf.add("constants-linked", HEADING, "Method 1 of a constant alone.", data)
    motion, codec = column(wave(9), HUNDREDTHS), codec_of()
    for method in (3, 255):
        data = file_of(motion, codec=codec, segments=stream(0, at(0, bytes((method,)))))
        shelf.add(f"method-{method}", HEADING, f"A method {method}.", data)


def _links(shelf: Broken) -> None:
    motion = panel([wave(9), wave(9, 1)], (HUNDREDTHS,) * 2, (2,))
    first = Link(4, 9, ())
    cases = {
        "links-9": ("A channel that looks at nine others.", [first, Link(4, 9, (0,) * 9)]),
        "links-15": ("A channel that looks at fifteen others.", [first, Link(4, 9, (0,) * 15)]),
        "link-to-itself": ("A channel that looks at itself.", [first, Link(4, 9, (1,))]),
        "link-of-the-first": ("The first coded channel looks at one.", [Link(4, 9, (0,))]),
        "link-behind": ("A channel that looks at one behind it.", [Link(4, 9, (1,))]),
        "link-beyond": ("A channel that looks at one that is not.", [first, Link(4, 9, (2,))]),
    }
    good = build_stream(_ordinals(motion), (HUNDREDTHS,) * 2, [Coded()] * 2, [first] * 2)
    for name, (purpose, links) in cases.items():
        every = [*links, first][:2]
        data = good[:5] + b"".join(link.head() for link in every) + good[9:]
        shelf.add(name, HEADING, purpose, _with(motion, data))
    codec = codec_of([Coded()] * 2, [Link(45, 45, ())] * 2)
    data = file_of(motion, codec=codec, grouping="all")
    shelf.add("unit-45", HEADING, "Steps in 2^45.", data)
    for size in (5, 6, 7, 8):
        purpose = f"The stream ends in the links, {size - 5} bytes behind the heads."
        shelf.add(f"cut-in-links-{size - 5}", HEADING, purpose, _with(motion, good[:size]))
    n = 514
    wide = panel([[0.0, 0.25]] * n, (HUNDREDTHS,) * n, (n,))
    links = [first, *[Link(4, 9, (0,) * 8)] * (n - 1)]
    heads = [Coded(scale=20)] * n
    good = build_stream(_ordinals(wide), (HUNDREDTHS,) * n, heads, [first] * n)
    linked = b"".join(link.head() for link in links)
    data = good[: 1 + 2 * n] + linked + good[1 + 4 * n :]
    shelf.add("links-4104", HEADING, "More than 4096 links in a stream.", _with(wide, data))


def _echoes(shelf: Broken) -> None:
    once = wave(10)
    motion = panel([once + once, wave(20, 1)], (HUNDREDTHS,) * 2, (2,))
    good = Echo(10, 10, 0, 1, 10, 0, False)
    links = [Link(4, 9, ())] * 2
    data = build_stream(_ordinals(motion), (HUNDREDTHS,) * 2, [Coded()] * 2, links, echoes=[good])
    heads, rest = data[:5], data[5 + len(build_echoes([good])) :]
    cases = {
        "rows-0": ("no rows", [replace(good, n_rows=0)]),
        "rows-beyond": ("a row behind the last", [replace(good, n_rows=11)]),
        "row-beyond": ("rows behind the last alone", [replace(good, row=20, n_rows=1)]),
        "lag-0": ("what it is itself", [replace(good, lag=0)]),
        "lag-beyond": ("a row before the first", [replace(good, lag=11)]),
        "channels-0": ("no channels", [replace(good, n_channels=0)]),
        "channels-beyond": ("a channel that is not", [replace(good, channel=1, n_channels=2)]),
        "channel-beyond": ("a channel that is not, alone", [replace(good, channel=2)]),
        "source-beyond": ("what a channel had that is not", [replace(good, source=2)]),
        "sources-beyond": ("of two channels, one not", [replace(good, n_channels=2, source=1)]),
        "numbers-41": ("41 of 40 numbers", [good] * 4 + [replace(good, row=19, n_rows=1)]),
    }
    for name, (what, echoes) in cases.items():
        stream = heads + build_echoes(echoes) + rest
        shelf.add(f"echo-{name}", HEADING, f"An echo of {what}.", _with(motion, stream))
    for flags in (2, 3, 128):
        stream = heads + build_echoes([good])[:-1] + bytes((flags,)) + rest
        shelf.add(f"echo-flags-{flags}", HEADING, f"Flags {flags}.", _with(motion, stream))
    shelf.add("echoes-0", HEADING, "Method 2 without echoes.", _with(motion, heads + b"\0" + rest))
    shelf.add(
        "echoes-41", HEADING, "41 echoes of 40 numbers.", _with(motion, heads + b"\x29" + rest)
    )
    for size in (5, 8, 12):
        purpose = f"The stream ends in the echoes, {size - 5} bytes behind the heads."
        shelf.add(f"cut-in-echoes-{size - 5}", HEADING, purpose, _with(motion, data[:size]))
    counts = tuple(round(50 * v) for v in once) * 2
    values = [0.25 * count for count in counts]
    motion = panel([values, values], (SINGLE, HUNDREDTHS), (2,))
    own = [Coded(MULTIPLES, unit=0.25, multiples=counts), Coded()]
    data = build_stream(_ordinals(motion), (SINGLE, HUNDREDTHS), own, links)
    end = data.index(b"".join(link.head() for link in links))
    heads, rest = data[1:end], data[end:]
    for name, echo in {
        "in-multiples": replace(good, source=1),
        "of-multiples": replace(good, channel=1),
    }.items():
        stream = b"\2" + heads + build_echoes([echo]) + rest
        purpose = f"An echo {name.replace('-', ' ')}, which are no ordinals."
        shelf.add(f"echo-{name}", HEADING, purpose, _with(motion, stream))
    _echoes_of_rests(shelf, good)
    whole = panel([[2.0**53] * 3, [2.0**53] * 2 + [0.0]], (WHOLE,) * 2, (2,))
    mirrored = (Echo(2, 1, 1, 1, 1, 0, True),)
    ordinals = _ordinals(whole)
    ordinals[2, 1] = -1 - 2**53
    heads_ = [Coded(form=PLAIN, drop=19)] * 2
    data = build_stream(ordinals, (WHOLE,) * 2, heads_, [Link(4, 9, ())] * 2, echoes=mirrored)
    shelf.add(
        "echo-beyond-grid", HEADING, "An echo whose other sign no grid has.", _with(whole, data)
    )


def _echoes_of_rests(shelf: Broken, good: Echo) -> None:
    """Counts, with what is left of them, and products: each beside a channel that may echo."""
    counts = tuple(round(50 * v) for v in wave(10)) * 2
    law = Coded(COUNTS, law=Law(0.25), multiples=counts, rests=(1,) * 20)
    degrees = Coded(PRODUCTS, unit=0.25, shifts=3, multiples=counts)
    products = SIX.values(of_products(np.array(counts), 0.25, 3, SIX)).tolist()
    for name, head, column_, grid, place in (
        ("counts", law, values_of(law, SINGLE), SINGLE, 0),
        ("rests", law, values_of(law, SINGLE), SINGLE, 2),
        ("products", degrees, products, SIX, 0),
    ):
        own = [head, Coded()]
        motion = panel([column_, wave(20, 1)], (grid, HUNDREDTHS), (2,))
        every = [Link(4, 9, ())] * (3 if head.rests else 2)
        data = build_stream(_ordinals(motion), (grid, HUNDREDTHS), own, every)
        end = data.index(b"".join(link.head() for link in every))
        for way, echo in (
            ("in", replace(good, channel=place, source=1)),
            ("of", replace(good, channel=1, source=place)),
        ):
            stream = b"\2" + data[1:end] + build_echoes([echo]) + data[end:]
            purpose = f"An echo {way} {name}, which are no ordinals."
            shelf.add(f"echo-{way}-{name}", HEADING, purpose, _with(motion, stream))


def _ordinals(motion: Motion) -> Any:
    signal = motion.signals[0]
    pairs = zip(signal.grids, signal.values.T, strict=True)
    return np.stack([grid.ordinals(values)[0] for grid, values in pairs], axis=1)


def _sizes(shelf: Broken) -> None:
    spec = f"Entropy coding; {HEADING}"
    cases: tuple[tuple[str, str, Edit], ...] = (
        ("byte-0-behind", "A byte 0 behind the bits, which changes none.", plus(b"\0")),
        ("byte-behind", "A byte 255 behind the bits.", plus(b"\xff")),
        ("half-missing", "Half of the bits are missing.", lambda data: data[: len(data) // 2]),
        ("bits-missing", "A head and a link without bits.", lambda data: data[:5]),
        ("another-value", "A bit of the first byte of bits is flipped.", flip(5)),
    )
    for name, purpose, edit in cases:
        motion = column(wave(30), HUNDREDTHS)
        data = file_of(motion, codec=codec_of([Coded()]), segments=stream(0, edit))
        shelf.add(name, spec, purpose, data)


def _numbers(shelf: Broken) -> None:
    """Bits that say what the rules of decoding refuse; they end with the fault."""
    plain = {"beyond": ("2^44", 2**44), "below": ("-2^44 - 1", -(2**44) - 1)}
    for name, (what, ordinal) in plain.items():
        data = build_stream([[5], [ordinal]], (WHOLE,), [Coded()], faulty=True)
        purpose = f"The value {what} of a plain channel."
        shelf.add(f"value-{name}", HEADING, purpose, _with(column([5, ordinal], WHOLE), data))
    motion, head = column([0.0], SIX), b"\1\4\x64\0" + Link(4, 9, ()).head()
    seven = build_stream([[6 * 9_000_000 + 234568]], (SIX,), [Coded(form=7, top=12, scale=0)])
    assert seven[1:5] == b"\x84\7\0\x0c"
    data = seven[:2] + b"\6" + seven[3:]
    purpose = "A number of seven digits in form 6: no multiple of ten."
    shelf.add("digits-7", HEADING, purpose, _with(motion, data))
    purpose = "A mantissa whose first digit is 0."
    shelf.add("mantissa-0", HEADING, purpose, _with(motion, head + _small(_mantissa_0)))
    narrow = b"\1\4\3\0" + Link(4, 9, ()).head()
    purpose = "A class below 0."
    shelf.add("class-below", HEADING, purpose, _with(motion, narrow + _small(_class_below)))
    purpose = "A class more than 4095 below the unit."
    shelf.add("class-far", HEADING, purpose, _with(motion, head + _small(_class_far)))
    magnitude = 101 * 900_000 + 1
    data = build_stream([[magnitude]], (SIX,), [Coded(top=100)], faulty=True)
    shelf.add("class-beyond", HEADING, "A class one beyond the greatest.", _with(motion, data))


def _small(more: Callable[[Any, Any], None]) -> bytes:
    """The bits of a first number below the unit, expected to be 0, scale 0: then ``more``."""
    _, coding = best_streams.loops()
    data, state = np.zeros(UNEXAMINED, np.uint8), start_states("best")[0].copy()
    coding.start(state, data, 1)
    track, flow = np.zeros(14, np.int64), np.array([0, 3, 0], np.int64)
    track[[numbers.FAST, numbers.SLOW]] = 16
    numbers.code_error(state, data, 0, 1, track, flow)
    numbers.adaptive(state, data, 0, numbers.C_ZERO + 1)
    numbers.adaptive(state, data, 0, numbers.C_MINUS)
    more(state, data)
    return data[: coding.finish(state, data)].tobytes()


def _mantissa_0(state: Any, data: Any) -> None:
    numbers.code_down(state, data, 1)
    for digit in (0, 1, 2, 3, 4, 5):
        numbers.code_digit(state, data, digit)


def _class_below(state: Any, data: Any) -> None:
    """Class 12 below the unit, where there are four, the highest of which is 13."""
    numbers.code_down(state, data, 12)
    for digit in (5, 1, 2, 3, 4, 5):
        numbers.code_digit(state, data, digit)


def _class_far(state: Any, data: Any) -> None:
    numbers.code_down(state, data, 4096)


def _signal(shelf: Broken) -> None:
    header = put(payloads.Clip, "signals.0.header", b"\1h")
    data = file_of(dance(), codec=codec_of(), CLIP=header)
    shelf.add("header", HEADING, "A header for best, which has none.", data)

    def doubled(made: Any) -> Any:
        ((header, streams),) = made
        return [(header, [*streams, *streams])]

    twice = put(payloads.Clip, "signals.0.n_resolutions", b"\2")
    data = file_of(dance(), codec=codec_of(), CLIP=twice, segments=doubled)
    purpose = "Two resolutions of best, which has one."
    shelf.add("resolutions", f"{HEADING}; Codecs", purpose, data)
