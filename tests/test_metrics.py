"""Figures of one motion against another: by hand, by hypothesis, on real clips; unwrapping."""

from __future__ import annotations

import io
import re
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import mcz
from mcz import Channel, Joint, Motion, MotionError, Signal, Skeleton, codecs
from mcz.codecs.contract import Encoded, Segment
from mcz.files.writing.clip_writer import LEFT_OUT, quality_entries
from mcz.kinematics.angles import Unwrapper, unwrap, whole_turns
from tests import overlap_codec
from tests.motions import POSITIONS, motions, skeleton, smooth, write_bytes

TURNS = st.lists(st.integers(-3, 3), min_size=50, max_size=50)


def markers(values: object, **changes: object) -> Motion:
    """Two markers; ``values`` of shape (frames, 6)."""
    joints = tuple(Joint(name, channels=POSITIONS) for name in ("left", "right"))
    arguments = {"name": "points", "unit_cm": 10.0, "angle_unit": ""} | changes
    return Motion(Skeleton(joints, **arguments), (Signal(np.array(values, np.float64)),))


def hinge(degrees: list[float], unit: str = "deg", unit_cm: float | None = 100.0) -> Motion:
    """A bone of length 2 that turns about z; its points are its origin and its end."""
    joint = Joint("arm", tails=((2.0, 0.0, 0.0),), channels=(Channel("rz"),))
    bones = Skeleton((joint,), unit_cm=unit_cm, angle_unit=unit)
    return Motion(bones, (Signal(np.array(degrees, np.float64)[:, None]),))


def test_markers_by_hand() -> None:
    a = markers([[0, 0, 0, 1, 1, 1], [0, 0, 0, 1, 1, 1]])
    b = markers([[0, 3, 4, 1, 1, 1], [0, 0, 0, 1, 1, 2]])
    comparison = mcz.compare(a, b)
    assert (comparison.frames, comparison.channels, comparison.points) == (2, 6, 2)
    assert comparison.mse == comparison.mse_raw == pytest.approx((9 + 16 + 1) / 12)
    assert comparison.rms_coordinate_error == pytest.approx(np.sqrt(26 / 12))
    assert comparison.mean_position_error == pytest.approx((5 + 1) / 4)
    assert comparison.max_position_error == pytest.approx(5)
    assert comparison.mean_position_error_cm == pytest.approx(15)
    assert comparison.max_position_error_cm == pytest.approx(50)
    assert comparison.where == (0, "left")
    assert comparison.unit_cm == 10
    assert (comparison.mismatched_values, comparison.mismatched_points) == (0, 0)
    # A marker has no axes that could turn: its virtual markers move as it does.
    assert comparison.virtual_marker_mean_cm == pytest.approx(15)
    assert comparison.virtual_marker_max_cm == pytest.approx(50)


def test_a_hinge_by_hand() -> None:
    comparison = mcz.compare(hinge([0, 0]), hinge([0, 90]))
    assert comparison.points == 2
    assert comparison.max_position_error == pytest.approx(2 * np.sqrt(2))
    assert comparison.mean_position_error == pytest.approx(2 * np.sqrt(2) / 4)
    assert comparison.where == (1, "arm end")
    assert comparison.mse == pytest.approx(90**2 / 2)
    # Markers 3 cm off the origin: those of x and y turn, that of z does not.
    assert comparison.virtual_marker_max_cm == pytest.approx(3 * np.sqrt(2))
    assert comparison.virtual_marker_mean_cm == pytest.approx(2 * 3 * np.sqrt(2) / 6)


@pytest.mark.parametrize(("unit", "full"), [("deg", 360.0), ("rad", 2 * np.pi)])
def test_whole_turns_are_no_error_of_channels(unit: str, full: float) -> None:
    comparison = mcz.compare(hinge([1.0, 1.0], unit), hinge([1.0, 1.0 + full], unit))
    assert comparison.mse == pytest.approx(0, abs=1e-20)
    assert comparison.mse_raw == pytest.approx(full**2 / 2)
    assert comparison.max_position_error == pytest.approx(0, abs=1e-12)


