"""Invalid, one fault each: headers, segments and streams of ``mrdwt``.

Where a reader can overlook the fault, the hash is that of what it then decodes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mcz.codecs.parameters import SCALED
from mcz.codecs.wavelet.streams import CONSTANT, MAX_INDEX
from mcz.container import payloads
from mcz.numbers import Grid, GridKind
from mcz.schema import varint
from mcz.transforms import dwt
from mcz.transforms.wavelets import MAX_TAP, by_id
from tools.records import built
from tools.vectors.build import wavelet_clips
from tools.vectors.build.cuts import CUT_HEADING, window
from tools.vectors.build.edits import (
    BAD_STEPS,
    Edit,
    Made,
    at,
    binary64,
    both,
    headed,
    plus,
    put,
    says,
    stream,
)
from tools.vectors.build.files import Broken, Vector, rehash
from tools.vectors.build.wavelet_clips import (
    BIOR,
    DB2,
    HAAR,
    HEADING,
    Head,
    Plan,
    Wave,
    approximation,
    counted,
    dance_of,
    detail,
    file_with,
    header,
    motion_of,
    waves,
    zeros,
)
from tools.vectors.invalid.common import every_codec

FLAT = Plan(8, HAAR, 0, decimals=0)  # values are the approximations
WHOLE = Grid(GridKind.INTEGER)
_FIELDS = ("wavelet", "lo", "hi", "levels", "coded_frames", "decimals", "unit", "least")


def vectors() -> Iterable[Vector]:
    shelf = Broken("invalid/mrdwt")
    _headers(shelf)
    _filters(shelf)
    _signal(shelf)
    _segments(shelf)
    _missing(shelf)
    _heads(shelf)
    _bits(shelf)
    _out_of_range(shelf)
    _values(shelf)
    _end_hidden(shelf)
    _lead_hidden(shelf)
    every_codec.add(shelf, "mrdwt")
    return shelf.vectors


def of_zeros(plan: Plan, n_channels: int = 1, **edits: Any) -> bytes:
    """A file of zeros, all of whose streams are empty."""
    made = [zeros(plan)] * n_channels
    return file_with(plan, made, motion_of(plan, made), **edits)


def _headers(shelf: Broken) -> None:
    """Headers over nothing but zeros, which any reading of them gives."""
    plan = Plan(8, BIOR, decimals=3)
    scaled = replace(plan, decimals=SCALED)
    cases: tuple[tuple[str, str, Plan, dict[str, bytes]], ...] = (
        ("wavelet-11", "A wavelet beyond the registry.", plan, {"wavelet": b"\x0b"}),
        ("wavelet-255", "Wavelet 255.", plan, {"wavelet": b"\xff"}),
        ("levels-17", "17 levels.", plan, {"levels": b"\x11"}),
        ("levels-255", "255 levels.", plan, {"levels": b"\xff"}),
        ("decimals-16", "16 decimals.", plan, {"decimals": b"\x10"}),
        ("decimals-254", "254 decimals.", plan, {"decimals": b"\xfe"}),
        ("least-0", "A least detail of 0.", plan, {"least": b"\0"}),
        ("least-2-39", "A least detail of 2^39 + 1.", plan, {"least": varint(2**39 + 1)}),
        ("least-varint", "A least detail of 1 in two bytes.", plan, {"least": b"\x81\0"}),
        ("frames-varint", "8 frames in two bytes.", plan, {"coded_frames": b"\x88\0"}),
        ("header-none", "A header of no bytes.", plan, dict.fromkeys(_FIELDS, b"")),
        ("header-cut", "A header without its last field.", plan, {"least": b""}),
        ("header-and-byte", "A byte behind the header.", plan, {"least": b"\1\0"}),
        ("header-and-unit", "A unit where decimals are said.", plan, {"unit": binary64(1.0)}),
        ("unit-missing", "No unit of scaled coefficients.", scaled, {"unit": b""}),
    )
    for name, purpose, made, parts in cases:
        shelf.add(name, HEADING, purpose, of_zeros(made, CLIP=says(header(made, **parts))))
    for name, unit in BAD_STEPS.items():
        edit = says(header(scaled, unit=binary64(unit)))
        shelf.add(f"unit-{name}", HEADING, f"A unit of {unit!r}.", of_zeros(scaled, CLIP=edit))


def _filters(shelf: Broken) -> None:
    """Filters in the header that no level makes use of."""
    two, four = (0.5, 0.5), (0.5, 0.5, 0.25, 0.25)
    beyond = math.nextafter(MAX_TAP, math.inf)
    odd, many = two + two[:1], (0.25,) * 66
    cases: dict[str, tuple[str, Sequence[float], Sequence[float]]] = {
        "none": ("Filters without taps", (), ()),
        "odd": ("Filters of 3 taps", odd, odd),
        "one": ("Filters of one tap", two[:1], two[:1]),
        "66": ("Filters of 66 taps", many, many),
        "unlike": ("4 taps beside 2", four, two),
        "unlike-hi": ("2 taps beside 4", two, four),
        "beyond": ("A tap next to 16", (0.5, beyond), two),
        "below": ("A tap next to -16", two, (-beyond, 0.5)),
        "NaN": ("A tap that is no number", two, (0.5, math.nan)),
        "infinite": ("An infinite tap", (-math.inf, 0.5), two),
    }
    spec = f"{HEADING}; Wavelets"
    for name, (purpose, lo, hi) in cases.items():
        said = header(FLAT, wavelet=b"\0", lo=counted(lo), hi=counted(hi))
        data = of_zeros(FLAT, CLIP=says(said))
        shelf.add(f"taps-{name}", spec, f"{purpose}.", data)
    said = b"\0" + counted(two) + counted(two)[:-4]
    data = of_zeros(FLAT, CLIP=says(said))
    shelf.add("taps-cut", spec, "A header that ends within a tap.", data)


def _signal(shelf: Broken) -> None:
    plan = Plan(8, DB2)
    spec = f"{HEADING}; Codecs; CLIP"

    def extended(made: Made) -> Made:
        return [(head, [*streams, b"", b""]) for head, streams in made]

    def fewer(made: Made) -> Made:
        return [(head, streams[::2]) for head, streams in made]

    more = put(payloads.Clip, "signals.0.n_resolutions", b"\4")
    data = of_zeros(plan, 2, CLIP=more, segments=extended)
    shelf.add("resolutions", spec, "Four resolutions of two levels.", data)
    none = put(payloads.Clip, "signals.0.n_resolutions", b"\0")
    data = of_zeros(plan, 2, CLIP=none, segments=lambda made: [(made[0][0], [])])
    shelf.add("resolutions-0", spec, "No resolution at all.", data)
    together = put(payloads.Clip, "signals.0.groups", b"\0")
    data = of_zeros(plan, 2, CLIP=together, segments=fewer)
    shelf.add("groups", spec, "A group of two channels.", data)
    twice = put(payloads.Clip, "signals.0.samples_per_frame", b"\2")

    def rows(found: Any) -> Any:
        signals = (replace(found.signals[0], samples_per_frame=2),)
        return replace(found, signals=signals)

    data = of_zeros(plan, CLIP=twice, CEND=rehash(np.zeros((16, 1))), row=rows)
    shelf.add("samples", spec, "Two rows a frame.", data)
    run = built(payloads.GridRun, {"n_channels": 2, "grid": WHOLE}, "grids")
    integers = put(payloads.Clip, "signals.0.grids", b"\1" + run)
    data = of_zeros(plan, 2, CLIP=integers, CEND=rehash(np.zeros((8, 2), np.int64)))
    purpose = "All grids are INTEGER, but the codec decodes no ordinals."
    shelf.add("integers", spec, purpose, data)


def _segments(shelf: Broken) -> None:
    plan = Plan(16, DB2, ends=(8,))
    spec = f"{HEADING}; DATA"
    moved = both(headed(0, n_frames=6), headed(1, first=6, n_frames=10, lead=6))
    cases: tuple[tuple[str, str, Callable[[Made], Made]], ...] = (
        ("segment-inside", "A segment that begins inside a coefficient.", moved),
        ("segment-lead-less", "A lead of a frame less than the filters reach.", headed(1, lead=5)),
        ("segment-lead-more", "A lead of a frame more than the filters reach.", headed(1, lead=7)),
        ("segment-lead-none", "A segment that claims to bear upon no other.", headed(1, lead=0)),
        ("segment-tail", "A tail, which no segment has.", headed(0, tail=1)),
        ("segment-not-fresh", "A segment that needs the one before.", headed(1, flags=0)),
    )
    for name, purpose, edit in cases:
        shelf.add(name, spec, purpose, of_zeros(plan, segments=edit))
    plan = Plan(6, HAAR)
    more, fewer = (header(plan, coded_frames=bytes((n,))) for n in (8, 5))
    purpose = "The last segment ends inside a coefficient, and not with the coded frames."
    shelf.add("end-inside", spec, purpose, of_zeros(plan, CLIP=says(more)))
    purpose = "Fewer coded frames than are stored."
    shelf.add("frames-fewer", spec, purpose, of_zeros(plan, CLIP=says(fewer)))
    purpose = "Coded frames, 0 of them, of a clip that has some."
    data = of_zeros(plan, CLIP=says(header(plan, coded_frames=b"\0")))
    shelf.add("frames-0", spec, purpose, data)


def _missing(shelf: Broken) -> None:
    """The last frames need approximations that no segment holds."""
    spec = f"{HEADING}; {CUT_HEADING}"
    plan = Plan(16, DB2)
    said = says(header(plan, coded_frames=varint(32)))
    purpose = "A clip without the segment that bears upon its last frames."
    shelf.add("missing-after", spec, purpose, of_zeros(plan, CLIP=said))
    far = says(header(plan, coded_frames=varint(2**52)))
    purpose = "The same with 2^52 coded frames."
    shelf.add("missing-after-2-52", spec, purpose, of_zeros(plan, CLIP=far))


def _heads(shelf: Broken) -> None:
    constant, ramp = [5] * 8, [3, 4, 6, 9, 13, 18, 24, 31]
    scaled = replace(FLAT, decimals=SCALED)
    level = Plan(8, HAAR, 1, decimals=0)
    cases: tuple[tuple[str, str, Plan, Sequence[int], Edit], ...] = (
        ("form-127", "Equals with predictor 1.", FLAT, constant, at(0, b"\x7f")),
        ("form-255", "Equals with predictor 3.", FLAT, constant, at(0, b"\xff")),
        ("equals-and-byte", "A byte behind equals.", FLAT, constant, plus(b"\0")),
        ("equals-and-bits", "Bits behind equals.", FLAT, constant, plus(b"\x5a\x01")),
        ("first-varint", "The first coefficient in two bytes.", FLAT, constant, _overlong),
        ("cut-before-step", "A stream that ends before its step.", scaled, constant, _first(1)),
        ("cut-before-first", "A stream that ends before its first.", scaled, constant, _first(2)),
        ("cut-in-first", "A stream that ends within its first.", FLAT, [999] * 8, _first(2)),
        ("cut-before-bits", "A head without bits.", FLAT, ramp, _first(2)),
    )
    for name, purpose, plan, band, edit in cases:
        equal = len(set(band)) == 1
        head = Head(128, 0, CONSTANT) if equal else Head(128, 2, 3)
        made = [zeros(plan, a=band, heads=(head,))]
        data = file_with(plan, made, motion_of(plan, made), segments=stream(0, edit))
        shelf.add(name, HEADING, purpose, data)
    for name, sign in (("beyond", 1), ("below", -1)):
        value = sign * (MAX_INDEX + 1)
        made = [zeros(FLAT, a=constant, heads=(Head(0, 0, CONSTANT),))]
        new = bytes((CONSTANT,)) + varint(2 * MAX_INDEX + (2 if sign > 0 else 1))
        edits = {"segments": stream(0, _as(new)), "CEND": rehash(np.full((8, 1), float(value)))}
        data = file_with(FLAT, made, motion_of(FLAT, made), **edits)
        shelf.add(f"first-{name}", HEADING, f"A first coefficient of {value}.", data)
    level = replace(level, decimals=SCALED)
    full = zeros(level, d1=[4, 0, -3, 1], heads=(Head(0, 0, CONSTANT),))
    data = file_with(level, [full], motion_of(level, [full]), segments=stream(0, _as(b"")))
    purpose = "An empty approximation, so no step, beside details of step 0."
    shelf.add("details-without-step", HEADING, purpose, data)


def _as(data: bytes) -> Edit:
    return lambda _: data


def _first(size: int) -> Edit:
    return lambda data: data[:size]


def _overlong(data: bytes) -> bytes:
    """The stream of equals, whose first takes a byte, with that in two."""
    return data[:-1] + bytes((data[-1] | 128, 0))


def _bits(shelf: Broken) -> None:
    """Bits of an approximation, stream 0, and of the finest detail, stream 2."""
    spec = f"{HEADING}; Entropy coding"
    plan = Plan(40, DB2)
    made = waves(plan)
    motion = motion_of(plan, made)
    edits: tuple[tuple[str, str, Edit], ...] = (
        ("byte-0-behind", "A byte 0 behind the bits, which changes none", plus(b"\0")),
        ("byte-behind", "A byte 255 behind the bits", plus(b"\xff")),
        ("bytes-behind", "A thousand bytes behind the bits", plus(bytes(1000))),
        ("byte-missing", "The last byte of the bits is missing", lambda data: data[:-1]),
        ("half-missing", "Half of the bits are missing", lambda data: data[: len(data) // 2]),
        ("bit-flipped", "A bit is flipped", lambda data: at(5, bytes((data[5] ^ 1,)))(data)),
    )
    for index, band in ((0, "approximation"), (2, "detail")):
        for name, purpose, edit in edits:
            data = file_with(plan, made, motion, segments=stream(index, edit))
            shelf.add(f"{band}-{name}", spec, f"{purpose}: {band}.", data)
    short = Plan(1, HAAR, 0)
    one = [zeros(short, a=[7], heads=(Head(0, 0, 4),))]
    data = file_with(short, one, motion_of(short, one), segments=stream(0, plus(b"\0")))
    purpose = "A byte 0 behind the head of a single approximation, which has no bits."
    shelf.add("byte-for-nothing", spec, purpose, data)
    silent = Plan(8, HAAR, 1)
    data = of_zeros(silent, segments=stream(1, _as(b"\0")))
    shelf.add(
        "detail-of-0",
        spec,
        "A detail of one byte 0, which says a residual of more than 60 bits.",
        data,
    )


def _out_of_range(shelf: Broken) -> None:
    """Bits that say what the rules of decoding refuse; they end with the fault."""
    spec = f"{HEADING}; Residuals"
    cases: dict[str, tuple[str, list[int], int]] = {
        "beyond": ("An approximation of 2^40 + 1", [MAX_INDEX - 4, MAX_INDEX + 1], 0),
        "below": ("An approximation of -2^40 - 1", [-5, 9, -MAX_INDEX - 1], 2),
        "54-bits": ("A residual of 54 bits", [0, 2**53], 0),
        "61-bits": ("A residual of more than 60 bits", [0, 2**61], 1),
    }
    for name, (purpose, band, predictor) in cases.items():
        plan = replace(FLAT, n_frames=len(band))
        new = approximation(plan, band, Head(0, predictor, 10), faulty=True)
        made = [zeros(plan, a=[5] * len(band), heads=(Head(0, 0, CONSTANT),))]
        lax = rehash(np.array([band], np.float64).T)
        edits = {"segments": stream(0, _as(new)), "CEND": lax}
        data = file_with(plan, made, motion_of(plan, made), **edits)
        shelf.add(f"approximation-{name}", spec, f"{purpose}.", data)
    details: dict[str, tuple[str, int, list[int]]] = {
        "beyond": ("A detail of 2^40, least 1", 1, [0, 3, MAX_INDEX]),
        "below": ("A detail of -2^40, least 1", 1, [0, 3, -MAX_INDEX]),
        "beyond-least": ("A detail of 2^40, least 1000", 1000, [1001, 0, MAX_INDEX]),
        "54-bits": ("A residual of 54 bits of a detail", 1, [0, 2**53]),
    }
    for name, (purpose, least, band) in details.items():
        plan = Plan(2 * len(band), HAAR, 1, decimals=0, least=least)
        bands = [[0] * len(band), band]
        new = detail(plan, bands, 1, faulty=True)
        made = [zeros(plan, d1=[least] * len(band))]
        edits = {"segments": stream(1, _as(new)), "CEND": rehash(_haar(bands))}
        data = file_with(plan, made, motion_of(plan, made), **edits)
        shelf.add(f"detail-{name}", spec, f"{purpose}.", data)


def _haar(bands: Sequence[Sequence[int]]) -> np.ndarray:
    """The values of one level of haar."""
    floats = [np.array([band], np.float64).T for band in bands]
    return dwt.synthesize(floats, [0], 0, 2 * len(bands[0]), by_id(HAAR))


def _values(shelf: Broken) -> None:
    plan = Plan(20, BIOR, 3)
    made = waves(plan, 6)
    motion = dance_of(plan, made)
    values = motion.signals[0].values
    near = values.copy()
    near[7, 3] = np.nextafter(near[7, 3], np.inf)
    spec = f"{HEADING}; CEND"
    for name, purpose, other in (
        ("hash-near", "One value is the neighbor of the one hashed.", near),
        ("hash-order", "The hash is of values summed with details first.", _turned(plan, made)),
    ):
        assert other.tobytes() != values.tobytes()
        shelf.add(name, spec, purpose, file_with(plan, made, motion, CEND=rehash(other)))


def _turned(plan: Plan, made: Sequence[Wave]) -> np.ndarray:
    """The values where the sum of a synthesis begins with the details."""
    columns = []
    for one in made:
        low, bands = np.array(one.bands[0]) / 100, [np.array(b) / 100 for b in one.bands[1:]]
        for level, high in zip(range(plan.levels - 1, -1, -1), bands, strict=True):
            low = np.array(
                [_sum(plan, low, high, n) for n in range(plan.lengths[level])], np.float64
            )
        columns.append(low)
    return np.array(columns).T


def _sum(plan: Plan, low: np.ndarray, high: np.ndarray, n: int) -> float:
    taps = plan.filters.n_taps
    x = 0.0
    for filter_, band in ((plan.filters.hi, high), (plan.filters.lo, low)):
        for k in range(n // 2, (n + taps - 2) // 2 + 1):
            x = x + filter_[n + taps - 2 - 2 * k] * float(band[k])
    return x


def _end_hidden(shelf: Broken) -> None:
    plan = wavelet_clips.Plan(6, wavelet_clips.HAAR)
    edits = window(wavelet_clips.motion_of(plan, [wavelet_clips.zeros(plan)]), 0, 4)
    said = says(wavelet_clips.header(plan, coded_frames=b"\x08"))
    data = of_zeros(plan, **{**edits, "CLIP": both(edits["CLIP"], said)})
    purpose = "The last segment ends inside a coefficient, behind all frames that are shown."
    shelf.add("end-inside-hidden", f"{wavelet_clips.HEADING}; CLIP", purpose, data)


def _lead_hidden(shelf: Broken) -> None:
    """A segment that is stored, not shown, and says of itself what the codec does not allow."""
    plan = Plan(24, DB2, 1, ends=(8, 16))
    channels = wavelet_clips.waves(plan)
    motion = wavelet_clips.motion_of(plan, channels)
    edits = window(motion, 20, 24)
    data = wavelet_clips.file_with(plan, channels, motion, **edits, segments=headed(1, lead=1))
    purpose = "A lead of a frame less than the filters reach, of a segment that nobody needs."
    shelf.add("segment-lead-hidden", "Codec 16: wavelet; CLIP; DATA", purpose, data)
