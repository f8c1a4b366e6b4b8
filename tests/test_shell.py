"""The shell and the figures by joint: by hand, beside plain sums, on real clips."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import mcz
from mcz import Channel, Joint, Motion, OptionError, Signal, Skeleton
from mcz.kinematics.points import (
    SHELL_CM,
    origins_of,
    places_of,
    points_of,
    positions_of,
)
from mcz.sources.sample import acclaim_walk, bvh_walk
from tests.motions import motions, smooth
from tests.test_metrics import hinge


def noisy(motion: Motion, size: float = 0.5, seed: int = 1) -> Motion:
    noise = np.random.default_rng(seed).normal(0, size, motion.values.shape)
    return motion.with_values(motion.values + noise)


def test_at_rest_the_shell_lies_along_the_axes_of_the_world() -> None:
    """Whatever ``axis`` says, unlike virtual markers, and at the start of a bone, not its end."""
    skeleton = acclaim_walk().skeleton
    rest = np.zeros((1, skeleton.n_channels))
    places = places_of(skeleton, rest, markers=True, shell_cm=2.0)
    shell = places.shell.reshape(skeleton.n_joints, 3, 3)
    origins = origins_of(skeleton, rest)[0]
    assert np.allclose((shell - origins[:, None]) * skeleton.unit_cm, 2 * np.eye(3), atol=1e-12)
    marked = places.markers.reshape(skeleton.n_joints, 3, 3)
    assert not np.allclose(shell, marked, atol=0.1)


def test_without_axis_and_tails_shell_and_markers_are_the_same() -> None:
    motion = bvh_walk()
    skeleton = replace(motion.skeleton, unit_cm=1.0)
    places = places_of(skeleton, motion.values, markers=True, shell_cm=SHELL_CM)
    assert np.allclose(places.shell, places.markers, atol=1e-9)
    assert SHELL_CM == 3


def test_a_hinge_by_hand() -> None:
    """Points 3 cm off the origin: those of x and y turn by a quarter, that of z does not."""
    comparison = mcz.compare(hinge([0, 0, 0]), hinge([0, 90, -90]))
    assert comparison.shell_radius_cm == 3
    assert comparison.shell_max_cm == pytest.approx(3 * np.sqrt(2))
    assert comparison.shell_mean_cm == pytest.approx(2 * 3 * np.sqrt(2) / 3)
    assert comparison.shell_where == (1, "arm")
    entries = comparison.entries()
    assert (entries["shell_max_frame"], entries["shell_max_joint"]) == (1, "arm")
    assert entries["shell_mean_cm"] == comparison.shell_mean_cm
    wide = mcz.compare(hinge([0, 0, 0]), hinge([0, 90, -90]), shell_cm=12.0)
    assert wide.shell_radius_cm == 12
    assert wide.shell_max_cm == pytest.approx(12 * np.sqrt(2))
    assert wide.mean_position_error == comparison.mean_position_error


def test_axes_of_an_asf_do_not_turn_the_shell() -> None:
    """A bone turned about its own x by C: W turns about another axis, and that is what counts."""

    def bone(degrees: float) -> Motion:
        joint = Joint("b", tails=((1, 0, 0),), axis=(0, 0, 30), channels=(Channel("rx"),))
        skeleton = Skeleton((joint,), unit_cm=1.0, intrinsic=False)
        return Motion(skeleton, (Signal(np.array([[degrees]])),))

    along = np.array([np.cos(np.pi / 6), np.sin(np.pi / 6), 0])
    apart = np.sqrt(1 - along**2) * 3 * 2  # half a turn about ``along``
    comparison = mcz.compare(bone(0), bone(180))
    assert comparison.shell_max_cm == pytest.approx(apart.max())


@pytest.mark.parametrize("radius", [0.0, -1.0, np.inf, np.nan])
def test_a_radius_is_a_length(radius: float) -> None:
    with pytest.raises(OptionError, match="the radius of the shell is"):
        mcz.compare(smooth(), smooth(), shell_cm=radius)
    with pytest.raises(OptionError, match="the radius of the shell is"):
        mcz.compare(hinge([0.0], ""), hinge([0.0], ""), shell_cm=radius)
    with pytest.raises(OptionError, match="the radius of the shell is"):
        places_of(smooth().skeleton, smooth().values, shell_cm=radius)


def test_a_shell_needs_a_unit() -> None:
    unknown = replace(smooth().skeleton, unit_cm=None)
    with pytest.raises(OptionError, match="length unit .*is unknown.*3 cm.*unit="):
        places_of(unknown, smooth().values, shell_cm=SHELL_CM)
    comparison = mcz.compare(hinge([0.0], unit_cm=None), hinge([9.0], unit_cm=None))
    assert (comparison.shell_mean_cm, comparison.shell_radius_cm, comparison.shell_where) == (
        None,
        None,
        None,
    )


def test_the_shell_can_be_left_out() -> None:
    comparison = mcz.compare(smooth(), noisy(smooth()), shell_cm=None)
    assert (comparison.shell_mean_cm, comparison.shell_max_cm, comparison.shell_radius_cm) == (
        None,
        None,
        None,
    )
    assert comparison.virtual_marker_mean_cm is not None
    alone = mcz.compare(smooth(), noisy(smooth()), virtual_markers=False)
    assert (alone.virtual_marker_mean_cm, alone.shell_mean_cm is None) == (None, False)


def test_where_shells_cannot_be_compared() -> None:
    walk = acclaim_walk()
    comparison = mcz.compare(walk, mcz.in_positions(walk, virtual_markers=True))
    assert comparison.virtual_marker_mean_cm is not None and comparison.shell_mean_cm is None
    assert any("has virtual markers: no errors of shells" in note for note in comparison.notes)
    comparison = mcz.compare(walk, mcz.in_positions(walk))
    assert comparison.shell_mean_cm is None
    assert any("virtual markers and shells" in note for note in comparison.notes)
    one = hinge([0.0])
    other = Joint("b", 0, (2.0, 0.0, 0.0), channels=(Channel("rz"),))
    two = Skeleton((Joint("a"), other), unit_cm=100.0)
    comparison = mcz.compare(one, Motion(two, one.signals))
    assert comparison.points == 2
    assert comparison.shell_mean_cm is comparison.virtual_marker_mean_cm is None
    assert any("1 and 2 joints: no errors" in note for note in comparison.notes)


@given(motions(), st.floats(0.5, 20))
def test_beside_plain_sums(motion: Motion, radius: float) -> None:
    """Any values, masks and gaps: the figures by joint and over all, from arrays of points."""
    values = np.clip(np.nan_to_num(motion.values, nan=1.0), -1e300, 1e300)
    other = motion.with_values(values * (1 + 1e-9))
    comparison = mcz.compare(motion, other, shell_cm=radius)
    with np.errstate(all="ignore"):
        a, b = (
            places_of(m.skeleton, m.values, shell_cm=radius).shell.reshape(m.n_frames, 4, 3, 3)
            for m in (motion, other)
        )
        shell = np.sqrt(((a - b) ** 2).sum(axis=3)).max(axis=2) * 2.5
        p, q = (positions_of(m.skeleton, m.values) for m in (motion, other))
        points = np.sqrt(((p - q) ** 2).sum(axis=2))
        known = np.isfinite(a).all(axis=(2, 3)) & np.isfinite(b).all(axis=(2, 3))
    plain = same_figures(comparison.shell_mean_cm, comparison.shell_max_cm, shell, known)
    first = 0
    for index, own in enumerate(points_of(motion.skeleton)):
        joint = comparison.by_joint[index]
        assert joint.points == len(own)
        same_figures(joint.shell_mean_cm, joint.shell_max_cm, shell[:, [index]], known[:, [index]])
        columns = slice(first, first + len(own))
        valid = np.isfinite(p[:, columns]).all(axis=2) & np.isfinite(q[:, columns]).all(axis=2)
        same_figures(joint.mean_position_error, joint.max_position_error, points[:, columns], valid)
        first += len(own)
    if plain and comparison.shell_where is not None:
        frame, name = comparison.shell_where
        at = motion.skeleton.addresses().index(name)
        assert shell[frame, at] == pytest.approx(comparison.shell_max_cm, rel=1e-9)
        assert comparison.by_joint[at].shell_frame == frame


def same_figures(
    mean: float | None, most: float | None, distances: np.ndarray, known: np.ndarray
) -> bool:
    """Compare both figures with the known ``distances``; False if these give no figures."""
    counted = distances[known]
    with np.errstate(all="ignore"):
        if not counted.size or not np.isfinite(counted.sum()):
            return False
        assert mean == pytest.approx(counted.mean(), rel=1e-9, abs=1e-300)
        assert most == pytest.approx(counted.max(), rel=1e-9, abs=1e-300)
    return True


def test_frames_of_several_rows() -> None:
    motion = hinge([0.0] * 6)
    other = hinge([0.0, 0.0, 0.0, 0.0, 0.0, 90.0])
    pairs = [
        replace(m, signals=(replace(m.signals[0], samples_per_frame=2),)) for m in (motion, other)
    ]
    comparison = mcz.compare(*pairs)
    assert comparison.shell_where == (2, "arm")
    assert (comparison.by_joint[0].frame, comparison.by_joint[0].shell_frame) == (2, 2)


def test_without_points_there_are_no_figures_by_joint() -> None:
    comparison = mcz.compare(hinge([0.0], ""), hinge([1.0], ""))
    assert (comparison.by_joint, comparison.shell_mean_cm, comparison.points) == ((), None, None)


def test_blocks_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    walk = acclaim_walk()
    other = noisy(walk)
    whole = mcz.compare(walk, other)
    monkeypatch.setattr("mcz.kinematics.metrics.comparison.BLOCK", 5000)
    parts = mcz.compare(walk, other)
    assert parts.shell_where == whole.shell_where
    for one, two in zip(parts.by_joint, whole.by_joint, strict=True):
        for key, value in one.entries().items():
            assert two.entries()[key] == (
                pytest.approx(value, rel=1e-12) if isinstance(value, float) else value
            )
