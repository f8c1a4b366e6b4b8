"""Clips of online: units in segments, positions, cuts, packets."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from mcz.container import payloads
from mcz.kinematics.marker_motion import marker_skeleton
from mcz.motion import Signal
from mcz.numbers import Grid, GridKind
from mcz.writing.clip_writer import write_skeleton
from tools.vectors.build import edits
from tools.vectors.build.cuts import CUT_HEADING, cut, shown
from tools.vectors.build.edits import put, swap
from tools.vectors.build.files import Crafter, finished
from tools.vectors.build.motions import HUNDREDTHS, puppet
from tools.vectors.build.online_clips import Groups, both, codec_of, file_with, motion_of, values_of
from tools.vectors.build.online_units import GOLOMB, HEADING, MIXED, REORDERED, Plan
from tools.vectors.build.spatial_clips import basis_of, markers

BEHIND = ("I5 L2 S3 S1", "S2 L4", "L3", "S2", "I2 L2 I3 S1", "S4")  # segments of units
LIVE = tuple("I1 S1 S1 L1 S1 S1 I1 S1 S1 L1 S1 I1 I1".split())


def add(shelf: Groups) -> None:
    _units(shelf)
    _segments(shelf)
    _clips(shelf)
    _positions(shelf)
    _cuts(shelf)
    _live(shelf)


def _units(shelf: Groups) -> None:
    plan = Plan(("I2 S1 S4 L1 S6 L3 S1",), 6, apart=True)
    for name, purpose, made in both("units-parts", "Groups in units of 1 to 6 frames", plan):
        shelf.plan(name, purpose, made, [(2, 4), (6, 12), (17, 18)])
    single = "I1 S1 S1 S1 L1 S1 S1 S1 L1 S1"
    for name, purpose, made in both("units-single", "Units of one frame", Plan((single,), 4)):
        shelf.plan(name, purpose, made, [(3, 6)])
    plan = Plan(("I4 L4 I4 L2 S3 I1 L5",), 9, apart=True)
    requests = [(0, 23), (3, 5), (8, 9), (9, 14), (12, 17), (17, 18), (19, 23), (23, 23)]
    purpose = "Parts that begin behind an intra coded unit inside the only segment"
    for name, said, made in both("units-intra", purpose, plan):
        shelf.plan(name, said, made, requests)


def _segments(shelf: Groups) -> None:
    requests = [(0, 11), (11, 13), (12, 14), (20, 22), (19, 24), (24, 30), (27, 34), (31, 31)]
    plan = Plan(BEHIND, 6, apart=True)
    purpose = "Segments that begin with an LTR, with STRs of a group that goes on, and fresh ones"
    for name, said, made in both("segments", purpose, plan):
        shelf.plan(name, said, made, requests, spec="DATA")
    purpose = "The same as packets of an open DATA, reordered."
    made = replace(plan, apart=False, order=REORDERED, coder=GOLOMB)
    about = "Open DATA and packets"
    shelf.plan("segments-packets", purpose, made, requests[:4], spec=about, packets=True)
    plan = Plan(("I4 L4", "I4 L4", "I4"), 9, bases=(basis_of(9, 4),))
    shelf.plan(
        "segments-fresh", "Segments that start fresh.", plan, [(7, 9), (16, 20)], spec="DATA"
    )


def _clips(shelf: Groups) -> None:
    """What the clip says beside the codec: grids, groups, masks."""
    plan = Plan(("I9 L9",), step=0.125)
    grids = (Grid(GridKind.INTEGER), Grid(GridKind.FIXED, 1), HUNDREDTHS)
    motion = motion_of(plan, signals=(Signal(values_of(plan), grids),))
    purpose = "Values are not rounded to the grids, one of which is INTEGER."
    shelf.plan("grids", purpose, plan, motion=motion, spec="Codecs; CLIP")
    said = put(payloads.Clip, "signals.0.groups", b"\3\1\3")
    purpose = "One group of all channels, that is listed."
    shelf.plan("groups-listed", purpose, plan, [(2, 3)], spec="CLIP", CLIP=said)
    plan = Plan(("I16 L8", "L8", "I18"), 9, apart=True)
    mask = np.ones((50, 9), np.bool_)
    mask[0:5, 0:3], mask[14:18, 3:6], mask[40:, 3:6], mask[20:31, 7] = (False,) * 4
    motion = motion_of(plan, skeleton=markers(3), mask=mask)
    purpose = "Markers with gaps: at the start, across segments, to the end, of one coordinate."
    requests = [(12, 20), (5, 14), (30, 50)]
    shelf.plan("masks", purpose, plan, requests, motion=motion, spec="Masks")


def _positions(shelf: Groups) -> None:
    """Points and virtual markers of the puppet, of which bases know nothing and everything."""
    base = replace(puppet(), unit_cm=100.0)
    for name, of in (("positions", "cosines"), ("positions-learned", "three bases")):
        crafter = Crafter()
        base_id = write_skeleton(crafter, base)
        skeleton = marker_skeleton(base, base_id, virtual_markers=True)
        n_points = skeleton.n_channels // 3
        bases = tuple(basis_of(n_points, 3, seed) for seed in range(3))
        plan = Plan(("I4 L3",), skeleton.n_channels, apart=True, step=0.25)
        plan = replace(plan, bases=bases) if of != "cosines" else plan
        metadata = {"source-note": "positions, made up"}
        motion = motion_of(plan, skeleton=skeleton, metadata=metadata)
        crafter.clip(motion, codec=codec_of(plan), grouping="all", segment_frames=0)
        purpose = f"Places of points and virtual markers of a skeleton, by {of}."
        shelf.hold(name, f"{HEADING}; Kinematics; SKEL", purpose, finished(crafter), motion)


def _cuts(shelf: Groups) -> None:
    for coder, end in ((MIXED, ""), (GOLOMB, "-golomb")):
        plan = Plan(BEHIND, 4, coder, bases=(basis_of(4, 3),))
        whole = motion_of(plan)
        data = file_with(plan, whole)
        for start, stop in ((18, 20), (0, 26), (24, 34), (31, 31))[: 4 if coder == MIXED else 1]:
            motion = shown(whole, start, stop)
            found = cut(data, frames=(start, stop))
            how = ", Golomb" if end else ""
            purpose = (
                f"Frames {start} to {stop} of 34, cut out with the segments that they need{how}."
            )
            headings = f"{HEADING}; {CUT_HEADING}"
            shelf.hold(f"cut-{start}-{stop}{end}", headings, purpose, found, motion)


def _live(shelf: Groups) -> None:
    plan = Plan(LIVE, 6, apart=True)
    about: dict[str, Any] = {"spec": "Open DATA and packets; INDX"}
    requests = [(0, 13), (4, 7), (6, 7), (7, 10), (12, 13)]
    live: dict[str, Any] = {"packets": True, "frames": 1, "anew": True}
    purpose = (
        "A frame a packet; each fresh one begins an open DATA, of kind 1, others are of kind 2"
    )
    for name, said, made in both("live", purpose, plan):
        shelf.plan(name, said, made, requests, **about, **live)
    opened = edits.both(put(payloads.Clip, "flags", b"\1"), put(payloads.Clip, "n_frames", b"\0"))
    purpose = "The same, of a clip that did not know its frames, without INDX"
    for name, said, made in both("live-open", purpose, plan):
        shelf.plan(name, said, made, requests, **about, **live, CLIP=opened, index=False)
    once = live | {"anew": False}
    purpose = "Fresh frames, too, are packets of kind 2 of the only open DATA."
    shelf.plan("live-once", purpose, plan, requests, **about, **once)
    mask = np.ones((13, 6), np.bool_)
    mask[5:7, :3] = mask[8, 4] = False
    motion = motion_of(plan, skeleton=markers(2), mask=mask)
    purpose = "Frames with a mask: the first of kind 1, the next of kind 2, which imply it."
    shelf.plan("live-masks", purpose, plan, requests, motion=motion, **about, **live)
    steady = replace(plan, fill=lambda number, n_rows, n: np.zeros((n_rows, n), np.int64))
    purpose = "Packets of frames in which nothing is here."
    shelf.plan("live-quiet", purpose, steady, [(5, 8)], **about, **live)
    mixed = Plan(("I2 L3", "S1", "S1", "L1", "S1", "I4", "S1"), 6, GOLOMB, REORDERED)
    purpose = "Packets of kind 1 with segments of some frames, and of kind 2, reordered."
    shelf.plan("live-mixed", purpose, mixed, [(5, 8), (9, 14)], **about, **live)
    _repeats(shelf, plan, opened, requests)


def _repeats(shelf: Groups, plan: Plan, opened: Any, requests: list[tuple[int, int]]) -> None:
    """As live clips are written: what a reader needs is repeated."""
    live: dict[str, Any] = {"packets": True, "frames": 1, "anew": True}
    about: dict[str, Any] = {"spec": "REPT; Open DATA and packets; INDX", "CLIP": opened}
    for name, purpose, changes in (
        ("once", "A REPT before the third open DATA.", {"repeat": (2,)}),
        ("each", "A REPT before each open DATA, the first, too.", {"repeat": range(9)}),
        ("no-index", "A REPT before two DATA of a file without INDX.", {"index": False}),
        ("empty", "An empty REPT.", {"REPT": lambda payload: b""}),
        ("noise", "A REPT of bytes that say nothing.", {"REPT": lambda payload: b"noise" * 9}),
        ("other", "A REPT of another clip.", {"REPT": swap(b"wave", b"WAVE")}),
    ):
        given = live | {"repeat": (1, 3)} | changes
        shelf.plan(f"repeat-{name}", purpose, plan, requests, **about, **given)
    bases = replace(plan, apart=False, bases=(basis_of(6, 3),))
    purpose = "A REPT with a model."
    given = live | {"repeat": (1, 3)}
    shelf.plan("repeat-model", purpose, bases, requests, **about, **given)
