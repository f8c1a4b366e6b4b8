"""Foot sliding: known values, given contacts, gaps, real clips."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import mcz
from mcz import MotionError, Signal
from tests.test_contacts import markers, steps

SHIFTS = st.lists(st.integers(-1000, 1000), min_size=3, max_size=3)


def walk() -> tuple[mcz.Motion, np.ndarray]:
    """Three times 60 frames in which a foot stands still, in between it moves; a body above."""
    track = steps(60, 60, 60, 60, 60)
    places = np.stack([track, track + np.array([0, 90, 0])], axis=1)
    return markers("lfoot body", places), places


def test_without_any_error_nothing_slides() -> None:
    motion, _ = walk()
    comparison = mcz.compare(motion, motion, contacts=True)
    assert comparison.sliding is not None
    sliding = comparison.sliding
    assert sliding.contacts == mcz.contacts(motion)
    assert (sliding.mean_mm, sliding.max_mm) == (0, 0)
    assert sliding.path_mm == sliding.path_original_mm
    entries = comparison.entries()
    assert (entries["contacts"], entries["slide_max_mm"]) == (3, 0)
    assert entries["contact_frames"] == sum(slide.n_frames for slide in sliding.slides)
    assert mcz.compare(motion, motion).sliding is None
    assert mcz.compare(motion, motion).entries()["contacts"] is None


def test_a_slide_by_hand() -> None:
    """Still for 61 frames; the decoded foot moves ahead by 0.1 mm a frame, from 5 cm aside."""
    still = np.zeros((61, 1, 3))
    moved = still + np.array([5.0, 0, 0])
    moved[:, 0, 2] += np.arange(61) * 0.01
    comparison = mcz.compare(
        markers("lfoot", still), markers("lfoot", moved), contacts=True
    ).sliding
    (slide,) = comparison.slides
    assert (slide.joint, slide.first, slide.n_frames) == ("lfoot", 0, 61)
    assert slide.mean_mm == comparison.mean_mm == pytest.approx(0.1 * 61 / 2)
    assert slide.max_mm == comparison.max_mm == pytest.approx(6.0)
    assert (slide.path_mm, slide.path_original_mm) == (pytest.approx(6.0), 0)
    assert comparison.where == (60, "lfoot")
    assert comparison.entries()["slide_max_frame"] == 60


@given(SHIFTS, st.sampled_from([0.125, 1.0, 2.5]))
def test_a_shift_of_all_is_no_sliding(shift: list[int], unit: float) -> None:
    motion, places = walk()
    other = markers("lfoot body", (places + shift) / unit, unit_cm=unit)
    comparison = mcz.compare(motion, other, contacts=True).sliding
    assert comparison.max_mm == pytest.approx(0, abs=1e-8)
    assert comparison.path_mm == pytest.approx(comparison.path_original_mm, abs=1e-7)


@given(st.integers(0, 2**32 - 1))
def test_beside_plain_sums(seed: int) -> None:
    motion, places = walk()
    noise = np.random.default_rng(seed).normal(0, 0.2, places.shape)
    other = markers("lfoot body", places + noise)
    comparison = mcz.compare(motion, other, contacts=True).sliding
    errors, path, meant = [], 0.0, 0.0
    for run in mcz.contacts(motion).runs:
        p = places[run.first : run.first + run.n_frames, 0] * 10
        q = p + noise[run.first : run.first + run.n_frames, 0] * 10
        errors += [np.linalg.norm((y - q[0]) - (x - p[0])) for x, y in zip(p, q, strict=True)][1:]
        path += sum(np.linalg.norm(y - x) for x, y in zip(q, q[1:], strict=False))
        meant += sum(np.linalg.norm(y - x) for x, y in zip(p, p[1:], strict=False))
    assert comparison.mean_mm == pytest.approx(np.mean(errors))
    assert comparison.max_mm == pytest.approx(max(errors))
    assert comparison.path_mm == pytest.approx(path)
    assert comparison.path_original_mm == pytest.approx(meant)


def test_contacts_that_are_given() -> None:
    motion, places = walk()
    moved = places.copy()
    moved[70:, 1] += 1  # the body jumps aside
    other = markers("lfoot body", moved)
    runs = (mcz.Contact("body", 65, 10), mcz.Contact("body", 100, 1))
    given_ = mcz.Contacts(runs, ("body",), 300)
    comparison = mcz.compare(motion, other, contacts=given_).sliding
    assert comparison.contacts is given_
    assert [slide.n_frames for slide in comparison.slides] == [10, 1]
    assert comparison.slides[0].max_mm == pytest.approx(10 * np.sqrt(3))
    alone = comparison.slides[1]  # one frame leaves nothing to measure
    assert (alone.mean_mm, alone.max_mm, alone.path_mm) == (None, None, None)
    named = mcz.compare(motion, other, contacts=["body"]).sliding
    assert named.contacts == mcz.contacts(motion, ["body"])
    nobody = mcz.compare(motion, other, contacts=mcz.Contacts((), (), 300))
    assert (nobody.sliding, nobody.notes) == (None, ())
    with pytest.raises(MotionError, match="contacts have 299 frames, .* has 300"):
        mcz.compare(motion, other, contacts=replace(given_, n_frames=299))
    with pytest.raises(MotionError, match="no joint 'head'"):
        mcz.compare(motion, other, contacts=["head"])


def test_what_is_unknown_does_not_count() -> None:
    still = markers("lfoot", np.zeros((60, 1, 3)))
    moved = np.zeros((60, 1, 3))
    moved[30:, 0, 0] = 0.5
    moved[29:32] = np.nan
    comparison = mcz.compare(still, markers("lfoot", moved), contacts=True).sliding
    assert comparison.mean_mm == pytest.approx(5 * 28 / 56)
    assert comparison.path_mm == 0  # the jump is between places of which one is unknown
    moved[0] = np.nan
    comparison = mcz.compare(still, markers("lfoot", moved), contacts=True).sliding
    assert (comparison.mean_mm, comparison.max_mm, comparison.where, comparison.path_mm) == (
        None,
        None,
        None,
        0,
    )
    nothing = markers("lfoot", np.full((60, 1, 3), np.nan))
    comparison = mcz.compare(still, nothing, contacts=True).sliding
    assert (comparison.path_mm, comparison.path_original_mm, len(comparison.slides)) == (
        None,
        None,
        1,
    )


def test_without_feet_or_unit_there_are_no_contacts() -> None:
    hand = markers("hand", np.zeros((60, 1, 3)))
    comparison = mcz.compare(hand, hand, contacts=True)
    assert comparison.sliding is None
    assert any("no joint is named like a foot" in note for note in comparison.notes)
    unknown = markers("lfoot", np.zeros((60, 1, 3)), unit_cm=None)
    comparison = mcz.compare(unknown, unknown, contacts=True)
    assert comparison.sliding is None
    assert any("length unit" in note for note in comparison.notes)


def test_rate_and_up_of_the_other_side() -> None:
    motion, places = walk()
    silent = markers("lfoot body", places, up_axis="", frame_rate=None)
    comparison = mcz.compare(silent, motion, contacts=True).sliding
    assert not (comparison.contacts.up_guessed or comparison.contacts.rate_assumed)
    slow = replace(motion, frame_rate=Fraction(30))
    assert mcz.compare(silent, slow, contacts=True).sliding.contacts.frame_rate == 30
    alone = mcz.compare(silent, silent, contacts=True).sliding.contacts
    assert alone.up_guessed and alone.rate_assumed


def test_of_frames_of_several_rows_the_first_counts() -> None:
    motion, _ = walk()
    doubled = np.repeat(motion.values, 2, axis=0)
    wrong = doubled.copy()
    wrong[1::2] += 3
    pair = [replace(motion, signals=(Signal(v, samples_per_frame=2),)) for v in (doubled, wrong)]
    comparison = mcz.compare(*pair, contacts=True)
    assert comparison.sliding.max_mm == 0 and comparison.max_position_error > 5


def test_blocks_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    motion, places = walk()
    noise = np.random.default_rng(2).normal(0, 0.1, places.shape)
    other = markers("lfoot body", places + noise)
    whole = mcz.compare(motion, other, contacts=True).sliding
    monkeypatch.setattr("mcz.kinematics.metrics.comparison.BLOCK", 100)
    assert mcz.compare(motion, other, contacts=True).sliding == whole


@pytest.mark.real
def test_real_sliding_grows_with_the_error(data: Path) -> None:
    motion = mcz.read(data / "cmu/amc/02_01.amc")
    noise = np.random.default_rng(5).normal(0, 1, motion.values.shape)
    slides = [
        mcz.compare(motion, motion.with_values(motion.values + noise * size), contacts=True).sliding
        for size in (0.01, 0.1, 1.0)
    ]
    means = [slide.mean_mm for slide in slides]
    assert means[1] == pytest.approx(10 * means[0], rel=0.1)
    assert means[2] > 5 * means[1]
    assert {slide.path_original_mm for slide in slides} == {slides[0].path_original_mm}
    assert slides[2].path_mm > 10 * slides[2].path_original_mm
