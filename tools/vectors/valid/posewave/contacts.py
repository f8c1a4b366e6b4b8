"""Points that are held in their places: skeletons, segments, ramps, steps, what is out of reach."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from mcz.codecs.posewave.contact_keeper import Piece
from mcz.motion import Skeleton
from tools.vectors.build.pose_clips import (
    HEADING,
    Plan,
    Poses,
    acclaim,
    biovision,
    chain,
    waves,
)

CONTACTS = f"{HEADING}; Held contacts"


def add(shelf: Poses) -> None:
    _skeletons(shelf)
    _segments(shelf)
    _headers(shelf)
    _far(shelf)


def held(*points: tuple[int, int], rounds: int = 4, ramp: int = 5, **more: Any) -> dict[str, Any]:
    """The header's field, of points by joint and tail; each but the first follows that before."""
    fields = [
        {"joint": joint, "tail": tail, "step": 2.0**-7, "follows": number} | more
        for number, (joint, tail) in enumerate(points)
    ]
    return {"contacts": [{"rounds": rounds, "ramp": ramp, "points": fields}]}


def pieces(*runs: tuple[int, int, int]) -> tuple[Piece, ...]:
    """Contacts by point, first frame and number of frames, each shifted by itself."""
    return tuple(Piece(p, first, n, first, i) for i, (p, first, n) in enumerate(runs))


RUNS = pieces((0, 2, 9), (0, 14, 15), (1, 0, 7), (1, 9, 21))


def _skeletons(shelf: Poses) -> None:
    bones = chain(["tx ty tz rz rx ry", "tx ty tz rz rx", "rx tz", "ty rz"], unit_cm=1.0)
    scaled = chain(["tx ty tz rz rx ry", "sx sy sz rx", "length rz", "qw qx qy qz ry"])
    cases: dict[str, tuple[str, Skeleton, tuple[tuple[int, int], ...]]] = {
        "fixed-axes": ("Points of fixed axes, one a tail", acclaim(), ((2, 1), (3, 2))),
        "rad": ("The same in radians", replace(acclaim(), angle_unit="rad"), ((2, 1), (3, 2))),
        "intrinsic": ("Points of intrinsic rotations", biovision(), ((4, 1), (3, 0))),
        "below": ("A point and one below it", biovision(), ((2, 0), (3, 1))),
        "positions": ("Positions of every joint give way", bones, ((3, 0), (1, 0))),
        "plain": ("Channels that do not give way", scaled, ((3, 0), (1, 0))),
        "root": ("Points of a root", acclaim(), ((0, 0), (0, 0))),
        "angle-unknown": ("Nothing gives way", biovision(""), ((4, 1), (3, 0))),
    }
    for name, (purpose, skeleton, points) in cases.items():
        fields = held(*points) | ({"rotation": 113} if name == "rad" else {})
        source = waves(30, skeleton, 0.02 if name == "rad" else 1.0)
        plan = Plan(skeleton, source, fields, price=0.5, pieces=RUNS)
        requests = [(0, (7, 12), (1,)), (1, (0, 30), None)]
        shelf.plan(f"contacts-{name}", f"{purpose}.", plan, CONTACTS, requests)
    skeleton = biovision()
    fields = held((4, 1), (3, 0)) | {"orders": [0, 2, 6, 0, 3]}
    plan = Plan(skeleton, waves(30, skeleton, 8.0), fields, price=0.5, pieces=RUNS)
    purpose = "Joints of other axis orders, whose coded angles are corrected."
    shelf.plan("contacts-orders", purpose, plan, CONTACTS, [(1, (0, 30), None), (0, (3, 9), None)])


