"""Text sources of lossy clips, whose values are on no grid."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mcz.codecs.contract import Codec
from mcz.container import note_records, payloads
from mcz.container.segments import GROUP_NOTES
from mcz.formats import amc, asf
from mcz.motion import Motion, Signal
from mcz.numbers import Grid, GridFlag, GridKind
from mcz.schema import varint
from mcz.transforms.wavelets import Wavelet
from tools.records import built
from tools.vectors.build import wavelet_clips
from tools.vectors.build.cuts import CUT_HEADING, cut, shown
from tools.vectors.build.edits import Made, both, put
from tools.vectors.build.files import Crafter, Whole, file_of, finished
from tools.vectors.build.motions import HUNDREDTHS
from tools.vectors.build.source_files import (
    AMC,
    ASF,
    BOTH,
    HEADING,
    TEXT_SPEC,
    Columns,
    blank,
    called,
    lossy,
    path_of,
    restored,
    take,
    with_asf,
)
from tools.vectors.build.wavelet_clips import HAAR, Plan, Wave

TO_ORDINAL = f"Value to ordinal; {TEXT_SPEC}"
F = GridFlag


def add(shelf: Whole) -> None:
    _ties(shelf)
    _products(shelf)
    _printed(shelf)
    _general(shelf)
    _words(shelf)
    _zeros(shelf)
    _ends(shelf)
    _changes(shelf)
    _numbered(shelf)
    _cut(shelf)
    _beside(shelf)


def _hold_lossy(shelf: Whole, name: str, purpose: str, decimals: int, columns: Columns) -> None:
    """A clip of numbers of so many decimals, none of which need be on its grid."""
    n_rows = max(len(own) for _, own in columns)
    plan = Plan(n_rows, HAAR, 0, decimals)
    _hold(shelf, name, purpose, [lossy(plan, columns, name)])


def _hold(
    shelf: Whole, name: str, purpose: str, made: Sequence[tuple[Motion, Codec]], spec: str = ""
) -> None:
    crafter = Crafter()
    for motion, codec in made:
        crafter.clip(motion, codec=codec, grouping="channel")
    motions = [motion for motion, _ in made]
    sources = tuple((path_of(motion), restored(motion)) for motion in motions)
    shelf.hold(
        f"bvh-{name}", spec or TO_ORDINAL, purpose, finished(crafter), *motions,
        sources=sources, modes=BOTH,
    )  # fmt: skip


def _both_signs(found: Iterable[int]) -> list[int]:
    return [sign * n for n in found for sign in (1, -1)]


def _ties(shelf: Whole) -> None:
    """Numbers of three binary digits, halves of a last place on some grid."""
    halves = _both_signs([500, 1500, 2500, 3500, 125, 375, 625, 875, 250, 750])
    grids = (
        Grid(GridKind.FIXED, 0),
        Grid(GridKind.FIXED, 1),
        HUNDREDTHS,
        Grid(GridKind.TRIMMED, 1),
        Grid(GridKind.TRIMMED, 2),
        *(Grid(GridKind.GENERAL, digits) for digits in (1, 2)),
    )
    purpose = "Values halfway between two numbers of their grids, to the even one, in a lossy clip."
    _hold_lossy(shelf, "lossy-ties", purpose, 3, [(grid, halves) for grid in grids])


def _printed(shelf: Whole) -> None:
    """The same numbers on grids whose text is another rule's."""
    halves = _both_signs([500, 1500, 2500, 125, 375, 100, 333, 1])
    grids = (
        Grid(GridKind.PRINTED, 0, style=210),
        Grid(GridKind.PRINTED, 1, style=145),
        Grid(GridKind.PRINTED, 2, style=84),
        Grid(GridKind.PRINTED, 32, style=144),
        Grid(GridKind.PRINTED, 64, style=210),
        Grid(GridKind.PRINTED, 129, style=192),
    )
    purpose = "Values of a lossy clip on PRINTED grids."
    _hold_lossy(shelf, "lossy-printed", purpose, 3, [(grid, halves) for grid in grids])


