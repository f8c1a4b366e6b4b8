"""Contacts of posewave: feet keep their place, points that cannot, refusals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import mcz
from mcz.codecs import codec_by_name
from mcz.codecs.posewave.contact_choice import choose_contacts, parse_runs, runs_of
from mcz.codecs.posewave.contact_plan import Contacts, parse_contacts
from mcz.codecs.posewave.contacts import ContactTracker, Outcome, Piece
from mcz.errors import ContactWarning, MotionError, OptionError
from mcz.files.writing.signal_source import MemorySource
from mcz.kinematics.points import first_points, positions_of
from mcz.model.motion import Channel, Joint, Motion, Signal, Skeleton
from tests.codecs.lossy import Direct, amc

Runs = Sequence[tuple[str, int, int]]

TOLERANCE = 0.01  # cm
TURNS = tuple(Channel(kind) for kind in ("rz", "rx", "ry"))
MOVES = tuple(Channel(kind) for kind in ("tx", "ty", "tz"))


def biped(angle_unit: str = "deg") -> Skeleton:
    """Hips and two legs of thigh, shin, foot and toe."""
    joints = [Joint("hips", channels=MOVES + TURNS)]
    for side, x in (("Left", 3.0), ("Right", -3.0)):
        hips = len(joints)
        joints += [
            Joint(f"{side}UpLeg", 0, (x, -1.0, 0.2), channels=TURNS),
            Joint(f"{side}Leg", hips, (0.0, -20.0, 0.0), channels=TURNS),
            Joint(f"{side}Foot", hips + 1, (0.0, -20.0, -1.0), channels=TURNS),
            Joint(f"{side}Toe", hips + 2, (0.0, -3.0, 6.0), ((0.0, 0.0, 3.0),), channels=TURNS),
        ]
    return Skeleton(tuple(joints), unit_cm=2.0, angle_unit=angle_unit)


def walk_motion(n_frames: int = 150, seed: int = 0, angle_unit: str = "deg") -> Motion:
    """Knees bent, all channels smooth, some noise."""
    skeleton = biped(angle_unit)
    random = np.random.default_rng(seed)
    time = np.arange(n_frames)[:, None] / 40
    n = skeleton.n_channels
    values = 12 * np.sin(time * random.uniform(0.5, 3, n) + random.uniform(0, 6, n))
    values += random.normal(0, 0.2, values.shape)
    for side in ("Left", "Right"):
        values[:, skeleton.columns(skeleton.find(f"{side}Leg"))[1]] += 45
    if skeleton.angle_unit == "rad":
        values[:, 3:] *= np.pi / 180
    return Motion(skeleton, (Signal(values),), frame_rate=Fraction(120), name="walk")


def errors_cm(motion: Motion, found: np.ndarray, runs: Runs) -> np.ndarray:
    """Greatest error of displacements from the first frame of each run, (n_runs,)."""
    skeleton = motion.skeleton
    names, firsts = skeleton.addresses(), first_points(skeleton)
    off = positions_of(skeleton, found) - positions_of(skeleton, np.asarray(motion.values))
    greatest = []
    for name, first, count in runs:
        own = off[first : first + count, firsts[names.index(name)]]
        greatest.append(np.linalg.norm(own - own[0], axis=1).max() * (skeleton.unit_cm or 1.0))
    return np.array(greatest)


RUNS = ("LeftFoot", 5, 40), ("RightFoot", 30, 60), ("LeftFoot", 50, 3), ("LeftFoot", 60, 90)


@pytest.mark.parametrize("step", [0.03, 0.3])
@pytest.mark.parametrize("unit", ["deg", "rad"])
def test_feet_keep_their_places(step: float, unit: str) -> None:
    motion = walk_motion(angle_unit=unit)
    coded = Direct("posewave", motion, step=step, contacts=RUNS, contact_tolerance=TOLERANCE)
    decoded = coded.read()
    assert errors_cm(motion, decoded, RUNS).max() <= TOLERANCE
    without = Direct("posewave", motion, step=step)
    assert errors_cm(motion, without.read(), RUNS).min() > TOLERANCE
    # No point is farther off than without contacts, or hardly.
    source = positions_of(motion.skeleton, np.asarray(motion.values))
    off, usual = (
        np.linalg.norm(positions_of(motion.skeleton, values) - source, axis=2)
        for values in (decoded, without.read())
    )
    assert off.mean() < usual.mean() and off.max() < 1.5 * usual.max()
    # Coarser requests know nothing of contacts.
    assert np.array_equal(coded.read(resolution=1), without.read(resolution=1))


@pytest.mark.parametrize(("step", "tolerance"), [(0.005, 0.01), (0.02, 0.02), (0.3, 0.05)])
def test_the_tolerance_follows_the_step(step: float, tolerance: float) -> None:
    motion = walk_motion()
    coded = Direct("posewave", motion, step=step, contacts=RUNS)
    stated = Direct("posewave", motion, step=step, contacts=RUNS, contact_tolerance=tolerance)
    assert np.array_equal(coded.read(), stated.read())
    assert errors_cm(motion, coded.read(), RUNS).max() <= tolerance


@settings(max_examples=12)
@given(st.integers(0, 10**6), st.sampled_from([0.02, 0.2]), st.sampled_from([0.003, 0.02, 0.1]))
def test_whatever_runs(seed: int, step: float, tolerance: float) -> None:
    random = np.random.default_rng(seed)
    motion = walk_motion(100, seed)
    runs = [
        (str(random.choice(["LeftFoot", "RightFoot"])), int(first), int(random.integers(1, 30)))
        for first in random.integers(0, 70, random.integers(1, 6))
    ]
    coded = Direct("posewave", motion, step=step, contacts=runs, contact_tolerance=tolerance)
    # Runs that touch count as one; each still keeps its displacement, to twice the tolerance.
    assert errors_cm(motion, coded.read(), runs).max() <= 2 * tolerance


def test_contacts_go_on_across_segments() -> None:
    motion = walk_motion(400)
    runs = ("LeftFoot", 5, 300), ("RightFoot", 120, 250)
    coded = Direct(
        "posewave", motion, step=0.2, contacts=runs, contact_tolerance=TOLERANCE, segment_frames=64
    )
    assert len(coded.segments) == 7
    decoded = coded.read()
    assert errors_cm(motion, decoded, runs).max() <= TOLERANCE
    assert np.array_equal(coded.read(150, 260), decoded[150:260])


def test_two_points_of_a_foot() -> None:
    """The toe's second contact begins and ends within one of its foot, the first does not."""
    motion = walk_motion()
    runs = ("LeftFoot", 5, 60), ("LeftToe", 40, 60), ("LeftToe", 110, 30), ("LeftFoot", 80, 10)
    coded = Direct("posewave", motion, step=0.2, contacts=runs, contact_tolerance=TOLERANCE)
    assert errors_cm(motion, coded.read(), runs).max() <= TOLERANCE


