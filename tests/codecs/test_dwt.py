"""Codec 5, ``dwt``: one threshold, the bound, and the published figures."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import mcz
from mcz.angles import unwrap
from mcz.codecs.wavelet.shared import WAVELET_HEADER
from mcz.metrics import compare
from mcz.motion import POSITION_KINDS
from mcz.schema import parse
from mcz.transforms import wavelets
from tests.codecs.lossy import Direct, amc, bytes_of, clip_of, decoded, saved, wandering
from tests.motions import smooth

KINDS = st.lists(st.sampled_from(["rx", "ry", "tx", "sx"]), min_size=1, max_size=4)


def bound(name: str, levels: int, approximation: float, detail: float) -> float:
    """The greatest error of a value, given those of its coefficients."""
    wavelet = wavelets.by_name(name)[1]
    gains = [
        max(taps[0::2].sum(), taps[1::2].sum()) for taps in (np.abs(wavelet.lo), np.abs(wavelet.hi))
    ]
    error = approximation
    for _ in range(levels):
        error = gains[0] * error + gains[1] * detail
    return error


@given(
    st.integers(1, 120),
    KINDS,
    st.sampled_from(["haar", "db2", "bior4.4"]),
    st.integers(0, 5),
    st.sampled_from([0.0, 0.3, 5.0]),
    st.sampled_from([0, 2, 4]),
)
def test_error_of_the_preset_is_bounded(n_frames, kinds, name, levels, t_w, decimals) -> None:
    motion = wandering(n_frames, kinds)
    found = decoded("dwt", motion, preset="khan2014", t_w=t_w, Q=decimals, N=levels, wavelet=name)
    meant = unwrap(motion.values, motion.skeleton)
    half = 0.5 * 10.0**-decimals
    most = bound(name, levels, half, max(t_w, half)) + 1e-9 * (1 + np.abs(meant).max())
    assert np.abs(found - meant).max() <= most


@given(st.integers(1, 120), KINDS, st.integers(0, 5), st.sampled_from([1e-4, 0.1, 3.0]))
def test_error_of_the_defaults_is_bounded(n_frames, kinds, levels, t_w) -> None:
    motion = wandering(n_frames, kinds)
    found = decoded("dwt", motion, t_w=t_w, N=levels)
    meant = unwrap(motion.values, motion.skeleton)
    reach = max(np.linalg.norm([0, 2 * i, i / 2]) for i in range(len(kinds))) * math.pi / 180
    for column, kind in enumerate(kinds):
        T = t_w * (reach or 1.0) if kind in POSITION_KINDS else t_w
        step = T / 0.8 * math.sqrt(5 / 4)  # step codes are quarters of an octave or a little more
        most = bound("bior4.4", levels, step / 2, 0.8 * step) + 1e-9 * (1 + np.abs(meant).max())
        assert np.abs(found[:, column] - meant[:, column]).max() <= most


def test_it_is_mrdwt_with_a_flat_threshold() -> None:
    motion = wandering(300, ["tx", "rx", "ry"])
    for settings in ({}, {"Q": 2, "N": 3, "wavelet": "db4"}, {"segment_frames": 64}):
        own = Direct("dwt", motion, t_w=0.7, **settings)
        other = Direct("mrdwt", motion, T_g=0.7, threshold_rule="flat", **settings)
        assert own.segments == other.segments and own.header == other.header
        assert own.read().tobytes() == other.read().tobytes()


def test_presets() -> None:
    published = Direct("dwt", smooth(100), preset="khan2014")
    fields = parse(WAVELET_HEADER, published.header, "header")
    assert (fields.wavelet, fields.levels, fields.decimals) == (wavelets.IDS["db2"], 4, 2)
    assert fields.least == 300 and len(published.segments) == 1
    few = Direct("dwt", smooth(3), preset="khan2014")
    assert parse(WAVELET_HEADER, few.header, "header").levels == 4
    default = parse(WAVELET_HEADER, Direct("dwt", smooth(400)).header, "header")
    assert (default.wavelet, default.levels, default.decimals) == (10, 4, 255)
    assert default.unit == 0.2 / 0.8


@pytest.mark.parametrize("t_w", [0, 1e-35])
def test_a_step_is_needed(t_w: float) -> None:
    with pytest.raises(mcz.OptionError, match="t_w is .* and Q is not given"):
        saved("dwt", smooth(20), t_w=t_w)


def test_radians_are_coded_like_degrees() -> None:
    motion = wandering(200, ["rx", "ry"])
    radians = clip_of(np.radians(motion.values), ["rx", "ry"], "rad")
    found = np.degrees(decoded("dwt", radians, t_w=0.5))
    np.testing.assert_allclose(found, unwrap(motion.values, motion.skeleton), atol=3)


# The published figures


MSE_OF_10_03 = dict(
    zip(
        range(3, 28, 3),
        (0.265, 0.595, 0.966, 1.278, 1.68, 1.974, 2.283, 2.588, 2.76),
        strict=True,
    )
)
SIZES = {"10_03": 288_143, "05_01": 479_866}  # of the .amc with its line ends
TABLE_4 = {"10_03": (3, 0.266, 24.88), "05_01": (15, 1.085, 47.84)}  # t_w, MSE, CR


@pytest.mark.real
def test_errors_are_the_published_ones(data: Path) -> None:
    motion = amc(data, "10_03")
    for t_w, mse in MSE_OF_10_03.items():
        with mcz.open(saved("dwt", motion, preset="khan2014", t_w=t_w)) as file:
            found = compare(motion, file.only_clip().motion(), virtual_markers=False).mse
        assert found == pytest.approx(mse, abs=0.002), t_w
    motion = amc(data, "05_01")
    with mcz.open(saved("dwt", motion, preset="khan2014", t_w=15)) as file:
        found = compare(motion, file.only_clip().motion(), virtual_markers=False).mse
    assert found == pytest.approx(1.0857, abs=0.002)


@pytest.mark.real
@pytest.mark.parametrize("name", TABLE_4)
def test_table_4_of_khan2014(data: Path, name: str) -> None:
    """At the published setting and error, at least 2.3 times the published ratio."""
    t_w, mse, ratio = TABLE_4[name]
    stored = saved("dwt", amc(data, name), preset="khan2014", t_w=t_w)
    assert SIZES[name] / bytes_of(stored) >= 2.3 * ratio
    with mcz.open(stored) as file:
        assert float(file.only_clip().quality["mse"]) == pytest.approx(mse, abs=0.001)
