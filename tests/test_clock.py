"""One clock: what a source says about time is the time of every frame, everywhere."""

from __future__ import annotations

import io
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

import mcz
from mcz.clock import Timeline
from mcz.motion import Channel, Joint, Motion, Signal, Skeleton

MARKER = (Joint("a", channels=tuple(map(Channel, ("tx", "ty", "tz")))),)


def markers(n: int, rate: int | None = 100, **facts: object) -> Motion:
    values = np.arange(n * 3.0).reshape(n, 3)
    skeleton = Skeleton(MARKER, unit_cm=0.1, angle_unit="")
    return Motion(skeleton, (Signal(values),), rate and Fraction(rate), **facts)  # type: ignore[arg-type]


def stored(motion: Motion) -> Motion:
    out = io.BytesIO()
    mcz.write(motion, out)
    with mcz.open(out.getvalue()) as file:
        clip = file.only_clip()
        np.testing.assert_array_equal(clip.times, clip.motion().times)
        return clip.motion()


def times_signal(values: list[float], unit: str = "s") -> Signal:
    return Signal(np.array(values)[:, None], name="time", channels=(Channel("", "time", unit),))


def near(found: object, wanted: object) -> None:
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-9)  # type: ignore[call-overload]


def test_frame_1_is_at_0() -> None:
    near(markers(3).times, [0, 0.01, 0.02])
    near(markers(3, frame_numbers=np.array([101, 102, 150])).times, [1, 1.01, 1.49])
    near(mcz.times(markers(5), slice(-2, None)), [0.03, 0.04])


def test_start_time_is_that_of_the_first_frame() -> None:
    motion = markers(3, metadata={"start-time": "-0.5"}, frame_numbers=np.array([7, 8, 10]))
    near(motion.times, [-0.5, -0.49, -0.47])
    near(stored(motion).times, motion.times)
    near(motion.cut(1, 3).times, motion.times[1:])
    near(stored(motion.cut(1, 3)).times, motion.times[1:])


def test_a_signal_of_times_comes_first() -> None:
    motion = markers(4, metadata={"start-time": "9"})
    motion = replace(motion, signals=(*motion.signals, times_signal([500, 510, 700, 705], "ms")))
    near(motion.times, [0.5, 0.51, 0.7, 0.705])
    near(stored(motion).times, motion.times)


@pytest.mark.parametrize("bad", [[0.0, np.nan, 1, 2], [0.0, 2, 1, 3], [0.0, 1, 2, np.inf]])
def test_times_that_fall_or_are_unknown_do_not_count(bad: list[float]) -> None:
    motion = markers(4)
    motion = replace(motion, signals=(*motion.signals, times_signal(bad)))
    near(motion.times, [0, 0.01, 0.02, 0.03])
    assert motion.timeline is not None and "do not count" in motion.timeline.note


def test_numbers_that_do_not_ascend_count_rows() -> None:
    motion = markers(4, frame_numbers=np.array([5, 6, 1, 2]))
    near(motion.times, [0.04, 0.05, 0.06, 0.07])
    assert motion.timeline is not None and "ascend" in motion.timeline.note


def test_an_unknown_rate_is_an_error_that_says_what_to_do() -> None:
    with pytest.raises(mcz.OptionError, match="say the rate when reading"):
        _ = markers(4, None).times
    with pytest.raises(mcz.OptionError, match="rate"):
        mcz.times(markers(4, None))


def test_samples_lie_evenly_from_each_frame_on() -> None:
    analog = Signal(
        np.zeros((8, 1)), name="analog", samples_per_frame=4, channels=(Channel("", "f"),)
    )
    motion = markers(2, 50, frame_numbers=np.array([11, 13]))
    motion = replace(motion, signals=(*motion.signals, analog))
    wanted = [0.2, 0.205, 0.21, 0.215, 0.24, 0.245, 0.25, 0.255]
    near(mcz.times(motion, signal="analog"), wanted)
    near(mcz.times(motion, (1, 2), signal=1), wanted[4:])
    with pytest.raises(mcz.OptionError, match="analog"):
        mcz.times(motion, signal="forces")


TRC = """PathFileType\t4\t(X/Y/Z)\tw.trc
DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames
{rate}\t{rate}\t{n}\t1\tmm\t{rate}\t1\t{n}
Frame#\tTime\tA\t\t
\t\tX1\tY1\tZ1

{rows}"""


def trc(path: Path, numbers: list[int], rate: int = 120, digits: int = 3) -> Motion:
    rows = "".join(f"{n}\t{(n - 1) / rate:.{digits}f}\t1.0\t2.0\t{n}.0\n" for n in numbers)
    path.write_text(TRC.format(rate=rate, n=len(numbers), rows=rows))
    return mcz.read(path)


NUMBERS = [*range(124, 140), *range(170, 180)]


