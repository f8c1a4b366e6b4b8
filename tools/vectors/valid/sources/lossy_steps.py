"""Sources of lossy clips with a step a frame: halves, and values beyond the ends of grids."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mcz.codecs.parameters import SCALED
from mcz.container import note_records
from mcz.container.segments import GROUP_NOTES
from mcz.formats import bvh, c3d
from mcz.motion import Exceptions, Motion, Signal
from mcz.numbers import Grid, GridKind
from mcz.numbers import GridFlag as F
from tests.formats.c3d_files import DEC, SGI
from tools.records import built
from tools.vectors.build import wavelet_clips
from tools.vectors.build.c3d_files import C3D_SPEC, c3d_file, take_c3d
from tools.vectors.build.edits import Made
from tools.vectors.build.files import Whole, file_of, rehash
from tools.vectors.build.source_files import BOTH, HEADING, hierarchy, take
from tools.vectors.build.wavelet_clips import HAAR, Head, Plan, Wave


def add(shelf: Whole) -> None:
    _lossy(shelf)
    _lossy_exceptions(shelf)
    _lossy_c3d(shelf)


def _lossy(shelf: Whole) -> None:
    """Values that are on no grid, by mrdwt: halves, and numbers beyond the ends of grids."""
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
    """A clip of mrdwt whose every frame is a segment with a step of its own."""
    n = len(integers)
    plan = Plan(n, HAAR, 0, SCALED, unit, ends=tuple(range(1, n)))
    heads = tuple(Head(step, 0, 63) for step in steps)
    channels = [
        Wave([[*integers[c % n :], *integers[: c % n]]], heads, spoken=(0,))
        for c in range(len(grids))
    ]
    values = wavelet_clips.values_of(plan, channels)
    rows = [" ".join(["0"] * len(grids))] * n
    head = hierarchy(len(grids) // 6) + f"MOTION\nFrames: {n}\nFrame Time: 0.01\n"
    source = head.encode() + "\n".join([*rows, ""]).encode()
    motion = take(source, name)
    motion = replace(motion, signals=(Signal(values, tuple(grids)),))
    return motion, wavelet_clips.codec_of(plan, channels)


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
            note = built(note_records.GroupNotes, {"grid_changes": [], "exceptions": [entry]}, "")
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
        ("integers", c3d_file(8, size=2, scale=0.5), 1.0),
        ("floats", c3d_file(8), 2.0**100),
        ("sgi", c3d_file(8, processor=SGI), 2.0**-100),
        ("dec", c3d_file(8, processor=DEC), 2.0**100),
        ("dec-small", c3d_file(8, processor=DEC), 2.0**-100),
    )
    for name, file, unit in cases:
        whole = take_c3d(file.build(), f"lossy-{name}")
        plan = Plan(8, HAAR, 0, SCALED, unit, ends=tuple(range(1, 8)))
        heads = tuple(Head(step, 0, 63) for step in steps)
        channels = [Wave([[*integers[c:], *integers[:c]]], heads, spoken=(0,)) for c in range(6)]
        mask = np.ones((8, 6), np.bool_)
        mask[2, :3] = mask[5:, 3:] = False
        values = wavelet_clips.values_of(plan, channels)
        first = replace(whole.signals[0], values=values, mask=mask, ordinals=None)
        motion = replace(whole, signals=(first, *whole.signals[1:]))
        source = c3d.write(motion)
        data = file_of(motion, codec=wavelet_clips.codec_of(plan, channels), grouping="channel")
        purpose = f"Words nearest to the values of a lossy clip with gaps: {name}."
        sources = ((f"lossy-{name}.c3d", source),)
        spec = f"{C3D_SPEC}; Value to ordinal"
        shelf.hold(f"c3d-lossy-{name}", spec, purpose, data, motion, sources=sources, modes=BOTH)
