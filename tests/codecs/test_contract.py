"""The contract of every codec: error bounds, partial decoding, edits, odd clips."""

from __future__ import annotations

import contextlib
import io
import itertools
import math
import re
from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import mcz
from mcz.codecs import CODECS, codec_by_name
from mcz.model.motion import POSITION_KINDS, Channel, Joint, Motion, Signal, Skeleton, joint_columns
from tests import overlap_codec
from tests.codecs.cases import CASES, Case, expected_values, small, write_case, write_smooth
from tests.codecs.lossy import (
    Direct,
    bones,
    bytes_of,
    clip_of,
    markers,
    markers_with_gaps,
    random_walks,
)
from tests.motions import smooth

EVERY = pytest.mark.parametrize("name", CASES)
FINITE = pytest.mark.parametrize("name", [n for n in CASES if n != "overlap"])
LOSSY = pytest.mark.parametrize("name", [n for n in CASES if CASES[n].error > 1e-9])
LOSSLESS = ("raw", "fast", "best")
CODEC = pytest.mark.parametrize("name", CODECS)
LOSSY_CODEC = pytest.mark.parametrize("name", [n for n in CODECS if n not in LOSSLESS])


@pytest.fixture(autouse=True, scope="module")
def overlap() -> Iterator[None]:
    CODECS[overlap_codec.CODEC.name] = overlap_codec.CODEC
    yield
    del CODECS[overlap_codec.CODEC.name]


def test_every_codec_has_a_case() -> None:
    assert {case.name for case in CASES.values()} == set(CODECS)


def encode_and_decode(motion: Motion, case: Case, **params: Any) -> np.ndarray:
    with mcz.open(write_case(motion, case, **params), max_decoded=2**40) as file:
        return file.only_clip().read()


# Values


@EVERY
@pytest.mark.parametrize("n_frames", [0, 1, 2, 3, 100])
def test_values_come_back(name: str, n_frames: int) -> None:
    case, data = CASES[name], write_smooth(name, n_frames)
    assert mcz.verify(data) == []
    with mcz.open(data) as file:
        clip = file.only_clip()
        assert (clip.codec, clip.n_frames) == (case.name, n_frames)
        decoded = clip.read()
    wanted = expected_values(case, smooth(n_frames))
    assert decoded.shape == wanted.shape
    assert np.abs(decoded - wanted).max(initial=0) <= case.error
    assert (
        decoded.size < 99 or (decoded == wanted).all() == case.codec.lossless or name == "overlap"
    )


@EVERY
@pytest.mark.parametrize("length", [7, 32])
def test_segments_hold_what_one_would(name: str, length: int) -> None:
    case, many = CASES[name], write_smooth(name, 100, length)
    with mcz.open(many) as file, mcz.open(write_smooth(name, 100, 4096)) as other:
        clip, whole = file.only_clip(), other.only_clip().read()
        rows = [row.header for row in clip.signals[0].rows]
        decoded = clip.read()
    assert len(rows) > 1
    assert [row.first for row in rows] == [0, *(row.stop for row in rows[:-1])]
    assert rows[-1].stop == 100
    assert np.abs(decoded - expected_values(case, smooth(100))).max() <= case.error
    if case.is_free:
        assert decoded.tobytes() == whole.tobytes()


@EVERY
def test_the_same_clip_gives_the_same_bytes(name: str) -> None:
    assert write_case(smooth(100), CASES[name]) == write_smooth(name)


@FINITE
def test_segments_keep_to_the_memory_that_is_allowed(name: str) -> None:
    """Limit for 40 frames; codecs may round up to whole blocks of 16."""
    case = CASES[name]
    motion = markers(200, 1) if case.of_points else random_walks(200, ["tx", "rx", "rz"])
    limits = {**case.length(150), "segment_bytes": 40 * 8 * 3}
    if case.params.get("preset") == "khan2014" and case.name == "qbc":
        with pytest.raises(mcz.OptionError, match="delta is 80, but .* at most 40 frames"):
            small(name).again(motion, **limits)
        return
    many = small(name).again(motion, **limits)
    assert max(span.n_frames for span in many.spans) <= 48
    if case.is_free:
        assert many.read().tobytes() == small(name).again(motion).read().tobytes()


