"""Valid: ``lsdt-frame``."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from mcz.container import payloads
from mcz.motion import Channel, Joint, Skeleton
from tools.vectors.build.edits import both, put, stream
from tools.vectors.build.files import Vector
from tools.vectors.build.spatial_clips import (
    FRAME,
    UNLIKE,
    Plan,
    Spaces,
    basis_of,
    listed,
    markers,
    motion_of,
    noise,
)
from tools.vectors.build.spatial_streams import longer_frame
from tools.vectors.valid.common import every_codec, lsdt, spatial


def vectors() -> Iterable[Vector]:
    shelf = Spaces(FRAME)
    lsdt.add(shelf)
    spatial.add(shelf)
    spatial.add_cuts(shelf)
    _live(shelf)
    _segments_of_frames(shelf)
    every_codec.add(shelf, FRAME)
    return shelf.vectors


def _live(shelf: Spaces) -> None:
    fresh = tuple(f % 4 == 0 for f in range(11))
    plan = Plan(FRAME, 6, (1,) * 11, fresh=fresh, apart=True)
    about: dict[str, Any] = {"spec": "Open DATA and packets; INDX"}
    requests = [(0, 11), (5, 7), (8, 9), (10, 11)]
    live = {"packets": True, "frames": 1}
    purpose = "A frame a packet, of kind 2 behind the first, every fourth fresh."
    shelf.plan("live", purpose, plan, requests, **about, **live)
    opened = both(put(payloads.Clip, "flags", b"\1"), put(payloads.Clip, "n_frames", b"\0"))
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


def _segments_of_frames(shelf: Spaces) -> None:
    for prefix in (False, True):
        end, how = ("-prefix", ", prefix codes") if prefix else ("", "")
        plan = Plan(n_channels=9, segments=(6, 4, 1, 5), apart=True, bases=UNLIKE, prefix=prefix)
        one = replace(plan, fresh=(True, True, False, True))
        purpose = f"A segment that goes on where the one before ended{how}."
        requests = [(10, 11), (7, 9), (9, 13), (12, 16), (6, 6)]
        shelf.plan(f"segments-one-on{end}", purpose, one, requests, spec="DATA")
        many = replace(plan, fresh=(True, False, False, False))
        purpose = f"Four segments, of which the first alone starts fresh{how}."
        shelf.plan(f"segments-all-on{end}", purpose, many, requests, spec="DATA")
        purpose = f"Four segments that start fresh{how}."
        shelf.plan(f"segments-fresh{end}", purpose, plan, requests, spec="DATA")
    plan = Plan(n_channels=70, segments=(4,), fill=noise)
    shelf.plan("rows-70", "A matrix of 70 rows.", plan)
    entries = np.eye(1, 2048, 5, dtype=np.int64) + 3 * np.eye(1, 2048, 2047, dtype=np.int64)
    wide = Plan(n_channels=2048, segments=(2,), bases=(basis_of(2048, 1, entries=entries),))
    skeleton = Skeleton((Joint("", channels=(Channel(""),) * 2048),))
    motion = motion_of(replace(wide, codec=FRAME), skeleton=skeleton)
    shelf.plan("points-2048", "A matrix of 2048 points.", wide, motion=motion, spec="Space")
    loud = longer_frame(np.array([7, 0, -1, 0]))
    plan = Plan(n_channels=5, segments=(1,), fill=listed([[7, 0, -1]]))
    purpose = "A length that counts zeros behind the last coefficient."
    shelf.plan("length-more", purpose, plan, segments=stream(0, lambda _: loud))
