"""What ``pca``, ``dwt`` and ``awt`` have in common: odd clips, parts, cuts, hostile bytes."""

from __future__ import annotations

import io
import math
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import mcz
from mcz.angles import unwrap
from mcz.codecs import CODECS, by_name
from mcz.codecs.pca import pca
from mcz.codecs.wavelet import awt, dwt
from mcz.metrics import compare
from mcz.motion import POSITION_KINDS, Channel, Joint, Motion, Signal, Skeleton
from tests.codecs.lossy import Direct, bones, clip_of, decoded, gapped, saved, wandering
from tests.motions import smooth
from tests.repair import flipped, flips, joined, parts_of, replaced, use

NAMES = ("pca", "dwt", "awt")
FINE: dict[str, dict[str, object]] = {  # settings that keep nearly everything
    "pca": {"q": 99, "Q": 4},
    "dwt": {"t_w": 0.0005, "Q": 4},
    "awt": {"a_w": 10**6, "Q": 4},
}
COARSE: dict[str, dict[str, object]] = {
    "pca": {"q": 2},
    "dwt": {"t_w": 5.0},
    "awt": {"a_w": 6},
}
SETTINGS = [(name, s) for name in NAMES for s in ({}, FINE[name], COARSE[name])]
SETTINGS += [(name, {"preset": "khan2014"}) for name in NAMES]
KINDS = st.lists(st.sampled_from(["rx", "ry", "tx", "sx", "length"]), min_size=1, max_size=5)
FRAMES = st.one_of(st.integers(1, 20), st.integers(1, 200))
CASES = st.sampled_from(SETTINGS)


def test_the_table_of_codecs_has_them() -> None:
    assert [CODECS[i] for i in (4, 5, 6)] == [pca.CODEC, dwt.CODEC, awt.CODEC]
    assert not any(by_name(name).lossless for name in NAMES)
    assert {by_name(name).domain for name in NAMES} == {"values"}


# A part is the same as in the whole


@given(FRAMES, KINDS, CASES, st.one_of(st.none(), st.integers(1, 90)), st.data())
def test_part_equals_whole(n_frames, kinds, case, segment_frames, data) -> None:
    name, settings = case
    extra = {} if segment_frames is None else {"segment_frames": segment_frames}
    coded = Direct(name, wandering(n_frames, kinds), **settings, **extra)
    resolution = data.draw(st.integers(0, coded.layout.n_resolutions - 1))
    whole = coded.read(resolution=resolution)
    n_groups = len(coded.layout.groups)
    for _ in range(3):
        start = data.draw(st.integers(0, n_frames))
        stop = data.draw(st.integers(start, n_frames))
        groups = tuple(data.draw(st.lists(st.integers(0, n_groups - 1), unique=True)))
        columns = [column for group in groups for column in coded.layout.groups[group]]
        part = coded.read(start, stop, groups, resolution)
        assert part.tobytes() == np.ascontiguousarray(whole[start:stop][:, columns]).tobytes()


@given(FRAMES, KINDS, st.sampled_from(NAMES), st.one_of(st.none(), st.integers(8, 90)))
def test_fine_settings_lose_only_rounding(n_frames, kinds, name, segment_frames) -> None:
    motion = wandering(n_frames, kinds)
    extra = {} if segment_frames is None else {"segment_frames": segment_frames}
    found = decoded(name, motion, **FINE[name], **extra)
    np.testing.assert_allclose(found, unwrap(motion.values, motion.skeleton), rtol=0, atol=0.02)


@pytest.mark.parametrize("name", NAMES)
def test_the_public_reader_reads_joints(name: str) -> None:
    with mcz.open(saved(name, smooth(80), segment_frames=32)) as file:
        clip = file.only_clip()
        whole = clip.read()
        columns = [
            c for j in ("knee", "hips") for c in clip.skeleton.columns(clip.skeleton.find(j))
        ]
        part = clip.read((10, 50), ["knee", "hips"])
        np.testing.assert_array_equal(part, whole[10:50][:, columns])
        assert clip.read(joints=["fixed"]).shape == (80, 0)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("frames", [(0, 60), (90, 170), (150, 210), (205, None)])