@pytest.mark.parametrize(
    ("codec", "params", "lead"), [("mrdwt", {}, 8 * 15), ("qbc", {}, 39), ("pca", {"q": 20}, 0)]
)
def test_a_long_clip_is_cut_into_segments_by_size(codec: str, params: Any, lead: int) -> None:
    """Noise fills 64 KiB soon: segments get shorter, the values stay near or those of one."""
    values = np.random.default_rng(3).normal(0, 1000, (6000, 20))
    motion = clip_of(values, ["tx"] * 20)
    many, one = (Direct(codec, motion, **params, **more) for more in ({}, {"segment_frames": 6000}))
    assert len(many.segments) > 2 and len(one.segments) == 1
    assert all(sum(map(len, segment.streams)) < 2**16 for segment in many.segments)
    assert all(segment.lead == min(segment.first, lead) for segment in many.segments)
    assert lead == 0 or many.read().tobytes() == one.read().tobytes()
    assert np.abs(many.read() - values).max() < 4


# Parts


@EVERY
@settings(max_examples=8)
@given(data=st.data())
def test_a_part_is_what_it_is_in_the_whole(name: str, data: st.DataObject) -> None:
    n_frames = data.draw(st.sampled_from([1, 20, 100]))
    file_data = write_smooth(name, n_frames, data.draw(st.sampled_from([0, 2, 7, 32])))
    with mcz.open(file_data, unverified=data.draw(st.booleans())) as file:
        clip = file.only_clip()
        resolution = data.draw(st.integers(0, clip.signals[0].counts.n_resolutions - 1))
        start = data.draw(st.integers(0, n_frames))
        stop = data.draw(st.integers(start, n_frames))
        joints = data.draw(st.lists(st.sampled_from(clip.skeleton.addresses()), max_size=4))
        whole = clip.read(resolution=resolution)
        np.testing.assert_array_equal(
            clip.read((start, stop), resolution=resolution), whole[start:stop]
        )
        columns = joint_columns(clip.skeleton, joints)
        part = clip.read((start, stop), joints, resolution)
        np.testing.assert_array_equal(part, whole[start:stop][:, columns])
        thin = clip.read((start, stop), joints, resolution, decimate=True)
        np.testing.assert_array_equal(thin, part[:: 2**resolution])


@EVERY
def test_a_part_needs_its_own_streams_alone(name: str) -> None:
    """No bytes of other segments, groups or finer resolutions are fetched."""
    coded, n = small(name), small(name).layout.n_resolutions
    for segment, start, stop in ((0, 1, 3), (len(coded.spans) - 1, 18, 20)):
        for group, resolution in itertools.product(range(len(coded.layout.groups)), range(n)):
            asked: set[tuple[int, int, int]] = set()

            def fetch(*place: int, asked: Any = asked) -> bytes:
                asked.add(place)
                return coded.stream(*place)

            assert coded.read(start, stop, (group,), resolution, {"fetch": fetch}).size
            assert {place[1] for place in asked} <= set(range(n - resolution))
            assert {place[2] for place in asked} <= {group}
            if not CASES[name].is_free and name != "overlap":
                assert {place[0] for place in asked} <= {segment}


@EVERY
def test_details_that_are_not_stored_are_those_left_out(name: str) -> None:
    coded = small(name)
    for k in range(coded.layout.n_resolutions):
        shorter = replace(coded.layout, n_resolutions=coded.layout.n_resolutions - k)
        decoded = coded.read(changes={"layout": shorter})
        assert decoded.tobytes() == coded.read(resolution=k).tobytes()


@EVERY
def test_resolutions_out_of_range_are_refused(name: str) -> None:
    with mcz.open(write_smooth(name)) as file:
        clip = file.only_clip()
        n = clip.signals[0].counts.n_resolutions
        with pytest.raises(mcz.OptionError, match=f"resolutions 0 to {n - 1}"):
            clip.read(resolution=n)


# Edits


def extract_clips(data: bytes, **how: Any) -> bytes:
    out = io.BytesIO()
    mcz.extract(data, out, **how)
    assert mcz.verify(out.getvalue()) == []
    return out.getvalue()