def _products(shelf: Whole) -> None:
    """Values that are no tie, whose product with a power of ten is rounded to one, or off one."""
    found: dict[int, list[int]] = {}
    for digits in (1, 2):
        unit = 10 ** (3 - digits)
        odd = (k for k in range(unit // 2, 10_000, unit) if _is_rounded(k, digits))
        found[digits] = _both_signs(list(odd)[::3][:14])
    great = [k for k in range(1005, 10_000, 10) if _is_rounded(k, 2)][:14]
    columns = [
        (HUNDREDTHS, found[2]),
        (Grid(GridKind.TRIMMED, 2), found[2]),
        (Grid(GridKind.FIXED, 1), found[1]),
        (Grid(GridKind.GENERAL, 3), _both_signs(great)),
        (Grid(GridKind.GENERAL, 2), _both_signs([k for k in found[1] if k >= 1000])),
    ]
    purpose = "Values of a lossy clip of which the rounded product with a power of ten is a tie."
    _hold_lossy(shelf, "lossy-products", purpose, 3, columns)


def _is_rounded(thousandths: int, digits: int) -> bool:
    """Whether the place of a number differs from that of the exact value of its binary64."""
    value = thousandths / 1000
    return round(value * 10.0**digits) != int(f"{value:.{digits}f}".replace(".", ""))


def _general(shelf: Whole) -> None:
    """Where the first digit moves, and what is too small for an exact power."""
    nines = [999, 9995, 9994, 99949, 99951, 999_500, 1, 10, 100, 1000, 123_456_789, 10**12]
    columns = [(Grid(GridKind.GENERAL, digits), nines) for digits in (1, 2, 3, 6, 14, 15)]
    _hold_lossy(
        shelf,
        "lossy-general",
        "Values of a lossy clip around powers of ten, by digits.",
        5,
        columns,
    )
    tiny = _both_signs([1, 10, 100, 10**7, 10**8, 999_999_999_999, 123_456_789, 995, 9_950_000])
    _hold_lossy(
        shelf,
        "lossy-general-small",
        "Small values of a lossy clip, beyond the exact powers of ten.",
        15,
        [(Grid(GridKind.GENERAL, digits), tiny) for digits in (1, 3, 8, 9, 14, 15)],
    )  # fmt: skip
    _below_tens(shelf)
    taps = (1e-307, 1e-308)
    plan = Plan(24, Wavelet(taps, (0.0, 0.0)), 1, 3)
    least = [10_000, 1000, 999, 995, 994, 500, 9999, 9994, 9950, 9940, -999, -500]
    made = lossy(plan, [(Grid(GridKind.GENERAL, d), least) for d in (1, 2, 3, 15)], "least")
    purpose = "Values of a lossy clip at the lower end of GENERAL, at 1e-307, and below it."
    _hold(shelf, "lossy-general-least", purpose, [made])


def _below_tens(shelf: Whole) -> None:
    """Numbers a few last places below 10^5, whose rounded logarithm is 5."""
    plan = Plan(8, Wavelet((1.0, 1.0), (1e-10, 1e-11)), 1, 0)
    tens, places = [100_000] * 2 + [-100_000] * 2, [0, -1, 2, 5]
    grids = [Grid(GridKind.GENERAL, digits) for digits in (13, 14, 15)]
    made = lossy(plan, [(grid, tens) for grid in grids], "lossy-general-below", places)
    purpose = "Values of a lossy clip less than a last place below a power of ten, or a few."
    _hold(shelf, "lossy-general-below", purpose, [made])


def _words(shelf: Whole) -> None:
    """Values between two binary32, nearer to the one whose text is farther."""
    between = [16_777_217_000, 16_777_219_000, 16_777_218_999, 33_554_434_001, 33_554_433_999]
    found = [k for k in range(16_777_217, 16_900_000) if _is_nearer_by_text(k / 1000)]
    found = found[:14]
    integers = _both_signs([*between, *found, 100, 123_456_789_012])
    assert len(found) > 4
    columns = [(Grid(GridKind.TEXT32), integers), (Grid(GridKind.TEXT64, 0), integers)]
    purpose = "Values of a lossy clip on TEXT32: the nearest binary32 counts, not the nearest text."
    _hold_lossy(shelf, "lossy-text32", purpose, 3, columns)


def _is_nearer_by_text(value: float) -> bool:
    """Whether a neighbor of the nearest binary32 has a text that is nearer."""
    bits = int(np.float32(value).view(np.int32))
    own, *beside = (float(str(np.int32(b).view(np.float32))) for b in (bits, bits - 1, bits + 1))
    return min(abs(x - value) for x in beside) < abs(own - value)


def _zeros(shelf: Whole) -> None:
    grids = (
        *(Grid(GridKind.FIXED, digits) for digits in (0, 4, 14, 15)),
        Grid(GridKind.FIXED, 4, F.NO_ZERO | F.PLUS),
        Grid(GridKind.FIXED, 0, F.POINT),
        Grid(GridKind.TRIMMED, 4, F.POINT_ZERO | F.NO_ZERO),
        Grid(GridKind.TRIMMED, 4, F.PLUS),
        Grid(GridKind.TEXT64, 74),
    )
    tiny = _both_signs([1, 5 * 10**10, 5 * 10**10 + 1, 5, 4, 0])
    purpose = "Values of a lossy clip nearest to 0, which keep their sign."
    _hold_lossy(shelf, "lossy-zeros", purpose, 15, [(grid, tiny) for grid in grids])


def _ends(shelf: Whole) -> None:
    """The last number of a grid, the binary64 beside it, and ten times these."""
    last = (2.0**51 - 1) / 10.0**4
    cases = {
        "last": last,
        "above": float(np.nextafter(last, np.inf)),
        "below": float(np.nextafter(last, 0)),
    }
    grids = (
        Grid(GridKind.FIXED, 4),
        Grid(GridKind.FIXED, 4, F.PLUS | F.NO_ZERO),
        Grid(GridKind.TRIMMED, 4, F.POINT),
        Grid(GridKind.FIXED, 5),
        Grid(GridKind.TEXT64, 74),
    )
    made = []
    for name, value in cases.items():
        plan = Plan(4, HAAR, 0, 255, value / 4)
        heads = (wavelet_clips.Head(136, 0, 12),)
        motion = blank(4, grids, name)
        channels = [Wave([[1, -1, 0, 10]], heads)] * motion.signals[0].n_channels
        values = wavelet_clips.values_of(plan, channels)
        assert values[0, 0] == value
        motion = replace(motion, signals=(replace(motion.signals[0], values=values),))
        made.append((motion, wavelet_clips.codec_of(plan, channels)))
    purpose = "Values of lossy clips at the last number of a grid and beside it."
    _hold(shelf, "lossy-ends", purpose, made)


def _changes(shelf: Whole) -> None:
    """A lossy clip in two segments, the second of which has other grids."""
    plan = Plan(6, HAAR, 0, 3, ends=(3,))
    integers = [1234, -5678, 125, 1234, -5678, 125]
    motion, codec = lossy(plan, [(HUNDREDTHS, integers)], "changes")
    later = ((3, 1, Grid(GridKind.FIXED, 1, F.PLUS)), (3, 4, Grid(GridKind.GENERAL, 1)))
    signal = replace(motion.signals[0], grid_changes=later)

    def noted(made: Made) -> Made:
        changes = {c: {"grid_changes": [{"channel": 0, "grid": g}]} for _, c, g in later}
        (first, (header, streams)) = made
        none: dict[str, Any] = {"exceptions": []}
        notes = [
            built(note_records.GroupNotes, none | changes[c], "notes") if c in changes else b""
            for c in range(signal.n_channels)
        ]
        return [first, (replace(header, flags=header.flags | GROUP_NOTES), [*notes, *streams])]

    data = file_of(motion, codec=codec, grouping="channel", segments=noted)
    shown_ = replace(motion, signals=(signal,))
    shelf.hold(
        "bvh-lossy-grid-changes", f"Group notes; {TO_ORDINAL}",
        "Channels of a lossy clip that are printed on another grid in its second segment.",
        data, shown_, sources=((path_of(motion), restored(shown_)),), modes=BOTH,
    )  # fmt: skip


def _numbered(shelf: Whole) -> None:
    """An AMC file, with the numbers and bones of its frames."""
    skeleton = asf.read(ASF, "mannequin")
    motion = called(amc.read(AMC, "take", skeleton), "take.amc")
    whole = motion.signals[0]
    plan = Plan(whole.n_rows, HAAR, 0, 4)
    channels = [
        Wave([[(c * 7919 + row * 104_729) % 400_001 - 200_000 for row in range(whole.n_rows)]])
        for c in range(whole.n_channels)
    ]
    signal = replace(whole, values=wavelet_clips.values_of(plan, channels), ordinals=None)
    motion = replace(motion, signals=(signal,))
    crafter = Crafter()
    with_asf(crafter, skeleton)
    crafter.clip(motion, codec=wavelet_clips.codec_of(plan, channels), grouping="channel")
    shelf.hold(
        "amc-lossy", f"Frame notes of AMC and BVH; {TO_ORDINAL}",
        "A lossy AMC file: frame numbers with a gap, a frame without a bone, as in the source.",
        finished(crafter), motion,
        sources=(("take.amc", restored(motion)), ("small.asf", ASF)), modes=BOTH,
    )  # fmt: skip


def _cut(shelf: Whole) -> None:
    """Frames 3 to 6 of a lossy clip: its source is that of what is left."""
    plan = Plan(10, HAAR, 1, 3, ends=(4, 8))
    columns = [(HUNDREDTHS, [c * 1111 + k * k * 137 for k in range(5)]) for c in range(6)]
    motion, codec = lossy(plan, columns, "cut")
    data = cut(file_of(motion, codec=codec, grouping="channel"), frames=(3, 7))
    left = shown(motion, 3, 7)
    shelf.hold(
        "bvh-lossy-cut", f"{CUT_HEADING}; {TEXT_SPEC}",
        "Frames 3 to 6 of a lossy BVH file of 10, in two of its three segments.",
        data, left, sources=((path_of(motion), restored(left)),), modes=BOTH,
    )  # fmt: skip


def _beside(shelf: Whole) -> None:
    """A lossless motion whose stated hash is not compared, since another signal is lossy."""
    motion = take(restored(blank(3, [HUNDREDTHS], "beside")), "beside")
    plan = Plan(3, HAAR, 0, 2)
    channels = [Wave([[-10, 25, 7]])]
    joint = motion.skeleton.joints[0]
    values = wavelet_clips.values_of(plan, channels)
    other = Signal(values, (Grid(GridKind.BINARY64),), "gauge", channels=joint.channels[:1])
    whole = replace(motion, signals=(*motion.signals, other))
    assert whole.source is not None
    stated = replace(whole, source=replace(whole.source, size=1, sha256=b"s" * 32))
    header = wavelet_clips.header(plan)
    edits: dict[str, Callable[..., Any]] = {
        "CLIP": both(
            put(payloads.Clip, "signals.1.codec", b"\x10"),
            put(payloads.Clip, "signals.1.header", varint(len(header)) + header),
        ),
        "segments": lambda made: [
            (head, wavelet_clips._segments(plan, channels)[0].streams if head.signal else streams)
            for head, streams in made
        ],
        "row": _second_codec,
    }
    data = file_of(stated, grouping="all", **edits)
    shelf.hold(
        "bvh-beside-lossy", f"{HEADING}; CLIP; CEND",
        "A lossless motion beside a lossy signal: size and hash of the source are not compared.",
        data, whole, sources=((path_of(motion), restored(motion)),), modes=BOTH,
    )  # fmt: skip


def _second_codec(row: Any) -> Any:
    first, second = row.signals
    return replace(row, signals=(first, replace(second, codec=16)))
