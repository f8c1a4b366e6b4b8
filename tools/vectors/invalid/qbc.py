"""Invalid, one fault each: headers, segments and streams of ``qbc``.

Where a reader can overlook the fault, the hash is that of what it then decodes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mcz.codecs.curves import kernels, streams
from mcz.codecs.curves.choices import MAX_INDEX
from mcz.codecs.curves.qbc import MAX_DELTA
from mcz.codecs.parameters import SCALED
from mcz.coding.mixing import mixed
from mcz.coding.residuals import bits, code_residual
from mcz.container import payloads
from mcz.numbers import Grid, GridKind
from mcz.schema import varint
from tools.records import built
from tools.vectors.build import curve_clips
from tools.vectors.build.curve_clips import (
    HEADING,
    Path,
    Piece,
    Plan,
    coded_curves,
    coded_marks,
    curves_of,
    file_with,
    header,
    motion_of,
    paths,
    still,
)
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
from tools.vectors.invalid.common import every_codec

WHOLE = Grid(GridKind.INTEGER)


def vectors() -> Iterable[Vector]:
    shelf = Broken("invalid/qbc")
    _headers(shelf)
    _signal(shelf)
    _segments(shelf)
    _missing(shelf)
    _heads(shelf)
    _bits(shelf)
    _marks(shelf)
    _curves(shelf)
    _values(shelf)
    every_codec.add(shelf, "qbc")
    return shelf.vectors


def _silent(plan: Plan, n_joints: int = 1, **edits: Any) -> bytes:
    """A file of zeros, all of whose streams are empty."""
    made = [still(plan)] * n_joints
    return file_with(plan, made, motion_of(plan, made), **edits)


def _headers(shelf: Broken) -> None:
    """Headers over nothing but zeros, which any reading of them gives."""
    plan = Plan(16, decimals=3)
    scaled = replace(plan, decimals=SCALED)
    none = dict.fromkeys(("delta", "coded_frames", "decimals", "step", "position_step"), b"")
    long = varint(MAX_DELTA + 1)
    cases: tuple[tuple[str, str, Plan, dict[str, bytes]], ...] = (
        ("delta-0", "Marks 0 frames apart.", plan, {"delta": b"\0"}),
        ("delta-2-20", "Marks 2^20 + 1 frames apart.", plan, {"delta": long}),
        ("delta-varint", "Marks 8 frames apart, in two bytes.", plan, {"delta": b"\x88\0"}),
        ("frames-varint", "16 frames in two bytes.", plan, {"coded_frames": b"\x90\0"}),
        ("decimals-16", "16 decimals.", plan, {"decimals": b"\x10"}),
        ("decimals-254", "254 decimals.", plan, {"decimals": b"\xfe"}),
        ("header-none", "A header of no bytes.", plan, none),
        ("header-cut", "A header without its last field.", plan, {"decimals": b""}),
        ("header-and-byte", "A byte behind the header.", plan, {"decimals": b"\3\0"}),
        ("header-and-step", "A step where decimals are said.", plan, {"step": binary64(1.0)}),
        ("step-missing", "One step.", scaled, {"step": b""}),
        ("step-cut", "Half of a step.", scaled, {"step": binary64(1.0)[:4]}),
    )
    for name, purpose, made, parts in cases:
        shelf.add(name, HEADING, purpose, _silent(made, CLIP=says(header(made, **parts))))
    for name, step in BAD_STEPS.items():
        edit = says(header(scaled, step=binary64(step)))
        shelf.add(f"step-{name}", HEADING, f"A step of {step!r}.", _silent(scaled, CLIP=edit))
        edit = says(header(scaled, position_step=binary64(step)))
        purpose = f"A step of positions of {step!r}."
        shelf.add(f"position-step-{name}", HEADING, purpose, _silent(scaled, CLIP=edit))


def _signal(shelf: Broken) -> None:
    plan = Plan(8)
    spec = f"{HEADING}; Codecs; CLIP"
    more = put(payloads.Clip, "signals.0.n_resolutions", b"\3")

    def extended(made: Made) -> Made:
        return [(head, [*streams, b"", b""]) for head, streams in made]

    data = _silent(plan, 2, CLIP=more, segments=extended)
    shelf.add("resolutions", spec, "Three resolutions.", data)
    none = put(payloads.Clip, "signals.0.n_resolutions", b"\0")
    data = _silent(plan, 2, CLIP=none, segments=lambda made: [(made[0][0], [])])
    shelf.add("resolutions-0", spec, "No resolution at all.", data)
    twice = put(payloads.Clip, "signals.0.samples_per_frame", b"\2")

    def rows(found: Any) -> Any:
        signals = (replace(found.signals[0], samples_per_frame=2),)
        return replace(found, signals=signals)

    data = _silent(plan, CLIP=twice, CEND=rehash(np.zeros((16, 1))), row=rows)
    shelf.add("samples", spec, "Two rows a frame.", data)
    run = built(payloads.GridRun, {"n_channels": 2, "grid": WHOLE}, "grids")
    integers = put(payloads.Clip, "signals.0.grids", b"\1" + run)
    data = _silent(plan, 2, CLIP=integers, CEND=rehash(np.zeros((8, 2), np.int64)))
    purpose = "All grids are INTEGER, but the codec decodes no ordinals."
    shelf.add("integers", spec, purpose, data)


def _segments(shelf: Broken) -> None:
    plan = Plan(24, ends=(16,))
    spec = f"{HEADING}; DATA"
    moved = both(headed(0, n_frames=12), headed(1, first=12, n_frames=12, lead=7))
    cases: tuple[tuple[str, str, Callable[[Made], Made]], ...] = (
        ("segment-inside", "A segment that begins between two marks.", moved),
        ("segment-lead-less", "A lead of a frame less than delta - 1.", headed(1, lead=6)),
        ("segment-lead-more", "A lead of delta.", headed(1, lead=8)),
        ("segment-lead-none", "A segment that claims to bear upon no other.", headed(1, lead=0)),
        ("segment-tail", "A tail, which no segment has.", headed(0, tail=1)),
        ("segment-not-fresh", "A segment that needs the one before.", headed(1, flags=0)),
    )
    for name, purpose, edit in cases:
        shelf.add(name, spec, purpose, _silent(plan, segments=edit))
    plan = Plan(12)
    more, fewer, none = (header(plan, coded_frames=bytes((n,))) for n in (20, 11, 0))
    purpose = "The last segment ends between two marks, and not with the coded frames."
    shelf.add("end-inside", spec, purpose, _silent(plan, CLIP=says(more)))
    purpose = "Fewer coded frames than are stored."
    shelf.add("frames-fewer", spec, purpose, _silent(plan, CLIP=says(fewer)))
    purpose = "Coded frames, 0 of them, of a clip that has some."
    shelf.add("frames-0", spec, purpose, _silent(plan, CLIP=says(none)))
    hidden = (
        ("end-inside-hidden", 12, 20, "The last segment ends between two marks"),
        ("frames-fewer-hidden", 16, 11, "Fewer coded frames than are stored"),
    )
    for name, stored, n_coded, purpose in hidden:
        plan = Plan(stored)
        edits = window(motion_of(plan, [still(plan)]), 0, 9)
        said = says(header(plan, coded_frames=bytes((n_coded,))))
        data = _silent(plan, **{**edits, "CLIP": both(edits["CLIP"], said)})
        shelf.add(name, spec, f"{purpose}, behind all frames that are shown.", data)


def _missing(shelf: Broken) -> None:
    """The last frames need a mark that no segment holds."""
    spec = f"{HEADING}; {CUT_HEADING}"
    plan = Plan(16)
    said = says(header(plan, coded_frames=varint(32)))
    purpose = "A clip without the segment that has the mark behind its last frames."
    shelf.add("missing-after", spec, purpose, _silent(plan, CLIP=said))
    far = says(header(plan, coded_frames=varint(2**52)))
    purpose = "The same with 2^52 coded frames."
    shelf.add("missing-after-2-52", spec, purpose, _silent(plan, CLIP=far))
    next_alone = says(header(plan, coded_frames=b"\x11"))
    purpose = "The one coded frame that is not stored is the mark behind."
    shelf.add("missing-mark", spec, purpose, _silent(plan, CLIP=next_alone))


def _as(data: bytes) -> Edit:
    return lambda _: data


def _with(shelf: Broken, name: str, purpose: str, plan: Plan, path: Path, edits: Any) -> None:
    spec = f"{HEADING}; Entropy coding"
    made = [path]
    data = file_with(plan, made, motion_of(plan, made), segments=edits)
    shelf.add(name, spec, f"{purpose}.", data)


def _heads(shelf: Broken) -> None:
    single = Plan(1)
    plan = Plan(17)
    straight = Path([(5,), (9,), (-7,)], spoken=(1,))
    ones = Path(straight.marks, {k: [Piece(1, (3 * n,)) for n in range(8)] for k in range(2)})
    for scale in (64, 255):
        byte = at(0, bytes((scale,)))
        cases = (
            ("scale", "marks, of which there is one", single, Path([(-3,)]), stream(0, byte)),
            ("break-scale", "breaks, of which there is none", plan, straight, stream(1, byte)),
            (
                "middle-scale",
                "middle points, of which there is none",
                plan,
                ones,
                stream(1, at(1, byte(b"?"))),
            ),
        )
        for name, what, made, path, edit in cases:
            _with(shelf, f"{name}-{scale}", f"A first scale {scale} of {what}", made, path, edit)
    bent = paths(plan)[0]
    for name, purpose, index, size in (
        ("marks-without-bits", "A first scale of marks, and no bits", 0, 1),
        ("curves-without-scale", "Curves with one of their two scales", 1, 1),
        ("curves-without-bits", "Both first scales of curves, and no bits", 1, 2),
    ):
        _with(shelf, name, purpose, plan, bent, stream(index, lambda data, n=size: data[:n]))
    nothing = Plan(5, 1)
    path = Path([(k,) for k in range(5)], spoken=(1,))
    purpose = "A byte 0 behind the head of curves of a frame each, which have no bits"
    _with(shelf, "byte-for-nothing", purpose, nothing, path, stream(1, plus(b"\0")))


def _bits(shelf: Broken) -> None:
    plan = Plan(60)
    path = paths(plan)[0]
    edits: tuple[tuple[str, str, Edit], ...] = (
        ("byte-0-behind", "A byte 0 behind the bits, which changes none", plus(b"\0")),
        ("byte-behind", "A byte 255 behind the bits", plus(b"\xff")),
        ("bytes-behind", "A thousand bytes behind the bits", plus(bytes(1000))),
        ("byte-missing", "The last byte of the bits is missing", lambda data: data[:-1]),
        ("half-missing", "Half of the bits are missing", lambda data: data[: len(data) // 2]),
        ("bit-flipped", "A bit is flipped", lambda data: at(9, bytes((data[9] ^ 1,)))(data)),
    )
    for index, what in enumerate(("marks", "curves")):
        for name, purpose, edit in edits:
            _with(shelf, f"{what}-{name}", f"{purpose}: {what}", plan, path, stream(index, edit))


def _marks(shelf: Broken) -> None:
    """Bits of marks that say what the rules of decoding refuse; they end with the fault."""
    cases: dict[str, tuple[str, list[int]]] = {
        "first-42-bits": ("A first mark of 42 bits", [2**41]),
        "first-63-bits": ("A first mark of 63 bits", [2**62]),
        "first-beyond": ("A first mark of 2^40 + 1", [MAX_INDEX + 1]),
        "first-below": ("A first mark of -2^40 - 1", [-MAX_INDEX - 1]),
        "mark-beyond": ("A mark of 2^40 + 1", [MAX_INDEX - 4, MAX_INDEX + 1]),
        "mark-below": ("A mark of -2^40 - 1", [-5, 9, -MAX_INDEX - 1]),
        "mark-54-bits": ("A residual of 54 bits", [0, 2**53]),
        "mark-61-bits": ("A residual of more than 60 bits", [0, 2**61]),
    }
    for name, (purpose, marks) in cases.items():
        plan = Plan(len(marks), 1, decimals=0)
        new = coded_marks(np.array([marks]).T, 10, faulty=True)
        made = [Path([(7,)] * len(marks))]
        lax = rehash(np.array([marks], np.float64).T)
        edits = {"segments": stream(0, _as(new)), "CEND": lax}
        data = file_with(plan, made, motion_of(plan, made), **edits)
        shelf.add(name, f"{HEADING}; Residuals", f"{purpose}.", data)


def _curves(shelf: Broken) -> None:
    """Bits of curves that say what the rules of decoding refuse."""
    plan = Plan(9, decimals=0)
    marks = [(MAX_INDEX - 5,), (9 - MAX_INDEX,)]
    good = Path(marks, {0: [Piece(3, (4,), (5,)), Piece(5)]})
    _beyond(shelf, marks)
    cases: dict[str, tuple[str, list[Piece]]] = {
        "break-54-bits": ("A residual of 54 bits of a break", [Piece(3, (2**53 + 2**40,))]),
        "length-minus": ("A curve over -3 frames", [Piece(-3, (4,))]),
        "length-beyond": ("A curve over 9 of 8 frames", [Piece(9, (4,))]),
    }
    for name, (purpose, pieces) in cases.items():
        left = 8 - sum(piece.n_frames for piece in pieces)
        rest = [Piece(left)] if left else []
        found, frames, curves = curves_of(plan, replace(good, pieces={0: [*pieces, *rest]}), 0, 1)
        count = len(pieces)
        curves = streams.Curves(curves.lengths[:count], curves.ends[:count], curves.mids[:count])
        new = coded_curves(found, frames, curves, (8, 6), faulty=True)
        data = file_with(plan, [good], motion_of(plan, [good]), segments=stream(1, _as(new)))
        shelf.add(name, f"{HEADING}; Residuals", f"{purpose}.", data)
    for name, length, purpose in (
        ("length-0", 0, "A curve over none of 8 frames, before one over all of them."),
        ("length-of-all", 8, "All 8 frames that are left, not said as the last curve."),
    ):
        bent = Path(marks, {0: [Piece(8, None, (40,))]})
        new = _lone_curve((marks[0][0] + marks[1][0]) >> 1, 40, length)
        data = file_with(plan, [bent], motion_of(plan, [bent]), segments=stream(1, _as(new)))
        shelf.add(name, f"{HEADING}; Residuals", purpose, data)


def _beyond(shelf: Broken, marks: list[tuple[int]]) -> None:
    """Points beyond the limits, the last that is coded; the hashes are of such curves."""
    start, end = marks[0][0], marks[1][0]
    for word, point in (("beyond", MAX_INDEX + 1), ("below", -MAX_INDEX - 1)):
        for what, plan, piece, values in (
            ("break", Plan(3, 2, 0), Piece(1, (point,)), [start, point, end]),
            ("middle", Plan(9, 8, 0), Piece(8, None, (point,)), _curve(start, point, end)),
        ):
            rest = [Piece(1)] * (plan.n_frames - 1 - piece.n_frames)
            found, frames, curves = curves_of(plan, Path(marks, {0: [piece, *rest]}), 0, 1)
            first = streams.Curves(curves.lengths[:1], curves.ends[:1], curves.mids[:1])
            new = coded_curves(found, frames, first, (8, 6), faulty=True)
            lax = rehash(np.array([values], np.float64).T)
            made = [Path(marks, spoken=(1,))]
            edits = {"segments": stream(1, _as(new)), "CEND": lax}
            data = file_with(plan, made, motion_of(plan, made), **edits)
            purpose = f"A {what if rest else 'middle point'} of {_power(point)}."
            shelf.add(f"{what}-{word}", f"{HEADING}; Residuals", purpose, data)


def _curve(start: int, middle: int, end: int) -> list[float]:
    """The frames of one curve over eight, and its end."""
    times = [i / 8 for i in range(9)]
    return [
        ((1 - t) * (1 - t) * start + ((2 * t) * (1 - t)) * middle) + (t * t) * end for t in times
    ]


def _power(point: int) -> str:
    return "2^40 + 1" if point > 0 else "-2^40 - 1"


def _code_long_way(
    state: curve_clips.Ints, data: Any, left: int, length: int, error: int, scale: int
) -> bool:
    """Code a length as a residual, a break of no residual behind 0 frames, and a middle point."""
    first, sides = kernels.C_LAST, (0, 0, 3)
    mixed(state, data, 0, kernels.M_LAST, first + bits(left), first + 16, first + 24)
    scales = 4 * left, left
    code_residual(state, data, length - left // 2, 0, scales, 0, sides, kernels.LENGTHS)
    if length == 0:
        scales = 16 * scale, 16 * scale
        code_residual(state, data, 0, 0, scales, 3, sides, kernels.BREAKS)
        mixed(state, data, 1, kernels.M_LAST, first + bits(left), first + 17, first + 24)
    code_residual(state, data, error, 0, (16 * scale, 16 * scale), 3, sides, kernels.MIDDLES)
    return True


def _lone_curve(predicted: int, middle: int, length: int) -> bytes:
    """One curve over 8 frames, whose length, or one of 0 frames before it, is said the long way."""
    scale = streams.scale_of(6)

    def loop(state: curve_clips.Ints, data: Any) -> bool:
        return bool(_code_long_way(state, data, 8, length, middle - predicted, scale))

    return b"\x06\x06" + curve_clips._bits(streams.DETAILS, loop, faulty=False)


def _values(shelf: Broken) -> None:
    plan = Plan(60, decimals=SCALED, step=0.1)
    made = paths(plan, (4, 2))
    motion = motion_of(plan, made)
    values = motion.signals[0].values
    near = values.copy()
    near[7, 3] = np.nextafter(near[7, 3], np.inf)
    spec = f"{HEADING}; CEND"
    for name, purpose, other in (
        ("hash-near", "One value is the neighbor of the one hashed.", near),
        ("hash-order", "The hash is of values summed from their end on.", _turned(plan, made)),
        (
            "hash-coarse",
            "The hash is of the straight curves.",
            curve_clips.values_of(plan, made, 1),
        ),
    ):
        assert other.tobytes() != values.tobytes()
        shelf.add(name, spec, purpose, file_with(plan, made, motion, CEND=rehash(other)))


def _turned(plan: Plan, made: Sequence[Path]) -> np.ndarray:
    """The values where the sums of the curves begin with their ends."""
    columns = []
    for path in made:
        marks, _, curves = curves_of(plan, path, 0, len(plan.marks) - 1)
        rows, start = [], marks[0] * plan.step
        for k, n in enumerate(curves.lengths.tolist()):
            middle, end = curves.mids[k] * plan.step, curves.ends[k] * plan.step
            for i in range(n):
                t = i / n
                u = 1 - t
                rows.append(((t * t) * end + ((2 * t) * u) * middle) + (u * u) * start)
            start = end
        columns.append(np.array([*rows, start]))
    return np.concatenate(columns, axis=1)
