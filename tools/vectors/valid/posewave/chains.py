"""Segments that go on where the one before ended, in files and live."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from mcz.container import payloads
from mcz.motion import Signal
from tools.vectors.build.edits import both, put
from tools.vectors.build.pose_clips import (
    HEADING,
    Plan,
    Poses,
    acclaim,
    biovision,
    motion_of,
    segments_of,
    waves,
)

CHAINS = f"{HEADING}; Segments that go on"
LIVE = f"{CHAINS}; Open DATA and packets"


def add(shelf: Poses) -> None:
    _segments(shelf)
    _none_kept(shelf)
    _live(shelf)


def _segments(shelf: Poses) -> None:
    skeleton = acclaim()
    source = waves(40, skeleton)
    ends = (1, 2, 3, 5, 8, 13, 14, 30)
    on = {1, 2, 3, 5, 6, 7, 8}
    plan = Plan(skeleton, source, {"levels": 0}, ends, on=on)
    requests = [(0, (0, 2), None), (0, (6, 9), (1,)), (0, (4, 5), None), (0, (35, 40), (2, 0))]
    purpose = "Segments of 1 to 16 frames, of which two start fresh."
    shelf.plan("on", purpose, plan, CHAINS, requests)
    octaves = [0] * 8 + [2] * 5 + [7] + [0] * 16 + [1] * 10
    refined = replace(plan, fields={"levels": 0, "flags": 1, "step": 0.25}, refinement=octaves)
    purpose = "Exponents, which those of the segment before tell; rows of zeros among them."
    shelf.plan("on-refining", purpose, refined, CHAINS, requests)
    coarse = replace(plan, fields={"levels": 0, "step": 2.0, "start": 1}, price=0.5)
    shelf.plan("on-zeros", "Most rows are zeros.", coarse, CHAINS, requests)
    long = replace(plan, source=waves(64, skeleton), ends=(50,), on={1})
    purpose = "What goes on knows more than 40 rows, and is not made to forget."
    shelf.plan("on-after-50", purpose, long, CHAINS, [(0, (48, 56), (2,))])
    bones = biovision()
    plan = Plan(bones, waves(24, bones), {"levels": 0, "orders": [0] * 5}, (7, 9), on={1, 2})
    purpose = "Orders that are all those of the source let segments go on."
    shelf.plan("on-orders-kept", purpose, plan, CHAINS, [(0, (8, 20), (3,))])


def _none_kept(shelf: Poses) -> None:
    skeleton = acclaim()
    still = np.repeat(waves(1, skeleton), 9, axis=0)
    first = segments_of(Plan(skeleton, still[:4], {"levels": 0}))[0].streams
    streams = {0: first, 1: (b"",), 2: (b"",)}
    plan = Plan(skeleton, still, {"levels": 0}, (4, 5), streams=streams, on={1, 2})
    shelf.plan(
        "on-none-kept", "Nothing moves, and no rows go on.", plan, CHAINS, [(0, (6, 9), None)]
    )


def _live(shelf: Poses) -> None:
    skeleton = acclaim()
    plan = Plan(
        skeleton,
        waves(11, skeleton),
        {"levels": 0, "flags": 1},
        tuple(range(1, 11)),
        refinement=[0, 1, 0, 0, 3, 0, 0, 0, 0, 0, 1],
        on=set(range(11)) - {0, 4, 8},
    )
    requests = [(0, (5, 7), None), (0, (8, 9), (1,)), (0, (10, 11), None)]
    live: dict[str, Any] = {"packets": True, "frames": 1}
    purpose = "A frame a packet, of kind 2 behind the first, every fourth fresh."
    shelf.plan("live", purpose, plan, LIVE, requests, **live)
    opened = both(put(payloads.Clip, "flags", b"\1"), put(payloads.Clip, "n_frames", b"\0"))
    purpose = "The same, of a clip that did not know its frames, without INDX."
    shelf.plan("live-open", purpose, plan, LIVE, requests, **live, CLIP=opened, index=False)
    mask = np.ones(plan.source.shape, np.bool_)
    mask[5:7, :3] = False
    masked = Signal(motion_of(plan).signals[0].values, mask=mask)
    purpose = "Frames with a mask, of kind 1, among those of kind 2."
    shelf.plan("live-masks", purpose, plan, LIVE, requests, {"signals": (masked,)}, **live)
