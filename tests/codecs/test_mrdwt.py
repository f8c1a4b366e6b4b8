"""Presets ``mrdwt`` and ``dwt``: bounds, wavelets, segments, options, headers."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

import mcz
from mcz.codecs.channel_weights import weights_of
from mcz.codecs.parameters import code_of, ratio_of
from mcz.codecs.transforms import wavelets
from mcz.codecs.wavelet.wavelet import WaveletHeader
from mcz.kinematics.angles import unwrap
from mcz.kinematics.metrics import compare
from mcz.model.motion import POSITION_KINDS, Motion
from mcz.model.schema import parse
from tests.codecs import lossy
from tests.codecs.lossy import bones, clip_of, markers_with_gaps, random_walks
from tests.formats.c3d_files import INTEL, SGI, make_c3d
from tests.motions import smooth

Array = np.ndarray
KINDS = st.lists(st.sampled_from(["rx", "ry", "tx", "sx", "length"]), min_size=1, max_size=4)
NAMES = st.sampled_from(["haar", "db2", "db3", "db8", "sym4", "bior4.4", "coif1"])
FRAMES = st.one_of(st.integers(1, 20), st.integers(1, 200))


def encode_file(motion: Motion, **params: object) -> bytes:
    return lossy.encode_file("mrdwt", motion, **params)


def encode_and_decode(motion: Motion, **params: object) -> Array:
    return lossy.encode_and_decode("mrdwt", motion, **params)


class Direct(lossy.Direct):
    """A clip coded and decoded by the codec alone."""

    def __init__(self, motion: Motion, **params: Any) -> None:
        super().__init__("mrdwt", motion, **params)
        self.fields = parse(WaveletHeader, self.header, "header")


@cache
def small() -> Direct:
    params = {"T_g": 1.0, "N": 2, "wavelet": "db2", "segment_frames": 12}
    return Direct(random_walks(20, ["tx", "rx"]), **params)


@cache
def wavelet_of(name: str) -> wavelets.Wavelet:
    return wavelets.by_name(name)[1]


# Errors are bounded


def gains(wavelet: wavelets.Wavelet) -> tuple[float, float]:
    """The most that a unit error of all coefficients makes of a sample, by filter."""
    both = (np.abs(wavelet.lo), np.abs(wavelet.hi))
    return tuple(max(taps[0::2].sum(), taps[1::2].sum()) for taps in both)


def bound(name: str, levels: int, approximation: float, detail: float) -> float:
    """The greatest error of a value, given those of its coefficients."""
    low, high = gains(wavelet_of(name))
    error = approximation
    for _ in range(levels):
        error = low * error + high * detail
    return error


def thresholds(motion: Motion, T_g: float) -> Array:
    """Thresholds of SPEC.md's rule "flat", for rotations in degrees."""
    reach = max(np.linalg.norm([0, 2 * i, i / 2]) for i in range(motion.skeleton.n_joints))
    lever = reach * math.pi / 180 or 1.0
    kinds = [channel.kind for channel in motion.skeleton.channels]
    return np.array([T_g * lever if kind in POSITION_KINDS else T_g for kind in kinds])


@given(
    FRAMES,
    KINDS,
    NAMES,
    st.integers(0, 5),
    st.sampled_from([1e-6, 0.001, 0.3, 1.0, 5.0, 30.0]),
    st.sampled_from([None, 0, 1, 4]),
    st.integers(0, 9),
)
@example(50, ["rx", "tx"], "db2", 3, 0.0, 1, 0)
def test_errors_are_bounded(n_frames, kinds, name, levels, T_g, decimals, seed) -> None:
    motion = random_walks(n_frames, kinds, seed)
    params = {} if decimals is None else {"Q": decimals}
    params |= {"T_g": T_g, "N": levels, "wavelet": name, "threshold_rule": "flat"}
    decoded = encode_and_decode(motion, **params)
    meant = unwrap(motion.values, motion.skeleton)
    for column, T in enumerate(thresholds(motion, T_g)):
        step = T / 0.8 * math.sqrt(5 / 4)  # step codes are quarters of an octave or a little more
        half = 0.5 * 10.0 ** -(decimals or 0)
        errors = (step / 2, 0.8 * step) if decimals is None else (half, max(T, half))
        most = bound(name, levels, *errors) + 1e-9 * (1 + np.abs(meant).max())
        assert np.abs(decoded[:, column] - meant[:, column]).max() <= most