def _segments(shelf: Poses) -> None:
    skeleton = acclaim()
    source = waves(40, skeleton)
    source[30:] = source[30]
    fields = held((2, 1), (3, 1))
    runs = pieces((0, 4, 30), (1, 2, 3), (1, 5, 1), (1, 9, 4), (1, 15, 25))
    plan = Plan(skeleton, source, fields, (1, 12, 13, 30), price=0.5, pieces=runs)
    purpose = "Contacts that go on from segment to segment; in one nothing is kept, one is short."
    requests = [(0, (11, 32), (2,)), (1, (0, 40), None), (2, (12, 13), None)]
    shelf.plan("contacts-segments", purpose, plan, CONTACTS, requests)
    for levels in (0, 5):
        own = replace(plan, fields=fields | {"levels": levels}, ends=(17,))
        purpose = f"Contacts with {levels} levels."
        shelf.plan(f"contacts-levels-{levels}", purpose, own, CONTACTS)
    cut = replace(plan, cut=1, ends=(1,))
    purpose = "The finest details are not stored: contacts are in a segment of a frame alone."
    shelf.plan("contacts-cut", purpose, cut, CONTACTS)
    short = pieces((0, 3, 20), (1, 10, 1))
    near = Plan(skeleton, source[:30], held((2, 1), (3, 2)), price=0.5, pieces=short)
    purpose = "A point stands for a frame where it is; then it leans by nothing, and counts."
    shelf.plan("contacts-leaning", purpose, near, CONTACTS)
    none = replace(plan, pieces=(), ends=())
    shelf.plan("contacts-none", "Points that never stand.", none, CONTACTS)


def _headers(shelf: Poses) -> None:
    skeleton = acclaim()
    source = waves(30, skeleton, 1.0)
    two = (2, 1), (3, 2)
    cases: dict[str, tuple[str, dict[str, Any]]] = {
        "rounds-1": ("A round", held(*two, rounds=1)),
        "rounds-6": ("6 rounds", held(*two, rounds=6)),
        "ramp-0": ("No ramp", held(*two, ramp=0)),
        "ramp-64": ("A ramp of 64 frames, more than the clip has", held(*two, ramp=64)),
        "points-8": ("8 points, many of them the same", held(*two, *two, (1, 0), (2, 0), *two)),
        "alone": ("Points that follow none", held(*two, follows=0)),
        "step-fine": ("A fine step: large residuals", held(*two, step=2.0**-18)),
        "step-coarse": ("A coarse step", held(*two, step=2.0)),
        "step-least": ("Displacements in the least step", held(*two, step=2.0**-60)),
        "step-greatest": ("Displacements in the greatest step", held(*two, step=2.0**60)),
    }
    for name, (purpose, fields) in cases.items():
        step = fields["contacts"][0]["points"][0]["step"]
        runs = () if name == "step-least" else RUNS
        runs += pieces(*((point, 3 * point, 9) for point in range(2, 8))) * (name == "points-8")
        plan = Plan(skeleton, source, fields, price=0.5, pieces=runs, tolerance=step)
        shelf.plan(f"contacts-{name}", f"{purpose}.", plan, CONTACTS)


def _far(shelf: Poses) -> None:
    """Decoded poses so coarse that points are far from their places."""
    skeleton = acclaim()
    source = waves(30, skeleton, 40.0)
    for name, fields in (
        ("far", {"step": 16.0}),
        ("out-of-reach", {"step": 16.0, "rotation": 110, "position": 100, "first": 0}),
        ("wide", {"step": 16.0, "rotation": 200, "position": 200}),
    ):
        plan = Plan(
            skeleton, source, held((2, 1), (3, 2)) | fields, price=0.5, pieces=RUNS, tolerance=0.01
        )
        purpose = f"Points far from their places: {name}."
        shelf.plan(f"contacts-{name}", purpose, plan, CONTACTS)
    source = np.repeat(source[:1], 30, axis=0) + 0.25 * waves(30, skeleton)
    source[:, 0] += 2.0**41
    source[:, 6] += 2.0**39
    plan = Plan(
        skeleton,
        source,
        held((2, 1), (3, 2)) | {"position": 255, "rotation": 255, "step": 2.0**10},
        pieces=RUNS,
    )
    shelf.plan("contacts-values-far", "Values beyond 2^40 count as 0.", plan, CONTACTS)