@pytest.mark.real
@pytest.mark.parametrize("name", ["16_02", "05_01"])
def test_real_clips(name: str, data: Path) -> None:
    motion = amc(data, name)
    coded = Direct("posewave", motion, step=0.1, contacts="auto", contact_tolerance=TOLERANCE)
    runs = runs_of(MemorySource(motion, 0, coded.codec, 2**26), "auto")
    assert [run[:3] for run in runs] == [
        (run.joint, run.first, run.n_frames) for run in mcz.contacts(motion).runs
    ]
    decoded = coded.read()
    assert errors_cm(motion, decoded, runs).max() <= TOLERANCE
    usual = Direct("posewave", motion, step=0.1)
    n_frames = sum(count for _, _, count in runs)
    assert coded.n_bytes - usual.n_bytes < 1.75 * n_frames
    source = positions_of(motion.skeleton, np.asarray(motion.values))
    off, before = (
        np.linalg.norm(positions_of(motion.skeleton, values) - source, axis=2)
        for values in (decoded, usual.read())
    )
    assert off.mean() < before.mean() and off.max() <= 1.25 * before.max()


def test_contacts_are_found_of_joints_by_name() -> None:
    motion = walk_motion(1100)
    values = np.array(motion.values)
    values[500:] = values[500]
    still = replace(motion, signals=(Signal(values),))
    source = MemorySource(still, 0, codec_by_name("posewave"), 2**26)
    found = runs_of(source, "auto")
    assert {run[0] for run in found} <= {"LeftFoot", "RightFoot", "LeftToe", "RightToe"}
    assert max(first + count for _, first, count in found) == 1100
    some = runs_of(source, (("RightFoot", 0, 0), ("LeftToe", 7, 3)))
    assert set(some) == {run for run in found if run[0] == "RightFoot"} | {("LeftToe", 7, 3)}