def test_a_jump_of_half_a_turn_does_not_poison_what_follows() -> None:
    """Unwrapped along time, 179.99 and 180.01 lead to results a whole turn apart."""
    a = hinge([0.0, 179.99, 179.99, 179.99])
    b = hinge([-0.02, 180.0, 180.0, 180.0])
    assert mcz.compare(a, b).mse == pytest.approx((0.02**2 + 3 * 0.01**2) / 4)
    apart = unwrap(b.values, b.skeleton) - unwrap(a.values, a.skeleton)
    assert np.abs(apart).max() > 300


def test_angles_of_unknown_unit_have_no_turns_and_no_positions() -> None:
    comparison = mcz.compare(hinge([0.0], ""), hinge([360.0], ""))
    assert comparison.mse == comparison.mse_raw == 360.0**2
    assert comparison.mean_position_error is None
    assert any("angle unit" in note for note in comparison.notes)


def test_only_what_is_valid_on_both_sides_counts() -> None:
    a = markers([[0, 0, 0, 1, 1, 1], [0, 0, 0, 1, 1, 1]])
    b = markers([[0, 0, 7, 1, 1, 1], [0, 0, 0, 1, 1, 4]])
    mask = np.ones((2, 6), bool)
    mask[0, :3] = False
    masked = replace(a, signals=(replace(a.signals[0], mask=mask),))
    comparison = mcz.compare(masked, b)
    assert comparison.mse == pytest.approx(9 / 9)
    assert (comparison.mismatched_values, comparison.mismatched_points) == (3, 1)
    assert comparison.mean_position_error == pytest.approx(3 / 3)
    assert comparison.where == (1, "right")
    both = mcz.compare(masked, replace(b, signals=(replace(b.signals[0], mask=mask),)))
    assert (both.mismatched_values, both.mean_position_error) == (0, 1)
    nothing = replace(b, signals=(replace(b.signals[0], mask=np.zeros((2, 6), bool)),))
    comparison = mcz.compare(a, nothing)
    assert (comparison.mse, comparison.max_position_error, comparison.where) == (None, None, None)
    assert (comparison.mismatched_values, comparison.mismatched_points) == (12, 4)


def test_infinite_and_huge_values_give_no_figure() -> None:
    a = markers([[0, 0, 0, 1, 1, 1]])
    comparison = mcz.compare(a, markers([[np.inf, 0, 0, 1e300, 1, 1]]))
    assert comparison.mismatched_values == 1
    assert comparison.mse is None
    assert comparison.mean_position_error is None
    assert all(value == value for value in comparison.entries().values())


def test_other_units_are_converted_for_positions() -> None:
    a, b = markers([[1, 2, 3, 4, 5, 6]]), markers([[10, 20, 30, 40, 50, 60]], unit_cm=1.0)
    comparison = mcz.compare(a, b)
    assert comparison.max_position_error == pytest.approx(0, abs=1e-12)
    assert comparison.mse is None
    assert any("units of 10 and 1 cm" in note for note in comparison.notes)


@pytest.mark.parametrize("units", [(None, None), (None, 10.0), (10.0, None)])
def test_without_a_unit_there_are_no_figures_in_cm(units: tuple[float | None, ...]) -> None:
    a, b = (markers([[x, 0, 0, 0, 0, 0]], unit_cm=u) for x, u in zip((0, 2), units, strict=True))
    comparison = mcz.compare(a, b)
    assert comparison.max_position_error == pytest.approx(2)
    assert comparison.mse is not None
    for key, value in comparison.entries().items():
        assert not key.endswith("_cm") or value is None
    assert any("unit" in note for note in comparison.notes)


