"""Valid: every print style of every grid, with its ends; sources of lossy clips and of parts."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from mcz.codecs._lossy import SCALED
from mcz.container import payloads
from mcz.container.segments import GROUP_NOTES
from mcz.formats import amc, asf, bvh, c3d
from mcz.motion import Exceptions, Motion, Signal
from mcz.numbers import Grid, GridFlag, GridKind
from mcz.schema import build
from tests.formats.c3d_files import DEC, SGI
from tools.vectors import waved
from tools.vectors.craft import Crafter, Vector, Whole, file_of, finished, rehash
from tools.vectors.edits import Made
from tools.vectors.sources import AMC, ASF, BOTH, HEADING, _with_asf, called, take
from tools.vectors.sources_c3d import SPEC as C3D_SPEC
from tools.vectors.sources_c3d import _rotations, made
from tools.vectors.sources_c3d import take as take_c3d
from tools.vectors.valid_cut import HEADING as CUT_HEADING
from tools.vectors.valid_cut import cut, shown
from tools.vectors.waved import HAAR, Head, Plan, Wave

F = GridFlag
NONE = F(0)
WHOLES = (NONE, F.POINT_ZERO, F.POINT)
EXPONENTS = (NONE, F.EXPONENT3, F.EXPONENT1)
MOST = 2**51 - 1  # magnitude of FIXED and TRIMMED
JOINT = """\
%(indent)sJOINT J%(number)d
%(indent)s{
%(indent)s\tOFFSET 0 0 0
%(indent)s\tCHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
"""
TEXT64_BITS = (
    0x0000000000000001,  # 5e-324
    0x7FEFFFFFFFFFFFFF,
    0x3FF0000000000000,  # 1
    0x3FB999999999999A,  # 0.1
    0x3FE0000000000000,
    0x405EC00000000000,  # 123
    0x4340000000000000,  # 2^53
    0x4341C37937E08000,  # 1e16
    0x430C6BF526340000,  # 1e15
    0x3F1A36E2EB1C432D,  # 1e-4
    0x3EE4F8B588E368F1,  # 1e-5
    0x3EB0C6F7A0B5ED8D,  # 1e-6
    0x3E7AD7F29ABCAF48,  # 1e-7
    0x444B1AE4D6E2EF50,  # 1e21
    0x4415AF1D78B58C40,  # 1e20
    0x5570000000000000,
)


def vectors() -> Iterable[Vector]:
    shelf = Whole("valid/sources")
    for name, grids, magnitudes in _tables():
        _printed(shelf, name, grids, magnitudes)
    _lossy(shelf)
    _lossy_exceptions(shelf)
    _lossy_c3d(shelf)
    _no_residuals(shelf)
    _parts(shelf)
    return shelf.vectors


# Every flag


def _flags(*choices: Sequence[GridFlag]) -> list[GridFlag]:
    """One of each, in every combination."""
    found = []
    for chosen in product(*choices):
        flags = NONE
        for flag in chosen:
            flags |= flag
        found.append(flags)
    return found


def _tables() -> Iterable[tuple[str, list[Grid], Sequence[Sequence[int]]]]:
    """Names, grids, and the magnitudes of each grid."""
    zero, plus = (NONE, F.NO_ZERO), (NONE, F.PLUS)
    fixed = [Grid(GridKind.FIXED, 0, flags) for flags in _flags((NONE, F.POINT), plus)]
    for digits in (1, 3, 15, 22):
        fixed += [Grid(GridKind.FIXED, digits, flags) for flags in _flags(zero, plus)]
    yield "fixed", fixed, [_decimals(grid.digits) for grid in fixed]
    trimmed = [
        Grid(GridKind.TRIMMED, digits, flags)
        for digits in (1, 3, 22)
        for flags in _flags(WHOLES, zero, plus)
    ]
    yield "trimmed", trimmed, [_decimals(grid.digits) for grid in trimmed]
    every = _flags(WHOLES, zero, plus, EXPONENTS, (NONE, F.UPPER))
    general = [Grid(GridKind.GENERAL, 6, flags) for flags in every]
    general += [Grid(GridKind.GENERAL, digits) for digits in range(1, 16)]
    yield "general", general, [_general(grid.digits) for grid in general]
    for digits in (0, 1, 16, 17):
        grids = [Grid(GridKind.TEXT64, digits, flags) for flags in every]
        yield f"text64-{digits}", grids, [TEXT64_BITS] * len(grids)
    places = [Grid(GridKind.TEXT64, 64 + places) for places in range(10, 41)]
    short = [0x444B1AE4D6E2EF4F, *(b for b in TEXT64_BITS if b < 0x444B1AE4D6E2EF4F)]
    yield "text64-places", places, [short[:12]] * len(places)
    words = [0, 1, 0x7F7FFFFF, 0x3F800000, 0x3DCCCCCD, 0x42F60000, 0x4B800000, 0x5A0E1BCA]
    words += [0x38D1B717, 0x3727C5AC, 0x0F800000, 0x007FFFFF]
    text32 = [Grid(GridKind.TEXT32, 0, flags) for flags in every]
    yield "text32", text32, [words] * len(text32)


def _decimals(digits: int) -> list[int]:
    unit = 10 ** min(digits, 13)
    found = [0, 1, MOST, unit, 7 * unit // 10, unit - 1, 12 * unit + 5, 30 * unit]
    return [*found, 100 * unit, unit // 2 + 1, MOST - 1, 9]


def _general(digits: int) -> list[int]:
    """Both ends, and where exponents begin and end."""
    block, most = 9 * 10 ** (digits - 1), 5535 * 10 ** (digits - 1)

    def number(first: int, exponent: int) -> int:
        """The magnitude of ``first`` times 10^exponent, one digit."""
        return 1 + (exponent + 307) * block + (first - 1) * 10 ** (digits - 1)

    found = [0, 1, most, number(1, 0), number(5, -1), number(1, -4), number(2, -5)]
    found += [number(3, digits - 1), number(3, digits), number(7, -100), number(9, 99)]
    return [*found, number(1, 1) - 1]


def _printed(
    shelf: Whole, name: str, grids: Sequence[Grid], magnitudes: Sequence[Sequence[int]]
) -> None:
    """A BVH file with a column a grid, its magnitudes with a plus and a minus in turn."""
    n_columns = -(-len(grids) // 6) * 6
    every = [*grids, *[grids[-1]] * (n_columns - len(grids))]
    columns = []
    for place in range(n_columns):
        own = magnitudes[min(place, len(grids) - 1)]
        signed = [-1 - m if (row + place) % 2 else m for row, m in enumerate([*own, *own[:1]])]
        columns.append(_read_back(every[place], np.array(signed, np.int64)))
    texts = [grid.texts(o).tolist() for grid, o in zip(every, columns, strict=True)]
    n_rows = len(columns[0])
    words = [b" ".join(row) for row in zip(*texts, strict=True)]
    head = _skeleton(n_columns // 6) + f"MOTION\nFrames: {n_rows}\nFrame Time: 0.01\n"
    source = head.encode() + b"\n".join([*words, b""])
    values = np.array([g.values(o) for g, o in zip(every, columns, strict=True)]).T
    motion = take(source, f"flags-{name}")
    assert np.array_equal(motion.signals[0].values, values), name
    motion = replace(motion, signals=(Signal(values, tuple(every)),))
    assert bvh.write(motion) == source, name
    purpose = f"Numbers at both ends and between, in every style of their grid: {name}."
    data = file_of(motion, grouping="all")
    spec = f"{HEADING}; Ordinal to text"
    sources = ((f"flags-{name}.bvh", source),)
    shelf.hold(f"bvh-flags-{name}", spec, purpose, data, motion, sources=sources, modes=BOTH)


def _read_back(grid: Grid, ordinals: NDArray[np.int64]) -> NDArray[np.int64]:
    """``ordinals``, 0 in place of those whose text has lost digits: a writer has none such."""
    read = np.array([float(text) for text in grid.texts(ordinals).tolist()])
    lost = read != grid.values(ordinals)
    return np.where(lost, 0, ordinals)


def _skeleton(n_joints: int) -> str:
    """A HIERARCHY of joints below each other, of six channels each."""
    lines, ends = "", ""
    for number in range(n_joints):
        lines += JOINT % {"indent": "\t" * number, "number": number}
        ends = "\t" * number + "}\n" + ends
    indent = "\t" * n_joints
    site = f"{indent}End Site\n{indent}{{\n{indent}\tOFFSET 0 1 0\n{indent}}}\n"
    return "HIERARCHY\n" + lines.replace("JOINT", "ROOT", 1) + site + ends


# Lossy clips


def _lossy(shelf: Whole) -> None:
    """Values that are on no grid, by codec 2: halves, and numbers beyond the ends of grids."""
    integers = [0, 1, -1, 3, -5, 12345, -99999, 2**40, -(2**40), 2**39 + 1, 7, -3]
    steps = [136, 136, 128, 128, 124, 130, 255, 255, 136, 200, 0, 64]
    grids = (
        *(Grid(GridKind.FIXED, digits) for digits in (0, 1, 2, 6, 22)),
        Grid(GridKind.TRIMMED, 3),
        *(Grid(GridKind.GENERAL, digits) for digits in (1, 3, 6, 15)),
        *(Grid(GridKind.TEXT64, digits) for digits in (0, 1, 16, 17, 74)),
        Grid(GridKind.TEXT32),
        Grid(GridKind.FIXED, 2, F.NO_ZERO | F.PLUS),
        Grid(GridKind.GENERAL, 4, F.EXPONENT3 | F.UPPER),
    )
    for name, unit in (("near", 1.0), ("far", 2.0**100), ("small", 2.0**-100)):
        motion, codec = _of_steps(grids, integers, steps, unit, f"lossy-{name}")
        source = bvh.write(motion)
        data = file_of(motion, codec=codec, grouping="channel")
        purpose = f"A lossy clip, whose values are on no grid: {name}."
        spec = f"{HEADING}; Value to ordinal; The text of AMC and BVH"
        sources = ((f"lossy-{name}.bvh", source),)
        shelf.hold(f"bvh-lossy-{name}", spec, purpose, data, motion, sources=sources, modes=BOTH)


def _of_steps(
    grids: Sequence[Grid], integers: Sequence[int], steps: Sequence[int], unit: float, name: str
) -> tuple[Motion, object]:
    """A clip of codec 2 whose every frame is a segment with a step of its own."""
    n = len(integers)
    plan = Plan(n, HAAR, 0, SCALED, unit, ends=tuple(range(1, n)))
    heads = tuple(Head(step, 0, 63) for step in steps)
    channels = [
        Wave([[*integers[c % n :], *integers[: c % n]]], heads, spoken=(0,))
        for c in range(len(grids))
    ]
    values = waved.values_of(plan, channels)
    rows = [" ".join(["0"] * len(grids))] * n
    head = _skeleton(len(grids) // 6) + f"MOTION\nFrames: {n}\nFrame Time: 0.01\n"
    source = head.encode() + "\n".join([*rows, ""]).encode()
    motion = take(source, name)
    motion = replace(motion, signals=(Signal(values, tuple(grids)),))
    return motion, waved.codec_of(plan, channels)


def _lossy_exceptions(shelf: Whole) -> None:
    """Exceptions of a lossy clip, which are values, and their texts."""
    grids = (Grid(GridKind.FIXED, 2),) * 6
    motion, codec = _of_steps(grids, [100, -250, 3, 7], [136] * 4, 2.0**-8, "noted")
    texts = (b"1e3", b"nan", b"-inf", b"+5.")
    rows, columns = np.array([0, 1, 2, 3]), np.array([1, 0, 5, 2])
    values = motion.signals[0].values.copy()
    values[rows, columns] = [1000.0, np.nan, -np.inf, 5.0]
    noted = replace(motion.signals[0], values=values, exceptions=Exceptions(rows, columns, texts))
    motion = replace(motion, signals=(noted,))

    def with_notes(segments: Made) -> Made:
        """Each frame is a segment, in which one channel has an exception."""
        found = []
        for (header, streams), column, text in zip(segments, columns, texts, strict=True):
            entry = {"row": 0, "channel": 0, "text": text}
            note = build(payloads.GROUP_NOTES, {"grid_changes": [], "exceptions": [entry]}, "")
            notes = [note if c == column else b"" for c in range(6)]
            flagged = replace(header, flags=header.flags | GROUP_NOTES)
            found.append((flagged, [*notes, *streams]))
        return found

    edits = {"segments": with_notes, "CEND": rehash(values)}
    data = file_of(motion, codec=codec, grouping="channel", **edits)
    source = bvh.write(motion)
    assert all(text in source for text in texts)
    shelf.hold(
        "bvh-lossy-exceptions",
        f"{HEADING}; Group notes; The text of AMC and BVH",
        "Exceptions of a lossy clip: their tokens are values and are printed.",
        data,
        motion,
        sources=(("noted.bvh", source),),
        modes=BOTH,
    )


def _lossy_c3d(shelf: Whole) -> None:
    """Words of values that are on no grid, beyond their ends, and beneath a mask."""
    integers = [0, 1, -1, 3, -5, 12345, -99999, 2**40]
    steps = [136, 134, 132, 128, 136, 136, 160, 255]
    cases = (
        ("integers", made(8, size=2, scale=0.5), 1.0),
        ("floats", made(8), 2.0**100),
        ("sgi", made(8, processor=SGI), 2.0**-100),
        ("dec", made(8, processor=DEC), 2.0**100),
        ("dec-small", made(8, processor=DEC), 2.0**-100),
    )
    for name, file, unit in cases:
        whole = take_c3d(file.build(), f"lossy-{name}")
        plan = Plan(8, HAAR, 0, SCALED, unit, ends=tuple(range(1, 8)))
        heads = tuple(Head(step, 0, 63) for step in steps)
        channels = [Wave([[*integers[c:], *integers[:c]]], heads, spoken=(0,)) for c in range(6)]
        mask = np.ones((8, 6), np.bool_)
        mask[2, :3] = mask[5:, 3:] = False
        values = waved.values_of(plan, channels)
        first = replace(whole.signals[0], values=values, mask=mask, ordinals=None)
        motion = replace(whole, signals=(first, *whole.signals[1:]))
        source = c3d.write(motion)
        data = file_of(motion, codec=waved.codec_of(plan, channels), grouping="channel")
        purpose = f"Words nearest to the values of a lossy clip with gaps: {name}."
        sources = ((f"lossy-{name}.c3d", source),)
        spec = f"{C3D_SPEC}; Value to ordinal"
        shelf.hold(f"c3d-lossy-{name}", spec, purpose, data, motion, sources=sources, modes=BOTH)


def _no_residuals(shelf: Whole) -> None:
    """A clip without the signal of residuals, which were 0, and -1 where a point is invalid."""
    for name, size, minus in (("integers", 2, 0xFFFF), ("floats", 4, 0xBF800000)):
        file = made(size=size)
        file.points[:, :, 3] = 0
        file.points[1, 0, 3] = file.points[3, 1, 3] = minus
        source = file.build()
        whole = take_c3d(source, f"bare-{name}")
        kept = tuple(signal for signal in whole.signals if signal.name != "residuals")
        assert len(kept) == len(whole.signals) - 1
        motion = replace(whole, signals=kept)
        assert c3d.write(motion) == source
        purpose = f"No signal of residuals: 0 where a point is valid, -1 elsewhere, {name}."
        sources = ((f"bare-{name}.c3d", source),)
        shelf.hold(
            f"c3d-bare-{name}", C3D_SPEC, purpose, file_of(motion), motion,
            sources=sources, modes=BOTH,
        )  # fmt: skip


# Parts


def _parts(shelf: Whole) -> None:
    skeleton = asf.read(ASF, "mannequin")
    whole = called(amc.read(AMC, "take", skeleton), "take.amc")
    crafter = Crafter()
    _with_asf(crafter, skeleton)
    crafter.clip(whole, segment_frames=1)
    data = cut(finished(crafter), frames=(1, 3))
    numbers = whole.frame_numbers
    assert numbers is not None
    motion = replace(shown(whole, 1, 3), frame_numbers=numbers[1:3])
    assert whole.source is not None and whole.source.notes is not None
    source = amc.write(_noted(motion, whole, 1, 3))
    shelf.hold(
        "amc-range",
        f"{HEADING}; {CUT_HEADING}; Registry",
        "Frames 1 and 2 of an AMC file, with their numbers; a bone is absent from one.",
        data,
        motion,
        sources=(("take.amc", source), ("small.asf", ASF)),
        modes=BOTH,
    )
    whole = take_c3d(_rotations().build(), "turned")
    data = cut(file_of(whole, segment_frames=1), frames=(1, 2))
    assert whole.frame_numbers is None or len(whole.frame_numbers) == 2
    motion = replace(shown(whole, 1, 2), frame_numbers=np.array([2]))
    source = c3d.write(motion)
    assert struct.unpack_from("<HH", source, 6) == (2, 2)
    shelf.hold(
        "c3d-rotations-range",
        f"{C3D_SPEC}; {CUT_HEADING}",
        "The second of two frames of a C3D file with rotations, which begin in another block.",
        data,
        motion,
        sources=(("turned.c3d", source),),
        modes=BOTH,
    )


def _noted(motion: Motion, whole: Motion, start: int, stop: int) -> Motion:
    """``motion`` with the frame notes of a part of ``whole``."""
    from mcz.formats.notes import join_notes

    source = whole.source
    assert source is not None and source.notes is not None
    notes = join_notes([(0, stop - start, source.notes.cut(start, stop))])
    return replace(motion, source=replace(source, notes=notes))
