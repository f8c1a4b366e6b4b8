"""Clips with levels: skeletons, metric, heads, orders, segments, cuts."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from mcz.container import payloads
from mcz.motion import Channel, Joint, Skeleton
from tools.vectors.build.edits import put
from tools.vectors.build.motions import UNROUNDED, channels
from tools.vectors.build.pose_clips import (
    HEADING,
    Floats,
    Plan,
    Poses,
    acclaim,
    biovision,
    chain,
    file_with,
    motion_of,
    waves,
)

METRIC = f"{HEADING}; Pose metric"
ROWS = f"{HEADING}; Rows in the metric"
ORDERS = f"{HEADING}; Axis orders"


def add(shelf: Poses) -> None:
    _skeletons(shelf)
    _positions(shelf)
    _plain(shelf)
    _paths(shelf)
    _degenerate(shelf)
    _metric(shelf)
    _lengths(shelf)
    _levels(shelf)
    _rows(shelf)
    _heads(shelf)
    _orders(shelf)
    _notes(shelf)
    _segments(shelf)
    _signals(shelf)


def _skeletons(shelf: Poses) -> None:
    cases: dict[str, tuple[str, Skeleton]] = {
        "fixed-axes": ("Fixed axes in degrees, orientations and tails", acclaim()),
        "fixed-axes-rad": ("Fixed axes, in radians", replace(acclaim(), angle_unit="rad")),
        "intrinsic": ("Intrinsic rotations in degrees", biovision()),
        "intrinsic-rad": ("The same skeleton in radians", biovision("rad")),
        "fixed": ("The same rotations about fixed axes", replace(biovision(), intrinsic=False)),
        "angle-unknown": ("Rotations of an unknown angle unit: all are plain", biovision("")),
        "roots": ("Three roots, one without channels, one below which nothing is", _roots()),
        "markers": ("Markers: roots with positions alone", _markers(7)),
        "singular-metric": ("Three rotations of which two coincide", chain(["rx ry rz rx ry rz"])),
    }
    for name, (purpose, skeleton) in cases.items():
        size = 0.01 if skeleton.angle_unit == "rad" else 0.5
        fields = {"rotation": 113} if skeleton.angle_unit == "rad" else {}
        plan = Plan(skeleton, waves(33, skeleton, size), fields)
        last = skeleton.n_joints - 1
        requests = [(0, (7, 12), (last,)), (1, (0, 33), None), (2, (3, 20), (last, 0)[: last + 1])]
        shelf.plan(name, f"{purpose}.", plan, METRIC, requests)
    axis = replace(biovision("").joints[1], axis=(0.0, 10.0, 0.0), channels=channels("tx ty tz"))
    skeleton = Skeleton((Joint("root", channels=channels("tx ty tz")), axis), name="turned")
    purpose = "An axis of an unknown angle unit, positions alone: all are plain."
    shelf.plan("axis-unknown", purpose, Plan(skeleton, waves(20, skeleton)), METRIC)


def _roots() -> Skeleton:
    return Skeleton(
        (
            Joint("one", channels=channels("tx ty tz rz rx ry")),
            Joint("bone", 0, (0.0, 3.0, 1.0), channels=channels("rx")),
            Joint("two", -1, (5.0, 0.0, 0.0)),
            Joint("below", 2, (0.0, -2.0, 0.0), ((1.0, 0.0, 0.0),), channels=channels("ry rz")),
            Joint("three", -1, (0.0, 9.0, 0.0), channels=channels("rx ty")),
        ),
        name="roots",
        angle_unit="deg",
        intrinsic=True,
    )


def _markers(n: int) -> Skeleton:
    joints = tuple(Joint(f"marker {j}", channels=channels("tx ty tz")) for j in range(n))
    return Skeleton(joints, name="markers", unit_cm=0.1)


def _positions(shelf: Poses) -> None:
    bones = chain(["tx ty tz rz rx ry", "tx ty tz rz rx", "rx tz", "ty rz"], unit_cm=1.0)
    adding = tuple(replace(joint, adds_to_offset=True) for joint in bones.joints)
    for name, purpose, joints in (
        ("replace", "Positions of every joint in the place of its offset.", bones.joints),
        ("add", "Positions of every joint that add to its offset.", adding),
    ):
        skeleton = replace(bones, joints=joints)
        plan = Plan(skeleton, waves(33, skeleton, 0.3))
        shelf.plan(f"positions-{name}", purpose, plan, METRIC, [(1, (5, 30), (1, 2))])


def _plain(shelf: Poses) -> None:
    kinds = ["tx ty tz rz rx ry", "sx sy sz rx", "length rz", "qw qx qy qz", "ry"]
    skeleton = chain(kinds)
    skeleton = replace(
        skeleton,
        joints=(*skeleton.joints, Joint("dial", 0, channels=channels("rx")), _dial()),
    )
    source = waves(33, skeleton, 0.05)
    plan = Plan(skeleton, source, {"plain": list(range(100, 100 + _n_plain(skeleton)))})
    purpose = "Scales, a length, a quaternion and plain scalars, each with a step of its own."
    shelf.plan("plain-steps", purpose, plan, METRIC, [(1, (2, 9), (2, 5))])
    shelf.plan("plain", "The same with steps of 1.", replace(plan, fields={}), METRIC)
    numbers = Skeleton((_dial(),), name="dial")
    source = waves(33, numbers, 8.0)
    fields = {"plain": [121, 130], "step": 0.5}
    shelf.plan("scalars", "Plain scalars and no bone.", Plan(numbers, source, fields), METRIC)


def _n_plain(skeleton: Skeleton) -> int:
    return sum(channel.kind[:1] not in ("t", "r") for channel in skeleton.channels)


def _dial() -> Joint:
    return Joint("needles", channels=tuple(_needles()))


def _needles() -> Iterable[Channel]:
    return (Channel("", "needle 0", "V"), Channel("", "needle 1", "A"))


def _paths(shelf: Poses) -> None:
    for name, purpose, skeleton in (
        ("long", "A chain of 105 channels: paths of two blocks.", chain(["rz rx ry"] * 35)),
        ("96", "A chain of just 96 channels.", chain(["rz rx ry"] * 32)),
        ("97", "A chain of 97 channels.", chain(["rz rx ry"] * 32 + ["rx"])),
        ("joint", "A joint of 99 channels.", chain(["rx", "rz rx ry" + " ty rx ry" * 32, "rz"])),
    ):
        plan = Plan(skeleton, waves(9, skeleton), {"step": 0.5, "levels": 1})
        shelf.plan(f"path-{name}", purpose, plan, METRIC, [(0, (4, 5), (1,))])
    for n in (21, 22, 43):
        skeleton = _markers(n)
        source = waves(21, skeleton, 0.5)
        plan = Plan(skeleton, source, {"step": 0.25, "position": 136})
        shelf.plan(f"kept-{3 * n}", f"{3 * n} kept channels: blocks of at most 64.", plan, ROWS)


def _degenerate(shelf: Poses) -> None:
    still = Skeleton(
        (Joint("all", channels=channels("rz rx ry")),), angle_unit="deg", intrinsic=True
    )
    moving = Skeleton((Joint("all", channels=channels("tx ty tz rz rx ry")),), angle_unit="deg")
    cases: dict[str, tuple[str, Skeleton, dict[str, Any]]] = {
        "no-extent": ("No extent and radius 0: pivots are reg", still, {"radius": 0.0}),
        "no-extent-moving": ("The same with positions", moving, {"radius": 0.0, "shell": 0}),
        "shell-alone": ("The metric is that of the shell alone", moving, {"shell": 16}),
        "radius-greatest": (
            "A radius of 2^60: pivots that rounding eats",
            acclaim(),
            {"radius": 2.0**60, "step": 2.0**50},
        ),
        "radius-least": ("A radius of 2^-149", acclaim(), {"radius": 2.0**-149}),
        "reg-least": (
            "Greatest steps of 2^33: the least reg",
            acclaim(),
            {"rotation": 255, "position": 255, "first": 24, "constant": 24},
        ),
        "reg-greatest": (
            "Greatest steps of 2^-32",
            acclaim(),
            {"rotation": 0, "position": 0, "first": 0, "constant": 0},
        ),
    }
    for name, (purpose, skeleton, fields) in cases.items():
        size = 2.0**-20 if name == "reg-greatest" else 0.3
        plan = Plan(skeleton, waves(17, skeleton, size), fields)
        shelf.plan(name, f"{purpose}.", plan, METRIC)
    skeleton = replace(
        acclaim(),
        joints=tuple(
            replace(joint, offset=(2.0**41, -1.0, 2.0**39), tails=((2.0**40, 1.0, 0.0),))
            for joint in acclaim().joints
        ),
    )
    plan = Plan(skeleton, waves(17, skeleton), {"step": 2.0**30})
    shelf.plan("offsets-far", "Offsets and tails of 2^40 and more count as 0.", plan, METRIC)
    source = waves(17, acclaim()) + 0.0
    source[:, 0] = 2.0**45 + 2.0**44 * (np.arange(17) % 2)
    source[:, 7] = 3.0 * 2.0**40
    plan = Plan(acclaim(), source, {"position": 255, "rotation": 255, "step": 2.0**20})
    shelf.plan("values-far", "Values beyond 2^40: the pose is that without them.", plan, METRIC)


def _metric(shelf: Poses) -> None:
    skeleton = acclaim()
    source = waves(33, skeleton)
    cases: dict[str, tuple[str, dict[str, Any]]] = {
        "shell-0": ("No shell", {"shell": 0}),
        "shell-16": ("The shell alone", {"shell": 16}),
        "shell-1": ("A sixteenth of shell", {"shell": 1, "radius": 0.3}),
        "weights": ("Weights of joints", {"weights": [128, 140, 96, 131]}),
        "weights-ends": ("The least and the greatest weights", {"weights": [0, 255, 128, 0]}),
        "steps-other": ("Other greatest steps", {"rotation": 121, "position": 130}),
    }
    for name, (purpose, fields) in cases.items():
        plan = Plan(skeleton, source, fields)
        shelf.plan(name, f"{purpose}.", plan, METRIC, [(1, (3, 9), (2,))])
    angles = waves(33, biovision(), 12.0)
    plan = Plan(biovision(), angles, {"levels": 3})
    shelf.plan("angles-wide", "Angles of several turns.", plan, METRIC)
    for turn, name in ((2.0**20 * 360, "2-20-turns"), (2.0**39, "2-39")):
        plan = Plan(biovision(), waves(17, biovision()) + turn, {"first": 0, "constant": 0})
        shelf.plan(f"angles-{name}", f"Angles about {turn:.0f} degrees.", plan, METRIC)
    for step, name in ((2.0**-60, "least"), (2.0**60, "greatest")):
        source = waves(9, _roots()) * (step * 64 if step < 1 else 1.0)
        fields = {"step": step, "rotation": 0 if step < 1 else 255, "position": 0}
        purpose = f"The {name} step."
        shelf.plan(f"step-{name}", purpose, Plan(_roots(), source, fields), METRIC)


def _lengths(shelf: Poses) -> None:
    skeleton = acclaim()
    for n_frames in (0, 1, 2, 3, 4, 5, 10, 33, 130):
        plan = Plan(skeleton, waves(n_frames, skeleton), {"levels": 3})
        requests = [(0, (n_frames // 2, n_frames), (1,))] if n_frames else []
        requests += [(2, (0, n_frames), None)] if n_frames else []
        shelf.plan(f"length-{n_frames}", f"{n_frames} frames, 3 levels.", plan, requests=requests)


def _levels(shelf: Poses) -> None:
    skeleton = acclaim()
    spec = f"{HEADING}; Lifting"
    for levels in range(9):
        for n_frames in (10, 70):
            plan = Plan(skeleton, waves(n_frames, skeleton), {"levels": levels})
            requests: list[Any] = [(k, (1, 9), None) for k in {levels // 2, levels} if k]
            name = f"levels-{levels}-of-{n_frames}"
            purpose = f"{levels} levels of {n_frames} frames: streams of levels that are not empty."
            shelf.plan(name, purpose, plan, spec, requests)
    for borrowing in (0, 2, 4, 5):
        plan = Plan(skeleton, waves(70, skeleton), {"levels": 5, "borrowing": borrowing})
        purpose = f"The {borrowing} finest levels take the metric of a coarser one."
        shelf.plan(f"borrowing-{borrowing}", purpose, plan, requests=[(1, (3, 40), None)])
    plan = Plan(skeleton, waves(3, skeleton), {"levels": 8, "borrowing": 8})
    shelf.plan("borrowing-of-3", "More borrowing than levels of 3 frames.", plan)
    for cut in (1, 3, 4):
        plan = Plan(skeleton, waves(40, skeleton), {"levels": 4}, cut=cut)
        requests = [(1, (3, 40), None)] if cut < 4 else []
        purpose = f"The {cut} finest resolutions are not stored."
        shelf.plan(f"resolutions-cut-{cut}", purpose, plan, f"{HEADING}; CLIP", requests)
    plan = Plan(skeleton, waves(5, skeleton), {"levels": 8}, cut=5)
    shelf.plan("resolutions-cut-short", "Of 5 frames no details are stored.", plan)


def _rows(shelf: Poses) -> None:
    skeleton = biovision()
    source = waves(70, skeleton, 1.5)
    for start in (0, 1):
        plan = Plan(skeleton, source, {"start": start, "levels": 4})
        shelf.plan(f"start-{start}", f"Start table {start}.", plan, ROWS)
    plan = Plan(skeleton, source, {"levels": 4, "step": 0.0005}, price=0.0)
    shelf.plan("fine", "A fine step: large integers, most of them escapes.", plan, ROWS)
    jumps = source.copy()
    jumps[::7, 3], jumps[::5, 0] = 170.0, -300.0
    plan = Plan(skeleton, jumps, {"levels": 3, "step": 2.0**-17}, price=0.0)
    shelf.plan("escapes", "Integers of all sizes up to millions.", plan, ROWS)
    far = waves(24, _markers(2))
    far[1::2, 0], far[::3, 4] = 40_000.0, -9_000.0
    fields = {"levels": 1, "step": 2.0**-12, "radius": 0.0, "shell": 0}
    plan = Plan(_markers(2), far, fields, price=0.0)
    shelf.plan("escapes-far", "Integers of up to 2^28.", plan, ROWS)
    noise = ((np.arange(60 * 18).reshape(60, 18) ** 2 * 7919 + 31) % 997 - 498) / 4.0
    plan = Plan(skeleton, noise, {"levels": 3, "step": 0.25}, price=0.0)
    shelf.plan("noise", "Noise: predictions and sizes reach far.", plan, ROWS)
    plan = Plan(skeleton, source, {"levels": 4, "step": 8.0, "start": 1}, price=0.5)
    shelf.plan("rows-of-zeros", "A coarse step: most rows are zero.", plan, ROWS)
    pauses = np.repeat(source[::10], 40, axis=0)[:160]
    plan = Plan(skeleton, pauses, {"levels": 5}, price=0.0)
    shelf.plan("pauses", "Poses that stay, and leaps: rows of zeros among others.", plan, ROWS)
    octaves = [[0, 0, 1, 7, 2, 0, 3][f // 10] for f in range(70)]
    for name, refinement in (("some", octaves), ("all", [7] * 70), ("none", [0] * 70)):
        fields = {"levels": 3, "flags": 1, "step": 0.5}
        plan = Plan(skeleton, source, fields, refinement=refinement)
        purpose = f"Rows with finer steps of their own: {name}."
        shelf.plan(f"refining-{name}", purpose, plan, ROWS, [(1, (5, 60), None)])


def _heads(shelf: Poses) -> None:
    skeleton = acclaim()
    source = waves(20, skeleton)
    still = np.repeat(source[:1], 20, axis=0)
    shelf.plan(
        "none-kept", "Nothing moves: no rows.", Plan(skeleton, still), requests=[(1, (2, 7), (1,))]
    )
    shelf.plan("zeros", "All values are 0.", Plan(skeleton, 0 * still))
    mixed = np.where(np.arange(skeleton.n_channels) % 3 == 1, source, still)
    shelf.plan("some-kept", "Every third channel moves.", Plan(skeleton, mixed))
    one = np.where(np.arange(skeleton.n_channels) == 8, source, still)
    shelf.plan("one-kept", "One channel moves.", Plan(skeleton, one))
    sizes = still.copy()
    sizes[:] = [(-1) ** c * 2.0 ** (c * 2 - 3) for c in range(skeleton.n_channels)]
    sizes[:, 5] += np.arange(20)
    plan = Plan(skeleton, sizes, {"first": 24, "constant": 0, "rotation": 145})
    shelf.plan("first-24", "First values of all sizes, with 24 halvings.", plan)
    plan = Plan(skeleton, source, {"first": 0, "constant": 24})
    shelf.plan("constant-24", "Constants with 24 halvings.", plan)
    most = 0 * still + (2.0**39 - 1) * np.array([1, -1] * 6)
    fields = {"first": 0, "constant": 0, "rotation": 128, "position": 128}
    shelf.plan("numbers-39-bits", "First values of 39 bits.", Plan(skeleton, most, fields))


def _turning(unit: str = "deg", intrinsic: bool = True) -> tuple[Skeleton, Floats]:
    """Angles through gimbal lock, with whole turns and other solutions."""
    skeleton = replace(biovision(unit), intrinsic=intrinsic)
    source = waves(40, skeleton, 1.0)
    frames = np.arange(40)
    source[:, 6], source[:, 7], source[:, 8] = 9.0 * frames, 45 + 2.5 * frames, -4.0 * frames
    source[:, 10] = 90.0
    source[20:, 12:15] += np.array([180.0, 0.0, 180.0])
    source[20:, 13] = 180.0 - source[20:, 13]
    source[30:, 15] += 720.0
    return skeleton, source * (np.pi / 180 if unit == "rad" else 1.0)


def _orders(shelf: Poses) -> None:
    skeleton, source = _turning()
    for code in range(1, 7):
        plan = Plan(skeleton, source, {"orders": [code] * 5})
        purpose = f"All joints in the order of code {code}."
        requests = [(0, (25, 35), (3,)), (1, (0, 40), None), (2, (30, 31), (1, 2))]
        shelf.plan(f"order-{code}", purpose, plan, ORDERS, requests)
    cases: tuple[tuple[str, str, Skeleton, Floats], ...] = (
        ("mixed", "Unlike orders, two of them kept.", *_turning()),
        ("fixed", "Unlike orders about fixed axes.", *_turning(intrinsic=False)),
        ("rad", "Unlike orders in radians.", *_turning("rad")),
    )
    for name, purpose, bones, angles in cases:
        fields: dict[str, Any] = {"orders": [0, 2, 6, 0, 3]}
        fields |= {"rotation": 113} if name == "rad" else {}
        plan = Plan(bones, angles, fields, ends=(16,))
        shelf.plan(f"orders-{name}", purpose, plan, ORDERS, [(1, (10, 20), None)])
    plan = Plan(skeleton, source, {"orders": [0] * 5})
    shelf.plan("orders-kept", "Orders that are all those of the source.", plan, ORDERS)
    still = np.repeat(source[:1], 12, axis=0)
    still[:, 6:9] = 90.0, 90.0, 0.0
    plan = Plan(skeleton, still, {"orders": [1, 2, 3, 4, 5]})
    shelf.plan("orders-still", "Orders of a pose in gimbal lock that stays.", plan, ORDERS)
    locked = still.copy()
    locked[:, 7] = 90.0 + 1e-7 * np.arange(12)
    locked[:, 10], locked[:, 11] = -90.0, 12.0 * np.arange(12)
    plan = Plan(skeleton, locked, {"orders": [4] * 5})
    shelf.plan("orders-gimbal-lock", "Gimbal lock, from both sides.", plan, ORDERS)


def _notes(shelf: Poses) -> None:
    skeleton, source = _turning()
    fields = {"orders": [0, 4, 0, 1, 0]}
    made = waves(10, skeleton)
    made[3:6, 6] += 360.0 * 2**30
    made[5:, 7] -= 360.0
    plan = Plan(skeleton, made, fields)
    shelf.plan("notes-turns", "Notes of many turns, both ways.", plan, ORDERS)
    plan = Plan(skeleton, source[::4], fields)
    shelf.plan("notes-switches", "Notes of switches.", plan, ORDERS, [(1, (2, 9), (1,))])


def _segments(shelf: Poses) -> None:
    skeleton = acclaim()
    plan = Plan(skeleton, waves(70, skeleton), {"levels": 3}, ends=(1, 3, 20, 52))
    requests = [(0, (2, 5), (1,)), (1, (19, 60), None), (3, (0, 70), (2,)), (0, (30, 30), None)]
    purpose = "Segments of 1, 2, 17, 32 and 18 frames."
    shelf.plan("segments", purpose, plan, f"{HEADING}; DATA", requests)
    source = waves(30, skeleton)
    source[10:20] = source[10]
    plan = Plan(skeleton, source, {"levels": 2}, ends=(10, 20))
    shelf.plan("segments-kept", "Other channels are kept in each segment.", plan)


def _signals(shelf: Poses) -> None:
    skeleton = acclaim()
    plan = Plan(skeleton, waves(12, skeleton))
    listed = put(payloads.Clip, "signals.0.groups", b"\3\1\x0c")
    shelf.plan("groups-listed", "One group of all channels, that is listed.", plan, CLIP=listed)
    motion = motion_of(plan)
    signal = replace(motion.signals[0], grids=(UNROUNDED * 4))
    purpose = "Values are not rounded to the grids, some of which are INTEGER."
    data = file_with(plan, replace(motion, signals=(signal,)))
    shelf.hold(
        "grids", f"{HEADING}; Codecs; CLIP", purpose, data, replace(motion, signals=(signal,))
    )
    mask = np.ones((12, 12), np.bool_)
    mask[0:2, 3], mask[5:9, 6:] = False, False
    signal = replace(motion.signals[0], mask=mask)
    purpose = "Gaps of some channels."
    held = replace(motion, signals=(signal,))
    shelf.hold("masks", f"{HEADING}; Masks", purpose, file_with(plan, held), held)
