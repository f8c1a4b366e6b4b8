"""Contacts of codec 13: feet keep their place, limbs that cannot, and hostile bytes."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import mcz
from mcz.codecs import by_name
from mcz.codecs.posewave.contact_choice import choose_contacts, parse_runs, runs_of
from mcz.codecs.posewave.contact_keeper import Keeper, Outcome, Piece
from mcz.codecs.posewave.contact_kernels import GREATEST_TURN, correct, place
from mcz.codecs.posewave.contact_plan import Contacts, Limb, make_limb
from mcz.codecs.posewave.contacts import decode_contacts
from mcz.codecs.posewave.rows import Stream
from mcz.codecs.posewave.skeleton_plan import Plan, make_plan
from mcz.coding.mixing import SQUASH
from mcz.errors import ContactWarning, FormatError, OptionError
from mcz.kinematics.points import first_points, positions_of
from mcz.motion import Channel, Joint, Motion, Signal, Skeleton
from mcz.writing.signal_source import MemorySource
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


def walking(n_frames: int = 150, seed: int = 0, angle_unit: str = "deg") -> Motion:
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
    """How far displacements from the first frame of each run are off, at most, (n_runs,)."""
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
    motion = walking(angle_unit=unit)
    coded = Direct("posewave", motion, step=step, contacts=RUNS)
    assert errors_cm(motion, coded.read(), RUNS).max() <= TOLERANCE
    without = Direct("posewave", motion, step=step)
    assert errors_cm(motion, without.read(), RUNS).min() > TOLERANCE
    # Coarser requests know nothing of contacts.
    assert np.array_equal(coded.read(resolution=1), without.read(resolution=1))


@settings(max_examples=12)
@given(st.integers(0, 10**6), st.sampled_from([0.02, 0.2]), st.sampled_from([0.003, 0.02, 0.1]))
def test_whatever_runs(seed: int, step: float, tolerance: float) -> None:
    random = np.random.default_rng(seed)
    motion = walking(100, seed)
    runs = [
        (str(random.choice(["LeftFoot", "RightFoot"])), int(first), int(random.integers(1, 30)))
        for first in random.integers(0, 70, random.integers(1, 6))
    ]
    coded = Direct("posewave", motion, step=step, contacts=runs, contact_tolerance=tolerance)
    # Runs that touch count as one; each still keeps its displacement, to twice the tolerance.
    assert errors_cm(motion, coded.read(), runs).max() <= 2 * tolerance


def test_contacts_go_on_across_segments() -> None:
    motion = walking(400)
    runs = ("LeftFoot", 5, 300), ("RightFoot", 120, 250)
    coded = Direct("posewave", motion, step=0.2, contacts=runs, segment_frames=64)
    assert len(coded.segments) == 7
    found = coded.read()
    assert errors_cm(motion, found, runs).max() <= TOLERANCE
    assert np.array_equal(coded.read(150, 260), found[150:260])


def test_two_points_of_a_foot() -> None:
    motion = walking()
    runs = ("LeftFoot", 5, 60), ("LeftToe", 40, 60), ("LeftToe", 110, 30), ("LeftFoot", 80, 10)
    coded = Direct("posewave", motion, step=0.2, contacts=runs)
    assert errors_cm(motion, coded.read(), runs).max() <= TOLERANCE


@pytest.mark.parametrize("name", ["16_02", "05_01"])
def test_real_clips(name: str, data: Path) -> None:
    motion = amc(data, name)
    coded = Direct("posewave", motion, step=0.1, contacts="feet")
    runs = runs_of(MemorySource(motion, 0, coded.codec, 2**26), "feet")
    assert {run[0] for run in runs} == {"lfoot", "rfoot"}
    assert errors_cm(motion, coded.read(), runs).max() <= TOLERANCE
    usual = Direct("posewave", motion, step=0.1)
    n_frames = sum(count for _, _, count in runs)
    assert coded.n_bytes - usual.n_bytes < 2 * n_frames


def test_feet_of_a_long_clip_are_found() -> None:
    motion = walking(1100)
    values = np.array(motion.values)
    values[500:] = values[500]
    still = replace(motion, signals=(Signal(values),))
    source = MemorySource(still, 0, by_name("posewave"), 2**26)
    found = runs_of(source, "feet")
    assert {run[0] for run in found} <= {"LeftFoot", "RightFoot"}
    assert max(first + count for _, first, count in found) == 1100


def test_no_contacts_cost_a_byte() -> None:
    motion = walking(angle_unit="deg")
    motion = replace(motion, frame_rate=Fraction(30))
    coded = Direct("posewave", motion, step=0.1, contacts=())
    assert coded.header == Direct("posewave", motion, step=0.1).header


def leg(bend: float) -> tuple[Plan, Limb, np.ndarray]:
    """A leg of 40, its knee bent by ``bend`` degrees, as plan, limb and a frame."""
    skeleton = biped()
    plan = make_plan(
        skeleton, np.ones(skeleton.n_channels, np.bool_), np.ones(skeleton.n_channels), radius=1.0
    )
    columns = [*skeleton.columns(1), *skeleton.columns(2)]
    values = np.zeros((1, skeleton.n_channels))
    values[0, skeleton.columns(2)[1]] = bend
    return plan, make_limb(skeleton, 3, 0, columns, "test"), values


@pytest.mark.parametrize("bend", [0.0, 1e-9, 1e-3, 0.5, 5.0, 90.0, 180.0])
@pytest.mark.parametrize("way", [(0.0, -1.0, 0.0), (0.0, 1.0, 0.0), (1e12, 1.0, 0.0)])
def test_a_stretched_leg_stays_bounded(bend: float, way: tuple[float, ...]) -> None:
    plan, limb, values = leg(bend)
    there = np.empty((1, 3))
    place(plan, limb, values, 0, there)
    before = values.copy()
    fades = np.zeros((2, len(limb.columns)))
    correct(plan, limb, values, 0, there + np.array(way), 16, fades)
    assert np.abs(values - before).max() <= GREATEST_TURN * 180 / np.pi + 1e-9
    assert np.array_equal(np.delete(values, limb.columns), np.delete(before, limb.columns))


def test_corrections_are_small_and_smooth() -> None:
    plan, limb, values = leg(20.0)
    values = np.repeat(values, 50, axis=0)
    there = np.empty((50, 3))
    place(plan, limb, values, 0, there)
    before = values.copy()
    turns = np.linspace(0, 3, 50)
    wanted = there + 0.1 * np.stack([np.sin(turns), np.cos(turns) - 1, np.sin(2 * turns)], axis=1)
    correct(plan, limb, values, 0, wanted, 6, np.zeros((2, 6)))
    place(plan, limb, values, 0, there)
    assert np.abs(there - wanted).max() < 1e-6
    assert np.abs(values - before).max() < 4.0
    assert np.abs(np.diff(values - before, 2, axis=0)).max() < 0.05


def test_a_limb_without_angles_does_nothing() -> None:
    skeleton = biped(angle_unit="")
    n = skeleton.n_channels
    plan = make_plan(skeleton, np.ones(n, np.bool_), np.ones(n), radius=1.0)
    limb = make_limb(skeleton, 3, 0, [*skeleton.columns(1)], "test")
    values = np.zeros((2, n))
    correct(plan, limb, values, 0, np.ones((2, 3)), 4, np.zeros((2, 3)))
    assert not values.any()


def test_limbs_that_no_skeleton_has() -> None:
    skeleton = biped()
    for joint, tail, columns in (
        (99, 0, [6, 7, 8]),
        (4, 2, [6, 7, 8]),
        (3, 0, [0, 1, 2]),
        (3, 0, [8, 7]),
        (3, 0, [6, 6]),
        (3, 0, [18, 19]),
    ):
        with pytest.raises(FormatError, match="test: "):
            make_limb(skeleton, joint, tail, columns, "test")


def test_runs_that_cannot_be() -> None:
    moving = np.ones(biped().n_channels, np.bool_)
    for wrong in ("lfoot", "lfoot:3", "lfoot:x+1", "lfoot:-1+2", "lfoot:1+0", 7, [(1, 2)]):
        with pytest.raises(OptionError, match="contacts"):
            parse_runs(wrong)
    assert parse_runs("a:1+2,b:c:3+4") == (("a", 1, 2), ("b:c", 3, 4))
    for name in ("nobody", "hips", "LeftUpLeg"):
        with pytest.raises(OptionError, match="contacts"):
            choose_contacts(biped(), [(name, 0, 5)], 0.01, moving)
    with pytest.raises(OptionError, match="beyond 150 frames"):
        Direct("posewave", walking(), contacts="LeftFoot:149+2")


def test_what_cannot_be_held_is_said() -> None:
    skeleton = biped()
    limb = make_limb(skeleton, 3, 0, [6, 7, 8], "test")
    keeper = Keeper(0.01, outcomes=[Outcome(Piece(0, 10, 5, 10), 0.02)])
    with pytest.warns(ContactWarning, match="LeftFoot .* 1 contacts; .* 0.02 .* 10 to 14"):
        keeper.warn(skeleton, Contacts(4, (limb,), (0.01,)))


@pytest.mark.parametrize("seed", range(6))
def test_hostile_bytes(seed: int) -> None:
    motion = walking(80)
    coded = Direct("posewave", motion, step=0.2, contacts="LeftFoot:5+40,RightFoot:20+60")
    random = np.random.default_rng(seed)
    finest = coded.places()[-1]
    stream = coded.stream(*finest)
    for _ in range(20):
        data = bytearray(stream)
        for at in random.integers(len(data) // 2, len(data), random.integers(1, 20)):
            data[at] = int(random.integers(256))
        try:
            coded.read(changes=coded.with_stream(finest, bytes(data)))  # checks that all is finite
        except FormatError:
            continue
    for extra in (b"\0", b"\1"):
        with pytest.raises(FormatError, match="too many"):
            coded.read(changes=coded.with_stream(finest, stream + extra))


def bits_of_contacts() -> str:
    """What a stream of contacts alone has, and what comes of it."""
    motion = walking(60)
    skeleton, source = motion.skeleton, np.asarray(motion.values)
    n = skeleton.n_channels
    plan = make_plan(skeleton, np.ones(n, np.bool_), np.ones(n), radius=1.0)
    runs = ("LeftFoot", 3, 20), ("LeftToe", 10, 20), ("RightFoot", 20, 40)
    wanted = choose_contacts(skeleton, runs, 0.01, np.ones(n, np.bool_))
    limbs = wanted.fields["limbs"]
    contacts = Contacts(
        wanted.fields["rounds"],
        tuple(make_limb(skeleton, x["joint"], x["tail"], x["columns"], "test") for x in limbs),
        tuple(x["step"] for x in limbs),
    )
    rough = np.round(source, 0)
    values = rough.copy()
    stream = Stream(np.zeros(SQUASH, np.int64), 20000, None)
    keeper = Keeper(0.01, wanted.pieces)
    keeper.encode(contacts, plan, stream, source, values)
    assert max(outcome.error for outcome in keeper.outcomes) <= 0.01
    data = stream.finish()
    again = Stream(np.zeros(SQUASH, np.int64), 0, data)
    decode_contacts(contacts, plan, again, rough, "test")
    again.check_whole("test")
    assert np.array_equal(rough, values)
    return f"{data.hex()} {values.tobytes().hex()}"


def test_interpreted_loops_give_the_same_bits() -> None:
    program = "from tests.codecs.test_posewave_contacts import bits_of_contacts as b; print(b())"
    done = subprocess.run(
        [sys.executable, "-c", program],
        cwd=Path(__file__).parents[2],
        env={**os.environ, "MCZ_LOOPS": "interpreted"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.strip() == bits_of_contacts()


def test_a_file(tmp_path: Path) -> None:
    motion = walking()
    path = tmp_path / "walk.mcz"
    mcz.write(motion, path, codec="posewave", step=0.1, contacts="LeftFoot:5+40")
    found = np.asarray(mcz.read(path).values)
    assert errors_cm(motion, found, [("LeftFoot", 5, 40)]).max() <= TOLERANCE
