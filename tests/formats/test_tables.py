"""TRC, MOT and STO of every style: bytes -> Motion -> the same bytes."""

from __future__ import annotations

import io
import lzma
import os
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import mcz
from mcz import Channel, LimitError, Motion, MotionError, SourceError
from mcz.model.numbers import GridKind, scan
from mcz.sources import FORMATS
from mcz.sources.sample import bvh_walk, marker_walk
from mcz.sources.tables.layout import PHRASES, fill_marks
from mcz.sources.tables.times import find_clock, rate_of_times, stated_rate
from tests.formats.tab_files import NUMBERS
from tools.vectors.build.table_files import FORCES, MARKERS, QUATERNIONS, TIMES

SMALL = {"trc": MARKERS, "mot": FORCES, "sto": QUATERNIONS}


def back(name: str, data: bytes) -> Motion:
    """The motion, which is written as the same bytes."""
    motion: Motion = FORMATS[name].read(data, "table")
    assert FORMATS[name].write(motion) == data
    return motion


def test_a_trc_says_its_markers() -> None:
    motion = back("trc", MARKERS)
    assert [joint.name for joint in motion.skeleton.joints] == ["R.Heel", "L Heel"]
    assert (motion.frame_rate, motion.frame_rate_exact, motion.metadata) == (60, True, {})
    assert motion.frame_numbers is not None
    assert motion.frame_numbers.tolist() == [185, 186, 187, 188, 189]
    assert len(motion.signals) == 1  # the times follow from the numbers
    assert motion.values[0, 0] == 596.88123
    assert np.isnan(motion.values[1, 3:]).all() and np.isnan(motion.values[3, :3]).all()
    assert not len(motion.signals[0].exceptions)


def test_times_that_follow_from_nothing_are_a_signal() -> None:
    motion = back("trc", TIMES)
    assert motion.signals[1].values.ravel().tolist() == [0.0, 0.02, 0.05, 1e9]
    assert motion.frame_rate is None
    assert "not uniform" in motion.metadata["source-note"]
    other = replace(motion.signals[1], values=motion.signals[1].values + 1)
    assert b"\n1\t1.00\t-2.73" in FORMATS["trc"].write(
        replace(motion, signals=(motion.signals[0], other))
    )


def test_a_storage_file_says_its_columns() -> None:
    motion = back("mot", FORCES)
    assert motion.skeleton.joint_names == ("pelvis_tilt", "pelvis_tx", "force")
    assert (motion.skeleton.angle_unit, motion.frame_rate) == ("deg", 60)
    (times,) = motion.signals_of("times")
    assert times.channels == (Channel("", "time", "s"),)
    quaternions = back("sto", QUATERNIONS)
    assert [c.name for c in quaternions.skeleton.joints[0].channels] == ["w", "x", "y", "z"]
    assert (quaternions.skeleton.angle_unit, quaternions.frame_rate) == ("", 100)
    assert quaternions.values[1].tolist() == [
        *(0.5066763245921503, 0.4914209832138792, -0.5354515570241827, 0.4637630315530473),
        *(0.8, 0, 0.6, 0),
    ]


REFUSED = {
    "trc": {
        b"": "no line begins with Frame#; not a TRC file, or truncated",
        b"PathFileType\t4\n": "no line begins with Frame#; not a TRC file, or truncated",
        b"Frame#\tTime\tA\n\t\tX1\n": "line 2: no row of numbers",
        b"Frame#\tTime\tA\n1\t0\t1\t2\t3\nnothing\n": "line 3: not a row of numbers",
        b"Frame#\tTime\tA\n1\t0\t1\t2\tx\n": "line 2: 'x' is not a number",
        b"Frame#\tTime\tA\n1.5\t0\t1\t2\t3\n": "is not a frame number, or too large",
        b"\xff\xfeF\0": "UTF-16",
    },
    "sto": {
        b"": "no line 'endheader'",
        b"name\nendheader\n": "names and a row of numbers must follow endheader",
        b"endheader\ntime\ta\n0\t1\n1\t2\t3\n": "line 4: more than 2 cells",
        b"endheader\ntime\ta\n0\t1,2,3\n1\t1,2\n": "line 4: 2 numbers in a cell; expected 3",
        b"endheader\ntime\ta\n0\t1\n# end\n": "line 4: not a row of numbers",
        b"endheader\ntime\ta\n0,"
        + b"1," * 99
        + b"1\t2\n": "101 numbers in a cell exceed the limit of 64",
    },
}


@pytest.mark.parametrize(
    ("name", "data"), [(name, data) for name, cases in REFUSED.items() for data in cases]
)
def test_what_is_no_table_is_refused_with_the_reason(name: str, data: bytes) -> None:
    with pytest.raises(SourceError) as caught:
        FORMATS[name].read(data, "table")
    assert REFUSED[name][data] in str(caught.value)


# Headers


def test_a_header_has_a_limit() -> None:
    longest = max(PHRASES.values(), key=len)
    mark = next(bytes((mark,)) for mark, phrase in PHRASES.items() if phrase == longest)
    n = 2**26 // len(longest)
    assert len(fill_marks(mark * n, [], b"")) == n * len(longest)
    with pytest.raises(LimitError, match="a header of"):
        fill_marks(mark * (n + 1), [], b"")


# Times