def test_other_channels_and_points_are_said() -> None:
    joints = tuple(Joint(name, channels=POSITIONS) for name in "abc")
    b = Motion(Skeleton(joints, angle_unit=""), (Signal(np.zeros((1, 9))),))
    comparison = mcz.compare(markers([[0] * 6]), b)
    assert (
        comparison.mse,
        comparison.channels,
        comparison.mean_position_error,
        comparison.points,
    ) == (None,) * 4
    assert any("6 and 9" in note for note in comparison.notes)
    assert any("2 and 3 points" in note for note in comparison.notes)


def test_other_extents_are_refused() -> None:
    with pytest.raises(MotionError, match="50 frames.*40 frames"):
        mcz.compare(smooth(50), smooth(40))
    double = replace(smooth(50), signals=(replace(smooth(50).signals[0], samples_per_frame=2),))
    with pytest.raises(MotionError, match="has 25 frames of 2 rows"):
        mcz.compare(smooth(25), double)


def test_further_signals() -> None:
    def with_analog(*values: float) -> Motion:
        channels = (Channel("", "emg", "V"),)
        analog = [Signal(np.full((100, 1), v), name="emg", samples_per_frame=2) for v in values]
        analog = [replace(signal, channels=channels) for signal in analog]
        return replace(smooth(50), signals=(smooth(50).signals[0], *analog))

    comparison = mcz.compare(with_analog(1.0, 2.0), with_analog(1.5, 2.0))
    assert comparison.signals == {"emg": 0.25, "emg#1": 0.0}
    assert comparison.entries()["signal.emg.mse"] == 0.25
    comparison = mcz.compare(with_analog(1.0, 2.0), with_analog(1.0))
    assert comparison.signals == {"emg": 0.0}
    assert any("emg#1" in note for note in comparison.notes)


@given(motions())
def test_a_motion_is_its_own_equal(motion: Motion) -> None:
    comparison = mcz.compare(motion, motion)
    figures = [
        v for k, v in comparison.entries().items() if re.search("mse|error|marker|shell_m", k)
    ]
    assert {v for v in figures if isinstance(v, float)} <= {0.0}
    assert (comparison.mismatched_values or 0, comparison.mismatched_points or 0) == (0, 0)


@given(st.lists(st.floats(-100, 100), min_size=3, max_size=3))
def test_a_moved_root_moves_every_point(shift: list[float]) -> None:
    motion = smooth(7)
    values = motion.values.copy()
    values[:, :3] += shift
    comparison = mcz.compare(motion, motion.with_values(values))
    distance = float(np.linalg.norm(shift))
    for value in (comparison.mean_position_error, comparison.max_position_error):
        assert value == pytest.approx(distance, abs=1e-9)
    assert comparison.mean_position_error_cm == pytest.approx(2.5 * distance, abs=1e-9)
    assert comparison.virtual_marker_max_cm == pytest.approx(2.5 * distance, abs=1e-9)
    assert comparison.rms_coordinate_error == pytest.approx(distance / np.sqrt(3), abs=1e-9)
    assert comparison.mse == pytest.approx(distance**2 / 10, abs=1e-9)


@given(TURNS, st.integers(0, 2**32 - 1))
def test_whole_turns_change_nothing_and_sides_may_change(counts: list[int], seed: int) -> None:
    motion = smooth(50)
    noise = np.random.default_rng(seed).uniform(-1, 1, motion.values.shape)
    other = motion.with_values(motion.values + noise)
    wound = other.values.copy()
    wound[:, 4] += 360.0 * np.array(counts)
    comparison, turned = mcz.compare(motion, other), mcz.compare(motion, motion.with_values(wound))
    back = mcz.compare(other, motion)
    for key, value in comparison.entries().items():
        if isinstance(value, float) and key != "mse_raw":
            assert turned.entries()[key] == pytest.approx(value, rel=1e-9), key
            if key != "sqnr_db":  # the power of the other side
                assert back.entries()[key] == pytest.approx(value, rel=1e-9), key
    assert (turned.mse_raw == pytest.approx(comparison.mse_raw)) == (not any(counts))