def test_frames_that_are_extracted_have_the_same_values(name: str, frames) -> None:
    data = saved(name, smooth(210), segment_frames=32)
    out = io.BytesIO()
    mcz.extract(data, out, frames=frames)
    with mcz.open(data) as whole, mcz.open(out.getvalue()) as part:
        meant = whole.only_clip().read((frames[0], frames[1] or 210))
        assert part.only_clip().read().tobytes() == meant.tobytes()
        assert part.only_clip().read((2, 4)).tobytes() == meant[2:4].tobytes()


@pytest.mark.parametrize("name", ["dwt", "awt"])
def test_joints_and_resolutions_that_are_extracted(name: str) -> None:
    data = saved(name, smooth(210), segment_frames=32, N=4)
    out = io.BytesIO()
    mcz.extract(data, out, joints=["spine"], resolution=1)
    with mcz.open(data) as whole, mcz.open(out.getvalue()) as part:
        meant = whole.only_clip().read(joints=["spine"], resolution=1)
        assert part.only_clip().read().tobytes() == meant.tobytes()


def test_joints_of_pca_cannot_be_cut() -> None:
    with pytest.raises(mcz.MczError):
        mcz.extract(saved("pca", smooth(60)), io.BytesIO(), joints=["spine"])


# Clips out of the ordinary


@pytest.mark.parametrize("n_frames", [0, 1, 2, 3])
@pytest.mark.parametrize(("name", "settings"), SETTINGS)
def test_few_frames(n_frames: int, name: str, settings: dict[str, object]) -> None:
    for kinds in (["tx", "rx", "ry"], ["rz"]):
        motion = wandering(n_frames, kinds)
        found = decoded(name, motion, **settings)
        assert found.shape == (n_frames, len(kinds))
        if settings is FINE[name]:
            np.testing.assert_allclose(found, unwrap(motion.values, motion.skeleton), atol=0.01)


@pytest.mark.parametrize(("name", "settings"), SETTINGS)
def test_constant_and_zero_channels(name: str, settings: dict[str, object]) -> None:
    values = np.tile([0.0, 77.5, -123.0], (300, 1))
    found = decoded(name, clip_of(values), **settings)
    size = 0.05 if settings else 0.3
    if settings is not COARSE[name] and (name, settings) != ("awt", {"preset": "khan2014"}):
        np.testing.assert_allclose(found, values, atol=size)
    assert not np.abs(found[:, 0]).max() > 0.01


@pytest.mark.parametrize(("name", "settings"), SETTINGS)
def test_all_zero_clips_have_empty_streams(name: str, settings: dict[str, object]) -> None:
    coded = Direct(name, clip_of(np.zeros((500, 7))), **settings)
    assert coded.n_bytes == 0
    assert not coded.read().any()


@pytest.mark.parametrize(("name", "settings"), SETTINGS)
def test_no_channels_at_all(name: str, settings: dict[str, object]) -> None:
    motion = Motion(Skeleton((Joint("rock"),)), (Signal(np.zeros((40, 0))),), name="still")
    assert decoded(name, motion, **settings).shape == (40, 0)
    none = Motion(Skeleton(()), (Signal(np.zeros((0, 0))),), name="nothing")
    assert decoded(name, none, **settings).shape == (0, 0)


@pytest.mark.parametrize(("name", "settings"), SETTINGS)
def test_masks_are_kept_and_gaps_are_filled(name: str, settings: dict[str, object]) -> None:
    motion = gapped()
    mask = motion.signals[0].mask
    with mcz.open(saved(name, motion, **settings)) as file:
        values, found = file.only_clip().read_masked()
        np.testing.assert_array_equal(found, mask)
        assert np.isfinite(values).all() and np.abs(values[~mask]).max() < 250
        if settings is FINE[name]:
            np.testing.assert_allclose(values[mask], motion.signals[0].values[mask], atol=0.05)
        shown = file.only_clip().read((40, 70), ["RASI"])
        np.testing.assert_array_equal(np.isnan(shown), ~mask[40:70, 3:])


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_values_that_are_not_finite_are_refused(name: str, bad: float) -> None:
    values = np.zeros((600, 2))
    values[300, 1] = bad
    with pytest.raises(mcz.MotionError, match=f"{name}: frames 0:600 hold a value that is not"):
        saved(name, clip_of(values))


