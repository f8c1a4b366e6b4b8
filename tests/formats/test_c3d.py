"""C3D files of every kind: bytes -> Motion -> the same bytes."""

from __future__ import annotations

import warnings
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given

from mcz import Channel, Joint, Motion, MotionError, Signal, Skeleton, SourceError
from mcz.model.numbers import Grid, GridKind
from mcz.sources.c3d import c3d
from tests.formats.c3d_files import DEC, INTEL, SGI, Made, c3d_files, make_c3d, real_of

ORDERS = (INTEL, DEC, SGI)
POSITION = tuple(Channel(kind) for kind in ("tx", "ty", "tz"))


def words_of(file: Made, words: np.ndarray) -> np.ndarray:
    """Decode words independently of the package."""
    if file.size == 2:
        return words.astype(np.uint16).view(np.int16).astype(np.int64)
    kind = ">u4" if file.processor == SGI else "<u4"
    data = words.astype(kind).tobytes()
    values = [real_of(data[k : k + 4], file.processor) for k in range(0, len(data), 4)]
    return np.array(values, np.float64).reshape(words.shape)


@given(c3d_files(extras=False))
def test_what_words_mean(file: Made) -> None:
    file.tail = b""
    motion = c3d.read(file.build(), "clip")
    n_frames, n_points, _ = file.points.shape
    assert motion.skeleton.n_joints == n_points
    if not file.points.size and not file.analog.size:
        return
    assert motion.n_frames == n_frames
    signals = {signal.name: signal for signal in motion.signals}
    points = words_of(file, file.points)
    positions = points[:, :, :3] * (float(np.float32(file.scale)) if file.size == 2 else 1.0)
    if file.processor == DEC and file.size == 2:
        positions = points[:, :, :3] * motion.signals[0].grids[0].scale if n_points else positions
    stored = motion.signals[0].values.reshape(n_frames, n_points, 3)
    assert np.array_equal(stored, positions, equal_nan=True)
    valid = (points[:, :, 3] >= 0) & ~np.isnan(positions).any(axis=2)
    mask = motion.signals[0].mask
    assert (mask is None) == bool(valid.all())
    assert mask is None or np.array_equal(mask, np.repeat(valid, 3, axis=1))
    if n_points:
        assert np.array_equal(signals["residuals"].values, points[:, :, 3], equal_nan=True)
    if file.analog.shape[2] and n_frames:
        assert signals["analog"].samples_per_frame == file.analog.shape[1]
        rows = words_of(file, file.analog).reshape(-1, file.analog.shape[2])
        assert np.array_equal(signals["analog"].values, rows, equal_nan=True)


@pytest.mark.parametrize("processor", ORDERS)
@pytest.mark.parametrize("convention", ["trial", "long", "header only", "wrapped"])
def test_more_frames_than_a_word_counts(processor: int, convention: str) -> None:
    n = 66_000
    file = make_c3d(n, 1, processor=processor, size=2, last=65_535)
    file.parameters["POINT"] = {"FRAMES": file.number(65_535)}
    if convention == "trial":
        file.parameters["TRIAL"] = {
            "ACTUAL_START_FIELD": file.long(1),
            "ACTUAL_END_FIELD": file.long(n),
        }
    elif convention == "long":
        file.parameters["POINT"]["LONG_FRAMES"] = file.real(float(n))
    elif convention == "wrapped":
        file.last = n & 0xFFFF
        file.parameters["POINT"] = {"FRAMES": file.number(n & 0xFFFF)}
    data = file.build()
    motion = c3d.read(data, "long")
    assert motion.n_frames == n
    assert c3d.write(motion) == data


def test_first_frames_beyond_a_word_are_in_trial() -> None:
    file = make_c3d(5, 1, first=65_535, last=65_535)
    file.parameters["TRIAL"] = {
        "ACTUAL_START_FIELD": file.long(70_000),
        "ACTUAL_END_FIELD": file.long(70_004),
    }
    motion = c3d.read(file.build(), "late")
    assert motion.frame_numbers is not None
    assert motion.frame_numbers.tolist() == [*range(70_000, 70_005)]
    assert "source-note" not in motion.metadata
    again = c3d.read(c3d.write(motion.cut(2, 4)), "late")
    assert again.frame_numbers is not None and again.frame_numbers.tolist() == [70_002, 70_003]


