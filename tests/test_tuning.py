"""Sizes and errors as targets: met, never exceeded, and proved by the public reader."""

from __future__ import annotations

import io
import math
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import mcz
from mcz.codecs.parameters import Dial
from mcz.files.reading.sizes import clip_sizes
from mcz.files.writing.tuning import GOAL, PROMISED, Target, search
from mcz.model.motion import Channel, Joint, Motion, Signal, Skeleton
from tests.motions import write_bytes

DIAL = Dial("T_g", 2.0**-20, 2.0**20)
RISING = Dial("a_w", 2.0**-20, 2.0**20, rises=True)


def walk(n_frames: int = 1200, **changes: object) -> Motion:
    """Two joints that turn and wander; enough frames that a byte is far less than 3 percent."""
    joints = (
        Joint("hips", channels=tuple(map(Channel, ("tx", "ty", "tz", "rz", "ry", "rx")))),
        Joint("knee", 0, (0.0, -10.0, 0.0), ((0.0, -9.0, 0.0),), channels=(Channel("rx"),)),
    )
    random = np.random.default_rng(2)
    frames = np.arange(n_frames)[:, None]
    values = 25 * np.sin(frames * np.linspace(0.02, 0.11, 7) + np.arange(7))
    values = np.round(values + np.cumsum(random.normal(0, 0.1, values.shape), axis=0), 4)
    skeleton = Skeleton(joints, unit_cm=changes.pop("unit_cm", 2.54))
    arguments = {"frame_rate": Fraction(120), "name": "walk"} | changes
    return Motion(skeleton, (Signal(values),), **arguments)


WALK = walk()


def encode_file(motion: Motion, **params: object) -> bytes:
    return write_bytes(motion, codec="mrdwt", **params)


class Found:
    """The public reader's account of a file, measured again."""

    def __init__(self, motion: Motion, data: bytes) -> None:
        with mcz.open(data) as file:
            clip = file.only_clip()
            sizes = clip_sizes(file.container, clip)
            self.quality = clip.quality or {}
            compared = mcz.compare(motion, clip.motion())
        seconds = motion.n_frames / float(motion.frame_rate or 1)
        self.figures = {
            "target_bytes": float(sizes.payload + sizes.overhead + sizes.models),
            "kbps": sizes.payload * 8 / 1000 / seconds,
            "mean_error_cm": compared.mean_position_error_cm,
            "max_error_cm": compared.max_position_error_cm,
        }

    def check(self, name: str, limit: float) -> None:
        """Never above the target, and near it unless the record says why not."""
        reached = self.figures[name]
        assert reached is not None and reached <= limit
        assert float(self.quality["target_reached"]) == pytest.approx(reached, rel=1e-9)
        assert float(self.quality[f"param.{name}"]) == limit
        if reached < PROMISED * limit:
            assert name in self.quality["target_remark"]
        else:
            assert "target_remark" not in self.quality
        for metric in ("mean", "max"):
            stated = float(self.quality[f"{metric}_position_error_cm"])
            assert stated == pytest.approx(self.figures[f"{metric}_error_cm"], rel=1e-9)


@pytest.mark.parametrize(
    ("name", "limit"),
    [
        ("target_bytes", 1200),
        ("target_bytes", 4000),
        ("target_bytes", 12_000),
        ("kbps", 1.5),
        ("kbps", 6),
        ("kbps", 15.5),
        ("mean_error_cm", 0.01),
        ("mean_error_cm", 0.5),
        ("mean_error_cm", 5),
        ("max_error_cm", 0.1),
        ("max_error_cm", 2),
    ],
)
def test_targets_are_met(name: str, limit: float) -> None:
    found = Found(WALK, encode_file(WALK, **{name: limit}))
    found.check(name, limit)
    assert found.figures[name] >= PROMISED * limit


@pytest.mark.parametrize("name", ["target_bytes", "kbps", "mean_error_cm", "max_error_cm"])
def test_the_end_of_the_range_is_remarked_upon(name: str) -> None:
    """More than the finest setting needs, or a greater error than the coarsest makes."""
    short = walk(100)
    found = Found(short, encode_file(short, **{name: 10**8}))
    found.check(name, 10**8)
    assert "the range of T_g ends there" in found.quality["target_remark"]
    assert float(found.quality["param.T_g"]) in (DIAL.low, DIAL.high)