@pytest.mark.parametrize("huge", [1e20, 1e300, 1.7e308, -1.7e308])
@pytest.mark.parametrize("kind", ["rx", "tx"])
@pytest.mark.parametrize(("name", "settings"), SETTINGS)
def test_huge_values_are_refused_or_coded(huge, kind, name, settings) -> None:
    values = np.ones((60, 2))
    values[20, 1], values[21, 1] = huge, -huge
    try:
        found = decoded(name, clip_of(values, [kind, kind]), **settings)
    except mcz.MotionError as error:
        assert "exceeds" in str(error) or "beyond" in str(error)
        return
    assert np.isfinite(found).all()


@pytest.mark.parametrize(("name", "settings"), SETTINGS)
def test_500_channels(name: str, settings: dict[str, object]) -> None:
    motion = wandering(64, ["tx", "ry", "rz", "rx"] * 125)
    coded = Direct(name, motion, **settings)
    whole = coded.read()
    assert whole.shape == (64, 500)
    part = coded.read(10, 20, (len(coded.layout.groups) - 1,))
    assert part.tobytes() == np.ascontiguousarray(whole[10:20][:, -part.shape[1] :]).tobytes()
    if settings is FINE[name]:
        np.testing.assert_allclose(whole, unwrap(motion.values, motion.skeleton), atol=0.1)


@pytest.mark.long
@pytest.mark.parametrize("name", NAMES)
def test_10000_channels(name: str) -> None:
    joints = tuple(
        Joint(f"p{i}", channels=tuple(map(Channel, POSITION_KINDS))) for i in range(3334)
    )
    values = np.cumsum(np.random.default_rng(0).normal(0, 1, (300, 10_002)), axis=0)
    motion = Motion(Skeleton(joints, unit_cm=1.0), (Signal(values),), name="wide")
    settings = {"pca": {"q": 250}, "dwt": {"t_w": 0.02}, "awt": {"a_w": 250}}[name]
    with mcz.open(saved(name, motion, **settings), max_decoded=2**40) as file:
        found = file.only_clip().read((100, 110))
        np.testing.assert_allclose(found, values[100:110], atol=3)


@pytest.mark.parametrize("name", NAMES)
def test_other_kinds_and_units(name: str) -> None:
    kinds = ["qw", "qx", "qy", "qz", "length", "sx"]
    joints = (Joint("root", channels=tuple(map(Channel, kinds)), tails=((0.0, 1.0, 0.0),)),)
    values = 1 + 0.1 * np.sin(np.arange(100)[:, None] / 9 + np.arange(6))
    motion = Motion(Skeleton(joints), (Signal(values),), name="mixed")
    np.testing.assert_allclose(decoded(name, motion, **FINE[name]), values, atol=0.01)
    face = Skeleton((Joint("face", channels=(Channel("", "smile", "%"), Channel("", "blink"))),))
    motion = Motion(face, (Signal(values[:, :2]),), name="face")
    np.testing.assert_allclose(decoded(name, motion, **FINE[name]), values[:, :2], atol=0.01)
    unknown = Motion(bones(["tx", "rx"], ""), (Signal(values[:, :2]),), name="odd")
    np.testing.assert_allclose(decoded(name, unknown, **FINE[name]), values[:, :2], atol=0.01)


@pytest.mark.parametrize("name", NAMES)
def test_rotations_come_back_unwrapped(name: str) -> None:
    values = (np.arange(300.0)[:, None] * 7 + 180) % 360 - 180
    found = decoded(name, clip_of(values), **FINE[name])
    np.testing.assert_allclose(found[:, 0], np.arange(300.0) * 7, atol=0.5)


