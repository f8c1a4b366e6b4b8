"""C3D metadata, and the meaning of analog words."""

from __future__ import annotations

import io
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import mcz
from mcz import Motion, MotionError, OptionError, Signal
from mcz.sources.c3d import c3d
from tests.formats.c3d_files import DEC, INTEL, SGI, Made, make_c3d, real, word

ORDERS = (INTEL, DEC, SGI)


def reals(file: Made, values: list[float], *dims: int) -> tuple[int, tuple[int, ...], bytes]:
    data = b"".join(real(value, file.processor) for value in values)
    return 4, dims or (len(values),), data


def integers(file: Made, values: list[int], *dims: int) -> tuple[int, tuple[int, ...], bytes]:
    data = b"".join(word(value, file.processor) for value in values)
    return 2, dims or (len(values),), data


def analog_of(motion: Motion) -> Signal:
    return next(signal for signal in motion.signals if signal.name == "analog")


def with_analog(file: Made, **more: Any) -> Made:
    file.parameters.setdefault("ANALOG", {}).update(more)
    return file


def recording_of(file: Made) -> mcz.Recording:
    decoded = mcz.recording(c3d.read(file.build(), "clip"))
    assert decoded is not None
    return decoded


@pytest.mark.parametrize("processor", ORDERS)
@pytest.mark.parametrize("size", [2, 4])
def test_analog_is_in_units_and_words_are_kept(processor: int, size: int) -> None:
    file = make_c3d(5, 2, 3, 4, processor=processor, size=size)
    scales = [0.25, -2.0, 0.1]
    with_analog(
        file,
        SCALE=reals(file, scales),
        OFFSET=integers(file, [2048, -5, 0]),
        GEN_SCALE=(4, (), real(0.5, processor)),
        UNITS=file.texts([b"N", b"Nmm", b"V"]),
    )
    data = file.build()
    motion = c3d.read(data, "clip")
    analog = analog_of(motion)
    words = analog.stored.astype(np.float64)
    kept = [float(np.float32(scale)) for scale in scales]
    assert processor == DEC or analog.scaling is not None
    assert analog.scaling is not None and np.allclose(analog.scaling.scales, kept, rtol=1e-6)
    wanted = (words - np.array([2048.0, -5.0, 0.0])) * analog.scaling.scales * 0.5
    assert np.array_equal(analog.values, wanted) and analog.values.dtype == np.float64
    assert (analog.stored.dtype == np.int64) == (size == 2)
    assert c3d.write(motion) == data
    stream = io.BytesIO()
    mcz.write(motion, stream)
    with mcz.open(stream.getvalue()) as reader:
        clip = reader.clips["clip"]
        assert np.array_equal(clip.read(signal="analog"), wanted)
        assert np.array_equal(clip.read(signal=2, frames=(1, 3)), wanted[4:12])
        assert np.array_equal(clip.read_masked(signal="analog")[0], analog.stored)
        assert clip.source_bytes() == data
        again = analog_of(clip.motion())
        assert np.array_equal(again.values, wanted)
        assert np.array_equal(again.stored, analog.stored)
        assert not mcz.verify(stream.getvalue())
        with pytest.raises(
            OptionError, match="no signal 'emg'; its signals are motion, residuals, analog"
        ):
            clip.read(signal="emg")


@pytest.mark.parametrize(
    ("format_", "word_", "offset"),
    [
        (b"SIGNED", 0xFFF0, -16.0),
        (b"UNSIGNED", 0xFFF0, 65_520.0),
        (b"UNSIGNED", 0x8010, 32_784.0),
        (b"UNSIGNED", 0x8000, 32_768.0),
        (b"SIGNED", 0x8000, 32_768.0),  # the middle of words without a sign
        (b"", 2048, 2048.0),
    ],
)
def test_the_sign_of_an_offset(format_: bytes, word_: int, offset: float) -> None:
    file = make_c3d(2, 1, 1, 1, size=2)
    with_analog(file, FORMAT=file.texts([format_]), OFFSET=integers(file, [word_]))
    scaling = analog_of(c3d.read(file.build(), "clip")).scaling
    assert scaling is not None and scaling.offsets.tolist() == [offset]


def test_what_is_missing_is_0_and_1() -> None:
    file = make_c3d(2, 1, 3)
    assert analog_of(c3d.read(file.build(), "clip")).scaling is None
    with_analog(file, SCALE=reals(file, [2.0]), OFFSET=reals(file, [1.5, 2.0]))
    scaling = analog_of(c3d.read(file.build(), "clip")).scaling
    assert scaling is not None and scaling.general == 1.0
    assert scaling.scales.tolist() == [2.0, 1.0, 1.0]
    assert scaling.offsets.tolist() == [1.5, 2.0, 0.0]


def test_numbers_go_on_in_the_next_parameter() -> None:
    file = make_c3d(1, 0, 3, size=2)
    with_analog(file, SCALE=reals(file, [2.0, 3.0]), SCALE2=reals(file, [4.0]))
    scaling = analog_of(c3d.read(file.build(), "clip")).scaling
    assert scaling is not None and scaling.scales.tolist() == [2.0, 3.0, 4.0]