@given(st.floats(1e-12, 1e12))
def test_step_codes_are_the_nearest(ratio: float) -> None:
    code = code_of(ratio)
    found = abs(math.log(ratio_of(code) / ratio))
    limited = [c for c in (0, 255, code - 1, code + 1) if 0 <= c <= 255]
    assert all(found <= abs(math.log(ratio_of(c) / ratio)) + 1e-12 for c in limited)


# Clips out of the ordinary


def test_gaps_are_filled_by_straight_lines() -> None:
    motion = markers_with_gaps()
    decoded = Direct(motion, Q=6, T_g=0, N=3).read()
    known = motion.signals[0].values
    line = np.linspace(known[43, 3], known[61, 3], 19)
    np.testing.assert_allclose(decoded[43:62, 3], line, atol=1e-4)
    np.testing.assert_allclose(decoded[:5, 3], known[5, 3], atol=1e-4)
    np.testing.assert_allclose(decoded[97:, 3], known[96, 3], atol=1e-4)


def test_a_marker_that_is_never_there() -> None:
    motion = markers_with_gaps()
    mask = np.ones((100, 6), bool)
    mask[:, 3:] = False
    motion = replace(motion, signals=(replace(motion.signals[0], mask=mask),))
    motion = motion.with_values(np.where(mask, motion.signals[0].values, np.nan))
    with mcz.open(encode_file(motion)) as file:
        assert np.isnan(file.only_clip().read()[:, 3:]).all()
        assert not file.only_clip().read_masked()[0][:, 3:].any()


def test_radians_are_coded_like_degrees() -> None:
    motion = random_walks(200, ["rx", "ry", "rz"])
    for rule in ("flat", "depth", "sensitivity"):
        degrees = Direct(motion, T_g=1.0, threshold_rule=rule)
        radians = Direct(
            clip_of(np.radians(motion.values), ["rx", "ry", "rz"], angle_unit="rad"),
            T_g=1.0,
            threshold_rule=rule,
        )
        decoded = np.degrees(radians.read())
        error = np.abs(degrees.read() - unwrap(motion.values, motion.skeleton)).max()
        np.testing.assert_allclose(decoded, degrees.read(), atol=1.5 * error)
        sizes = [sum(len(t) for s in c.segments for t in s.streams) for c in (degrees, radians)]
        assert sizes[0] == pytest.approx(sizes[1], rel=0.05)


@pytest.mark.parametrize("processor", [INTEL, SGI])
def test_c3d_keeps_gaps_that_only_nan_marks(tmp_path: Path, processor: int) -> None:
    """Their residuals say that they are valid: what fills them must not be taken for points."""
    source, target, back = (tmp_path / name for name in ("a.c3d", "a.mcz", "back.c3d"))
    file = make_c3d(40, n_points=3, processor=processor)
    file.points[5:9, 1, :3] = file.points[20, 2, 0] = 0x7FC00000
    source.write_bytes(file.build())
    mcz.encode(source, target, codec="mrdwt", params={"T_g": 5}, unit="mm")
    with mcz.open(target) as opened:
        back.write_bytes(opened.only_clip().source_bytes())
    original, again = mcz.read(source), mcz.read(back)
    assert not original.signals[0].mask[5:9, 3:6].any()
    np.testing.assert_array_equal(again.signals[0].mask, original.signals[0].mask)
    assert compare(original, again).mismatched_points == 0


# Parameters


