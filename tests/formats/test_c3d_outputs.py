"""Points that are no points: apart from the motion, and back in the same bytes."""

from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import mcz
from mcz import Channel, Joint, Motion, MotionError, Signal, Skeleton
from mcz.sources.c3d import c3d
from mcz.sources.c3d.parameters import Split
from tests.formats.c3d_files import DEC, INTEL, SGI, Made, make_c3d

ORDERS = (INTEL, DEC, SGI)


def add_point_lists(file: Made, **lists: list[str]) -> Made:
    """The file with parameters of POINT that list labels, or units."""
    more = {name: file.texts([text.encode() for text in texts]) for name, texts in lists.items()}
    file.parameters.setdefault("POINT", {}).update(more)
    return file


def signal_of(motion: Motion, name: str) -> Signal:
    return next(signal for signal in motion.signals if signal.name == name)


@pytest.mark.parametrize("processor", ORDERS)
@pytest.mark.parametrize("size", [2, 4])
def test_outputs_between_points_are_a_signal_of_their_own(processor: int, size: int) -> None:
    file = make_c3d(6, 5, 2, 2, processor=processor, size=size)
    add_point_lists(file, ANGLES=["p1"], ANGLE_UNITS=["deg"], POWERS=["p3"], POWER_UNITS=["W"])
    data = file.build()
    whole = c3d.read(make_c3d(6, 5, 2, 2, processor=processor, size=size).build(), "whole")
    motion = c3d.read(data, "apart")
    assert [signal.name for signal in motion.signals] == [
        "motion",
        "residuals",
        "outputs",
        "analog",
    ]
    assert [joint.name for joint in motion.skeleton.joints] == ["p0", "p2", "p4"]
    outputs, points = signal_of(motion, "outputs"), whole.signals[0].values
    assert outputs.channels is not None
    assert outputs.channels[0] == Channel("", "p1 x", "deg")
    assert [(c.name, c.unit) for c in outputs.channels[3:]] == [
        ("p3 x", "W"),
        ("p3 y", "W"),
        ("p3 z", "W"),
    ]
    assert np.array_equal(outputs.values, points[:, [3, 4, 5, 9, 10, 11]])
    assert np.array_equal(motion.signals[0].values, points[:, [0, 1, 2, 6, 7, 8, 12, 13, 14]])
    residuals = signal_of(whole, "residuals").values[:, [0, 2, 4, 1, 3]]
    assert np.array_equal(signal_of(motion, "residuals").values, residuals)
    assert motion.source is not None and motion.source.format == "c3d-outputs"
    assert c3d.write(motion) == data


LISTS = st.dictionaries(
    st.sampled_from(["ANGLES", "ANGLES2", "FORCES", "MOMENTS", "POWERS", "SCALARS", "SCALARS3"]),
    st.lists(st.sampled_from(["p0", "p1", "p2", "p3", "", "none"]), max_size=4),
    max_size=4,
)


@given(LISTS, st.sampled_from(ORDERS), st.sampled_from([2, 4]), st.integers(0, 4), st.data())
def test_whatever_is_listed_comes_back(
    lists: dict[str, list[str]], processor: int, size: int, n_points: int, draw: st.DataObject
) -> None:
    """In two lists, in none, twice, of no point; invalid points; no points at all."""
    file = add_point_lists(make_c3d(4, n_points, 1, 2, processor=processor, size=size), **lists)
    for frame, point in draw.draw(st.lists(st.tuples(st.integers(0, 3), st.integers(0, 3)))):
        if point < n_points:
            file.points[frame, point, 3] = 0xFFFF if size == 2 else 0xFFFFFFFF
    data = file.build()
    motion = c3d.read(data, "clip")
    assert c3d.write(motion) == data
    stream = io.BytesIO()
    mcz.write(motion, stream)
    with mcz.open(stream.getvalue()) as reader:
        clip = reader.clips["clip"]
        assert clip.source_bytes() == data
        for signal in motion.signals:
            assert np.array_equal(clip.read(signal=signal.name), signal.masked(), equal_nan=True)


@pytest.mark.parametrize(
    ("lists", "unit"),
    [
        ({"ANGLES": ["p1"]}, ""),
        ({"ANGLES": ["p1"], "ANGLE_UNITS": ["deg"], "FORCES": ["p1"], "FORCE_UNITS": ["N"]}, ""),
        ({"ANGLES": ["p1"], "ANGLE_UNITS": ["deg"], "SCALARS": ["p1"]}, ""),
        ({"FORCES": ["p1", "p1"], "FORCE_UNITS": ["N"]}, "N"),
        ({"MOMENTS": ["p0"], "MOMENTS2": ["p1"], "MOMENT_UNITS": ["Nmm"]}, "Nmm"),
    ],
)
def test_units_are_those_of_the_list_or_unknown(lists: dict[str, list[str]], unit: str) -> None:
    motion = c3d.read(add_point_lists(make_c3d(2, 3), **lists).build(), "units")
    channels = signal_of(motion, "outputs").channels
    assert channels is not None
    assert {c.unit for c in channels if c.name.startswith("p1")} == {unit}