@pytest.mark.parametrize("name", NAMES)
def test_what_a_lossy_signal_cannot_be(name: str) -> None:
    motion = clip_of(np.zeros((10, 2)))
    with pytest.raises(mcz.MotionError, match="one sample a frame"):
        saved(name, replace(motion, signals=(Signal(np.zeros((10, 2)), samples_per_frame=2),)))
    with pytest.raises(mcz.MotionError, match="integers"):
        saved(name, replace(motion, signals=(Signal(np.zeros((10, 2), np.int64)),)))


@pytest.mark.parametrize("name", NAMES)
def test_c3d_of_the_sample(name: str, samples, tmp_path) -> None:
    target, back = tmp_path / "walk.mcz", tmp_path / "back.c3d"
    mcz.encode(samples / "walk.c3d", target, codec=name)
    with mcz.open(target) as file:
        back.write_bytes(file.only_clip().source_bytes())
        stated = float(file.only_clip().quality["mean_position_error"])
    comparison = compare(mcz.read(samples / "walk.c3d"), mcz.read(back))
    assert comparison.mismatched_points == 0
    assert comparison.mean_position_error == pytest.approx(stated, rel=0.05)


# Parameters


COMMON = [
    *(("Q", v) for v in (-1, 16, "two", 1.5, math.nan, None)),
    *(("preset", v) for v in ("", "khan", "khan2016", None)),
    *(("segment_frames", v) for v in (0, -5, 2**40 + 1, "all", math.inf)),
]
WAVES = [
    *(("N", v) for v in (-1, 17, "all", 2.5, [4])),
    *(("wavelet", v) for v in ("", "db0", "db38", "morl", 3, None, "bior4,4")),
]
OWN: dict[str, list[tuple[str, Any]]] = {
    "pca": [("q", v) for v in (0, -1, 2**20 + 1, 1.5, "all", math.nan, None)],
    "dwt": [
        *(("t_w", v) for v in (-1, 2.0**20 + 1, "much", math.nan, math.inf, None)),
        *WAVES,
    ],
    "awt": [
        *(("a_w", v) for v in (-1, 2.0**40 + 1, "much", math.nan, math.inf, None)),
        *(("distortion", v) for v in ("", "mse", 1, None)),
        *(("iterations", v) for v in (-1, 2**40 + 1, 0.5, "many", None)),
        *(("seed", v) for v in (-1, 2**31, 0.5, "x", None)),
        *WAVES,
    ],
}


@pytest.mark.parametrize(
    ("codec", "name", "value"),
    [(codec, name, value) for codec in NAMES for name, value in (*OWN[codec], *COMMON)],
)
def test_bad_parameters_are_refused_by_name(codec: str, name: str, value: object) -> None:
    with pytest.raises(mcz.OptionError, match=f"^{name} |'{name}'"):
        saved(codec, smooth(20), **{name: value})


@pytest.mark.parametrize("codec", NAMES)
def test_unknown_parameters_are_refused(codec: str) -> None:
    with pytest.raises(mcz.OptionError, match=f"{codec} has no parameter 'level'; it has preset"):
        saved(codec, smooth(20), level=4)


def test_values_of_text_are_parsed() -> None:
    for codec, given_ in (
        ("pca", {"q": "3", "Q": "2", "segment_frames": "16"}),
        ("dwt", {"t_w": "0.5", "N": "3", "wavelet": "db3"}),
        ("awt", {"a_w": "9.5", "seed": "4", "iterations": "100", "distortion": "channels"}),
    ):
        numbers = {
            k: float(v) if "." in v else int(v) if v.isdigit() else v for k, v in given_.items()
        }
        assert saved(codec, smooth(60), **given_) == saved(codec, smooth(60), **numbers)


# Hostile bytes


