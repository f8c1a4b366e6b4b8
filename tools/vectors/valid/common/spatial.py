"""What several of lsdt-frame and lsdt-clip have: clips, cuts, vectors of their own, windows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mcz.container import payloads
from mcz.kinematics.marker_motion import marker_skeleton, marker_values
from mcz.motion import Signal
from mcz.numbers import Grid, GridKind
from mcz.writing.clip_writer import write_skeleton
from tools.vectors.build import spatial_clips
from tools.vectors.build.cuts import CUT_HEADING, cut, shown
from tools.vectors.build.edits import put
from tools.vectors.build.files import Crafter, finished
from tools.vectors.build.motions import HUNDREDTHS, puppet
from tools.vectors.build.spatial_clips import (
    FRAME,
    UNLIKE,
    WEIGHTS,
    Plan,
    Spaces,
    basis_of,
    codec_of,
    file_with,
    markers,
    motion_of,
    noise,
    values_of,
)

SEGMENTS = (12, 16, 9, 8)  # windows of 8 and 4, 8 and 8, 8 and 1, 8 frames
REQUESTS = ((10, 20), (27, 38), (36, 45))


def add(shelf: Spaces) -> None:
    """What the clip says beside the codec: grids, groups, masks, skeletons."""
    plan = Plan(shelf.codec, segments=(18,), step=0.125)
    grids = (Grid(GridKind.INTEGER), Grid(GridKind.FIXED, 1), HUNDREDTHS)
    motion = motion_of(plan, signals=(Signal(values_of(plan), grids),))
    purpose = "Values are not rounded to the grids, one of which is INTEGER."
    shelf.plan("grids", purpose, plan, motion=motion, spec="Codecs; CLIP")
    for name, kind, purpose in (
        ("joint", b"\1", "of the only joint"),
        ("listed", b"\3\1\3", "that is listed"),
    ):
        said = put(payloads.Clip, "signals.0.groups", kind)
        purpose = f"One group of all channels, {purpose}."
        shelf.plan(f"groups-{name}", purpose, plan, [(2, 3)], spec="CLIP", CLIP=said)
    plan = Plan(shelf.codec, 9, (16, 16, 18), apart=True)
    mask = np.ones((50, 9), np.bool_)
    mask[0:5, 0:3], mask[14:18, 3:6], mask[40:, 3:6], mask[20:31, 7] = (False,) * 4
    motion = motion_of(plan, skeleton=markers(3), mask=mask)
    purpose = "Markers with gaps: at the start, across segments, to the end, of one coordinate."
    requests = [(12, 20), (5, 14), (30, 50)]
    shelf.plan("masks", purpose, plan, requests, motion=motion, spec="Masks")
    _positions(shelf)


def _positions(shelf: Spaces) -> None:
    """Points and virtual markers of the puppet."""
    base = replace(puppet(), unit_cm=100.0)
    crafter = Crafter()
    base_id = write_skeleton(crafter, base)
    skeleton = marker_skeleton(base, base_id, virtual_markers=True)
    assert marker_values(base, np.zeros((1, 6)), virtual_markers=True).shape == (
        1,
        skeleton.n_channels,
    )
    plan = Plan(shelf.codec, skeleton.n_channels, (7,), apart=True, step=0.25)
    motion = motion_of(plan, skeleton=skeleton, metadata={"source-note": "positions, made up"})
    crafter.clip(motion, codec=codec_of(plan), grouping="all", segment_frames=0)
    purpose = "Places of points and virtual markers, whose skeleton names the one they are of."
    shelf.hold("positions", f"{shelf.spec}; Kinematics; SKEL", purpose, finished(crafter), motion)


def add_cuts(shelf: Spaces) -> None:
    plan = Plan(shelf.codec, 4, (16, 10, 16, 3), bases=(basis_of(4, 3),))
    if shelf.codec == FRAME:
        plan = replace(plan, fresh=(True, False, True, False))
    whole = motion_of(plan)
    data = file_with(plan, whole)
    for start, stop in ((17, 20), (0, 26), (28, 45), (44, 45), (16, 16)):
        motion = shown(whole, start, stop)
        found = cut(data, frames=(start, stop))
        purpose = f"Frames {start} to {stop} of 45, cut out with the segments that they need."
        shelf.hold(f"cut-{start}-{stop}", f"{shelf.spec}; {CUT_HEADING}", purpose, found, motion)


def add_own_vectors(shelf: Spaces) -> None:
    cases: dict[str, tuple[str, Plan]] = {
        "cosines": ("Cosines", Plan(segments=(10,))),
        "learned": ("One basis", Plan(n_channels=4, bases=(basis_of(4, 3),), weights=WEIGHTS[5:9])),
        "learned-unlike": (
            "Three bases, three of 8 frequencies",
            Plan(n_channels=9, segments=(19, 5), apart=True, bases=UNLIKE, frequencies=3),
        ),
        "frames-1": ("One frame", Plan(segments=(1,), bases=(basis_of(3, 2),))),
        "frames-2": ("Two frames", Plan(segments=(2,), bases=(basis_of(3, 2),), prefix=True)),
        "window-1": ("Windows of one frame", Plan(segments=(4,), window=1)),
        "step-greatest": ("The greatest step", Plan(segments=(4,), step=2.0**100)),
        "prefix": ("Prefix codes", Plan(n_channels=4, bases=(basis_of(4, 3),), prefix=True)),
    }
    for name, (purpose, plan) in cases.items():
        n = plan.n_frames
        shelf.plan(name, f"{purpose}.", plan, [(n // 3, n - n // 4)])


def add_ends(shelf: spatial_clips.Spaces, other: str) -> None:
    """Models of several clips, and both ends of windows and frequencies."""
    bases = (basis_of(4, 3),)
    first = spatial_clips.Plan(shelf.codec, 4, (9, 5), bases=bases)
    second = replace(first, codec=other, segments=(6,), step=0.25, prefix=True)
    crafter = Crafter()
    motions = [
        replace(spatial_clips.motion_of(plan), name=f"clip {k}")
        for k, plan in enumerate((first, second))
    ]
    for motion, plan in zip(motions, (first, second), strict=True):
        codec = spatial_clips.codec_of(plan)
        crafter.clip(motion, codec=codec, grouping="all", segment_frames=0)
    data = finished(crafter)
    purpose = f"Two clips with one model, the second of {other}."
    shelf.hold("model-shared", f"{shelf.spec}; Bases", purpose, data, *motions)
    plan = spatial_clips.Plan(shelf.codec, 1, (2050,), window=2048, frequencies=1, fill=_lone)
    shelf.plan("window-2048-1", "A window of 2048 frames, one frequency.", plan, [(2047, 2050)])
    plan = spatial_clips.Plan(shelf.codec, 3, (7,), step=2.0**-100)
    shelf.plan("step-least", "The least step.", plan)


def _lone(number: int, n_rows: int, n: int) -> spatial_clips.Ints:
    return spatial_clips.listed([[70]], [[-9]])(number, n_rows, n)


def add_longer(shelf: Spaces) -> None:
    """Matrices of windows that are longer than the one before, of which nothing is left."""
    plan = Plan(n_channels=9, segments=SEGMENTS, apart=True)
    cases = {
        "longer": ("", plan),
        "longer-full": (", no coefficient 0", replace(plan, fill=noise)),
        "longer-few": (", 5 of 8 frequencies", replace(plan, frequencies=5, bases=UNLIKE)),
    }
    for name, (how, made) in cases.items():
        purpose = f"Three matrices, windows of 8, 4, 8, 8, 8, 1 and 8 frames{how}."
        shelf.plan(name, purpose, made, REQUESTS)