def test_labels_go_on_and_may_be_too_few() -> None:
    file = make_c3d(1, 5, labels=[b"LASI ", b"  "])
    file.parameters["POINT"] = {"LABELS2": file.texts([b"S\xfcd"]), "UNITS": file.texts([b"M "])}
    motion = c3d.read(file.build(), "few")
    names = [joint.name for joint in motion.skeleton.joints]
    assert names == ["LASI", "point 2", "Süd", "point 4", "point 5"]
    assert motion.metadata["name-encoding"] == "latin-1"
    assert motion.metadata["source-note"] == "3 labels for 5 points"
    assert motion.skeleton.unit_cm == 100.0 and motion.skeleton.angle_unit == ""
    assert motion.signals[1].channels is not None
    assert [channel.name for channel in motion.signals[1].channels] == names


@pytest.mark.parametrize(
    ("stated", "rate", "exact"),
    [
        (120.0, Fraction(120), True),
        (59.94006, Fraction(60_000, 1001), False),
        (65.03, Fraction(6503, 100), False),
        (69.5, Fraction(139, 2), True),
        (69.99261474609375, Fraction(69.99261474609375), True),
        (0.0, None, True),
        (float("nan"), None, True),
    ],
)
def test_rates(stated: float, rate: Fraction | None, exact: bool) -> None:
    motion = c3d.read(make_c3d(rate=stated).build(), "rate")
    assert (motion.frame_rate, motion.frame_rate_exact) == (rate, exact)


def test_unsigned_analog() -> None:
    file = make_c3d(2, 1, 2, 2, size=2)
    file.analog[0, 0] = (65_535, 40_000)
    file.parameters["ANALOG"] = {
        "FORMAT": file.texts([b"UNSIGNED"]),
        "LABELS": file.texts([b"Fx", b"Fy"]),
        "UNITS": file.texts([b"N", b"V"]),
    }
    motion = c3d.read(file.build(), "analog")
    analog = motion.signals[2]
    assert analog.values[0].tolist() == [65_535, 40_000]
    assert analog.channels == (Channel("", "Fx", "N"), Channel("", "Fy", "V"))
    assert c3d.write(motion) == file.build()
    values = analog.values.copy()
    values[1] = (70_000, -5)  # as a lossy codec may overshoot
    other = replace(motion, signals=(*motion.signals[:2], replace(analog, values=values)))
    again = c3d.read(c3d.write(other), "analog").signals[2]
    assert again.values[1].tolist() == [65_535, 0]


def test_the_data_win_over_a_wrong_header() -> None:
    file = make_c3d(40, 2, 2, 7, header_samples=2, last=900)
    motion = c3d.read(file.build(), "wrong")
    assert motion.n_frames == 40 and motion.signals[2].samples_per_frame == 7
    assert "2 analog samples a frame are declared, 14 are taken" in motion.metadata["source-note"]
    cut = make_c3d(40, 2).build()[:-200]
    motion = c3d.read(cut, "cut")
    assert motion.n_frames == 33 and c3d.write(motion) == cut
    assert motion.metadata["source-note"] == "40 frames are declared, 33 are there"