@pytest.mark.parametrize("T_g", [0, 0.0, 1e-35])
def test_a_step_is_needed(T_g: float) -> None:
    with pytest.raises(mcz.OptionError, match="with T_g=.* there is no quantizer step; give Q"):
        encode_file(smooth(20), T_g=T_g)


@pytest.mark.parametrize("decimals", [12, 15])
def test_thresholds_beyond_the_range_of_integers(decimals: int) -> None:
    """``least`` stays in its range; what then has no integer is refused as such."""
    assert not encode_and_decode(clip_of(np.zeros((50, 2))), T_g=2.0**20, Q=decimals).any()
    with pytest.raises(mcz.MotionError, match="exceeds"):
        encode_file(smooth(50), T_g=2.0**20, Q=decimals)


@pytest.mark.parametrize(
    ("codec", "preset", "params", "wavelet", "decimals"),
    [
        ("mrdwt", "khan2016", {}, "db3", 1),
        ("dwt", "khan2014", {}, "db2", 2),
        ("awt", "khan2014", {"a_w": 20}, "db2", 2),
    ],
)
def test_presets(codec: str, preset: str, params: Any, wavelet: str, decimals: int) -> None:
    def fields(n_frames: int, **how: Any) -> tuple[WaveletHeader, int]:
        coded = lossy.Direct(codec, smooth(n_frames), **how)
        return parse(WaveletHeader, coded.header, "header"), len(coded.segments)

    found, n_segments = fields(100, preset=preset, **params)
    assert (found.wavelet, found.levels, found.decimals) == (wavelets.IDS[wavelet], 4, decimals)
    assert n_segments == 1
    assert fields(3, preset=preset, **params)[0].levels == 4
    default, _ = fields(400)
    assert (default.wavelet, default.levels, default.decimals) == (10, 4, 255)
    assert codec == "awt" or default.unit == 0.2 / 0.8
    assert found.least == {"mrdwt": 120, "dwt": 300}.get(codec, found.least)  # depth 0: the root


def test_a_preset_is_its_parameters() -> None:
    same = {"T_g": 12, "Q": 1, "N": 4, "wavelet": "db3", "threshold_rule": "depth"}
    coded = Direct(smooth(100), preset="khan2016")
    assert Direct(smooth(100), preset="khan2016", **same).segments == coded.segments


def test_default_levels_fit_the_clip() -> None:
    levels = [Direct(smooth(n)).fields.levels for n in (1, 17, 18, 35, 36, 143, 144, 2000)]
    assert levels == [0, 0, 1, 1, 2, 3, 4, 4]


def test_thresholds_by_depth() -> None:
    """Eq. 2 of Khan 2016: sqrt(log2(d + 2)), d the share of the greatest depth."""
    found = weights_of(bones(["rx"] * 5), np.zeros((1, 5)), "depth", unit_aware=False)
    np.testing.assert_allclose(found, [math.sqrt(math.log2(d / 4 + 2)) for d in range(5)])


# Hostile bytes


def test_a_cut_file_refuses_what_it_no_longer_holds() -> None:
    coded = small()
    cut = {"spans": coded.spans[:1]}
    with pytest.raises(mcz.FormatError, match="need approximations up to"):
        coded.read(0, 12, changes=cut)
    assert coded.read(0, 4, changes=cut).tobytes() == coded.read(0, 4).tobytes()


# Codec dwt, which has its streams


def test_dwt_is_mrdwt_with_a_flat_threshold() -> None:
    motion = random_walks(300, ["tx", "rx", "ry"])
    for settings in ({}, {"Q": 2, "N": 3, "wavelet": "db4"}, {"segment_frames": 64}):
        own = lossy.Direct("dwt", motion, t_w=0.7, **settings)
        other = lossy.Direct("mrdwt", motion, T_g=0.7, threshold_rule="flat", **settings)
        assert own.segments == other.segments and own.header == other.header
        assert own.read().tobytes() == other.read().tobytes()
