"""Valid: ``qbc``: marks, curves, segments, groups, cuts."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mcz.codecs.curves.choices import MAX_INDEX
from mcz.codecs.curves.qbc import MAX_DELTA
from mcz.codecs.curves.streams import MAX_SCALE
from mcz.codecs.parameters import SCALED
from mcz.container import payloads
from mcz.motion import Joint, Motion, Signal, Skeleton
from mcz.numbers import Grid, GridKind
from tools.vectors.build.curve_clips import (
    HEADING,
    PUPPET,
    Curves,
    Path,
    Piece,
    Plan,
    codec_of,
    dance_of,
    file_with,
    motion_of,
    paths,
    request,
    still,
    values_of,
)
from tools.vectors.build.cuts import CUT_HEADING, as_shown, cut, shown, window
from tools.vectors.build.edits import put
from tools.vectors.build.files import Crafter, Vector, finished
from tools.vectors.build.motions import HUNDREDTHS, LONG, channels
from tools.vectors.valid.common import every_codec

SPEC = f"{HEADING}; Residuals"


def vectors() -> Iterable[Vector]:
    shelf = Curves("valid/qbc")
    _deltas(shelf)
    _lengths(shelf)
    _grids_of_points(shelf)
    _empty(shelf)
    _scales(shelf)
    _pieces(shelf)
    _sizes(shelf)
    _segments(shelf)
    _long(shelf)
    _groups(shelf)
    _grids(shelf)
    _masks(shelf)
    _coded_frames(shelf)
    _cuts(shelf)
    every_codec.add(shelf, "qbc")
    return shelf.vectors


def _deltas(shelf: Curves) -> None:
    for delta in (1, 2, 3, 7, 16):
        plan = Plan(29, delta)
        requests = [(0, (delta, delta + 1), None), (1, (0, 29), None), (0, (11, 29), None)]
        shelf.curve(f"delta-{delta}", f"Marks every {delta} frames.", plan, requests=requests)
    plan = Plan(29, MAX_DELTA)
    purpose = "Marks 2^20 frames apart, so only at the first frame and the last."
    shelf.curve("delta-2-20", purpose, plan, requests=[(1, (3, 29), None)])


def _lengths(shelf: Curves) -> None:
    for n_frames in (0, 1, 2, 3, 8, 9, 10, 17):
        plan = Plan(n_frames, 8)
        made = paths(plan, PUPPET)
        motion = dance_of(plan, made)
        requests = [(0, (0, n_frames), (1,)), (1, (n_frames // 2, n_frames), (1, 0))]
        purpose = f"A clip of {n_frames} frames, marks every 8."
        shelf.curve(f"frames-{n_frames}", purpose, plan, made, motion=motion, requests=requests)
    plan = Plan(40)
    motion = Motion(Skeleton((Joint("rock"),)), (Signal(np.zeros((40, 0))),), name="still")
    purpose = "A clip of 40 frames without a channel."
    shelf.hold("no-channels", HEADING, purpose, file_with(plan, (), motion), motion)


def _grids_of_points(shelf: Curves) -> None:
    for decimals in (0, 1, 2, 15):
        plan = Plan(20, decimals=decimals)
        shelf.curve(f"decimals-{decimals}", f"Control points of {decimals} decimals.", plan)
    plan = Plan(24, 1, decimals=15)
    marks = [((2**40 - 7 * k * k) * (-1) ** k,) for k in range(24)]
    purpose = "Long control points with 15 decimals, divided once and not multiplied by 10^-15."
    shelf.curve("decimals-15-long", purpose, plan, [Path(marks)])
    for name, step in (("third", 1 / 3), ("least", 2.0**-100), ("greatest", 2.0**100)):
        plan = Plan(20, decimals=SCALED, step=step)
        purpose = f"Control points are multiples of {step!r}."
        shelf.curve(f"step-{name}", purpose, plan, requests=[(1, (2, 9), None)])
    plan = Plan(40, decimals=SCALED, step=0.25, position_step=1 / 3)
    made = paths(plan, (4, 2))
    purpose = "Positions and rotations have steps of their own."
    shelf.curve("step-positions", purpose, plan, made, motion=dance_of(plan, made))
    plan = Plan(200, 100, decimals=SCALED, step=0.1)
    purpose = "Frames that another order, or a fused product, would round to another number."
    shelf.curve("rounding", purpose, plan, paths(plan, (5, 4)))


def _empty(shelf: Curves) -> None:
    plan = Plan(30, ends=(16,))
    full = paths(plan)[0]
    made = [still(plan, 3), still(plan)]
    shelf.curve("empty", "Nothing but empty streams: all values are 0.", plan, made)
    bent = still(plan, 3, pieces={k: p for k, p in full.pieces.items() if k != 1})
    made = [bent, Path(full.marks), full, Path([*full.marks[:2], *[(0, 0, 0)] * 3])]
    purpose = "No marks but curves; marks without curves; marks of the first segment alone."
    requests = [(0, (9, 20), (3, 0)), (1, (3, 30), (2,))]
    shelf.curve("empty-beside", purpose, plan, made, requests=requests)
    made = [still(plan, 2, spoken=(0, 1)), Path(full.marks, spoken=(1,))]
    purpose = "Zeros and straight curves that are written with bits."
    shelf.curve("zeros-written", purpose, plan, made)
    plan = Plan(9, 1, ends=(5,))
    made = [Path([(k * k - 5,) for k in range(9)], spoken=(1,))]
    purpose = "Curves over one frame each: the head of their stream, and no bits."
    shelf.curve("curves-of-nothing", purpose, plan, made)
    plan = Plan(17, 8, ends=(8, 16))
    made = [replace(path, spoken=(1,)) for path in paths(plan)]
    purpose = "A last segment of one frame, which is the last mark: no curve begins there."
    shelf.curve("segment-of-one", purpose, plan, made, requests=[(0, (15, 17), None)])


def _scales(shelf: Curves) -> None:
    for halves in (0, 1, 30, MAX_SCALE):
        plan = Plan(60, 10)
        made = paths(plan, (3, 1), scales=(halves,) * 3)
        purpose = f"First scales of {halves} half octaves."
        shelf.curve(f"scale-{halves}", purpose, plan, made, spec=SPEC)
    plan = Plan(60, 10)
    made = paths(plan, scales=(0, MAX_SCALE, 20))
    purpose = "Three unlike first scales."
    shelf.curve("scales", purpose, plan, made, spec=SPEC)


def _pieces(shelf: Curves) -> None:
    plan = Plan(41, 20)
    marks = [(0, 500), (-7, -500), (40, 9)]
    ones = [Piece(1, (k, -3 * k), (0, 0)) for k in range(20)]
    made = [Path(marks, {0: ones}), Path(marks, {1: ones}), Path(marks, {0: ones, 1: ones})]
    purpose = "Curves of one frame each, beside none or as many before."
    shelf.curve("pieces-of-one", purpose, plan, made, requests=[(0, (17, 24), None)])
    cases: dict[str, tuple[str, list[int]]] = {
        "first-short": ("The first curve has one frame, the second all others", [1, 19]),
        "last-short": ("The last curve has one frame", [19, 1]),
        "halves": ("Each curve has half of what is left", [10, 5, 2, 1, 1, 1]),
        "twos": ("Curves of two frames", [2] * 10),
    }
    for name, (purpose, lengths) in cases.items():
        own = [Piece(n, (9 * n, -n), (n, 77)) for n in lengths]
        predicted = [Piece(n) for n in lengths]
        made = [Path(marks, {0: own, 1: own[::-1]}), Path(marks, {0: predicted})]
        shelf.curve(f"pieces-{name}", f"{purpose}.", plan, made, spec=SPEC)
    plan = Plan(64, 21)
    marks = [(-5, 7, 0), (-8, 8, -1), (3, -3, 1), (0, -1, -1)]
    sliced = [Piece(k) for k in (4, 3, 2, 5, 7)]
    made = [Path(marks, dict.fromkeys(range(3), sliced), spoken=(1,))]
    purpose = "All breaks and middle points as predicted: halves up, negative numbers, too."
    shelf.curve("predicted", purpose, plan, made, spec=SPEC)
    far = [Piece(1, (2**40, -(2**40)), None), *[Piece(k, (-(2**40), 2**40)) for k in (3, 16)]]
    marks = [(2**40, -(2**40)), (-(2**40), 2**40), (2**40 - 1, 1 - 2**40)]
    purpose = "Breaks are predicted between points 2^41 apart."
    shelf.curve("predicted-far", purpose, Plan(41, 20), [Path(marks, {0: far, 1: far})], spec=SPEC)


def _sizes(shelf: Curves) -> None:
    lengths = [*range(41), *range(39, -1, -1), *[40, 0, 39, 1, 30, 2, 20, 10, 0, 0, 0, 40] * 2]
    sized = [(2**n * 2 // 3 + n % 3) * (-1) ** (n // 2) if n else 0 for n in lengths]
    most = [-MAX_INDEX, MAX_INDEX, MAX_INDEX, -MAX_INDEX, 0, -MAX_INDEX, MAX_INDEX]
    marks = [(a, b, c) for a, b, c in zip(sized, sized[7:] + sized[:7], sized[::-1], strict=True)]
    marks += [(value, -value, value) for value in most]
    plan = Plan(len(marks), 1)
    purpose = "Marks of all sizes to 2^40, and leaps from end to end: 42 bits and more."
    shelf.curve("sizes-marks", purpose, plan, [Path(marks)], spec=SPEC)
    plan = Plan(4 * len(marks) - 3, 4)
    pieces = {k: [Piece(2, marks[k], marks[-k]), Piece(2, None, marks[k - 9])] for k in range(100)}
    purpose = "Breaks and middle points of all sizes to 2^40."
    shelf.curve("sizes-curves", purpose, plan, [Path([(1, -1, 0)] * len(marks), pieces)], spec=SPEC)
    plan = Plan(1, 1, decimals=0)
    single = [(2**n, 1 - 2**n, 0, -1, 1) for n in range(41)]
    purpose = "First marks, and only ones, of all lengths to 41 bits."
    shelf.curve("firsts", purpose, plan, [Path([point]) for point in single])
    noise = [
        tuple((k * k * 7919 + 31 * k + 5 * c) % 997 - 498 for c in range(7)) for k in range(60)
    ]
    plan = Plan(473, 8)
    pieces = {k: [Piece(3, noise[k], noise[-k]), Piece(5, None, noise[k])] for k in range(0, 59, 2)}
    purpose = "Noise of seven channels: probabilities and weights reach far."
    shelf.curve("noise", purpose, plan, [Path(noise, pieces, (16, 16, 16))], spec=SPEC)


def _segments(shelf: Curves) -> None:
    plan = Plan(70, 8, ends=(16, 32, 40, 64))
    made = paths(plan, PUPPET)
    motion = dance_of(plan, made)
    requests = [
        (0, (30, 35), (1,)),
        (0, (39, 40), (0, 1)),
        (0, (24, 25), (0,)),
        (1, (0, 64), (1, 0)),
        (1, (66, 70), None),
        (0, (50, 50), (1,)),
        (0, (3, 68), (1, 0)),
    ]
    purpose = "Five segments: the last curve of each ends at the first mark of the next."
    spec = f"{HEADING}; DATA"
    shelf.curve("segments", purpose, plan, made, spec=spec, motion=motion, requests=requests)
    plan = Plan(25, 4, ends=(4, 8, 12, 16, 20, 24))
    purpose = "Segments of one mark each."
    requests = [(0, (7, 9), None), (1, (20, 25), None)]
    shelf.curve("segments-of-a-mark", purpose, plan, spec=spec, requests=requests)
    plan = Plan(9, 1, ends=(1, 2, 5))
    purpose = "Marks at every frame: segments end anywhere, and lead is 0."
    requests = [(0, (0, 1), None), (1, (4, 9), None)]
    shelf.curve("segments-delta-1", purpose, plan, spec=spec, requests=requests)


def _long(shelf: Curves) -> None:
    plan = Plan(LONG, 2**16)
    marks = [(-2500,), (12,), (4000,)]
    pieces = [
        Piece(9, (-2400,), (1,)),
        Piece(55_527, (9,), (-70,)),
        Piece(9_000, (-5,)),
        Piece(1_000),
    ]
    requests = [(0, (65_530, 65_545), None), (1, (69_998, LONG), None)]
    purpose = "More than 65,535 frames from mark to mark."
    shelf.curve("long", purpose, plan, [Path(marks, {0: pieces})], requests=requests)


def _groups(shelf: Curves) -> None:
    plan = Plan(20, 6)
    about: dict[str, Any] = {"spec": f"{HEADING}; CLIP", "requests": [(1, (3, 9), (1, 0))]}
    listed = {"CLIP": put(payloads.Clip, "signals.0.groups", b"\3\2\4\2")}
    cases: dict[str, tuple[str, Sequence[int], dict[str, Any]]] = {
        "all": ("One group of all channels", (6,), {"grouping": "all"}),
        "channel": ("Groups of a channel each", (1,) * 6, {"grouping": "channel"}),
        "listed": ("The groups of the joints by another name", PUPPET, listed),
    }
    for name, (purpose, sizes, how) in cases.items():
        made = paths(plan, sizes)
        motion = dance_of(plan, made)
        shelf.curve(f"groups-{name}", f"{purpose}.", plan, made, motion=motion, **about, **how)


def _grids(shelf: Curves) -> None:
    plan = Plan(18, decimals=3)
    made = paths(plan)
    grids = (Grid(GridKind.INTEGER), Grid(GridKind.FIXED, 1), Grid(GridKind.GENERAL, 3))
    signal = Signal(values_of(plan, made), grids)
    motion = motion_of(plan, made, signals=(signal,))
    purpose = "Values are not rounded to the grids, one of which is INTEGER."
    shelf.curve("grids", purpose, plan, made, spec=f"{HEADING}; Codecs; CLIP", motion=motion)
    changes = ((8, 1, HUNDREDTHS), (8, 2, Grid(GridKind.TEXT64)))
    plan = replace(plan, ends=(8,))
    changed = motion_of(plan, made, signals=(replace(signal, grid_changes=changes),))
    purpose = "Another grid in a segment changes no value."
    spec = f"{HEADING}; Group notes"
    shelf.curve("grid-changes", purpose, plan, made, spec=spec, motion=changed)


def _masks(shelf: Curves) -> None:
    plan = Plan(50, ends=(16, 32))
    made = paths(plan, (3, 3, 3))
    names = ("ankle", "knee", "wrist")
    joints = tuple(Joint(name, channels=channels("tx ty tz")) for name in names)
    mask = np.ones((50, 9), np.bool_)
    mask[0:5, 0:3], mask[14:18, 3:6], mask[40:, 3:6], mask[20:31, 7] = (False,) * 4
    motion = motion_of(plan, made, skeleton=Skeleton(joints), mask=mask, name="markers")
    requests = [(0, (12, 20), (1,)), (1, (30, 50), (2, 1)), (1, (5, 14), None)]
    purpose = "Markers with gaps: at the start, across segments, to the end, of one coordinate."
    about: dict[str, Any] = {"spec": f"{HEADING}; Masks", "motion": motion}
    shelf.curve("masks", purpose, plan, made, requests=requests, **about)


def _coded_frames(shelf: Curves) -> None:
    """More frames were coded than are stored."""
    spec = f"{HEADING}; {CUT_HEADING}"
    plan = Plan(40, 8, ends=(16, 32))
    made = paths(plan, PUPPET)
    whole = dance_of(plan, made)
    for start, stop, name in ((5, 18, "cut-end"), (20, 25, "cut-end-at-mark")):
        edits = window(whole, start, stop, spare=32 - stop)
        data = file_with(plan, made, whole, **edits, segments=lambda found: found[:2])
        parts = tuple(
            as_shown(request(plan, made, whole, k, frames, joints), start)
            for k, frames, joints in ((0, (start, stop), (1,)), (1, (stop - 3, stop), (0, 1)))
        )
        motion = replace(shown(whole, start, stop), frame_numbers=None)
        purpose = f"The segment behind is gone; frames {start} to {stop} of 32 need none of it."
        shelf.hold(name, f"{spec}; CLIP", purpose, data, motion, parts=parts)
    plan = Plan(6, 1, coded=2**52)
    whole = motion_of(Plan(7, 1), [Path([(k * k,) for k in range(7)])])
    motion = replace(whole, signals=(whole.signals[0].cut(0, 6),))
    purpose = "2^52 coded frames, a mark each, of which 6 are stored."
    data = file_with(plan, [Path([(k * k,) for k in range(7)])], motion)
    shelf.hold("coded-frames-2-52", spec, purpose, data, motion)
    plan = Plan(51, ends=(32,), n_resolutions=1)
    made = paths(plan, (2, 1))
    purpose = "One resolution: the curves are not stored."
    spec = f"{HEADING}; CLIP"
    shelf.curve("resolutions-1", purpose, plan, made, spec=spec, requests=[(0, (20, 40), None)])


def _cuts(shelf: Curves) -> None:
    plan = Plan(70, ends=(16, 32, 48, 64))
    made = paths(plan, PUPPET)
    whole = dance_of(plan, made)
    crafter = Crafter()
    crafter.clip(whole, codec=codec_of(plan, made), segment_frames=0)
    data = finished(crafter)
    spec = f"{HEADING}; {CUT_HEADING}"
    for start, stop in ((21, 30), (0, 33), (66, 70), (40, 41), (16, 16)):
        motion = shown(whole, start, stop)
        found = cut(data, frames=(start, stop))
        size = stop - start
        parts = tuple(
            as_shown(request(plan, made, whole, k, (a + start, b + start), joints), start)
            for k, (a, b), joints in ((0, (0, size // 2), (1,)), (1, (size // 3, size), (1, 0)))
        )
        purpose = f"Frames {start} to {stop} of 70, cut out with the segments that bear upon them."
        shelf.hold(f"cut-frames-{start}-{stop}", spec, purpose, found, motion, parts=parts)
    hips, spine, tip = whole.skeleton.joints
    bones = replace(whole.skeleton, joints=(replace(hips, channels=()), spine, tip))
    spine_alone = Signal(whole.signals[0].values[:, 4:])
    motion = replace(whole, skeleton=bones, signals=(spine_alone,))
    purpose = "The two channels of one joint, cut out."
    shelf.hold("cut-joints", spec, purpose, cut(data, joints=[1]), motion)
    motion = replace(whole, signals=(Signal(values_of(plan, made, 1)),))
    purpose = "The curves cut out: the marks are left."
    shelf.hold("cut-resolution", spec, purpose, cut(data, resolution=1), motion)
    straight = Signal(values_of(plan, made, 1)[:, 4:])
    motion = shown(replace(whole, skeleton=bones, signals=(straight,)), 18, 35)
    found = cut(cut(data, joints=[1], frames=(10, 60)), resolution=1, frames=(8, 25))
    purpose = "Joints and frames cut out, then frames and the curves of what was left."
    shelf.hold("cut-twice", spec, purpose, found, motion)