@pytest.mark.parametrize("processor", ORDERS)
def test_rotations_are_a_signal(processor: int) -> None:
    file = make_c3d(5, 0, processor=processor)
    words = make_c3d(5, 0, 17, 2 * 2, processor=processor).analog
    kind = ">u4" if processor == SGI else "<u4"
    gap = bytes(512)
    file.tail = gap + words.astype(kind).tobytes() + b"end"
    rotation = {
        "USED": file.number(2),
        "RATIO": file.number(2),
        "DATA_START": file.number(0),
        "LABELS": file.texts([b"pelvis"]),
    }
    file.parameters["ROTATION"] = rotation
    block = (len(file.build()) - len(file.tail)) // 512 + 2
    rotation["DATA_START"] = file.number(block)
    data = file.build()
    motion = c3d.read(data, "rotations")
    signal = motion.signals[1]
    assert (signal.name, signal.values.shape) == ("rotations", (10, 34))
    assert signal.samples_per_frame == 2
    assert signal.channels is not None and signal.channels[1].name == "pelvis m21"
    assert signal.channels[33].name == "rotation 2 reliability"
    assert c3d.write(motion) == data
    part = motion.cut(1, 3)
    again = c3d.read(c3d.write(part), "rotations").signals[1]
    assert np.array_equal(again.values, part.signals[1].values)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda d: b"", "offset 0: the file is truncated"),
        (lambda d: d[:511], "offset 511: the file is truncated"),
        (lambda d: d[:1] + b"\0" + d[2:], "offset 1: 0x00 is not"),
        (lambda d: b"\0" + d[1:], "offset 0: the parameters begin at block 0"),
        (lambda d: b"\xff" + d[1:], "offset 0: the parameters begin at block 255"),
        (lambda d: d[:515] + b"\0" + d[516:], "offset 515: processor 0"),
        (lambda d: d[:16] + b"\xff\xff" + d[18:], "offset 16: the data begin at block 65535"),
        (lambda d: d[:2] + b"\xff\x7f" + d[4:600], "offset 1024"),
    ],
)
def test_what_cannot_be_read_is_refused(change: object, message: str) -> None:
    assert callable(change)
    data = make_c3d(3, 2).build()
    if message == "offset 1024":
        data = data[:1024].replace(b"USED", b"XSED")
        data = data[:2] + b"\xff\x7f" + data[4:]
    with pytest.raises(SourceError) as error:
        c3d.read(change(data) if message != "offset 1024" else data, "bad")
    assert message in str(error.value)


def markers(n_points: int, values: np.ndarray, **more: object) -> Motion:
    joints = tuple(Joint(f"m{k}", channels=POSITION) for k in range(n_points))
    skeleton = Skeleton(joints, unit_cm=0.1, angle_unit="")
    signals = more.pop("signals", (Signal(values),))
    return Motion(skeleton, signals, **more)  # type: ignore[arg-type]


def test_a_motion_without_source_is_written_plainly_and_comes_back() -> None:
    values = np.arange(24.0).reshape(4, 6) / 8
    values[1, 2] = np.nan
    mask = np.ones((4, 6), np.bool_)
    mask[2, 3:] = False
    numbers = np.arange(10, 14)
    analog = Signal(
        np.arange(16.0).reshape(8, 2),
        name="analog",
        role="analog",
        samples_per_frame=2,
        channels=(Channel("", "Fx", "N"), Channel("", "Fy", "N")),
    )
    motion = markers(
        2, values, frame_rate=Fraction(30), name="plain", frame_numbers=numbers,
        signals=(Signal(values, mask=mask), analog),
    )  # fmt: skip
    again = c3d.read(c3d.write(motion), "plain")
    assert again.skeleton == motion.skeleton and again.metadata == {}
    assert again.frame_rate == 30 and np.array_equal(again.frame_numbers, numbers)
    assert np.array_equal(again.signals[0].values, values, equal_nan=True)
    mask[1, :3] = False  # NaN
    assert np.array_equal(again.signals[0].mask, mask)
    assert np.array_equal(again.signals[2].values, analog.values)
    assert again.signals[2].channels == analog.channels
    assert again.signals[2].samples_per_frame == 2