SMALL: dict[str, tuple[str, dict[str, object]]] = {
    "pca": ("pca", {"q": 2, "segment_frames": 12}),
    "pca-decimals": ("pca", {"q": 3, "Q": 1}),
    "pca-khan2014": ("pca", {"preset": "khan2014", "q": 2, "Q": 1}),
    "dwt": ("dwt", {"t_w": 1.0, "N": 2, "wavelet": "db2", "segment_frames": 12}),
    "awt": ("awt", {"a_w": 8, "N": 2, "wavelet": "db2", "Q": 1}),
}


@cache
def small(which: str) -> Direct:
    codec, settings = SMALL[which]
    return Direct(codec, wandering(20, ["tx", "rx", "rz"]), **settings)


def outcome(coded: Direct, changes: dict[str, Any]) -> str:
    last = (len(coded.layout.groups) - 1,)
    try:
        coded.read(changes=changes)
        coded.read(3, 9, last, changes=changes)
    except mcz.MczError as error:
        assert str(error)
        return type(error).__name__
    return "decoded"


@pytest.mark.parametrize("which", SMALL)
def test_every_prefix_of_a_stream(which: str) -> None:
    """What is cut may spell another segment, of just that many bytes; what is added never does."""
    coded = small(which)
    for place in coded.places():
        data = coded.stream(*place)
        for size in range(len(data)):
            outcome(coded, coded.with_stream(place, data[:size]))
        for more in (b"\0", b"\xff", bytes(99)) if data else ():
            assert outcome(coded, coded.with_stream(place, data + more)) == "FormatError"


@pytest.mark.parametrize("which", SMALL)
def test_every_bit_of_a_stream(which: str) -> None:
    coded = small(which)
    for place in coded.places():
        data = coded.stream(*place)
        for byte, bit in flips(len(data), 10**9, seed=0):
            outcome(coded, coded.with_stream(place, flipped(data, byte, bit)))


@pytest.mark.parametrize("which", SMALL)
def test_every_prefix_and_bit_of_a_header(which: str) -> None:
    coded = small(which)
    for size in range(len(coded.header)):
        found = outcome(coded, {"header": coded.header[:size]})
        assert found in ("FormatError", "TruncatedError")
    assert outcome(coded, {"header": coded.header + b"\0"}) == "FormatError"
    for byte, bit in flips(len(coded.header), 10**9, seed=0):
        outcome(coded, {"header": flipped(coded.header, byte, bit)})


@given(st.data())
def test_streams_of_any_bytes(data) -> None:
    coded = small(data.draw(st.sampled_from(sorted(SMALL))))
    place = data.draw(st.sampled_from(coded.places()))
    outcome(coded, coded.with_stream(place, data.draw(st.binary(max_size=60))))


@pytest.mark.parametrize("which", SMALL)
def test_layouts_that_do_not_fit(which: str) -> None:
    coded = small(which)
    groups = ((0,), (1, 2))
    for changes in ({"samples_per_frame": 2}, {"n_resolutions": 4}, {"groups": groups}):
        layout = replace(coded.layout, **changes)
        assert outcome(coded, {"layout": layout}) == "FormatError"


@pytest.mark.parametrize("which", ["pca", "dwt", "awt"])
def test_files_with_repaired_checksums(which: str) -> None:
    """The public reader, extract and salvage, behind every checksum."""
    codec, settings = SMALL[which]
    data = saved(codec, wandering(20, ["tx", "rx"]), **settings)
    use(data)
    parts = parts_of(data)
    for number, (chunk, payload) in enumerate(parts):
        at_most = 60 if chunk.type in (b"DATA", b"CLIP") else 5
        for byte, bit in flips(len(payload), at_most, seed=number):
            file_outcome(joined(replaced(parts, number, flipped(payload, byte, bit))))
        for size in range(0, len(payload), max(1, len(payload) // 10)):
            file_outcome(joined(replaced(parts, number, payload[:size])))


def file_outcome(data: bytes) -> None:
    for action in (
        lambda: use(data),
        lambda: mcz.extract(data, io.BytesIO(), frames=(4, 9)),
        lambda: use(data, salvage=True),
    ):
        try:
            action()
        except mcz.MczError as error:
            assert str(error)
