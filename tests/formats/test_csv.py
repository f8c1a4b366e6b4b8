"""CSV files of Motive, of Vicon and of columns: bytes -> Motion -> the same bytes."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import numpy as np
import pytest

import mcz
from mcz import Motion, MotionError, SourceError
from mcz.sources import FORMATS, likely_formats
from mcz.sources.sample import bvh_walk
from mcz.sources.tables.csv_files import is_motion, kind_of
from tools.vectors.build.table_files import COLUMNS, DEVICES, EULER, MOTIVE, VICON


def back(data: bytes) -> Motion:
    """The motion, which is written as the same bytes."""
    motion: Motion = FORMATS["csv"].read(data, "table")
    assert FORMATS["csv"].write(motion) == data
    return motion


def source_format(motion: Motion) -> str:
    assert motion.source is not None
    return motion.source.format


def test_motive_says_its_bones_and_markers() -> None:
    motion = back(MOTIVE)
    hip, marker = motion.skeleton.joints
    assert (hip.name, marker.name) == ("A, B:Hip", "Unlabeled 7")
    assert [c.kind for c in hip.channels] == ["qx", "qy", "qz", "qw", "tx", "ty", "tz"]
    assert [c.label for c in marker.channels] == ["tx", "ty", "tz", "Marker Quality"]
    assert (motion.frame_rate, motion.frame_rate_exact, motion.skeleton.unit_cm) == (120, True, 0.1)
    assert len(motion.signals) == 1  # the times follow from the numbers
    points = mcz.positions(motion)
    assert points[1].tolist() == [[60.004, 19.161, 76.594], [9.99, 19.158, 9.789]]
    assert np.isnan(points[0, 1]).all() and np.isnan(points[3, 0]).all()


def test_angles_of_motive_turn_in_the_order_that_it_says() -> None:
    motion = back(EULER)
    (box,) = motion.skeleton.joints
    kinds = ["rz", "rx", "ry", "tx", "ty", "tz", ""]
    assert [channel.kind for channel in box.channels] == kinds
    assert motion.values[0, :3].tolist() == [90.5, -0.3125, 1.25]
    turned = motion.values.copy()
    turned[:, 0] += 1
    assert b"11,0.110000,-0.6250,1.50,92.25" not in FORMATS["csv"].write(motion)
    assert b"-0.625,1.5,92.25,0.060004" in FORMATS["csv"].write(motion.with_values(turned))


def test_bones_that_are_seen_from_their_parents_have_them() -> None:
    text = MOTIVE.replace(b"Global", b"Local").replace(b'"A0","A0","A0","A0"\r\n,Parent', b"X")
    local = back(MOTIVE.replace(b"Coordinate Space,Global", b"Coordinate Space,Local"))
    assert [joint.parent for joint in local.skeleton.joints] == [-1, -1]  # there is no 0:0
    text = MOTIVE.replace(b"Global", b"Local").replace(b'"0:0","0:0","0:0","0:0"\r', b'"1:1",,,\r')
    assert [joint.parent for joint in back(text).skeleton.joints] == [-1, 0]
    world = text.replace(b"Local", b"Global")
    assert [joint.parent for joint in back(world).skeleton.joints] == [-1, -1]


def test_sections_of_vicon_are_signals() -> None:
    motion = back(VICON)
    assert [joint.name for joint in motion.skeleton.joints] == ["Ann:LASI", "Ann:RASI"]
    assert motion.frame_numbers is not None and motion.frame_numbers.tolist() == [7, 8, 9]
    assert (motion.frame_rate, motion.skeleton.unit_cm) == (100, 0.1)
    devices, outputs = motion.signals[1:]
    assert (devices.name, devices.samples_per_frame, outputs.name) == (
        "Devices",
        2,
        "Model Outputs",
    )
    assert devices.channels is not None and outputs.channels is not None
    assert [(c.name, c.unit) for c in devices.channels[2:]] == [
        ("Plate #1 - Force.Fz", "N"),
        ("EMG - Left.1", "V"),
    ]
    assert outputs.channels[0].name == "Ann:LKnee.X"
    assert devices.masked()[1].tolist() == [1, -0.5, 613.25, -2.25e-05]
    assert np.isnan(devices.masked()[3, 3]) and np.isnan(motion.values[1, 3:]).all()
    assert mcz.positions(motion).shape == (3, 2, 3)


def test_devices_alone_have_a_motion_without_channels() -> None:
    motion = back(DEVICES)
    assert motion.values.shape == (3, 0)
    assert (motion.frame_rate, motion.signals[1].samples_per_frame) == (500, 2)


def test_columns_say_their_names_and_units() -> None:
    motion = back(COLUMNS)
    assert [joint.name for joint in motion.skeleton.joints] == ["knee angle", "force"]
    assert [channel.unit for channel in motion.skeleton.channels] == ["deg", "N"]
    assert (motion.frame_rate, len(motion.signals)) == (100, 1)
    assert np.isnan(motion.values[0, 1]) and motion.values[1].tolist() == [-1.5, 3.75]


@pytest.mark.parametrize(
    ("text", "rate", "numbers"),
    [
        ("frame,time,a\n4,0.00,1\n5,0.02,2\n6,0.04,3\n", 50, [4, 5, 6]),
        ("t,a\n0,1\n0.1,2\n0.5,3\n", None, None),
        ("1,2\n3,4\n", None, None),
        (",a,b\n0,1,NA\n1,NA,2\n2,3,4\n", None, [0, 1, 2]),
        ("# x, y\n1.0 2.0\n3.0 4.0\n", None, None),
        ("a,b\n,1\n2,\n", None, None),
        ('"1.5","2"\n"2.5","3"\n', None, None),
    ],
)
def test_columns_of_many_programs(text: str, rate: int | None, numbers: list[int] | None) -> None:
    motion = back(text.encode())
    assert motion.frame_rate == rate
    found = motion.frame_numbers
    assert (None if found is None else found.tolist()) == numbers
    if rate is None and text.startswith("t"):
        assert motion.signals[1].values.ravel().tolist() == [0, 0.1, 0.5]


REFUSED = {
    b"": "line 1: an empty file",
    b"a,b\nx,y\n": "no row of numbers",
    b"a;b\n1,5;2,5\n": "line 1: the first numbers have decimal commas, which are not supported",
    b"a,b\n1,2\n3,x\n": "line 3: 'x' is not a number",
    b"a,b\n1,2\n3,4,5\n": "line 3: more than 2 cells",
    b"Format Version,1.21\n": "no line Frame,Time",
    EULER[: EULER.index(b"10,0.1")]: "line 8: no row of numbers after Frame,Time",
    EULER + b"the end\n": "line 11: not a row of numbers",
    VICON.replace(b"\n9,0,11.75,0.75,-1.5", b""): "line 18: section 'Model Outputs' has 2 frames",
    VICON.replace(b"\n9,1,", b"\n10,0,"): "rows are not the same number in every frame",
    b"Devices\n1\n,,a\nFrame,Sub Frame,x\n,,N\n": "no row of numbers below Frame,Sub Frame",
    b"\xff\xfeF\0": "UTF-16",
}


@pytest.mark.parametrize("data", REFUSED)
def test_what_is_no_table_is_refused_with_the_reason(data: bytes) -> None:
    with pytest.raises(SourceError) as caught:
        FORMATS["csv"].read(data, "table")
    assert REFUSED[data] in str(caught.value)


def test_a_motion_from_elsewhere_is_no_csv_file() -> None:
    with pytest.raises(
        MotionError,
        match="was not read from a CSV file",
    ):
        FORMATS["csv"].write(bvh_walk())


@pytest.mark.parametrize("data", [MOTIVE, VICON, DEVICES, COLUMNS, b"1 2\n"])
def test_kinds_of_files(data: bytes) -> None:
    assert kind_of(data) == source_format(back(data)) == likely_formats(data)[0]


INDEX = b'"Subject","Trial #","Description"\n1,1,"forward jumps, turn"\n1,2,"climb"\n'


def test_a_folder_leaves_out_tables_of_words(tmp_path: Path) -> None:
    assert is_motion(VICON) and is_motion(MOTIVE) and is_motion(COLUMNS)
    assert not is_motion(INDEX) and not is_motion(b"a,b\n1,2\n3,x\n") and not is_motion(b"")
    folder = tmp_path / "takes"
    folder.mkdir()
    (folder / "index.csv").write_bytes(INDEX)
    (folder / "take.csv").write_bytes(MOTIVE)
    report = mcz.pack(folder, tmp_path / "takes.mcz")
    results = {outcome.path: outcome.result for outcome in report.outcomes}
    assert results == {"take.csv": "parsed", "index.csv": "skipped"}
    kept = mcz.pack(folder, tmp_path / "kept.mcz", keep_all=True)
    assert {outcome.result for outcome in kept.outcomes} == {"parsed", "verbatim"}


def test_memory_is_bounded_by_the_bytes_of_a_ragged_table() -> None:
    """Rows that leave out most of many columns do not take what these would need."""
    text = b",".join(b"c%d" % k for k in range(20_000)) + b"\n" + b"1,2\n" * 500
    tracemalloc.start()
    try:
        with pytest.raises(
            SourceError,
            match="a table would be far larger than the file",
        ):
            FORMATS["csv"].read(text, "table")
        assert tracemalloc.get_traced_memory()[1] < 2**26
    finally:
        tracemalloc.stop()
    for long in (b"a,b\n1,2\n" + b"," * 3_000_000 + b"3\n", b"1" + b",2" * 2**21, b"1 " * 2**22):
        with pytest.raises(SourceError, match="more than|no row of numbers"):
            FORMATS["csv"].read(long, "table")
    wide = b",".join(b"c%d" % k for k in range(2000)) + b"\n" + (b"," * 1999 + b"1\n") * 40
    assert back(wide).values.shape == (40, 2000)


def test_rows_that_are_no_rows_without_blanks() -> None:
    """An empty line is a row of blanks at first, and none where another word is what is missing."""
    with pytest.raises(SourceError, match="line 3: 'l' is not a number"):
        FORMATS["csv"].read(b"5;NA\n5\nl\n\n5;NA\n")