@EVERY
@pytest.mark.parametrize("frames", [None, (31, 32), (45, 83)])
def test_what_is_extracted_has_the_same_values(name: str, frames: tuple[int, int] | None) -> None:
    case, data = CASES[name], write_smooth(name, 100, 16)
    start, stop = frames or (0, 100)
    with mcz.open(data) as file:
        whole = file.only_clip()
        n = whole.signals[0].counts.n_resolutions
        by_joint = case.codec.grouping != "all"
        for joints in (None, ["spine"], ["knee", "hips"]) if by_joint else (None,):
            for k in sorted({0, min(1, n - 1), n - 1}):
                if (frames, joints, k) == (None, None, 0):
                    continue
                part = extract_clips(data, frames=frames, joints=joints, resolution=k)
                kept = joints and sorted(joints)
                wanted = whole.read((start, stop), kept, k)
                with mcz.open(part) as other:
                    clip = other.only_clip()
                    assert clip.read().tobytes() == wanted.tobytes()
                    piece = clip.read((0, (stop - start) // 2))
                    assert piece.tobytes() == wanted[: (stop - start) // 2].tobytes()
                    assert clip.signals[0].counts.n_resolutions == n - k
                if stop - start > 20:
                    again = extract_clips(part, frames=(9, 17))
                    with mcz.open(again) as other:
                        assert other.only_clip().read().tobytes() == wanted[9:17].tobytes()
    if not by_joint:
        with pytest.raises(mcz.OptionError, match="recode"):
            extract_clips(data, joints=["hips" if "hips" in whole.skeleton.addresses() else 0])


@EVERY
@pytest.mark.parametrize("frames", [(5, 30), (42, None), (8, 8)])
def test_frames_that_are_cut_off_are_gone(name: str, frames: tuple[int, int | None]) -> None:
    case, data = CASES[name], write_smooth(name)
    start, stop = frames[0], frames[1] or 100
    part = extract_clips(data, frames=frames, recode=True)
    with mcz.open(data) as file, mcz.open(part) as other:
        before, after = file.only_clip(), other.only_clip()
        rows = [[row.header.n_frames for row in info.rows] for info in after.signals]
        assert list(map(sum, rows)) == [stop - start]
        assert after.codec == case.name
        off = np.abs(after.read() - before.read()[start:stop])
        assert off.max(initial=0) <= 2 * case.error
        np.testing.assert_array_equal(after.frame_numbers, before.frame_numbers[start:stop])
        if after.quality:
            assert after.quality["cut-frames"] == f"{start}:{stop}"
    # What an earlier cut left stored goes, too.
    again = extract_clips(extract_clips(data, frames=frames), clip="smooth", recode=True)
    with mcz.open(again) as other:
        rows = [[row.header.n_frames for row in info.rows] for info in other.only_clip().signals]
        assert list(map(sum, rows)) == [stop - start]


def test_clips_of_all_codecs_are_merged(tmp_path: Path) -> None:
    for name, case in CASES.items():
        motion = replace(smooth(40), name=name)
        (tmp_path / f"{name}.mcz").write_bytes(write_case(motion, case))
    mcz.merge(sorted(tmp_path.glob("*.mcz")), tmp_path / "all.mcz")
    assert mcz.verify(tmp_path / "all.mcz") == []
    with mcz.open(tmp_path / "all.mcz") as file:
        assert set(file.clips) == set(CASES)
        for name in CASES:
            with mcz.open(tmp_path / f"{name}.mcz") as other:
                assert file.clips[name].read().tobytes() == other.only_clip().read().tobytes()


# Clips out of the ordinary


@FINITE
def test_masks_are_kept_and_what_lies_beneath_is_not_coded(name: str) -> None:
    case, motion = CASES[name], replace(markers_with_gaps(), frame_rate=Fraction(60))
    mask = motion.signals[0].mask
    with mcz.open(write_case(motion, case, **case.length(40))) as file:
        clip = file.only_clip()
        values, found = clip.read_masked()
        np.testing.assert_array_equal(found, mask)
        assert np.abs(values - motion.signals[0].values)[mask].max() <= case.error
        assert case.codec.lossless or np.abs(values).max() < 200
        shown = clip.read((40, 70), ["RASI"])
        np.testing.assert_array_equal(np.isnan(shown), ~mask[40:70, 3:])


def odd_clips() -> dict[str, Motion]:
    kinds = ["qw", "qx", "qy", "qz", "length", "sx", "tx"]
    tailed = Joint("root", channels=tuple(map(Channel, kinds)), tails=((0.0, 1.0, 0.0),))
    values = 1 + 0.1 * np.sin(np.arange(60)[:, None] / 9 + np.arange(7))
    face = Skeleton((Joint("face", channels=(Channel("", "smile", "%"), Channel("", "blink"))),))
    far = Joint("b", 0, (1.5e308, 1.5e308, 0.0), channels=(Channel("rx"),))
    flat = Joint("b", 0, channels=(Channel("rx"),))
    moving = Joint("a", channels=(Channel("tx"), Channel("rx")))
    return {
        "has no channels": Motion(Skeleton((Joint("rock"),)), (Signal(np.zeros((40, 0))),)),
        "no joints": Motion(Skeleton(()), (Signal(np.zeros((0, 0))),)),
        "still": clip_of(np.tile([0.0, 77.5, -123.0], (300, 1)), ["tx", "ty", "tz"]),
        "of all kinds": Motion(Skeleton((tailed,)), (Signal(values),)),
        "scalars": Motion(face, (Signal(values[:, :2]),)),
        "no angle unit": Motion(bones(["tx", "rx"], ""), (Signal(values[:, :2]),)),
        "no extent": Motion(Skeleton((moving, flat)), (Signal(values[:, :3]),)),
        "huge offsets": Motion(Skeleton((moving, far)), (Signal(values[:, :3]),)),
        "wide": markers(6, 100),
        "turning": clip_of((np.arange(90.0)[:, None] * 7 + 180) % 360 - 180),
    }


ODD = odd_clips()
PLACELESS = ("scalars", "no angle unit", "huge offsets", "no extent")  # no points that move


@EVERY
@pytest.mark.parametrize("odd", ODD)
def test_odd_clips(name: str, odd: str) -> None:
    case, motion = CASES[name], replace(ODD[odd], frame_rate=Fraction(60), name=odd)
    if case.of_points and odd in PLACELESS:
        with pytest.raises((mcz.MotionError, mcz.OptionError)):
            write_case(motion, case)
        return
    decoded, wanted = encode_and_decode(motion, case), expected_values(case, motion)
    assert decoded.shape == wanted.shape
    assert np.abs(decoded - wanted).max(initial=0) <= (3 if odd == "wide" else 1) * case.error


@LOSSY
def test_a_clip_of_zeros_takes_next_to_nothing(name: str) -> None:
    motion = markers(500, 4)
    coded = small(name).again(motion.with_values(np.zeros((500, 12))), segment_frames=512)
    assert coded.n_bytes <= 600  # less than a bit a value
    assert not coded.read().any()


@FINITE
@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_values_that_are_not_finite_are_refused(name: str, bad: float) -> None:
    case = CASES[name]
    values = np.array(markers(60, 2).values)
    values[30, 4] = bad
    motion = markers(60, 2).with_values(values)
    if case.codec.lossless:
        assert encode_and_decode(motion, case).tobytes() == values.tobytes()
        return
    with pytest.raises(
        mcz.MotionError, match=rf"{case.name}: a value (in|of) frames? .*{'not finite'}"
    ):
        write_case(motion, case)


@LOSSY
@pytest.mark.parametrize("huge", [1e13, 1e20, 1e300, -1.7e308])
@pytest.mark.parametrize("kind", ["rx", "tx", "length"])
def test_huge_values_are_refused_or_coded(name: str, kind: str, huge: float) -> None:
    case, values = CASES[name], np.ones((60, 2))
    values[20, 1], values[21, 1] = huge, -huge
    with contextlib.suppress(mcz.MotionError):
        assert np.isfinite(encode_and_decode(clip_of(values, [kind, kind]), case)).all()


@LOSSY_CODEC
def test_what_a_lossy_signal_cannot_be(name: str) -> None:
    params = {"domain": "channels"} if codec_by_name(name).positions else {}
    params |= {"step": 0.1} if name == "posewave" else {}
    own = Signal(np.zeros((10, 2)), channels=(Channel("", "a"), Channel("", "b")))
    for signal, words in (
        (Signal(np.zeros((10, 2)), samples_per_frame=2), "one sample a frame"),
        (Signal(np.zeros((10, 2), np.int64)), "integers"),
        (own, "has its own"),
    ):
        with pytest.raises(mcz.MotionError, match=words):
            write_case(
                replace(clip_of(np.zeros((10, 2))), signals=(signal,)), Case(name, 0, params)
            )


@LOSSY_CODEC
def test_a_c3d_comes_back_with_its_gaps_and_signals(
    name: str, samples: Path, tmp_path: Path
) -> None:
    target, back = tmp_path / "walk.mcz", tmp_path / "back.c3d"
    mcz.encode(samples / "walk.c3d", target, codec=name)
    with mcz.open(target) as file:
        clip = file.only_clip()
        assert {info.codec.name for info in clip.signals[1:]} == {"fast"}
        back.write_bytes(clip.source_bytes())
        stated = float(clip.quality["mean_position_error"])
    source, again = mcz.read(samples / "walk.c3d"), mcz.read(back)
    compared = mcz.compare(source, again)
    assert compared.mismatched_points == 0
    assert compared.mean_position_error == pytest.approx(stated, rel=0.05)
    for before, after in zip(source.signals[1:], again.signals[1:], strict=True):
        np.testing.assert_array_equal(before.values, after.values)


@pytest.mark.long
@pytest.mark.parametrize(
    ("codec", "params", "n_frames", "least", "error"),
    [
        ("mrdwt", {"T_g": 0.02}, 900, 2, 1),
        ("qbc", {"d2_lmt": 4}, 900, 2, 2),
        ("pca", {"q": 250}, 300, 1, 3),
        ("dwt", {"t_w": 0.02}, 300, 1, 3),
        ("awt", {"a_w": 250}, 300, 1, 3),
    ],
)
def test_10000_channels(
    codec: str, params: dict[str, Any], n_frames: int, least: int, error: float
) -> None:
    """Long and wide: segments stay below the limits, memory below a few of them."""
    places = tuple(map(Channel, POSITION_KINDS))
    joints = tuple(Joint(f"p{i}", channels=places) for i in range(3334))
    values = np.cumsum(np.random.default_rng(0).normal(0, 1, (n_frames, 10_002)), axis=0)
    motion = Motion(Skeleton(joints, unit_cm=1.0), (Signal(values),), name="wide")
    with mcz.open(write_case(motion, Case(codec, 0, params)), max_decoded=2**40) as file:
        clip = file.only_clip()
        assert len(clip.signals[0].rows) >= least
        np.testing.assert_allclose(clip.read((100, 110)), values[100:110], atol=error)


# Parameters


DIALED = [name for name in CODECS if codec_by_name(name).dial]


@pytest.mark.parametrize("name", DIALED)
def test_a_finer_setting_costs_more_and_errs_less(name: str) -> None:
    dial, case, motion = codec_by_name(name).dial, Case(name), smooth(200)
    rising, falling = (1, 3, 6, 100), (10, 1.0, 0.1, 0.01)
    sizes, errors = [], []
    for setting in rising if dial.rises else falling:
        coded = write_case(motion, case, **{dial.parameter: setting})
        with mcz.open(coded) as file:
            errors.append(np.abs(file.only_clip().read() - expected_values(case, motion)).mean())
        sizes.append(bytes_of(coded))  # without the quality record
    assert sizes == sorted(sizes) and errors == sorted(errors, reverse=True)
    assert errors[-1] < errors[0] / 4


def bad_values(range_: str) -> list[Any]:
    """Values that a parameter of that range refuses, those next to its ends among them."""
    numbers = re.fullmatch(r"(\S+) to (\S+)", range_)
    if numbers is None:
        return ["", "nothing", 7, [4]]
    low, high = (float(end.replace(",", "")) for end in numbers.groups())
    around = [low - 1 if "." not in numbers[1] else low / 2, high * 2]
    return ["", "many", math.nan, math.inf, [4], *around, *map(str, around)]


@CODEC
def test_bad_parameters_are_refused_by_name(name: str) -> None:
    codec, seen = codec_by_name(name), 0
    for parameter in codec.parameters:
        if not parameter.range or "path" in parameter.range or "auto" in parameter.range:
            continue
        for value in bad_values(parameter.range):
            with pytest.raises(mcz.OptionError, match=rf"^{parameter.name} |'{parameter.name}'"):
                write_case(smooth(5), Case(name), **{parameter.name: value})
            seen += 1
    assert seen > 5
    with pytest.raises(
        mcz.OptionError, match=f"{name} has no parameter 'level'; its parameters are"
    ):
        write_case(smooth(5), Case(name), level=4)


@EVERY
def test_values_of_text_are_parsed(name: str) -> None:
    codec, params = CASES[name].codec, CASES[name].params
    assert codec.options({k: str(v) for k, v in params.items()}) == codec.options(params)


@LOSSY
def test_a_quality_record_says_how_and_how_well(name: str) -> None:
    case, motion = CASES[name], smooth(100)
    with mcz.open(write_smooth(name)) as file:
        quality = file.only_clip().quality
        decoded = mcz.compare(motion, file.only_clip().motion())
    assert quality["codec"] == case.name
    recorded = {key: quality[f"param.{key}"] for key in case.params}
    assert case.codec.options(recorded) == case.codec.options(case.params)
    assert float(quality["mean_position_error"]) == pytest.approx(decoded.mean_position_error)
    assert "target_reached" not in quality