def test_blocks_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    motion = smooth(50)
    other = motion.with_values(np.round(motion.values))
    whole = mcz.compare(motion, other)
    monkeypatch.setattr("mcz.kinematics.metrics.comparison.BLOCK", 100)
    parts = mcz.compare(motion, other)
    assert parts.where == whole.where
    for key, value in whole.entries().items():
        if isinstance(value, float):
            assert parts.entries()[key] == pytest.approx(value, rel=1e-12), key


def test_virtual_markers_can_be_left_out() -> None:
    comparison = mcz.compare(smooth(), smooth(), virtual_markers=False)
    assert (comparison.virtual_marker_mean_cm, comparison.virtual_marker_max_cm) == (None, None)
    assert comparison.mean_position_error == 0


def test_ids_are_those_of_the_manual() -> None:
    docs = Path(__file__).parents[1] / "docs"
    names = "reference/measures.md", "guides/contacts.md"
    pages = [(docs / name).read_text("utf-8") for name in names]
    tables = [page.split("| id | unit | meaning |", 1)[1].split("\n\n", 1)[0] for page in pages]
    cells = re.findall(r"^\| ([^|]+) \|", "".join(tables), re.M)
    listed = [i for cell in cells for i in cell.split(", ")]
    ids = {i.strip() for i in listed if not i.startswith("signal.NAME.")} - {"id", "---"}
    assert ids == set(mcz.compare(smooth(), smooth()).entries())


# Unwrapping


def by_definition(values: np.ndarray, full: float) -> np.ndarray:
    """SPEC.md, "Unwrapping", one value at a time."""
    out = values.copy()
    count, last = 0.0, None
    for row, v in enumerate(values.tolist()):
        if not abs(v) < 2.0**40:
            continue
        if last is not None:
            q = (v - last) / full
            m = float(np.ceil(abs(q) - 0.5))
            count += m if q >= 0 else -m
        last = v
        out[row] = v - full * count
    return out


ANGLES = st.one_of(
    st.sampled_from([0.0, 180.0, -180.0, 179.5, -179.5, 360.0, 540.0, -720.0]),
    st.sampled_from([np.nan, np.inf, 2.0**40, -1e300]),
    st.floats(-1000, 1000),
    st.floats(-(2.0**41), 2.0**41),
)


@given(st.lists(ANGLES, max_size=40), st.integers(1, 7), st.sampled_from(["deg", "rad"]))
def test_unwrapping_is_as_defined_however_it_is_cut(
    angles: list[float], step: int, unit: str
) -> None:
    motion = hinge(angles, unit)
    values = motion.signals[0].values
    expected = by_definition(values[:, 0], {"deg": 360.0, "rad": 2 * np.pi}[unit])
    np.testing.assert_array_equal(unwrap(values, motion.skeleton)[:, 0], expected)
    unwrapper = Unwrapper(motion.skeleton)
    parts = [unwrapper(values[at : at + step]) for at in range(0, len(values), step)]
    np.testing.assert_array_equal(np.concatenate([np.empty((0, 1)), *parts])[:, 0], expected)


@given(st.lists(st.integers(-40, 40), min_size=1, max_size=40))
def test_unwrapping_is_numpys(eighths: list[int]) -> None:
    """Multiples of an eighth of a turn: exact in both, and with many ties."""
    angles = np.array(eighths) * 45.0
    found = unwrap(angles[:, None], hinge([0.0]).skeleton)[:, 0]
    np.testing.assert_array_equal(found, np.unwrap(angles, period=360.0))