@given(st.lists(st.sampled_from([0.0, -1.0, 1e-30, 3e38, float("nan"), float("inf")]), min_size=3))
def test_any_scale_gives_the_words_back(scales: list[float]) -> None:
    file = make_c3d(3, 1, 2, 2, size=2)
    with_analog(file, SCALE=reals(file, scales[:2]), GEN_SCALE=reals(file, scales[2:3]))
    data = file.build()
    motion = c3d.read(data, "clip")
    assert c3d.write(motion) == data
    stream = io.BytesIO()
    mcz.write(motion, stream)
    with mcz.open(stream.getvalue()) as reader:
        assert reader.clips["clip"].source_bytes() == data


def test_changed_values_become_the_nearest_words() -> None:
    file = make_c3d(2, 1, 1, 2, size=2)
    with_analog(file, SCALE=reals(file, [0.5]), OFFSET=integers(file, [100]))
    motion = c3d.read(file.build(), "clip")
    analog = analog_of(motion)
    values = analog.values.copy()
    values[1, 0], values[2, 0] = 7.1, 1e9
    changed = replace(analog, values=values)
    again = c3d.read(c3d.write(replace(motion, signals=(*motion.signals[:2], changed))), "again")
    stored = analog_of(again).stored[:, 0].tolist()
    assert stored == [analog.stored[0, 0], 114, 0x7FFF, analog.stored[3, 0]]


def test_without_its_source_a_clip_has_the_values() -> None:
    """Nothing would say what the words mean."""
    file = make_c3d(3, 1, 2, size=2)
    with_analog(file, SCALE=reals(file, [0.5, 2.0]), UNITS=file.texts([b"N", b"V"]))
    motion = c3d.read(file.build(), "clip")
    stream = io.BytesIO()
    mcz.write(replace(motion, source=None), stream)
    with mcz.open(stream.getvalue()) as reader:
        decoded = analog_of(reader.clips["clip"].motion())
    assert np.array_equal(decoded.values, analog_of(motion).values)
    assert decoded.channels == analog_of(motion).channels and decoded.scaling is None


def test_a_scaling_that_the_source_does_not_say_is_refused() -> None:
    file = make_c3d(3, 1, 1, size=2)
    with_analog(file, SCALE=reals(file, [0.5]))
    motion = c3d.read(file.build(), "clip")
    analog = analog_of(motion)
    assert analog.scaling is not None
    other = analog.in_units(replace(analog.scaling, general=3.0))
    motion = replace(motion, signals=(*motion.signals[:2], other))
    with pytest.raises(MotionError, match="'analog' and its source have different scalings"):
        mcz.write(motion, io.BytesIO())


@pytest.mark.parametrize("size", [2, 4])
def test_a_plain_file_says_what_words_mean(size: int) -> None:
    file = make_c3d(3, 1, 2, 2, size=size)
    with_analog(
        file,
        SCALE=reals(file, [0.5, 0.1]),
        OFFSET=integers(file, [2048, -3]),
        GEN_SCALE=(4, (), real(3.0, INTEL)),
    )
    motion = c3d.read(file.build(), "clip")
    again = c3d.read(c3d.write(replace(motion, source=None)), "again")
    assert np.array_equal(analog_of(again).values, analog_of(motion).values)
    assert np.array_equal(analog_of(again).stored, analog_of(motion).stored)


@pytest.mark.parametrize(
    ("x", "y", "up"),
    [
        ("+X", "+Z", "z"),
        ("+X", "+Y", "y"),
        ("+Y", "+X", "x"),
        ("-X", "+Z", "z"),
        ("", "+z", "z"),
        ("", "Z", "z"),
        ("-X", "-Z", "-z"),
        ("+Z", "+Z", ""),
        ("+X", "up", ""),
        ("+X", "", ""),
    ],
)
def test_the_axis_that_points_up(x: str, y: str, up: str) -> None:
    file = make_c3d(1, 1)
    axes = {"X_SCREEN": x, "Y_SCREEN": y}
    file.parameters["POINT"] = {k: file.texts([v.encode()]) for k, v in axes.items() if v}
    motion = c3d.read(file.build(), "clip")
    assert motion.skeleton.up_axis == up
    again = c3d.read(c3d.write(replace(motion, source=None)), "again")
    assert again.skeleton.up_axis == up


@pytest.mark.parametrize("processor", ORDERS)
def test_events_of_the_parameters(processor: int) -> None:
    file = make_c3d(1, 1, processor=processor)
    file.parameters["EVENT"] = {
        "USED": file.number(2),
        "TIMES": reals(file, [0.0, 1.5, 2.0, 0.25, 9.0, 9.0], 2, 3),
        "LABELS": file.texts([b"Foot Strike", b"Foot Off"]),
        "CONTEXTS": file.texts([b"Left", b"Right"]),
        "SUBJECTS": file.texts([b"Ann"]),
    }
    assert recording_of(file).events == (
        mcz.Event("Foot Strike", 1.5, "Left", "Ann"),
        mcz.Event("Foot Off", 120.25, "Right"),
    )


