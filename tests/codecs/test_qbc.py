"""Codec 17, ``qbc``: the bound, breaks, segments, streams, published figures."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import mcz
from mcz.codecs.curves import qbc, streams
from mcz.codecs.curves.choices import STEP_SHARE
from mcz.codecs.parameters import SCALED
from mcz.kinematics.angles import unwrap
from mcz.kinematics.points import reach
from mcz.model.motion import Channel, Joint, Motion, Signal, Skeleton
from mcz.model.schema import parse
from tests.codecs import lossy
from tests.codecs.lossy import Direct, clip_of
from tests.motions import smooth

Array = np.ndarray


def encode_file(motion: Motion, **params: object) -> bytes:
    return lossy.encode_file("qbc", motion, **params)


def encode_and_decode(motion: Motion, **params: object) -> Array:
    return lossy.encode_and_decode("qbc", motion, **params)


def encode_directly(motion: Motion, **params: object) -> Direct:
    return Direct("qbc", motion, **params)


def joints_of(sizes: list[int]) -> Skeleton:
    """A joint each of so many channels, some of them none."""
    kinds = ("rx", "tx", "ry", "sx")
    found = [tuple(Channel(kinds[c % 4], f"c{c}") for c in range(size)) for size in sizes]
    return Skeleton(tuple(Joint(f"j{j}", j - 1, channels=c) for j, c in enumerate(found)))


def joint_walks(n_frames: int, sizes: list[int], seed: int = 0, roughness: float = 4.0) -> Motion:
    """Random walks of joints with so many channels."""
    random = np.random.default_rng(seed)
    steps = random.normal(0, roughness, (n_frames, sum(sizes)))
    values = np.cumsum(steps, axis=0) + random.normal(0, 100, sum(sizes))
    return Motion(joints_of(sizes), (Signal(values),), name="clip")


def of_any(values: list[float]) -> Motion:
    """A joint of two channels with just these values."""
    pairs = np.array(values[: len(values) // 2 * 2], np.float64).reshape(-1, 2)
    skeleton = Skeleton((Joint("j", channels=(Channel("tx"), Channel("ty"))),))
    return Motion(skeleton, (Signal(pairs),), name="clip")


SIZES = st.lists(st.integers(0, 7), min_size=1, max_size=3).filter(any)
FRAMES = st.one_of(st.integers(1, 12), st.integers(1, 150))
SETTINGS = st.fixed_dictionaries(
    {
        "d2_lmt": st.sampled_from([1e-4, 0.5, 9.0, 400.0]),
        "delta": st.sampled_from([1, 2, 7, 16, 40, 200]),
        "breaks": st.sampled_from(["split", "fewest"]),
        "middle": st.sampled_from(["least-squares", "published"]),
    },
    optional={"Q": st.sampled_from([0, 2, 4])},
)


# The bound


def curves_of(clip: Direct, group: int) -> list[tuple[int, int]]:
    """First and last frame of each curve of a joint, from the streams."""
    fields = parse(qbc.QbcHeader, clip.header, "header")
    n_channels = len(clip.layout.groups[group])
    found = []
    for index, span in enumerate(clip.spans):
        frames = qbc.marks_of(span.first, span.stop, fields.coded_frames, fields.delta)
        own = len(frames) - (span.stop < fields.coded_frames)
        marks = streams.parse_marks(clip.stream(index, 0, group), own, n_channels)
        if own < len(frames):
            after = streams.parse_first_mark(clip.stream(index + 1, 0, group), n_channels)
            marks = np.concatenate([marks, after])
        curves = streams.parse_curves(clip.stream(index, 1, group), marks, frames, whole=True)
        ends = int(frames[0]) + np.cumsum([0, *curves.lengths])
        found += [(int(a), int(b)) for a, b in zip(ends, ends[1:], strict=False)]
    return found


def step_of(clip: Direct) -> float:
    fields = parse(qbc.QbcHeader, clip.header, "header")
    return float(fields.step if fields.decimals == SCALED else 10.0**-fields.decimals)


def check_bound(motion: Motion, limit: float, clip: Direct, *, closed: bool) -> None:
    """No frame is farther from its curve than SPEC.md allows, all channels of a joint together."""
    fields = parse(qbc.QbcHeader, clip.header, "header")
    errors = clip.read() - unwrap(motion.values, motion.skeleton)
    if fields.decimals == SCALED:
        lengths = [c.kind in ("tx", "ty", "tz", "length") for c in motion.skeleton.channels]
        errors = errors / np.where(lengths, fields.position_step / fields.step, 1.0)
    slack = 1e-9 * (1 + np.abs(motion.values).max(initial=0.0))
    for group, columns in enumerate(clip.layout.groups):
        distances = np.sqrt((errors[:, list(columns)] ** 2).sum(axis=1))
        rounding = math.sqrt(len(columns)) * step_of(clip) / 2
        if not closed:
            assert distances.max() <= math.sqrt(limit) + rounding + slack
            continue
        touching: dict[int, int] = {}  # the longest curve that has the frame
        for a, b in curves_of(clip, group):
            for frame in range(a, b + 1):
                touching[frame] = max(touching.get(frame, 0), b - a)
        for frame, distance in enumerate(distances):
            single = touching.get(frame, 0) < 2
            assert distance <= (max(rounding, math.sqrt(limit)) if single else limit**0.5) + slack


PRESETS = st.sampled_from(["default", "khan2014"])  # which holds it before rounding


@given(FRAMES, SIZES, SETTINGS, st.integers(0, 99), st.sampled_from([0.01, 1.0, 30.0]), PRESETS)
def test_the_bound_holds(n_frames, sizes, settings, seed, roughness, preset) -> None:
    motion = joint_walks(n_frames, sizes, seed, roughness)
    clip = encode_directly(motion, **settings, preset=preset)
    check_bound(motion, settings["d2_lmt"], clip, closed=preset == "default")


@given(st.lists(st.floats(-1e6, 1e6), min_size=2, max_size=60), SETTINGS, PRESETS)
def test_the_bound_holds_for_any_values(values, settings, preset) -> None:
    motion = of_any(values)
    clip = encode_directly(motion, **settings, preset=preset)
    check_bound(motion, settings["d2_lmt"], clip, closed=preset == "default")


@given(FRAMES, SIZES, SETTINGS, st.integers(0, 99))
def test_fewest_breaks_are_no_more(n_frames, sizes, settings, seed) -> None:
    motion = joint_walks(n_frames, sizes, seed)
    counts = [
        [len(curves_of(clip, group)) for group in range(len(clip.layout.groups))]
        for breaks in ("split", "fewest")
        for clip in (encode_directly(motion, **{**settings, "breaks": breaks}),)
    ]
    assert all(fewest <= split for split, fewest in zip(*counts, strict=True))


def test_fewest_breaks_take_fewer_bytes() -> None:
    motion = joint_walks(800, [3, 3, 3, 6], roughness=0.3)
    assert encode_directly(motion, breaks="fewest").n_bytes < 0.97 * encode_directly(motion).n_bytes


def test_a_limit_of_0_keeps_what_decimals_hold() -> None:
    motion = smooth(90)
    decoded = encode_and_decode(motion, d2_lmt=0, Q=4)
    np.testing.assert_allclose(decoded, motion.values, rtol=0, atol=1e-9)


def test_a_parabola_is_one_curve() -> None:
    frames = np.arange(41.0)[:, None]
    motion = clip_of(np.hstack([frames**2 / 40, 3 * frames - 7]), ["tx", "ty"])
    for middle in qbc.MIDDLES:
        clip = encode_directly(motion, d2_lmt=1e-3, middle=middle)
        assert [curves_of(clip, group) for group in range(2)] == [[(0, 40)]] * 2
        np.testing.assert_allclose(clip.read(), motion.values, rtol=0, atol=0.04)


def test_the_step_follows_from_the_limit() -> None:
    for limit in (1e-6, 1.0, 50.0):
        assert step_of(encode_directly(smooth(20), d2_lmt=limit)) == STEP_SHARE * limit**0.5


def test_a_part_fetches_the_next_segment_only_where_it_must() -> None:
    clip = encode_directly(smooth(100), delta=10, segment_frames=20)
    for start, stop, resolution, meant in (
        (25, 31, 0, {(1, 0), (1, 1)}),
        (25, 32, 0, {(1, 0), (1, 1), (2, 0)}),
        (25, 31, 1, {(1, 0)}),
        (30, 31, 1, {(1, 0)}),
        (38, 41, 0, {(1, 0), (1, 1), (2, 0), (2, 1)}),
        (99, 100, 0, {(4, 0), (4, 1)}),
    ):
        asked = set()

        def fetch(segment: int, stored: int, group: int, asked: Any = asked) -> bytes:
            assert group == 2
            asked.add((segment, stored))
            return clip.stream(segment, stored, group)

        clip.read(start, stop, (2,), resolution, {"fetch": fetch})
        assert asked == meant, (start, stop)


# Clips out of the ordinary


def test_points_up_to_the_limit_are_coded() -> None:
    values = np.array([[2.0**40, -(2.0**40)], [-(2.0**40), 2.0**40], [0, 1], [2.0**40, 5]])
    decoded = encode_and_decode(clip_of(values, ["tx", "ty"]), Q=0, d2_lmt=0, delta=1)
    np.testing.assert_array_equal(decoded, values)
    with pytest.raises(mcz.MotionError, match="exceeds"):  # a middle point lies beyond
        encode_file(clip_of(values, ["tx", "ty"]), Q=0, d2_lmt=0, delta=2)
    with pytest.raises(mcz.MotionError, match="exceeds"):
        encode_file(clip_of(values + 1, ["tx", "ty"]), Q=0, d2_lmt=0)


# Parameters


@pytest.mark.parametrize("limit", [0, 0.0, 5e-324, 1e-60])
def test_a_step_is_needed(limit: float) -> None:
    with pytest.raises(mcz.OptionError, match="d2_lmt .*step"):
        encode_file(smooth(20), d2_lmt=limit)
    assert encode_file(smooth(20), d2_lmt=limit, Q=1)


def test_fewest_breaks_need_marks_near_each_other() -> None:
    with pytest.raises(mcz.OptionError, match="breaks=fewest allows delta up to 512"):
        encode_file(smooth(20), breaks="fewest", delta=513)


def test_presets() -> None:
    clip = encode_directly(smooth(400), preset="khan2014")
    fields = parse(qbc.QbcHeader, clip.header, "header")
    assert (fields.delta, fields.decimals, fields.coded_frames) == (80, 2, 400)
    assert len(clip.segments) == 1
    same = {"d2_lmt": 4, "delta": 80, "Q": 2, "middle": "published"}
    assert encode_directly(smooth(400), preset="khan2014", **same).segments == clip.segments
    default = parse(qbc.QbcHeader, encode_directly(smooth(400)).header, "header")
    assert (default.delta, default.decimals, default.step) == (40, SCALED, 0.75)
    lever = reach(smooth(1).skeleton) * math.pi / 180
    assert default.position_step == 0.75 * lever