@given(
    st.fractions(1, 10**5, max_denominator=1001),
    st.integers(0, 8),
    st.integers(-100, 10**6),
    st.integers(2, 40),
)
def test_a_clock_is_found_where_times_are_rounded(
    rate: Fraction, places: int, first: int, n: int
) -> None:
    numbers = np.arange(first, first + n)
    times = [f"{float(k / rate):.{places}f}" for k in range(n)]
    stop = np.cumsum([len(time) + 1 for time in times]) - 1
    tokens = scan(" ".join(times).encode(), stop - [len(time) for time in times], stop)
    clock = find_clock(tokens, numbers, [rate])
    if clock is None:  # nothing moves, or a tie was rounded to even
        exact = [k * 10**places / rate for k in range(n)]
        assert times[0] == times[-1] or any((2 * x).denominator == 1 for x in exact)
        return
    printed = clock.grid.texts(np.array(clock.ordinals(numbers.tolist()))).tolist()
    assert printed == [time.encode() for time in times]


def test_rates() -> None:
    times = np.arange(50) / 119.88
    assert rate_of_times(np.round(times, 6), [5e-7]) == (Fraction(120000, 1001), True)
    assert rate_of_times(np.round(times, 6), [5e-7], [Fraction("119.88")])[0] == Fraction("119.88")
    assert rate_of_times(np.arange(30) / 60, [0.0])[0] == 60
    assert rate_of_times(np.array([0.0, 0.1, 0.3]), [5e-3]) == (None, True)
    assert rate_of_times(np.array([0.0, np.inf]), [5e-3]) == (None, True)
    assert rate_of_times(np.array([0.0]), [5e-3]) == (None, True)
    assert stated_rate("1e999999999") is None
    assert stated_rate(" 119.88") == Fraction("119.88")


# Plain files


def test_a_plain_trc_holds_markers_alone() -> None:
    markers = replace(marker_walk(), source=None)
    again = back("trc", FORMATS["trc"].write(markers))
    assert np.array_equal(again.values, markers.values, equal_nan=True)
    assert again.skeleton.joint_names == markers.skeleton.joint_names
    with pytest.raises(MotionError, match="markers only"):
        FORMATS["trc"].write(replace(bvh_walk(), source=None))
    unknown = replace(markers, skeleton=replace(markers.skeleton, unit_cm=None))
    with pytest.raises(MotionError, match="length unit"):
        FORMATS["trc"].write(unknown)
    with pytest.raises(MotionError, match="rate is unknown"):
        FORMATS["trc"].write(replace(markers, frame_rate=None))


@pytest.mark.parametrize("to", ["trc", "sto", "mot"])
def test_converted(to: str) -> None:
    walk = replace(bvh_walk(), skeleton=replace(bvh_walk().skeleton, unit_cm=1.0))
    again = back(to, FORMATS[to].write(mcz.convert(walk, to)))
    assert again.frame_rate == 120
    if to == "trc":
        assert (
            np.abs(again.values - 10 * mcz.positions(walk).reshape(again.n_frames, -1)).max() < 1e-5
        )
    else:
        assert np.array_equal(again.values, walk.values)
        assert np.allclose(again.times, np.arange(again.n_frames) / 120, atol=1e-6)
        other = {"sto": "mot", "mot": "sto"}[to]
        twice = back(other, FORMATS[other].write(mcz.convert(again, other)))
        assert np.array_equal(twice.values, again.values)


# Real files

DATA = Path(os.environ.get("MCZ_DATA", "/nonexistent"))


def real_files() -> list[Path]:
    folders = DATA / "other/opensim-core", DATA / "other/trc"
    return [p for folder in folders for p in sorted(folder.glob("*")) if p.suffix[1:] in SMALL]


@pytest.mark.real
def test_real_tables_are_small() -> None:
    """Short ones: five take more than xz -9e and 200 bytes. tools/source_sizes.py has all."""
    chosen = [path for path in real_files() if path.stat().st_size < 60_000]
    total = against = beyond = 0
    for path in chosen:
        data = path.read_bytes()
        target = io.BytesIO()
        mcz.encode(path, target, effort="best")
        with mcz.open(target.getvalue()) as file:
            assert file.only_clip().source_bytes() == data, path
        size = len(target.getvalue())
        xz = len(lzma.compress(data, preset=9 | lzma.PRESET_EXTREME))
        total, against, beyond = total + size, against + xz, beyond + (size > xz + 200)
    assert len(chosen) > 15
    assert total < 0.85 * against
    assert beyond <= 5


@pytest.mark.parametrize("style", ["%.18e", "%.2E", "binary32", "17 digits"])
def test_a_grid_for_each_style(style: str) -> None:
    """Numbers as other programs print them are on a grid, and no exceptions."""
    texts = [NUMBERS[style](x) for x in np.linspace(0.5, 90, 40).tolist()]
    rows = "".join(f"{k}\t{text}\n" for k, text in enumerate(texts))
    signal = back("sto", f"endheader\ntime\ta\n{rows}".encode()).signals[0]
    assert not len(signal.exceptions)
    assert signal.grids[0].kind == GridKind.PRINTED
    bases = {"%.18e": 64, "%.2E": 131, "binary32": 32, "17 digits": 4}
    assert signal.grids[0].digits == bases[style]