@pytest.mark.parametrize("processor", ORDERS)
@pytest.mark.parametrize(("key", "n"), [(12_345, 2), (12_345, 99), (0, 2)])
def test_events_of_the_header(processor: int, key: int, n: int) -> None:
    data = bytearray(make_c3d(1, 1, processor=processor).build())
    data[298:302] = word(key, processor) + word(n, processor)
    data[304:312] = real(0.5, processor) + real(2.0, processor)
    data[396:404] = b"LHS RTO "
    decoded = mcz.recording(c3d.read(bytes(data), "clip"))
    assert decoded is not None
    if not key:
        assert decoded.events == ()
    else:
        assert decoded.events[:2] == (mcz.Event("LHS", 0.5), mcz.Event("RTO", 2.0))
        assert len(decoded.events) == min(n, 18)


@pytest.mark.parametrize("processor", ORDERS)
def test_force_platforms(processor: int) -> None:
    file = make_c3d(1, 1, 12, processor=processor)
    corners = [float(k) for k in range(24)]
    matrix = [float(k) for k in range(72)]
    file.parameters["FORCE_PLATFORM"] = {
        "USED": file.number(2),
        "TYPE": integers(file, [2, 4]),
        "CORNERS": reals(file, corners, 3, 4, 2),
        "ORIGIN": reals(file, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0], 3, 2),
        "CHANNEL": integers(file, [*range(1, 13)], 6, 2),
        "CAL_MATRIX": reals(file, matrix, 6, 6, 2),
        "ZERO": integers(file, [1, 10]),
    }
    found = recording_of(file)
    first, second = found.platforms
    assert first.corners == ((0, 1, 2), (3, 4, 5), (6, 7, 8), (9, 10, 11))
    assert (second.type, second.origin, second.channels) == (4, (4, 5, 6), (7, 8, 9, 10, 11, 12))
    assert first.calibration[1] == (1, 7, 13, 19, 25, 31)  # the first index varies fastest
    assert found.zero_frames == (1, 10)
    del file.parameters["FORCE_PLATFORM"]["CORNERS"], file.parameters["FORCE_PLATFORM"]["ORIGIN"]
    file.parameters["FORCE_PLATFORM"]["CAL_MATRIX"] = reals(file, [], 6, 6, 0)
    found = recording_of(file)
    assert [p.type for p in found.platforms] == [2, 4]
    assert found.platforms[0].corners == () and found.platforms[0].origin is None
    assert found.platforms[0].calibration == ()


def test_names_units_and_descriptions() -> None:
    file = make_c3d(2, 2, 2, 3, first=41)
    file.parameters["POINT"] = {
        "DESCRIPTIONS": file.texts([b"left knee"]),
        "ANGLES": file.texts([b"p1"]),
        "ANGLE_UNITS": file.texts([b"deg"]),
    }
    with_analog(
        file,
        LABELS=file.texts([b"Fx"]),
        DESCRIPTIONS=file.texts([b"", b"spare"]),
        UNITS=file.texts([b"N"]),
        RATE=(4, (), real(300.0, INTEL)),
        OFFSET=integers(file, [7]),
    )
    found = recording_of(file)
    assert (found.first_frame, found.unit, found.analog_rate) == (41, "mm", 300.0)
    points = [(p.name, p.description, p.unit, p.groups) for p in found.points]
    assert points == [("p0", "left knee", "mm", ()), ("p1", "", "deg", ("ANGLES",))]
    channels = [(c.name, c.description, c.unit, c.offset) for c in found.analog]
    assert channels == [("Fx", "", "N", 7.0), ("channel 2", "spare", "", 0.0)]


def test_parameters_behind_the_data() -> None:
    file = make_c3d(4, 2, 1, size=2)
    with_analog(file, SCALE=reals(file, [0.5]))
    file.parameters["POINT"] = {"Y_SCREEN": file.texts([b"+Y"])}
    data = file.build()
    size = 4 * 2 * (8 + 1)
    head, section = bytearray(data[:512]), data[512:-size]
    head[0], head[16] = 3, 2
    behind = bytes(head) + data[-size:] + bytes(512 - size) + section
    motion = c3d.read(behind, "clip")
    assert c3d.write(motion) == behind
    assert motion.skeleton.up_axis == "y"
    assert np.array_equal(analog_of(motion).values, analog_of(motion).stored * 0.5)


@given(st.binary(max_size=400), st.integers(0, 255))
def test_any_parameters_say_something(junk: bytes, at: int) -> None:
    data = bytearray(make_c3d(2, 1, 1, size=2).build())
    data[512 + at : 512 + at + len(junk)] = junk[: len(data) - 512 - at]
    try:
        motion = c3d.read(bytes(data), "junk")
    except mcz.SourceError:
        return
    assert mcz.recording(motion) is not None
    assert c3d.write(motion) == data


def test_other_sources_say_nothing(samples: Any) -> None:
    assert mcz.recording(mcz.read(samples / "walk.bvh")) is None
