"""Contacts: names of feet, the rule of SPEC.md beside a plain reading of it, guesses, errors."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import mcz
from mcz import (
    Channel,
    Contact,
    Contacts,
    Joint,
    Motion,
    MotionError,
    OptionError,
    Signal,
    Skeleton,
    contacts,
)
from mcz.kinematics.contacts import find_runs, frames_in, speeds
from mcz.kinematics.joint_names import is_foot
from tests.motions import POSITIONS

FEET = (
    *("lfoot", "rtoes", "LeftFoot", "RightToeBase", "lFoot", "LeftToes", "RightAnkle", "LEFT_FOOT"),
    *("Foot_L", "Toes_R", "foot.L", "CC_Base_L_ToeBase", "Bip01 R Foot", "Bip01 L Toe0"),
    *("mixamorig:LeftFoot", "mixamorig:RightToe_Base", "LHEE", "RTOE", "Matt:LTOE", "r heel"),
    *("R.Ankle", "ball_l", "L_Foot", "RightForeFoot", "  left foot "),
)
OTHERS = (
    *("", "lfemur", "foot", "toes", "LeftHand", "LeftFootIndex", "CurlToe", "Ballon_l", "rtibia"),
    *("CC_Base_L_BigToe1", "lfoot end", "Left", "lThumb1", "heels", "leftover"),
)


@pytest.mark.parametrize("name", FEET)
def test_names_of_feet(name: str) -> None:
    assert is_foot(name)


@pytest.mark.parametrize("name", OTHERS)
def test_names_of_others(name: str) -> None:
    assert not is_foot(name)


def markers(names: str, places: np.ndarray, **changes: object) -> Motion:
    """Markers of these names; ``places`` in cm, (frames, markers, 3)."""
    joints = tuple(Joint(name, channels=POSITIONS) for name in names.split())
    arguments = {"unit_cm": 1.0, "angle_unit": "", "up_axis": "y"} | changes
    rate = arguments.pop("frame_rate", Fraction(120))
    signal = Signal(np.array(places, np.float64).reshape(len(places), 3 * len(joints)))
    return Motion(Skeleton(joints, **arguments), (signal,), frame_rate=rate)


def steps(*frames: int, cm: float = 40.0) -> np.ndarray:
    """A foot that stands and moves ahead by turns, in so many frames each, (frames, 3)."""
    x, y, at = [], [], 0.0
    for turn, n in enumerate(frames):
        t = np.arange(n) / n
        moves = turn % 2
        x.append(at + moves * cm * (t - np.sin(2 * np.pi * t) / (2 * np.pi)))
        y.append(moves * 10 * np.sin(np.pi * t) ** 2)
        at += moves * cm
    return np.stack([np.concatenate(x), np.concatenate(y), np.zeros(sum(frames))], axis=1)


def test_a_foot_stands_between_its_steps() -> None:
    track = steps(60, 60, 60, 60, 60)
    found = contacts(markers("lfoot body", np.stack([track, track + np.array([0, 90, 0])], axis=1)))
    assert found.joints == ("lfoot",)
    assert [run.joint for run in found.runs] == ["lfoot"] * 3
    for run, first in zip(found.runs, (0, 120, 240), strict=True):
        assert abs(run.first - first) <= 10
        assert abs(run.first + run.n_frames - min(first + 60, 300)) <= 10
    standing = found.frames("lfoot")
    assert standing.sum() == sum(run.n_frames for run in found.runs)
    assert standing[[10, 150, 290]].all() and not standing[[90, 210]].any()
    with pytest.raises(MotionError, match="joint 'body' is not among the examined feet: lfoot"):
        found.frames("body")


def test_what_is_unknown_does_not_stand() -> None:
    track = np.zeros((100, 3))
    track[40:60, 0] = np.nan
    assert list(find_runs(track, 120.0, 1)) == [(0, 38), (62, 38)]
    assert list(find_runs(np.full((50, 3), np.nan), 120.0, 1)) == []
    track[50] = [np.inf, 1e308, 0]
    assert list(find_runs(track, 120.0, 1)) == [(0, 38), (62, 38)]


@pytest.mark.parametrize("n_frames", [0, 1, 2, 11, 12])
def test_clips_of_few_frames(n_frames: int) -> None:
    found = contacts(markers("lfoot", np.zeros((n_frames, 1, 3))))
    assert found.n_frames == n_frames
    assert found.runs == ((Contact("lfoot", 0, 12),) if n_frames == 12 else ())


def test_feet_of_the_caller() -> None:
    motion = markers("a b lfoot", np.zeros((60, 3, 3)))
    assert contacts(motion, ["b", 0]).joints == ("b", "a")
    assert contacts(motion, [1, "b"]).runs == (Contact("b", 0, 60),)
    with pytest.raises(MotionError, match="no joint 'c'"):
        contacts(motion, ["c"])
    with pytest.raises(MotionError, match="none of its 1 joint is named like a foot"):
        contacts(markers("a", np.zeros((60, 1, 3))))


@pytest.mark.parametrize(
    "run", [Contact("b", 0, 5), Contact("a", 6, 5), Contact("a", -1, 5), Contact("a", 3, 0)]
)
def test_runs_lie_in_what_was_looked_at(run: Contact) -> None:
    with pytest.raises(MotionError, match="does not fit 10 frames of"):
        Contacts((run,), ("a",), 10)
    assert Contacts((Contact("a", 5, 5),), ("a",), 10).frames("a").sum() == 5


def test_what_nobody_says_is_guessed_and_said() -> None:
    track = steps(60, 60, 60)
    places = np.stack([track, track + np.array([0, 90, 5])], axis=1)
    known = contacts(markers("lfoot body", places))
    assert (known.up_axis, known.up_guessed, known.rate_assumed) == ("y", False, False)
    for axis, turn in (("x", [1, 0, 2]), ("y", [0, 1, 2]), ("z", [0, 2, 1])):
        motion = markers("lfoot body", places[..., turn], up_axis="", frame_rate=None)
        found = contacts(motion)
        assert (found.up_axis, found.up_guessed) == (axis, True)
        assert (found.frame_rate, found.rate_assumed) == (120.0, True)
        assert found.runs == known.runs
    upside_down = contacts(markers("lfoot body", places * [1, -1, -1], up_axis="-y"))
    assert (upside_down.up_axis, upside_down.runs) == ("-y", known.runs)
    nothing = contacts(markers("lfoot", np.full((20, 1, 3), np.nan), up_axis=""))
    assert (nothing.up_axis, nothing.runs) == ("y", ())


def test_what_has_no_contacts_is_refused() -> None:
    with pytest.raises(OptionError, match="length unit of the skeleton is unknown.*unit="):
        contacts(markers("lfoot", np.zeros((9, 1, 3)), unit_cm=None))
    joint = Joint("lfoot", channels=(Channel("rx"),))
    turning = Motion(
        Skeleton((joint,), unit_cm=1.0, angle_unit=""), (Signal(np.zeros((3, 1))),), Fraction(30)
    )
    with pytest.raises(MotionError, match="angle unit .*is unknown"):
        contacts(turning)
    own = Signal(np.zeros((9, 1)), channels=(Channel("", "emg", "V"),))
    with pytest.raises(MotionError, match="differ from those of its skeleton"):
        contacts(replace(markers("lfoot", np.zeros((9, 1, 3))), signals=(own,)))


def test_rows_beside_the_first_of_a_frame_do_not_count() -> None:
    track = steps(60, 60, 60)
    motion = markers("lfoot", track[:, None])
    doubled = np.repeat(motion.values, 2, axis=0)
    doubled[1::2] += 1000
    twice = replace(motion, signals=(Signal(doubled, samples_per_frame=2),))
    assert contacts(twice) == contacts(motion)


def test_blocks_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    motion = markers("lfoot body", np.stack([steps(60, 60, 60)] * 2, axis=1), up_axis="")
    whole = contacts(motion)
    monkeypatch.setattr("mcz.kinematics.contacts.BLOCK", 100)
    assert contacts(motion) == whole


# The rule, as docs/guides/contacts.md, says it


def by_definition(p: np.ndarray, rate: float, up: int) -> list[tuple[int, int]]:
    def frames(t: Fraction) -> int:
        return int(np.floor(float(t) * rate + 0.5))

    n, w = len(p), max(1, frames(Fraction(1, 60)))
    known = [bool(np.isfinite(x).all()) for x in p]
    heights = sorted(x[up] for x, k in zip(p, known, strict=True) if k)
    if not heights:
        return []
    at = (len(heights) - 1) / 20
    low, part = int(at), at - int(at)
    floor = heights[low] + part * (heights[min(low + 1, len(heights) - 1)] - heights[low])
    surely, perhaps = [False] * n, [False] * n
    for f in range(n):
        a, b = max(0, f - w), min(n - 1, f + w)
        if a == b or not (known[a] and known[b] and known[f]):
            continue
        speed = float(np.linalg.norm(p[b] - p[a])) * rate / (b - a)
        surely[f] = speed < 15 and p[f][up] - floor < 6
        perhaps[f] = speed < 30 and p[f][up] - floor < 8
    runs: list[list[int]] = []
    for f in range(n):
        if perhaps[f]:
            if runs and runs[-1][1] == f:
                runs[-1][1] = f + 1
            else:
                runs.append([f, f + 1])
    joined: list[list[int]] = []
    for first, stop in runs:
        gap = range(joined[-1][1], first) if joined else range(0)
        if joined and len(gap) <= frames(Fraction(1, 40)) and all(known[f] for f in gap):
            joined[-1][1] = stop
        else:
            joined.append([first, stop])
    least = max(2, frames(Fraction(1, 10)))
    return [(a, b - a) for a, b in joined if b - a >= least and any(surely[a:b])]


@st.composite
def tracks(draw: st.DrawFn) -> tuple[np.ndarray, float]:
    """A walk at random that stands now and then, with gaps, and a frame rate."""
    rate = draw(st.sampled_from([24.0, 30.0, 60.0, 100.0, 120.0, 240.0, 29.97]))
    seed = draw(st.integers(0, 2**32 - 1))
    rng = np.random.default_rng(seed)
    pieces = draw(st.lists(st.tuples(st.integers(1, 40), st.integers(0, 60)), max_size=8))
    speed = np.concatenate([np.zeros(0)] + [np.full(n, float(v)) for n, v in pieces])
    moves = rng.normal(0, 1, (len(speed), 3)) * speed[:, None] / rate
    track = np.cumsum(moves, axis=0)
    track[rng.random(len(track)) < draw(st.sampled_from([0, 0.02, 0.2]))] = np.nan
    return track, rate


@given(tracks(), st.integers(0, 2))
def test_the_rule(track: tuple[np.ndarray, float], up: int) -> None:
    assert list(find_runs(*track, up)) == by_definition(*track, up)


@given(tracks())
def test_units_do_not_matter(track: tuple[np.ndarray, float]) -> None:
    places, rate = track
    motion = markers("rtoes", places[:, None], frame_rate=Fraction(rate))
    small = replace(motion.skeleton, unit_cm=0.25)
    in_quarters = replace(motion.with_values(motion.values * 4), skeleton=small)
    assert contacts(in_quarters) == contacts(motion)


def test_speeds() -> None:
    track = np.zeros((9, 3))
    track[:, 0] = np.arange(9)
    assert np.allclose(speeds(track, 120.0, 1 / 30), 120)
    assert np.allclose(speeds(track, 30.0, 1 / 30), 30)
    assert [frames_in(1 / 60, rate) for rate in (24, 30, 60, 120, 240)] == [0, 1, 1, 2, 4]


@pytest.mark.real
@pytest.mark.parametrize(
    ("clip", "n_steps", "share"),
    [("02_01", 3, 0.55), ("05_01", 5, 0.6), ("16_01", 2, 0.8), ("16_02", 2, 0.85)],
)
def test_real_walks_and_jumps(data: Path, clip: str, n_steps: int, share: float) -> None:
    """Both feet stand as often as they step, somewhat more than half of the time of a walk."""
    motion = mcz.read(data / f"cmu/amc/{clip}.amc")
    found = contacts(motion)
    assert found.joints == ("lfoot", "ltoes", "rfoot", "rtoes")
    assert (found.up_axis, found.up_guessed, found.rate_assumed) == ("y", True, True)
    assert sum(run.joint == "lfoot" for run in found.runs) == n_steps
    standing = [found.frames(joint).mean() for joint in ("lfoot", "rfoot")]
    assert np.mean(standing) == pytest.approx(share, abs=0.1)
    assert (found.frames("lfoot") | found.frames("rfoot")).mean() > (0.9 if n_steps > 2 else 0.75)


@pytest.mark.real
def test_real_flavours_of_bvh(data: Path) -> None:
    for name, up, n_feet in (
        ("cmu/bvh/02_01.bvh", "y", 4),
        ("cmu/bvh-3dsmax/131_01.bvh", "y", 4),
        ("cmu/bvh-daz/02_01.bvh", "y", 2),
        ("cmu/bvh-iclone/005_01.bvh", "y", 4),
        ("other/bandai-namco/dataset-2_walk_active_029.bvh", "y", 4),
        ("other/xia-style/neutral_01_000.bvh", "y", 4),
        ("other/bvh-viewer/Run.bvh", "z", 4),
        ("cmu/bvh-blender/01-01 v01.bvh", "z", 4),
    ):
        if (data / name).exists():
            decoded = contacts(mcz.read(data / name, unit="cm"))
            assert (decoded.up_axis, len(decoded.joints)) == (up, n_feet), name
            assert decoded.runs, name