@pytest.mark.parametrize("digits", [3, 4, 6])
def test_a_table_has_the_times_that_it_prints(tmp_path: Path, digits: int) -> None:
    motion = trc(tmp_path / "w.trc", NUMBERS, digits=digits)
    printed = [round((n - 1) / 120, digits) for n in NUMBERS]
    assert motion.frame_rate == 120
    near(motion.times, printed)
    near(stored(motion).times, printed)
    line = motion.timeline
    assert line is not None and line.runs == [(0, 16), (16, 26)] and not line.is_uniform
    near(np.diff(line.even)[:15], np.full(15, 1 / 120))


def test_the_clock_outlives_the_source(tmp_path: Path) -> None:
    motion = trc(tmp_path / "w.trc", NUMBERS, digits=6)
    for made in (
        motion.without_source(),
        mcz.select(motion, ["A"]),
        mcz.rename(motion, {"A": "B"}),
        mcz.convert(motion, "c3d"),
        mcz.post_filter(motion),
        stored(motion.without_source()),
    ):
        assert np.abs(made.times - motion.times).max() <= 1e-6
        assert made.frame_numbers is not None and made.frame_numbers.tolist() == NUMBERS


def test_irregular_times_outlive_the_source(tmp_path: Path) -> None:
    (tmp_path / "w.sto").write_text(
        "w\nversion=1\nnRows=4\nnColumns=2\ninDegrees=no\nendheader\ntime\tx\n"
        "1.0\t1\n1.013\t2\n1.5\t3\n1.71\t4\n"
    )
    motion = mcz.read(tmp_path / "w.sto")
    near(motion.times, [1, 1.013, 1.5, 1.71])
    near(mcz.select(motion, ["x"]).times, motion.times)
    near(stored(mcz.select(motion, ["x"])).times, motion.times)


def test_a_decimated_clip_keeps_its_times(tmp_path: Path) -> None:
    trc(tmp_path / "w.trc", list(range(125, 190)), digits=6)
    out = tmp_path / "w.mcz"
    mcz.encode(tmp_path / "w.trc", out, codec="dwt")
    with mcz.open(out) as file:
        clip = file.only_clip()
        thin = clip.motion((3, 60), 1, decimate=True)
        assert np.abs(thin.times - clip.times[3:60:2]).max() <= 1e-6
        assert np.abs(stored(thin).times - clip.times[3:60:2]).max() <= 1e-6


def test_cut_files_keep_the_clock(tmp_path: Path) -> None:
    motion = markers(30, metadata={"start-time": "2.5"})
    mcz.write(motion, tmp_path / "a.mcz")
    mcz.extract(tmp_path / "a.mcz", tmp_path / "b.mcz", frames=(10, 20))
    with mcz.open(tmp_path / "b.mcz") as file:
        near(file.only_clip().times, motion.times[10:20])
        near(file.only_clip().motion((5, 10)).times, motion.times[15:20])


@pytest.mark.parametrize("digits", [2, 3, 6])
def test_a_table_with_a_gap_has_a_rate(tmp_path: Path, digits: int) -> None:
    rows = [*range(100, 130), *range(300, 330), *range(1000, 1003)]
    lines = "".join(f"{n / 100:.{digits}f}\t{n}\n" for n in rows)
    (tmp_path / "w.sto").write_text(f"w\nversion=1\nendheader\ntime\tx\n{lines}")
    motion = mcz.read(tmp_path / "w.sto")
    assert motion.frame_rate == 100
    near(motion.times, np.array(rows) / 100)


def test_irregular_times_have_no_rate(tmp_path: Path) -> None:
    steps = np.random.default_rng(1).uniform(0.005, 0.03, 40).cumsum()
    (tmp_path / "w.sto").write_text(
        "w\nversion=1\nendheader\ntime\tx\n" + "".join(f"{t:.4f}\t1\n" for t in steps)
    )
    assert mcz.read(tmp_path / "w.sto").frame_rate is None


def test_one_missing_frame_is_a_gap_however_few_digits_are_printed() -> None:
    times = np.array([0.0, 0.01, 0.02, 0.04, 0.05])
    line = Timeline(times, Fraction(100), rounding=0.005)
    near(line.even, times)
    near(line.steps, [0.01, 0.01, np.nan, 0.01])
    coarse = np.round(np.arange(50) / 60, 2)
    near(Timeline(coarse, Fraction(60), rounding=0.005).steps, np.full(49, 1 / 60))


def test_steps_are_nan_across_gaps() -> None:
    line = Timeline(np.array([0.0, 0.1, 0.2, 0.9, 1.0]), Fraction(10))
    near(line.steps, [0.1, 0.1, np.nan, 0.1])
    assert line.runs == [(0, 3), (3, 5)]
    assert Timeline(np.arange(9) / 7.0, Fraction(7)).is_uniform


def moving(numbers: list[int], rate: int = 100, **facts: object) -> Motion:
    """One marker that moves at 1 m/s along x and 2 (m/s)/s along y, in mm."""
    seconds = (np.array(numbers) - 1) / rate
    values = np.stack([1000 * seconds, 1000 * seconds**2, 0 * seconds], axis=1)
    motion = markers(len(numbers), rate, frame_numbers=np.array(numbers), **facts)
    return motion.with_values(values)