def test_plain_integers() -> None:
    grid = Grid(GridKind.SCALED, scale=0.125)
    values = np.arange(-9.0, 9.0).reshape(3, 6) / 8
    analog = Signal(
        np.array([[0], [1], [65_535]]),
        name="analog",
        role="analog",
        channels=(Channel("", "force"),),
    )
    motion = markers(2, values, signals=(Signal(values, (grid,) * 6), analog))
    again = c3d.read(c3d.write(motion), "integers")
    assert again.signals[0].grids == motion.signals[0].grids
    assert np.array_equal(again.signals[0].values, values)
    assert np.array_equal(again.signals[2].values, analog.values)
    signed = replace(analog, values=np.array([[0], [-1], [65_535]]))  # 17 bits: floats
    again = c3d.read(c3d.write(replace(motion, signals=(motion.signals[0], signed))), "floats")
    assert again.signals[0].grids[0].kind == GridKind.BINARY32
    assert again.signals[2].values[:, 0].tolist() == [0, -1, 65_535]


@pytest.mark.parametrize(
    ("n_points", "n_frames"), [(0, 0), (0, 3), (3, 0), (300, 2), (1, 70_000), (2, 65_535)]
)
def test_plain_files_of_any_size_are_read_by_others(
    n_points: int, n_frames: int, tmp_path: Path
) -> None:
    ezc3d = pytest.importorskip("ezc3d")
    values = np.arange(n_frames * n_points * 3.0).reshape(n_frames, 3 * n_points)
    data = c3d.write(markers(n_points, values, frame_rate=Fraction(100)))
    again = c3d.read(data, "plain")
    assert again.n_frames == n_frames and again.metadata == {}
    assert np.array_equal(again.signals[0].values, values)
    if not n_frames or not n_points:
        return
    path = tmp_path / "plain.c3d"
    path.write_bytes(data)
    points = ezc3d.c3d(str(path))["data"]["points"]
    assert np.array_equal(
        np.moveaxis(points[:3], (0, 1, 2), (2, 1, 0)).reshape(values.shape), values
    )


@pytest.mark.parametrize(
    ("joint", "message"),
    [
        (Joint("hips", channels=(*POSITION, Channel("rx"))), "'hips' is not a marker"),
        (Joint("hips", channels=POSITION[:2]), "'hips' is not a marker"),
        (Joint("x" * 256, channels=POSITION), "256 bytes"),
    ],
)
def test_what_c3d_cannot_say_is_refused(joint: Joint, message: str) -> None:
    values = np.zeros((1, len(joint.channels)))
    with pytest.raises(MotionError, match=message):
        c3d.write(Motion(Skeleton((joint,)), (Signal(values),)))


def test_other_signals_and_values_too_large_are_refused() -> None:
    with pytest.raises(MotionError, match="pressure"):
        other = Signal(np.zeros((1, 1)), name="pressure", channels=(Channel("", "p"),))
        c3d.write(markers(1, np.zeros((1, 3)), signals=(Signal(np.zeros((1, 3))), other)))
    with pytest.raises(MotionError, match="too large"):
        c3d.write(markers(1, np.full((1, 3), 1e300)))
    with pytest.raises(MotionError, match="too long"):
        c3d.write(
            Motion(
                Skeleton(tuple(Joint("n" * 200, channels=POSITION) for _ in range(900))),
                (Signal(np.zeros((1, 2700))),),
            )
        )


def test_the_sample_is_read_by_others(samples: Path) -> None:
    ezc3d, pyc3d = pytest.importorskip("ezc3d"), pytest.importorskip("c3d")
    motion = c3d.read((samples / "walk.c3d").read_bytes(), "walk")
    values = motion.values.reshape(240, 34, 3)
    found = ezc3d.c3d(str(samples / "walk.c3d"))
    theirs = np.moveaxis(found["data"]["points"][:3], (0, 1, 2), (2, 1, 0))
    assert np.array_equal(theirs, values, equal_nan=True)
    with warnings.catch_warnings(), (samples / "walk.c3d").open("rb") as stream:
        warnings.simplefilter("ignore")  # no analog data
        frames = [points for _, points, _ in pyc3d.Reader(stream).read_frames()]
    assert np.array_equal(
        np.array(frames)[:, :, :3], motion.signals[0].values.reshape(values.shape)
    )