def test_no_contacts_cost_a_byte() -> None:
    motion = walk_motion()
    coded = Direct("posewave", motion, step=0.1, contacts=())
    assert coded.header == Direct("posewave", motion, step=0.1).header
    assert coded.header.endswith(b"\0")


def contacts_of(skeleton: Skeleton, *points: tuple[int, int], rounds: int = 4) -> Contacts:
    """Contacts of points by joint and tail, steps of 0.01."""
    fields = [Named(joint=j, tail=t, step=0.01, follows=0) for j, t in points]
    found = parse_contacts([Named(rounds=rounds, ramp=5, points=fields)], skeleton, "test")
    assert found is not None
    return found


class Named:
    """A parser's result."""

    def __init__(self, **fields: object) -> None:
        self.__dict__.update(fields)


def test_runs_that_cannot_be() -> None:
    for wrong in ("", "lfoot,", "lfoot:-1+2,", 7, [(1, 2)], [("a", -1, 2)], [("a", 3, 0)]):
        with pytest.raises(OptionError, match="contacts"):
            parse_runs(wrong)
    assert parse_runs("a:1+2, b:c:3+4") == (("a", 1, 2), ("b:c", 3, 4))
    assert parse_runs("m:LeftFoot,b") == (("m:LeftFoot", 0, 0), ("b", 0, 0))
    with pytest.raises(OptionError, match="no joint is called 'nobody'"):
        choose_contacts(biped(), [("nobody", 0, 5)], 0.01, None)
    with pytest.raises(OptionError, match="contacts: 9 joints are more than 8"):
        names = list(biped().addresses())
        choose_contacts(biped(), [(name, 0, 5) for name in names], 0.01, None)
    for contacts in ("LeftFoot:149+2", "LeftFoot,RightFoot:0+151"):
        with pytest.raises(OptionError, match="ends after the last of 150 frames"):
            Direct("posewave", walk_motion(), contacts=contacts)
    with pytest.raises(OptionError, match="no joint is called 'nobody'"):
        Direct("posewave", walk_motion(), contacts="nobody")


def test_skeletons_without_a_unit() -> None:
    motion = walk_motion()
    for change in ({"unit_cm": None}, {"angle_unit": ""}):
        other = replace(motion, skeleton=replace(motion.skeleton, **change))
        for contacts in ("auto", RUNS):
            with pytest.raises(OptionError, match="unknown"):
                Direct("posewave", other, step=0.1, contacts=contacts)


def test_a_skeleton_without_feet() -> None:
    motion = walk_motion()
    joints = tuple(replace(j, name=f"bone {n}") for n, j in enumerate(motion.skeleton.joints))
    other = replace(motion, skeleton=replace(motion.skeleton, joints=joints))
    with pytest.raises(OptionError, match="no joint .* is named like a foot"):
        Direct("posewave", other, step=0.1, contacts="auto")


def test_a_tolerance_that_is_too_small() -> None:
    motion = walk_motion()
    values = np.array(motion.values)
    values[:, :3] *= 1000
    far = replace(motion, signals=(Signal(values),))
    with pytest.raises(
        MotionError, match="on a point moves or is off by more than 2.30 steps of its grid"
    ):
        Direct("posewave", far, step=1.0, contacts=RUNS, contact_tolerance=1e-6)


def test_what_cannot_be_held_is_said() -> None:
    skeleton = biped()
    keeper = ContactTracker(0.01, outcomes=[Outcome(Piece(0, 10, 5, 10, 0), np.full((5, 3), 0.02))])
    with pytest.warns(ContactWarning, match="LeftFoot .* 1 contacts; .* 0.0346 .* 10 to 14"):
        keeper.warn(skeleton, contacts_of(skeleton, (3, 0)))
