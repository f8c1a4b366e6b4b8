"""Clips of mrdwt: segments, groups, masks, resolutions, cuts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mcz.codecs.parameters import SCALED
from mcz.codecs.wavelet.streams import CONSTANT
from mcz.container import payloads
from mcz.motion import Channel, Joint, Motion, Signal, Skeleton
from mcz.numbers import Grid, GridKind
from mcz.transforms.wavelets import MAX_LEVELS
from tools.records import built
from tools.vectors.build.cuts import CUT_HEADING, as_shown, cut, shown, window
from tools.vectors.build.edits import Made, put
from tools.vectors.build.files import Crafter, file_of, finished
from tools.vectors.build.lossless_clips import USUAL, build_stream
from tools.vectors.build.motions import HUNDREDTHS, LONG, channels
from tools.vectors.build.wavelet_clips import (
    DB2,
    DB3,
    HAAR,
    HEADING,
    Head,
    Plan,
    Wave,
    Waves,
    codec_of,
    dance_of,
    file_with,
    motion_of,
    request,
    values_of,
    waves,
    zeros,
)

EQUAL = (Head(0, 0, CONSTANT),)


def add(shelf: Waves) -> None:
    _lengths(shelf)
    _segments(shelf)
    _long(shelf)
    _groups(shelf)
    _grids(shelf)
    _masks(shelf)
    _coded_frames(shelf)
    _resolutions(shelf)
    _cuts(shelf)
    _signals(shelf)
    _quality(shelf)


def _lengths(shelf: Waves) -> None:
    for n_frames in (0, 1, 2):
        plan = Plan(n_frames, DB3)
        made, purpose = waves(plan, 6), f"A clip of {n_frames} frames."
        requests = [(0, (0, n_frames), (1,)), (2, (0, n_frames), (1, 0))]
        motion = dance_of(plan, made)
        shelf.wave(f"frames-{n_frames}", purpose, plan, made, motion=motion, requests=requests)
    plan, bones = Plan(40, DB3), Skeleton((Joint("rock"),))
    motion = Motion(bones, (Signal(np.zeros((40, 0))),), name="still")
    data = file_with(plan, (), motion)
    purpose = "A clip of 40 frames without a channel."
    shelf.hold("no-channels", HEADING, purpose, data, motion)


def _segments(shelf: Waves) -> None:
    plan = Plan(70, DB3, 2, ends=(16, 32, 40, 64))
    heads = tuple(Head(0, p, h) for p, h in ((1, 12), (0, 3), (2, 20), (3, 9)))
    made = waves(plan, 6, heads=heads)
    motion = dance_of(plan, made)
    requests = [
        (0, (30, 35), (1,)),
        (0, (39, 40), (0, 1)),
        (1, (0, 64), (1, 0)),
        (2, (66, 70), None),
        (0, (50, 50), (2,)),
        (0, (3, 68), (2, 1)),
    ]
    purpose = "Five segments, each of which bears upon 12 frames before its own."
    spec = f"{HEADING}; DATA"
    shelf.wave("segments", purpose, plan, made, spec=spec, motion=motion, requests=requests)
    steps = tuple(Head(step, 1, 12) for step in (128, 120, 133))
    plan = Plan(45, levels=3, decimals=SCALED, unit=0.125, ends=(8, 16, 24, 40))
    made = waves(plan, 2, heads=steps)
    requests = [(0, (7, 9), None), (1, (20, 45), None)]
    purpose = "Segments of one coefficient and more, whose quantizer steps differ."
    shelf.wave("segments-steps", purpose, plan, made, spec=spec, requests=requests)
    plan = Plan(24, HAAR, ends=(8, 16))
    silent, full = zeros(plan), waves(plan, 2)
    bands = [[*band[: len(band) // 3], *[0] * (len(band) * 2 // 3)] for band in full[0].bands]
    made = (Wave(bands), replace(full[1], heads=(Head(), *EQUAL)), silent)
    made = (made[0], Wave([[5, 1, 7, 7, 2, 2], *full[1].bands[1:]], made[1].heads), silent)
    purpose = "Streams that are empty, or constants, in some segments alone; none bears on others."
    requests = [(0, (7, 17), None)]
    shelf.wave("segments-alone", purpose, plan, made, spec=spec, requests=requests)


def _long(shelf: Waves) -> None:
    plan = Plan(LONG, HAAR, 4)
    n = plan.lengths[-1]
    made = [zeros(plan, a=[-2500] * n, heads=EQUAL)]
    requests = [(0, (65_530, 65_545), None), (3, (69_998, LONG), None)]
    purpose = "More than 65,535 frames in one segment, constant."
    shelf.wave("long-constant", purpose, plan, made, requests=requests)
    plan = Plan(2**16 + 300, DB2, MAX_LEVELS, ends=(2**16,))
    made = [zeros(plan, a=[40, -90, 77, 13], heads=(Head(0, 0, 10),))]
    requests = [(0, (65_530, 65_545), None)]
    purpose = "16 levels: a coefficient spans 65,536 frames, and the second segment all before it."
    shelf.wave("long-levels", purpose, plan, made, spec=f"{HEADING}; DATA", requests=requests)


def _groups(shelf: Waves) -> None:
    plan = Plan(20)
    made = waves(plan, 3)
    joints = tuple(Joint(f"hinge {j}", j - 1, channels=channels("rx")) for j in range(3))
    motion = motion_of(plan, made, skeleton=Skeleton(joints))
    spec, requests = f"{HEADING}; CLIP", [(1, (3, 9), (2, 0))]
    for name, how in (
        ("joint", {"grouping": "joint"}),
        ("listed", {"CLIP": put(payloads.Clip, "signals.0.groups", b"\3\3\1\1\1")}),
    ):
        purpose = f"Groups by another name ({name}), still one a channel."
        about: dict[str, Any] = {"spec": spec, "motion": motion, "requests": requests}
        shelf.wave(f"groups-{name}", purpose, plan, made, **about, **how)


def _grids(shelf: Waves) -> None:
    plan = Plan(18, DB2, decimals=3)
    made = waves(plan, 3)
    grids = (Grid(GridKind.INTEGER), Grid(GridKind.FIXED, 1), Grid(GridKind.GENERAL, 3))
    signal = Signal(values_of(plan, made), grids)
    motion = motion_of(plan, made, signals=(signal,))
    purpose = "Values are not rounded to the grids, one of which is INTEGER."
    shelf.wave("grids", purpose, plan, made, spec=f"{HEADING}; Codecs; CLIP", motion=motion)
    changes = ((8, 1, HUNDREDTHS), (8, 2, Grid(GridKind.TEXT64)))
    plan = replace(plan, ends=(8,))
    changed = motion_of(plan, made, signals=(replace(signal, grid_changes=changes),))
    purpose = "Another grid in a segment changes no value."
    spec = f"{HEADING}; Group notes"
    shelf.wave("grid-changes", purpose, plan, made, spec=spec, motion=changed)


def _masks(shelf: Waves) -> None:
    plan = Plan(50, DB3, ends=(16, 32))
    made = waves(plan, 9)
    names = ("ankle", "knee", "wrist")
    joints = tuple(Joint(name, channels=channels("tx ty tz")) for name in names)
    mask = np.ones((50, 9), np.bool_)
    mask[0:5, 0:3], mask[14:18, 3:6], mask[40:, 3:6], mask[20:31, 7] = (False,) * 4
    motion = motion_of(plan, made, skeleton=Skeleton(joints), mask=mask, name="markers")
    requests = [(0, (12, 20), (1,)), (2, (30, 50), (2, 1)), (1, (5, 14), None)]
    spec = f"{HEADING}; Masks"
    purpose = "Markers with gaps: at the start, across segments, to the end, of one coordinate."
    shelf.wave("masks", purpose, plan, made, spec=spec, motion=motion, requests=requests)


def _coded_frames(shelf: Waves) -> None:
    """More frames were transformed than are stored."""
    plan = Plan(8, HAAR, coded=21)
    made, spec = waves(plan, 2), f"{HEADING}; {CUT_HEADING}"
    purpose = "coded_frames is more than the stored frames, none of which needs what is not there."
    shelf.wave("coded-frames", purpose, plan, made, spec=spec, requests=[(1, (4, 8), None)])
    plan = replace(plan, coded=2**52)
    purpose = "2^52 coded frames, of which 8 are stored."
    part = [Wave([band[:8] for band in one.bands]) for one in made]
    shelf.wave("coded-frames-2-52", purpose, plan, part, spec=spec)
    plan = Plan(40, DB3, ends=(16, 32))
    made = waves(plan, 6)
    motion = shown(dance_of(plan, made), 5, 18)
    edits = window(dance_of(plan, made), 5, 18, spare=14)
    data = file_with(plan, made, dance_of(plan, made), **edits, segments=lambda found: found[:2])
    parts = tuple(
        as_shown(request(plan, made, dance_of(plan, made), k, frames, joints), 5)
        for k, frames, joints in ((0, (5, 18), (1,)), (1, (9, 18), (0, 1)))
    )
    motion = replace(motion, frame_numbers=None)
    purpose = "The last stored frames cannot be decoded, and are not shown."
    shelf.hold("cut-end", f"{spec}; CLIP", purpose, data, motion, parts=parts)


def _resolutions(shelf: Waves) -> None:
    for kept in (1, 2, 4):
        plan = Plan(51, DB3, 4, ends=(32,), n_resolutions=kept)
        made = waves(plan, 2)
        requests = [(k, (20, 40), None) for k in range(kept)]
        purpose = f"{kept} resolutions of 4 levels: the finest details are not stored."
        spec = f"{HEADING}; CLIP"
        shelf.wave(f"resolutions-{kept}", purpose, plan, made, spec=spec, requests=requests)
    plan = replace(plan, n_resolutions=2, decimals=SCALED, ends=())
    made = [Wave([[0] * len(one.bands[0]), *one.bands[1:]], EQUAL) for one in waves(plan, 2)]
    purpose = "Approximations of 0 and the coarsest of 4 details alone."
    shelf.wave("resolutions-scaled", purpose, plan, made, requests=[(1, (0, 51), None)])


def _cuts(shelf: Waves) -> None:
    plan = Plan(70, DB3, 2, ends=(16, 32, 48, 64))
    made = waves(plan, 6)
    whole = dance_of(plan, made)
    crafter = Crafter()
    crafter.clip(whole, grouping="channel", codec=codec_of(plan, made), segment_frames=0)
    record = {"codec": "mrdwt", "param.N": "2", "mse": "0.25", "uncut_frames": "9"}
    crafter.ancillary(b"QUAL", _record(record))
    data = finished(crafter)
    spec = f"{HEADING}; {CUT_HEADING}; QUAL"
    for start, stop in ((21, 30), (0, 33), (66, 70), (16, 16)):
        motion = shown(whole, start, stop)
        found = cut(data, frames=(start, stop))
        size = stop - start
        asked = ((0, (0, size // 2), (1,)), (2, (size // 3, size), (1, 0)))
        parts = tuple(
            as_shown(request(plan, made, whole, k, (a + start, b + start), joints), start)
            for k, (a, b), joints in asked
        )
        purpose = f"Frames {start} to {stop} of 70, cut out with the segments that bear upon them."
        shelf.hold(f"cut-frames-{start}-{stop}", spec, purpose, found, motion, parts=parts)
    motion = _of_spine(whole)
    purpose = "The two channels of one joint, cut out."
    shelf.hold("cut-joints", spec, purpose, cut(data, joints=[1]), motion)
    motion = _coarse(plan, made, whole, 1)
    parts = (request(plan, made, whole, 2, (30, 40), (1,)),)
    parts = tuple(((*a[:-1], "1"), arrays) for a, arrays in parts)
    purpose = "The finest details cut out; the next finer ones may be left out by a reader."
    shelf.hold("cut-resolution", spec, purpose, cut(data, resolution=1), motion, parts=parts)
    motion = shown(_of_spine(motion), 18, 35)
    found = cut(cut(data, joints=[1], frames=(10, 60)), resolution=1, frames=(8, 25))
    purpose = "Joints and frames cut out, then frames and the finest details of what was left."
    shelf.hold("cut-twice", spec, purpose, found, motion)


def _record(entries: dict[str, str], extension: bytes = b"") -> bytes:
    rows = [{"key": key, "value": value} for key, value in entries.items()]
    return built(payloads.Qual, {"entries": rows, "extension": extension}, "QUAL")


def _of_spine(motion: Motion) -> Motion:
    hips, spine, tip = motion.skeleton.joints
    bones = replace(motion.skeleton, joints=(replace(hips, channels=()), spine, tip))
    return replace(motion, skeleton=bones, signals=(Signal(motion.signals[0].values[:, 4:6]),))


def _coarse(plan: Plan, made: Sequence[Wave], motion: Motion, resolution: int) -> Motion:
    return replace(motion, signals=(Signal(values_of(plan, made, resolution)),))


def _signals(shelf: Waves) -> None:
    plan = Plan(20, DB3, ends=(8,))
    made = waves(plan, 6)
    samples = np.array([[k * k % 97 - 40, 5 * k] for k in range(40)], np.int64)
    whole = (Grid(GridKind.INTEGER),) * 2
    own = (Channel("", "emg", "V"), Channel("", "force", "N"))
    analog = Signal(samples, whole, name="analog", role="analog", samples_per_frame=2, channels=own)
    motion = dance_of(plan, made)
    motion = replace(motion, signals=(*motion.signals, analog))
    streams = [build_stream(samples[:, [c]], whole[:1], [USUAL]) for c in range(2)]

    def coded(found: Made) -> Made:
        return [(head, streams if head.signal == 1 else old) for head, old in found]

    requests = [(2, (3, 11), None), (0, (8, 20), (1,))]
    purpose = "A lossless signal beside the motion, of which a coarser motion leaves nothing out."
    about: dict[str, Any] = {"motion": motion, "requests": requests, "segments": coded}
    shelf.wave("signals", purpose, plan, made, spec=f"{HEADING}; CLIP", **about)
    extra = replace(motion.signals[0], name="forces", role="", channels=_newtons(6))
    both_coded = replace(codec_of(plan, made), lossless=True)  # the further signal as well
    motion = replace(motion, signals=(motion.signals[0], extra))
    data = file_of(motion, grouping="channel", codec=both_coded)
    requests = [(1, (3, 11), (1, 0))]
    parts = tuple(request(plan, made, motion, *one) for one in requests)
    purpose = "A further signal with channels of its own is of mrdwt, too."
    shelf.hold("signals-two", f"{HEADING}; CLIP", purpose, data, motion, parts=parts)


def _newtons(n_channels: int) -> tuple[Channel, ...]:
    return tuple(Channel("", f"plate {c}", "N") for c in range(n_channels))


def _quality(shelf: Waves) -> None:
    plan = Plan(12, DB2)
    made = waves(plan, 6)
    motion = dance_of(plan, made)
    cases: dict[str, tuple[str, bytes]] = {
        "measured": (
            "A quality record of settings and metrics",
            _record(
                {
                    "codec": "mrdwt",
                    "param.T_g": "0.2",
                    "frames": "12",
                    "channels": "6",
                    "mse": "0.0017",
                    "point_set": "acclaim",
                    "max_position_error_frame": "7",
                }
            ),
        ),
        "odd": (
            "A quality record that says what cannot be: nobody refuses a file for it",
            _record({"mse": "-nan", "": "", "cut-frames": "9:2", "frames": "1e9"}, b"\xff more"),
        ),
    }
    for name, (purpose, record) in cases.items():
        crafter = Crafter()
        crafter.clip(motion, grouping="channel", codec=codec_of(plan, made), segment_frames=0)
        crafter.ancillary(b"QUAL", record)
        spec = f"QUAL; {HEADING}"
        shelf.hold(f"quality-{name}", spec, f"{purpose}.", finished(crafter), motion)