def test_unwrapping_leaves_the_rest_alone() -> None:
    motion = smooth(20)
    values = motion.values.copy()
    values[5:, :3] += 1000
    values[5:, 4] += 720
    found = unwrap(values, skeleton())
    np.testing.assert_array_equal(found[:, :3], values[:, :3])
    np.testing.assert_allclose(found[:, 4], motion.values[:, 4], rtol=0, atol=1e-12)
    unknown = replace(skeleton(), angle_unit="")
    np.testing.assert_array_equal(unwrap(values, unknown), values)
    own = [Channel("", "a")] * 10
    np.testing.assert_array_equal(unwrap(values, skeleton(), own), values)
    assert whole_turns(np.array([180.0, -180.0, 180.0 + 2**-45]), 360.0).tolist() == [0, 0, 1]


# The quality record


def coarse(source, params):
    """Encode by ``overlap`` what is rounded to whole numbers."""

    class Rounded:
        layout = source.layout

        def values(self, start, stop):
            return np.round(source.values(start, stop))

    return overlap_codec.encode(Rounded(), params)


@pytest.fixture
def lossy(monkeypatch: pytest.MonkeyPatch) -> None:
    codec = replace(overlap_codec.CODEC, encode=coarse)
    monkeypatch.setitem(codecs.CODECS, overlap_codec.CODEC.name, codec)


def test_a_lossy_clip_has_a_quality_record(lossy: None) -> None:
    motion, out = smooth(47), io.BytesIO()
    mcz.write(motion, out, codec="overlap", length=12)
    with mcz.open(out.getvalue()) as file:
        clip = file.clips["smooth"]
        decoded = mcz.compare(motion, clip.motion())
        quality = clip.quality
        assert quality is not None
        assert quality["codec"] == "overlap"
        assert quality["param.length"] == "12"
        figures = {
            k: v for k, v in decoded.entries().items() if v is not None and k not in LEFT_OUT
        }
        ten = {k: float(f"{v:.10g}") if isinstance(v, float) else v for k, v in figures.items()}
        assert {k: quality[k] for k in figures} == {k: str(v) for k, v in ten.items()}
        assert set(quality) == {*figures, "codec", "param.length"}
        assert float(quality["mse"]) == pytest.approx(decoded.mse, rel=1e-9)
        assert decoded.mse and decoded.mse > 0
    assert mcz.verify(out.getvalue()) == []  # the flags of QUAL too


def test_values_are_decoded_once(monkeypatch: pytest.MonkeyPatch) -> None:
    calls = []

    def decode(*arguments):
        calls.append(1)
        return overlap_codec.decode(*arguments)

    codec = replace(overlap_codec.CODEC, encode=coarse, decode=decode)
    monkeypatch.setitem(codecs.CODECS, overlap_codec.CODEC.name, codec)
    mcz.write(smooth(), io.BytesIO(), codec="overlap")
    assert len(calls) == 1


def test_records_of_integers_masks_and_odd_names(monkeypatch: pytest.MonkeyPatch) -> None:
    """A signal of integers is decoded to values off its grid; what is masked stays so."""
    mask = np.ones((50, 10), bool)
    mask[3:9, 4] = False
    analog = Signal(np.arange(50)[:, None], name="a.b = c", channels=(Channel("", "emg"),))
    motion = smooth(50)
    motion = replace(motion, signals=(replace(motion.signals[0], mask=mask), analog))
    decoded = replace(
        motion, signals=(motion.signals[0], replace(analog, values=analog.values + 1))
    )
    found = quality_entries(motion, decoded, "x", {"q": None, "wavelet": "db3", "deep": True})
    assert found["signal.a.b = c.mse"] == "1.0"
    assert (found["param.wavelet"], found["param.deep"]) == ("db3", "true")
    assert "param.q" not in found
    assert found["mismatched_values"] == "0"


def test_records_without_channels_frames_or_units(lossy: None) -> None:
    empty = Motion(Skeleton(()), (Signal(np.empty((0, 0))),), frame_rate=Fraction(30), name="none")
    bare = replace(smooth(0), skeleton=replace(skeleton(), unit_cm=None))
    for motion in (empty, bare):
        with mcz.open(write_bytes(motion, codec="overlap")) as file:
            quality = file.clips[motion.name].quality
        assert quality is not None
        assert quality["frames"] == "0"
        assert not any("cm" in key or "mse" in key for key in quality)