GAPPED = [*range(101, 111), *range(300, 310), 400, *range(500, 502)]


def test_speeds_take_times_and_no_step_over_a_gap() -> None:
    motion = moving(GAPPED)
    speed = mcz.velocities(motion, unit="m")[:, 0]
    near(np.delete(speed[:, 0], 20), np.ones(22))
    assert np.isnan(speed[20]).all()  # alone between two gaps
    inner = [k for k in range(1, 19) if k not in (9, 10)]
    near(speed[inner, 1], 2 * motion.times[inner])
    near(mcz.velocities(motion, frames=(9, 12), unit="m"), mcz.velocities(motion, unit="m")[9:12])
    found = mcz.accelerations(motion, unit="m")[:, 0]
    np.testing.assert_allclose(found[:20, 1], 2, atol=1e-6)
    assert np.isnan(found[20:]).all()
    near(mcz.accelerations(motion, frames=(9, 12)), mcz.accelerations(motion)[9:12])


def test_speeds_by_irregular_times_are_exact_for_parabolas() -> None:
    seconds = np.array([0.0, 0.011, 0.019, 0.031, 0.04])
    motion = markers(5, None).with_values(np.stack([seconds, seconds**2, 0 * seconds], axis=1))
    motion = replace(motion, signals=(*motion.signals, times_signal(seconds.tolist())))
    near(mcz.velocities(motion)[1:-1, 0, :2], np.stack([np.ones(3), 2 * seconds[1:-1]], axis=1))
    np.testing.assert_allclose(mcz.accelerations(motion)[:, 0, 1], 2, atol=1e-6)


def test_rounded_times_do_not_shake_speeds(tmp_path: Path) -> None:
    motion = trc(tmp_path / "w.trc", NUMBERS, digits=3)  # z moves 120 mm a second
    np.testing.assert_allclose(mcz.velocities(motion)[:, 0, 2], 120, rtol=1e-9)


@pytest.mark.parametrize("rate", [200, 100, 50, 30])
def test_resampling_keeps_gaps_and_times(rate: int) -> None:
    motion = moving(GAPPED)
    made = mcz.resample(motion, rate)
    assert np.isfinite(made.values).all()
    near(made.values[:, 0] / 1000, made.times)
    inside = [(1.0, 1.09), (2.99, 3.08), (3.99, 3.99), (4.99, 5.0)]
    wanted = [k for k in range(6 * rate) if any(a <= 1 + k / rate <= b for a, b in inside)]
    near(made.times, 1 + np.array(wanted) / rate)
    near(stored(made).times, made.times)
    if rate == 100:
        np.testing.assert_array_equal(made.values, motion.values)


def test_resampling_takes_irregular_times() -> None:
    seconds = np.array([0.5, 0.511, 0.519, 0.531, 0.54, 0.549])
    motion = markers(6, None).with_values(np.stack([seconds] * 3, axis=1))
    motion = replace(motion, signals=(*motion.signals, times_signal(seconds.tolist())))
    made = mcz.resample(motion, 200)
    near(made.times, 0.5 + np.arange(10) / 200)
    near(made.values[:, 0], made.times)


def test_resampling_keeps_the_time_of_the_first_frame() -> None:
    made = mcz.resample(moving(list(range(101, 151))), 37)
    near(made.times[0], 1.0)
    near(mcz.resample(markers(9, metadata={"start-time": "2.5"}), 33).times[0], 2.5)


def test_windows_do_not_span_gaps(tmp_path: Path) -> None:
    mcz.write(moving(GAPPED), tmp_path / "a.mcz")
    with mcz.open(tmp_path / "a.mcz") as file:
        data = mcz.dataset(file, "positions,velocities", window=5, stride=1, unit="m", dtype="f8")
        assert len(data) == 12
        assert [part.n_frames for part in data.skipped] == [1, 2]
        for k in range(12):
            window = data.window(k)
            near(data[k]["positions"][0, 0, 0], window.time)
            near(data[k]["positions"][:, 0, 0], file.only_clip().times[window.start : window.stop])
            near(data[k]["velocities"][:, 0, 0], np.ones(5))
        spanning = mcz.dataset(
            file, "velocities", window=5, stride=1, unit="m", dtype="f8", across_gaps=True
        )
        assert len(spanning) == 19
        speeds = np.concatenate([spanning[k]["velocities"][:, 0, 0] for k in range(16)])
        near(speeds, np.ones(80))
        resampled = mcz.dataset(file, "positions,velocities", window=9, rate=200, unit="m")
        assert len(resampled) == 4
        np.testing.assert_allclose(
            resampled[3]["positions"][:, 0, 0], 3.035 + np.arange(9) / 200, 1e-5
        )
        np.testing.assert_allclose(resampled[3]["velocities"][:, 0, 0], 1, 1e-4)
