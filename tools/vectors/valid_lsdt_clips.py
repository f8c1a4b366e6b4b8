"""Valid: codecs 7 to 10, Hou's family: clips, cuts, live ones, rare ones."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from mcz.codecs._bases import model_of
from mcz.codecs.base import id_of
from mcz.container import payloads
from mcz.files.encoding import write_skeleton
from mcz.files.positions import marker_skeleton, places_of
from mcz.motion import Signal
from mcz.numbers import Grid, GridKind
from tools.vectors.craft import UNSUPPORTED, Crafter, Vector, Whole, finished
from tools.vectors.edits import both, put, swap
from tools.vectors.motions import HUNDREDTHS, puppet
from tools.vectors.spatial import (
    CLIP,
    FRAME,
    HEADINGS,
    MDTT,
    PCA_RDO,
    Plan,
    Spaces,
    basis_of,
    codec_of,
    file_with,
    markers,
    motion_of,
    values_of,
)
from tools.vectors.valid_cut import HEADING as CUT_HEADING
from tools.vectors.valid_cut import cut, shown


def vectors() -> Iterable[Vector]:
    shelves = [Spaces(name) for name in (FRAME, CLIP, MDTT, PCA_RDO)]
    for shelf in shelves:
        _clips(shelf)
        if shelf.codec in (FRAME, CLIP):
            _cuts(shelf)
    _live(shelves[0])
    return [*(vector for shelf in shelves for vector in shelf.vectors), *_uncommon()]


def _clips(shelf: Spaces) -> None:
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
        said = put(payloads.CLIP, "signals.0.groups", kind)
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
    assert places_of(base, np.zeros((1, 6)), virtual_markers=True).shape == (1, skeleton.n_channels)
    plan = Plan(shelf.codec, skeleton.n_channels, (7,), apart=True, step=0.25)
    motion = motion_of(plan, skeleton=skeleton, metadata={"source-note": "positions, made up"})
    crafter.clip(motion, codec=codec_of(plan), grouping="all", segment_frames=0)
    purpose = "Places of points and virtual markers, whose skeleton names the one they are of."
    shelf.hold("positions", f"{shelf.spec}; Kinematics; SKEL", purpose, finished(crafter), motion)


def _cuts(shelf: Spaces) -> None:
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


def _live(shelf: Spaces) -> None:
    fresh = tuple(f % 4 == 0 for f in range(11))
    plan = Plan(FRAME, 6, (1,) * 11, fresh=fresh, apart=True)
    about: dict[str, Any] = {"spec": "Open DATA and packets; INDX"}
    requests = [(0, 11), (5, 7), (8, 9), (10, 11)]
    live = {"packets": True, "frames": 1}
    purpose = "A frame a packet, of kind 2 behind the first, every fourth fresh."
    shelf.plan("live", purpose, plan, requests, **about, **live)
    opened = both(put(payloads.CLIP, "flags", b"\1"), put(payloads.CLIP, "n_frames", b"\0"))
    purpose = "The same, of a clip that did not know its frames, without INDX."
    shelf.plan("live-open", purpose, plan, requests, **about, **live, CLIP=opened, index=False)
    motion = motion_of(plan, skeleton=markers(2), mask=_gap(11))
    purpose = "Frames with a mask, of kind 1, among those of kind 2."
    shelf.plan("live-masks", purpose, plan, requests, motion=motion, **about, **live)
    mixed_fresh = (True, False, False, True, False, False, False)
    mixed = replace(plan, segments=(5, *(1,) * 6), fresh=mixed_fresh, prefix=True)
    purpose = "Packets of kind 1 and of kind 2, in prefix codes."
    shelf.plan("live-prefix", purpose, mixed, [(5, 6), (6, 11)], **about, **live)


def _gap(n_frames: int) -> Any:
    mask = np.ones((n_frames, 6), np.bool_)
    mask[5:7, :3] = False
    return mask


def _uncommon() -> Iterable[Vector]:
    found: list[Vector] = []
    for name in (FRAME, CLIP, MDTT, PCA_RDO):
        shelf = Whole(f"uncommon/{name}")
        plan = Plan(name, segments=(4,), bases=(basis_of(3, 2),))
        crafter = Crafter()
        later = replace(codec_of(plan), version=1)
        crafter.clip(motion_of(plan), codec=later, grouping="all", segment_frames=0)
        purpose = f"Version 1 of {name}, which this format does not have."
        shelf.add("newer-version", "Codecs", purpose, finished(crafter), exit=(UNSUPPORTED,))
        other = swap(id_of(model_of(plan.bases)), bytes(range(16)))
        data = file_with(plan, CLIP=other)
        purpose = "A model that the file has not, and that is not well known."
        spec = f"{HEADINGS[name]}; Bases"
        shelf.add("model-missing", spec, purpose, data, exit=(UNSUPPORTED,))
        found += shelf.vectors
    return found