def test_a_codec_that_gives_nan_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    def encode(source, params):
        n = source.layout.n_frames
        return Encoded(b"", iter([Segment(0, n, (b"",) * len(source.layout.groups))]))

    def decode(header, layout, spans, request, fetch):
        return np.full((request.stop - request.start, layout.n_channels), np.nan)

    codec = replace(overlap_codec.CODEC, encode=encode, decode=decode)
    monkeypatch.setitem(codecs.CODECS, overlap_codec.CODEC.name, codec)
    with mcz.open(write_bytes(smooth(5), codec="overlap")) as file:
        quality = file.clips["smooth"].quality
    assert quality is not None
    assert quality["mismatched_values"] == "50"
    assert "mse" not in quality


# Real clips


@pytest.mark.real
@pytest.mark.parametrize("name", ["cmu/amc/05_01.amc", "cmu/bvh/05_01.bvh"])
def test_lossless_is_without_error(data: Path, tmp_path: Path, name: str) -> None:
    mcz.encode(data / name, tmp_path / "x.mcz")
    motion = mcz.read(data / name)
    decoded = mcz.compare(motion, mcz.read(tmp_path / "x.mcz"))
    figures = decoded.mse, decoded.mse_raw, decoded.max_position_error
    assert figures == (0, 0, 0)
    assert decoded.points == {"amc": 31, "bvh": 38}[name[-3:]]
    if name.endswith("amc"):
        assert decoded.unit_cm == pytest.approx(2.54 / 0.45)
        assert decoded.virtual_marker_max_cm == 0


@pytest.mark.real
def test_rounding_as_khan_does(data: Path) -> None:
    """The preset rounds to one decimal: uniform errors of 0.1 / sqrt(12), and no more than 0.05."""
    motion = mcz.read(data / "cmu/amc/17_10.amc")
    values = unwrap(motion.values, motion.skeleton)
    rounded = motion.with_values(np.sign(values) * np.floor(np.abs(values) * 10 + 0.5) / 10)
    comparison = mcz.compare(motion, rounded)
    assert (comparison.frames, comparison.channels, comparison.points) == (2783, 62, 31)
    assert comparison.mse == pytest.approx(0.01 / 12, rel=0.1)
    assert comparison.mean_position_error is not None
    assert comparison.rms_coordinate_error is not None
    assert comparison.max_position_error is not None
    # A mean distance lies between one coordinate's rms and that of all three together.
    assert (
        comparison.rms_coordinate_error
        < comparison.mean_position_error
        < np.sqrt(3) * comparison.rms_coordinate_error
        < comparison.max_position_error
    )


@pytest.mark.parametrize("virtual_markers", [False, True])
def test_positions_against_what_they_were_made_of(virtual_markers: bool) -> None:
    """Points with points and virtual markers with virtual markers, by places that are known."""
    from mcz.kinematics.points import points_and_markers_of
    from mcz.sources.sample import acclaim_walk

    walk = acclaim_walk()
    places = mcz.in_positions(walk, virtual_markers=virtual_markers)
    noise = np.random.default_rng(3).normal(0, 0.1, places.values.shape)
    comparison = mcz.compare(walk, places.with_values(places.values + noise))
    distances = np.sqrt((noise.reshape(len(noise), -1, 3) ** 2).sum(axis=2))
    n_points = points_and_markers_of(walk.skeleton, walk.values[:1])[0].shape[1]
    assert comparison.points == n_points
    assert comparison.mean_position_error == pytest.approx(distances[:, :n_points].mean())
    if virtual_markers:
        meant = distances[:, n_points:].mean() * walk.skeleton.unit_cm
        assert comparison.virtual_marker_mean_cm == pytest.approx(meant)
    else:
        assert comparison.virtual_marker_mean_cm is None
