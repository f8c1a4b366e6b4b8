"""Errors of velocities and accelerations: beside plain differences, whatever the blocks are."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import mcz
from mcz import Motion
from mcz.kinematics.metrics import comparison
from mcz.kinematics.points import positions_of
from mcz.sources.sample import bvh_walk
from tests.motions import motions


@given(motions(), st.integers(1, 4000))
def test_beside_plain_differences(motion: Motion, block: int) -> None:
    """Any values, masks and gaps, and blocks of one frame on."""
    motion = replace(motion, frame_rate=Fraction(120))
    values = np.clip(np.nan_to_num(motion.values, nan=1.0), -1e300, 1e300)
    other = motion.with_values(values * (1 + 1e-9))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(comparison, "BLOCK", block)
        found = mcz.compare(motion, other, shell_cm=None, virtual_markers=False)
    with np.errstate(all="ignore"):
        p, q = (positions_of(m.skeleton, m.values) for m in (motion, other))
        off = p - q
        off[~(np.isfinite(p) & np.isfinite(q)).all(axis=2)] = np.nan
        for order, mean, most in (
            (1, found.mean_velocity_error_cm_s, found.max_velocity_error_cm_s),
            (2, found.mean_acceleration_error_cm_s2, found.max_acceleration_error_cm_s2),
        ):
            changes = np.sqrt((np.diff(off, order, axis=0) ** 2).sum(axis=2))
            plain = changes[~np.isnan(changes)] * (motion.skeleton.unit_cm or 0) * 120.0**order
            if not len(plain) or found.unit_cm is None:
                assert mean is most is None
            elif np.isfinite(plain.sum()):
                assert mean == pytest.approx(plain.mean(), rel=1e-6)
                assert most == pytest.approx(plain.max(), rel=1e-6)


def test_a_walk_that_is_shaken_by_hand() -> None:
    """A root that is off by 1 cm in one frame: 30 cm/s on two frames, 1,800 cm/s2 on the middle."""
    motion = bvh_walk()
    motion = replace(
        motion, skeleton=replace(motion.skeleton, unit_cm=1.0), frame_rate=Fraction(30)
    )
    values = motion.values.copy()
    values[100, 1] += 1.0
    found = mcz.compare(motion, motion.with_values(values))
    assert found.max_velocity_error_cm_s == pytest.approx(30)
    assert found.mean_velocity_error_cm_s == pytest.approx(60 / (motion.n_frames - 1))
    assert found.max_acceleration_error_cm_s2 == pytest.approx(1800)
    assert found.mean_acceleration_error_cm_s2 == pytest.approx(3600 / (motion.n_frames - 2))


def test_without_a_rate_or_a_unit_there_are_none() -> None:
    motion = bvh_walk()
    for changed in (
        replace(motion, frame_rate=None, skeleton=replace(motion.skeleton, unit_cm=1.0)),
        replace(motion, skeleton=replace(motion.skeleton, unit_cm=None)),
    ):
        found = mcz.compare(changed, changed)
        assert found.max_velocity_error_cm_s is found.max_acceleration_error_cm_s2 is None