@pytest.mark.parametrize("name", ["target_bytes", "kbps"])
def test_all_other_parameters_stay(name: str) -> None:
    limit = {"target_bytes": 3000, "kbps": 2}[name]
    given = {"preset": "khan2016", "wavelet": "db2", "segment_frames": 400, name: limit}
    found = Found(WALK, encode_file(WALK, **given))
    found.check(name, limit)
    assert found.quality["param.preset"] == "khan2016"
    assert found.quality["param.wavelet"] == "db2"
    assert float(found.quality["param.T_g"]) > 0


@settings(max_examples=settings.default.max_examples // 3)  # a dozen encodings each
@given(st.integers(150, 20_000))
def test_any_size(limit: int) -> None:
    short = walk(300)  # every step of a few bytes, at its shortest
    try:
        data = encode_file(short, target_bytes=limit)
    except mcz.OptionError as error:
        assert limit < 400 and "cannot be met" in str(error)
        return
    Found(short, data).check("target_bytes", limit)


def test_signals_beside_the_motion_count() -> None:
    random = np.random.default_rng(0).integers(-500, 500, (2400, 1))
    analog = Signal(
        random.astype(np.int64),
        name="analog",
        role="analog",
        samples_per_frame=2,
        channels=(Channel("", "emg", "V"),),
    )
    motion = replace(WALK, signals=(WALK.signals[0], analog))
    for name, limit in (("target_bytes", 8000), ("kbps", 6.0), ("mean_error_cm", 0.3)):
        data = encode_file(motion, **{name: limit})
        Found(motion, data).check(name, limit)
        with mcz.open(data) as file:
            np.testing.assert_array_equal(file.only_clip().read(signal=1), analog.values)


def test_the_command_line_takes_targets(tmp_path: Path, samples: Path) -> None:
    target = tmp_path / "walk.mcz"
    params = {"mean_error_cm": "0.2"}
    mcz.encode(samples / "walk.amc", target, codec="mrdwt", params=params)
    Found(mcz.read(samples / "walk.amc"), target.read_bytes()).check("mean_error_cm", 0.2)


# Targets without meaning, and out of reach


@pytest.mark.parametrize(
    ("changes", "params", "words"),
    [
        ({"frame_rate": None}, {"kbps": 4}, "kbps has no meaning: the frame rate is unknown"),
        ({"n_frames": 0}, {"kbps": 4}, "kbps has no meaning"),
        ({"unit_cm": None}, {"mean_error_cm": 1}, "mean_error_cm has no meaning: the length unit"),
        ({"unit_cm": None}, {"max_error_cm": 1}, "max_error_cm has no meaning: the length unit"),
        ({"n_frames": 0}, {"max_error_cm": 1}, "max_error_cm has no meaning"),
        ({}, {"target_bytes": 999, "kbps": 1}, "target_bytes and kbps exclude each other"),
        ({}, {"max_error_cm": 1, "mean_error_cm": 1}, "mean_error_cm and max_error_cm exclude"),
        ({}, {"target_bytes": 999, "T_g": 1}, "target_bytes and T_g exclude each other"),
        ({}, {"mean_error_cm": 1, "T_g": 0, "Q": 1}, "mean_error_cm and T_g exclude each other"),
        ({}, {"target_bytes": 10}, "target_bytes 10 cannot be met: T_g 1.04858e.06 gives"),
        ({}, {"preset": "khan2016", "mean_error_cm": 1e-6}, "mean_error_cm 1e-06 cannot be met"),
        ({}, {"preset": "khan2016", "max_error_cm": 1e-3}, "max_error_cm 0.001 cannot be met"),
        ({}, {"target_bytes": 0}, "target_bytes is 0"),
        ({}, {"target_bytes": "some"}, "target_bytes is 'some'"),
        ({}, {"kbps": math.nan}, "kbps is nan"),
        ({}, {"mean_error_cm": -1}, "mean_error_cm is -1"),
        ({}, {"max_error_cm": math.inf}, "max_error_cm is inf"),
    ],
)
def test_refused(tmp_path: Path, changes, params, words: str) -> None:
    """Nothing appears under the name of the file, nor beside it."""
    motion = walk(changes.pop("n_frames", 120), **changes)
    with pytest.raises(mcz.OptionError, match=words):
        mcz.write(motion, tmp_path / "a.mcz", codec="mrdwt", **params)
    assert not list(tmp_path.iterdir())


def test_a_file_that_is_there_stays_where_a_target_is_out_of_reach(tmp_path: Path) -> None:
    path = tmp_path / "a.mcz"
    mcz.write(walk(60), path)
    before = path.read_bytes()
    with pytest.raises(mcz.OptionError, match="cannot be met"):
        mcz.write(walk(60), path, codec="mrdwt", force=True, target_bytes=10)
    assert path.read_bytes() == before and list(tmp_path.iterdir()) == [path]


def test_errors_of_a_skeleton_without_kinematics() -> None:
    joints = (Joint("a", channels=(Channel("", "smile"),)),)
    motion = Motion(Skeleton((), unit_cm=1.0), (Signal(np.zeros((9, 0))),), name="none")
    with pytest.raises(mcz.OptionError, match="mean_error_cm has no meaning"):
        encode_file(motion, mean_error_cm=1)
    unknown = Skeleton((*joints, Joint("b", channels=(Channel("rx"),))), unit_cm=1.0, angle_unit="")
    motion = Motion(unknown, (Signal(np.ones((9, 2))),), name="none")
    with pytest.raises(mcz.OptionError, match="mean_error_cm has no meaning: .*angle unit"):
        encode_file(motion, mean_error_cm=1)


def test_lossless_codecs_have_no_targets() -> None:
    for codec in ("fast", "raw"):
        with pytest.raises(mcz.OptionError, match="no parameter 'kbps'"):
            mcz.write(walk(10), io.BytesIO(), codec=codec, kbps=1)


def test_values_that_only_coarse_steps_can_hold() -> None:
    """Fine settings are refused by the codec; the search stays where they are not."""
    motion = walk(200)
    values = motion.values.copy()
    values[:, 0] += 1e7
    motion = motion.with_values(values)
    found = Found(motion, encode_file(motion, target_bytes=10**7))
    found.check("target_bytes", 10**7)
    assert "no T_g that was tried is nearer" in found.quality["target_remark"]


# The search alone


def run_search(
    dial: Dial, figure: Callable[[float], float], limit: float, falls: bool
) -> tuple[float, float, bool, list[float]]:
    asked: list[float] = []

    def measure(target: Target, setting: float) -> float:
        asked.append(setting)
        assert dial.low <= setting <= dial.high
        assert not dial.is_integer or isinstance(setting, int)
        return figure(setting)

    return *search(dial, Target("figure", limit, falls), measure), asked


@given(
    st.sampled_from([DIAL, RISING]),
    st.floats(-15, 15).map(lambda x: 2.0**x),
    st.floats(0.05, 4),
    st.booleans(),
)
def test_smooth_figures_are_met_soon(dial: Dial, setting: float, power: float, falls: bool) -> None:
    """Any power law whose solution lies in the range; a size grows with a dial that rises."""
    sign = power if falls == dial.rises else -power
    found, reached, ended, asked = run_search(dial, lambda t: t**sign, setting**sign, falls)
    assert reached == found**sign <= setting**sign
    assert not ended and reached >= PROMISED * setting**sign
    assert len(asked) < 40


@given(st.integers(0, 2**32 - 1), st.floats(0.01, 100), st.booleans())
@example(123226746, 2.46875, False)  # the nearest of all was met on the way to a bracket
def test_figures_that_are_not_monotone(seed: int, limit: float, falls: bool) -> None:
    """A figure that jumps up and down: what is returned was measured and meets the target."""
    random = np.random.default_rng(seed)
    noise = np.exp(random.normal(0, 0.3, 4096))

    def figure(t: float) -> float:
        place = int((math.log2(t) + 20) * 100) % 4096
        return t ** (-0.5 if falls else 0.5) * float(noise[place])

    found, reached, _, asked = run_search(DIAL, figure, limit, falls)
    assert reached == figure(found) <= limit
    assert found in asked and len(asked) < 150
    assert reached == max(f for f in map(figure, asked) if f <= limit)


@pytest.mark.parametrize(("limit", "falls", "end"), [(5, True, DIAL.low), (5, False, DIAL.high)])
def test_ends_of_the_range(limit: float, falls: bool, end: float) -> None:
    found, reached, ended, _ = run_search(DIAL, lambda t: 1.0, limit, falls)
    assert (found, reached, ended) == (end, 1.0, True)


@pytest.mark.parametrize("falls", [True, False])
def test_targets_that_no_setting_meets(falls: bool) -> None:
    with pytest.raises(mcz.OptionError, match="figure 0.5 cannot be met: T_g .* gives 1"):
        run_search(DIAL, lambda t: 1.0, 0.5, falls)


def test_a_setting_that_is_refused_as_too_fine_is_no_answer() -> None:
    def figure(t: float) -> float:
        if t < 0.01:
            raise mcz.MotionError("a coefficient exceeds")
        return 1 / t

    found, reached, _, _ = run_search(DIAL, figure, 1000.0, falls=True)
    assert reached == 1 / found <= 100 and found >= 0.01
    with pytest.raises(mcz.MotionError):
        run_search(DIAL, lambda t: figure(t / 1e5), 1000.0, falls=True)
    with pytest.raises(mcz.OptionError, match="figure 1e-05 cannot be met: a coefficient exceeds"):
        run_search(DIAL, lambda t: 1 / figure(t), 1e-5, falls=False)


def test_a_figure_that_stays_is_not_followed_to_the_end() -> None:
    asked = []

    def figure(t: float) -> float:
        asked.append(t)
        return 100.0

    with pytest.raises(mcz.OptionError, match="cannot be met: T_g .* gives 100"):
        run_search(DIAL, figure, 10.0, falls=True)
    assert len(asked) <= 5


def test_errors_of_the_codec_come_through() -> None:
    values = walk(50).values.copy()
    values[3, 3] = math.nan
    with pytest.raises(mcz.MotionError, match="not finite"):
        encode_file(walk(50).with_values(values), target_bytes=1000)


# Dials that go the other way, and dials of integers

WHOLE = Dial("q", 1, 2**20, rises=True, is_integer=True)
COUNTED = Dial("n", 1, 1000, is_integer=True)


@given(
    st.sampled_from([WHOLE, COUNTED]),
    st.integers(1, 1000),
    st.floats(0, 0.999),
    st.booleans(),
)
def test_integers_that_meet_the_target_are_the_nearest(dial, whole, more, falls) -> None:
    """No integer comes nearer for a figure without jumps, unless it is near enough."""
    rises = falls == dial.rises  # the figure, with the dial
    figure: Callable[[float], float] = float if rises else (lambda n: 1.0 / n)
    limit = whole + more if rises else 1 / (whole - more * 0.5)
    found, reached, _, asked = run_search(dial, figure, limit, falls)
    assert reached == figure(found) <= limit
    assert found == whole or reached >= GOAL * limit
    assert len(set(asked)) < 120


def test_a_whole_dial_ends_at_its_range() -> None:
    assert run_search(COUNTED, lambda n: 1.0, 5, falls=True)[:3] == (1, 1.0, True)
    assert run_search(COUNTED, lambda n: 1.0, 5, falls=False)[:3] == (1000, 1.0, True)
    assert run_search(WHOLE, lambda n: 1.0, 5, falls=True)[:3] == (2**20, 1.0, True)
    assert run_search(WHOLE, lambda n: 1.0, 5, falls=False)[:3] == (1, 1.0, True)
    with pytest.raises(mcz.OptionError, match="cannot be met: q 1 gives 1"):
        run_search(WHOLE, lambda n: 1.0, 0.5, falls=True)


def test_a_rising_setting_that_is_refused_as_too_fine_is_no_answer() -> None:
    def figure(t: float) -> float:
        if t > 100:
            raise mcz.MotionError("a coefficient exceeds")
        return t

    found, reached, _, _ = run_search(RISING, figure, 1000.0, falls=True)
    assert reached == found <= 100
    with pytest.raises(mcz.MotionError):
        run_search(RISING, lambda t: figure(t * 1e9), 1e-9, falls=False)


@pytest.mark.parametrize(
    ("codec", "name", "limit"),
    [
        *(("pca", "target_bytes", 2500), ("pca", "mean_error_cm", 0.5), ("dwt", "kbps", 3)),
        *(("awt", "target_bytes", 2500), ("awt", "max_error_cm", 2), ("qbc", "mean_error_cm", 0.5)),
        *(("mdtt", "mean_error_cm", 0.5), ("pca-rdo", "target_bytes", 3500)),
        *(("lsdt-frame", "max_error_cm", 2), ("lsdt-clip", "kbps", 3)),
        *(("online", "target_bytes", 2500), ("online", "mean_error_cm", 0.5)),
        *(("posewave", "target_bytes", 2500), ("posewave", "mean_error_cm", 0.5)),
    ],
)
def test_targets_of_other_codecs(codec: str, name: str, limit: float) -> None:
    Found(WALK, write_bytes(WALK, codec=codec, **{name: limit})).check(name, limit)


def test_targets_that_components_cannot_meet() -> None:
    with pytest.raises(mcz.OptionError, match="target_bytes 10 cannot be met: q 1 gives"):
        mcz.write(WALK, io.BytesIO(), codec="pca", target_bytes=10)
    with pytest.raises(mcz.OptionError, match="mean_error_cm and q exclude each other"):
        mcz.write(WALK, io.BytesIO(), codec="pca", mean_error_cm=1, q=3)