def test_without_outputs_the_format_is_the_old_one() -> None:
    motion = c3d.read(add_point_lists(make_c3d(2, 3), ANGLES=["", "p9"]).build(), "old")
    assert motion.source is not None and motion.source.format == "c3d"
    assert len(motion.signals[0].grids) == 9


def test_a_file_of_before_still_says_what_it_said(monkeypatch: pytest.MonkeyPatch) -> None:
    data = add_point_lists(make_c3d(5, 4), ANGLES=["p1"]).build()
    with monkeypatch.context() as before:
        everything = Split(np.arange(4), np.arange(0))
        before.setattr(c3d, "find_outputs", lambda parameters, n: everything)
        old = c3d.read(data, "clip")
        stream = io.BytesIO()
        mcz.write(old, stream)
    with mcz.open(stream.getvalue()) as reader:
        clip = reader.clips["clip"]
        assert clip.source is not None and clip.source.format == "c3d"
        assert clip.n_channels == 12 and clip.source_bytes() == data
        assert np.array_equal(clip.values[:], old.signals[0].values)


def test_lossy_codecs_and_distances_leave_them_alone() -> None:
    file = add_point_lists(make_c3d(64, 4), ANGLES=["p1"], ANGLE_UNITS=["deg"])
    motion = c3d.read(file.build(), "clip")
    stream = io.BytesIO()
    mcz.write(motion, stream, codec="mrdwt", mean_error_cm=0.1)
    with mcz.open(stream.getvalue()) as reader:
        clip = reader.clips["clip"]
        outputs = signal_of(motion, "outputs")
        assert np.array_equal(clip.read(signal="outputs"), outputs.values)
        again = c3d.read(clip.source_bytes(), "again")
        assert np.array_equal(signal_of(again, "outputs").values, outputs.values)
        assert mcz.positions(motion).shape == (64, 3, 3)
        compared = mcz.compare(motion, clip.motion())
    assert compared.points == 3 and compared.signals["outputs"] == 0.0
    assert compared.mean_position_error_cm is not None
    assert 0 < compared.mean_position_error_cm <= 0.1


@pytest.mark.parametrize("size", [2, 4])
def test_a_plain_file_lists_them_again(size: int) -> None:
    file = make_c3d(9, 5, 2, 2, size=size)
    add_point_lists(file, ANGLES=["p0"], ANGLE_UNITS=["deg"], MOMENTS=["p3"], MOMENT_UNITS=["Nmm"])
    file.points[3, 3, 3] = 0xFFFF if size == 2 else 0xBF800000
    motion = c3d.read(file.build(), "clip")
    again = c3d.read(c3d.write(replace(motion, source=None)), "clip")
    assert again.metadata == {}
    for one in motion.signals:
        other = signal_of(again, one.name)
        assert np.array_equal(one.masked(), other.masked(), equal_nan=True), one.name
        assert one.channels == other.channels
    assert again.skeleton.joints == motion.skeleton.joints


def test_more_units_than_lists() -> None:
    units = ["deg", "N", "Nmm", "W", "kg", "m/s", "N/kg"]
    channels = tuple(Channel("", f"o{k} {part}", u) for k, u in enumerate(units) for part in "xyz")
    outputs = Signal(
        np.arange(42.0).reshape(2, 21), name="outputs", role="outputs", channels=channels
    )
    motion = Motion(Skeleton(()), (Signal(np.zeros((2, 0))), outputs))
    again = signal_of(c3d.read(c3d.write(motion), "many"), "outputs")
    assert again.channels is not None
    assert np.array_equal(again.values, outputs.values)
    found = {channel.name[:2]: channel.unit for channel in again.channels}
    assert [found[f"o{k}"] for k in range(4)] == units[:4]
    assert all(found[f"o{k}"] in ("", unit) for k, unit in enumerate(units))


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (("a x", "a y", "b z"), "'a x' does not"),
        (
            ("p x", "p y", "p z"),
            "C3D distinguishes outputs from points only by name, and these are both",
        ),
    ],
)
def test_what_a_plain_file_cannot_list_is_refused(names: tuple[str, ...], message: str) -> None:
    joint = Joint("p", channels=tuple(Channel(kind) for kind in ("tx", "ty", "tz")))
    channels = tuple(Channel("", name) for name in names)
    outputs = Signal(np.zeros((1, 3)), name="outputs", role="outputs", channels=channels)
    with pytest.raises(MotionError) as error:
        c3d.write(Motion(Skeleton((joint,)), (Signal(np.zeros((1, 3))), outputs)))
    assert message in str(error.value)
