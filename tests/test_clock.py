"""One clock: what a source says about time is the time of every frame, everywhere."""

from __future__ import annotations

import io
import json
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import mcz
from mcz import Channel, Joint, Motion, Signal, Skeleton
from mcz.files.tables import EVENT_EXPORTS
from mcz.model.clock import Timeline
from tests.clocked_files import motive, npz, sto, trc, vicon
from tests.commands import run
from tests.formats.c3d_files import Made
from tests.motions import write_bytes

MARKER = (Joint("a", channels=tuple(map(Channel, ("tx", "ty", "tz")))),)


def markers(n: int, rate: Fraction | int | None = 100, **facts: object) -> Motion:
    values = np.arange(n * 3.0).reshape(n, 3)
    skeleton = Skeleton(MARKER, unit_cm=0.1, angle_unit="")
    return Motion(skeleton, (Signal(values),), rate and Fraction(rate), **facts)  # type: ignore[arg-type]


def write_and_read(motion: Motion) -> Motion:
    with mcz.open(write_bytes(motion)) as file:
        clip = file.only_clip()
        np.testing.assert_array_equal(clip.times, clip.motion().times)
        return clip.motion()


def times_signal(values: list[float], unit: str = "s") -> Signal:
    return Signal(
        np.array(values)[:, None], name="time", role="times", channels=(Channel("", "time", unit),)
    )


def near(found: object, wanted: object) -> None:
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-9)  # type: ignore[call-overload]


def test_a_signal_of_times_comes_first() -> None:
    motion = markers(4, first_time=9.0)
    motion = replace(motion, signals=(*motion.signals, times_signal([500, 510, 700, 705], "ms")))
    near(motion.times, [0.5, 0.51, 0.7, 0.705])
    near(write_and_read(motion).times, motion.times)


def test_an_unknown_rate_is_an_error_that_says_what_to_do() -> None:
    with pytest.raises(mcz.OptionError, match="set the frame rate"):
        _ = markers(4, None).times
    with pytest.raises(mcz.OptionError, match="rate"):
        mcz.times(markers(4, None))


def test_samples_lie_evenly_from_each_frame_on() -> None:
    analog = Signal(
        np.zeros((8, 1)),
        name="analog",
        role="analog",
        samples_per_frame=4,
        channels=(Channel("", "f"),),
    )
    motion = markers(2, 50, frame_numbers=np.array([11, 13]))
    motion = replace(motion, signals=(*motion.signals, analog))
    wanted = [0.2, 0.205, 0.21, 0.215, 0.24, 0.245, 0.25, 0.255]
    near(mcz.times(motion, signal="analog"), wanted)
    near(mcz.times(motion, (1, 2), signal=1), wanted[4:])
    with pytest.raises(mcz.OptionError, match="analog"):
        mcz.times(motion, signal="forces")


def table(path: Path, numbers: list[int], rate: int = 120, digits: int = 3) -> Motion:
    path.write_bytes(trc(numbers, rate, digits, rate))
    return mcz.read(path)


NUMBERS = [*range(124, 140), *range(170, 180)]


@pytest.mark.parametrize("digits", [3, 4, 6])
def test_a_table_has_the_times_that_it_rounds(tmp_path: Path, digits: int) -> None:
    motion = table(tmp_path / "w.trc", NUMBERS, digits=digits)
    meant = (np.array(NUMBERS) - 1) / 120
    assert motion.frame_rate == 120 and motion.first_time is None
    near(motion.times, meant)
    near(write_and_read(motion).times, meant)
    line = motion.timeline
    assert line is not None and line.runs == [(0, 16), (16, 26)] and np.isnan(line.steps).any()
    near(np.diff(line.regular_times)[:15], np.full(15, 1 / 120))


def test_a_table_that_begins_late_has_a_first_time(tmp_path: Path) -> None:
    path = tmp_path / "w.trc"
    meant = 5 + np.array([0, 1, 2, 6, 7, 8]) / 120
    path.write_bytes(trc((1, 2, 3, 7, 8, 9), 120, times=meant))
    motion = mcz.read(path)
    assert motion.first_time == 5
    near(motion[3:].first_time, 5.05)
    for name, rate, factor in (("a", None, 1), ("b", 60, 2)):
        mcz.encode(path, tmp_path / f"{name}.mcz", rate=rate)
        mcz.extract(tmp_path / f"{name}.mcz", tmp_path / f"part-{name}.mcz", frames=(3, 5))
        with (
            mcz.open(tmp_path / f"{name}.mcz") as file,
            mcz.open(tmp_path / f"part-{name}.mcz") as part,
        ):
            clip = file.only_clip()
            assert clip.frame_numbers.tolist() == [1, 2, 3, 7, 8, 9]
            near(clip.times, factor * meant)
            near(clip.motion((3, 5)).times, factor * meant[3:5])
            near(part.only_clip().times, factor * meant[3:5])
            assert clip.source_bytes() == path.read_bytes()


def test_a_rate_that_is_set_moves_the_first_time() -> None:
    made = mcz.Motion(Skeleton(MARKER), markers(3).signals, Fraction(100), first_time=6.0)
    out, corrected = io.BytesIO(), io.BytesIO()
    mcz.write(made, out)
    mcz.set_rate(out.getvalue(), 300, output=corrected, names=["motion"], force=True)
    with mcz.open(corrected.getvalue()) as file:
        near(file.only_clip().times, [2, 2 + 1 / 300, 2 + 2 / 300])


def test_numbers_that_skip_while_times_do_not_have_a_signal(tmp_path: Path) -> None:
    (tmp_path / "w.trc").write_bytes(trc(range(1, 19, 2), 50, times=np.arange(9) / 50))
    motion = mcz.read(tmp_path / "w.trc")
    assert motion.frame_rate == 50 and motion.frame_numbers is not None
    assert [signal.role for signal in motion.signals[1:]] == ["times"]
    near(write_and_read(motion).times, np.arange(9) / 50)


@pytest.mark.parametrize("numbers", [[1, 1, 2, 3], [7] * 4, [9, 8, 7, 6], [5, 6, 1, 2]])
def test_numbers_that_do_not_ascend_come_back_with_their_source(
    tmp_path: Path, numbers: list[int]
) -> None:
    path = tmp_path / "w.trc"
    path.write_bytes(trc(numbers, 50, times=np.arange(4) / 50))
    mcz.encode(path, tmp_path / "w.mcz")
    with mcz.open(tmp_path / "w.mcz") as file:
        clip = file.only_clip()
        assert clip.source_bytes() == path.read_bytes()
        assert clip.frame_numbers.tolist() == list(range(numbers[0], numbers[0] + 4))
        near(clip.times, np.arange(4) / 50)
        part = clip.source_bytes((1, 3)).decode()
        assert [row.split("\t")[0] for row in part.splitlines()[6:]] == list(map(str, numbers[1:3]))


def test_the_clock_outlives_the_source(tmp_path: Path) -> None:
    motion = table(tmp_path / "w.trc", NUMBERS, digits=6)
    for made in (
        motion.without_source(),
        mcz.select(motion, ["RASI"]),
        mcz.rename(motion, {"RASI": "B"}),
        mcz.convert(motion, "c3d"),
        mcz.post_filter(motion),
        write_and_read(motion.without_source()),
    ):
        assert np.abs(made.times - motion.times).max() <= 1e-6
        assert made.frame_numbers is not None and made.frame_numbers.tolist() == NUMBERS


def test_a_decimated_clip_keeps_its_times(tmp_path: Path) -> None:
    table(tmp_path / "w.trc", list(range(125, 190)), digits=6)
    out = tmp_path / "w.mcz"
    mcz.encode(tmp_path / "w.trc", out, codec="dwt")
    with mcz.open(out) as file:
        clip = file.only_clip()
        thin = clip.motion((3, 60), 1, decimate=True)
        assert np.abs(thin.times - clip.times[3:60:2]).max() <= 1e-6
        assert np.abs(write_and_read(thin).times - clip.times[3:60:2]).max() <= 1e-6


def test_one_missing_frame_is_a_gap_however_few_digits_are_printed() -> None:
    times = np.array([0.0, 0.01, 0.02, 0.04, 0.05])
    line = Timeline(times, Fraction(100), rounding=0.005)
    near(line.regular_times, times)
    near(line.steps, [0.01, 0.01, np.nan, 0.01])
    coarse = np.round(np.arange(50) / 60, 2)
    near(Timeline(coarse, Fraction(60), rounding=0.005).steps, np.full(49, 1 / 60))


def accelerating_marker(numbers: list[int], rate: int = 100, **facts: object) -> Motion:
    """One marker that moves at 1 m/s along x and 2 (m/s)/s along y, in mm."""
    seconds = (np.array(numbers) - 1) / rate
    values = np.stack([1000 * seconds, 1000 * seconds**2, 0 * seconds], axis=1)
    motion = markers(len(numbers), rate, frame_numbers=np.array(numbers), **facts)
    return motion.with_values(values)


GAPPED = [*range(101, 111), *range(300, 310), 400, *range(500, 502)]


def test_speeds_take_times_and_no_step_over_a_gap() -> None:
    motion = accelerating_marker(GAPPED)
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
    motion = table(tmp_path / "w.trc", NUMBERS, digits=3)  # x moves 120 mm a second
    np.testing.assert_allclose(mcz.velocities(motion)[:, 0, 0], 120, rtol=1e-9)


@pytest.mark.parametrize("rate", [200, 100, 50, 30])
def test_resampling_keeps_gaps_and_times(rate: int) -> None:
    motion = accelerating_marker(GAPPED)
    made = mcz.resample(motion, rate)
    assert np.isfinite(made.values).all()
    near(made.values[:, 0] / 1000, made.times)
    inside = [(1.0, 1.09), (2.99, 3.08), (3.99, 3.99), (4.99, 5.0)]
    wanted = [k for k in range(6 * rate) if any(a <= 1 + k / rate <= b for a, b in inside)]
    near(made.times, 1 + np.array(wanted) / rate)
    near(write_and_read(made).times, made.times)
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
    made = mcz.resample(accelerating_marker(list(range(101, 151))), 37)
    near(made.times[0], 1.0)
    near(mcz.resample(markers(9, first_time=2.5), 33).times[0], 2.5)


def test_windows_do_not_span_gaps(tmp_path: Path) -> None:
    mcz.write(accelerating_marker(GAPPED), tmp_path / "a.mcz")
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


@pytest.mark.parametrize("rate", [None, 100])
@pytest.mark.parametrize("frames_a_second", [None, 50, 200])
def test_windows_go_by_irregular_times(
    tmp_path: Path, rate: int | None, frames_a_second: int | None
) -> None:
    seconds = 5 + np.cumsum(np.random.default_rng(3).uniform(0.008, 0.012, 40))
    seconds[20:] += 0.3
    motion = markers(40, rate and Fraction(rate)).with_values(np.stack([seconds] * 3, axis=1))
    motion = replace(motion, signals=(*motion.signals, times_signal(seconds.tolist())))
    mcz.write(motion, tmp_path / "a.mcz")
    for across in (False, True):
        with mcz.open(tmp_path / "a.mcz") as file:
            data = mcz.dataset(
                file,
                "positions,velocities",
                window=4,
                stride=3,
                dtype="f8",
                rate=frames_a_second,
                across_gaps=across,
            )
            times = [
                data.window(k).time + np.arange(4) / frames_a_second  # type: ignore[operator]
                if frames_a_second
                else file.only_clip().times[data.window(k).start : data.window(k).stop]
                for k in range(len(data))
            ]
            found = data[:]
        np.testing.assert_allclose(found["positions"][:, :, 0, 0], times, atol=1e-6)
        np.testing.assert_allclose(found["velocities"], 1, atol=1e-3)
        assert data.window(0).time == seconds[0]
        assert across or not ((np.diff(times) > 0.1).any())


def test_kept_windows_are_of_their_times(tmp_path: Path) -> None:
    for name, stretch in (("a", 1.0), ("b", 2.0)):
        motion = markers(9, None).with_values(np.arange(27.0).reshape(9, 3))
        times = (np.arange(9) ** 1.1 * stretch).tolist()
        motion = replace(motion, signals=(*motion.signals, times_signal(times)))
        mcz.write(motion, tmp_path / f"{name}.mcz")
    speeds = [
        mcz.dataset(tmp_path / f"{name}.mcz", "velocities", folder=tmp_path / "kept")[0]
        for name in "ab"
    ]
    near(speeds[0]["velocities"], speeds[1]["velocities"] * 2)


# What every source format says of time, and what every target makes of it.


@dataclass(frozen=True)
class Case:
    """A file with a first frame and a gap, as its format can; ``times`` are what it states."""

    name: str
    data: bytes
    times: list[float]
    events: tuple[float, ...] = ()
    samples: int = 0  # of the signal ``analog``, a frame
    rate: int | None = None  # that the file does not say


FIRST = [*range(124, 134), *range(160, 165)]  # frame numbers
STATED = [(number - 1) / 100 for number in FIRST]
FROM_0 = [number / 100 for number in FIRST]


def c3d_case() -> Case:
    made = Made(np.zeros((15, 1, 4), np.uint32), np.ones((15, 4, 1), np.uint32), first=124)
    seconds = made.real(1.30)[2]
    made.parameters["EVENT"] = {
        "USED": made.number(1),
        "TIMES": (4, (2, 1), made.real(0.0)[2] + seconds),
        "LABELS": made.texts([b"Foot Strike"]),
    }
    made.parameters["ANALOG"] = {"RATE": made.real(400.0)}
    times = [(123 + k) / 100 for k in range(15)]
    return Case("a.c3d", made.build(), times, (1.30,), 4)


def csv_case(unit: str, per_second: int) -> Case:
    digits = 2 if per_second == 1 else 0
    rows = "".join(f"{n},{(n - 1) / 100 * per_second:.{digits}f},{n}.5\n" for n in FIRST)
    return Case("a.csv", f"frame,time ({unit}),a\n{rows}".encode(), STATED)


def bvh_case() -> Case:
    head = (
        "HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\nCHANNELS 3 Xposition Yposition Zposition\n"
        "End Site\n{\nOFFSET 0 1 0\n}\n}\nMOTION\nFrames: 15\nFrame Time: 0.01\n"
    )
    data = head + "".join(f"{k}.0 0.0 0.0\n" for k in range(15))
    return Case("a.bvh", data.encode(), [k / 100 for k in range(15)])


def amc_case() -> Case:
    rows = "".join(f"{n}\nroot {n}.5 0 0 0 0 0\n" for n in FIRST)
    return Case("a.amc", f":FULLY-SPECIFIED\n:DEGREES\n{rows}".encode(), STATED, rate=100)


CASES = {
    "c3d": c3d_case(),
    "trc": Case("a.trc", trc(FIRST), STATED),
    "mot": Case("a.mot", sto(FIRST), STATED),
    "sto": Case("a.sto", sto(FIRST), STATED),
    "motive": Case("a.csv", motive(FIRST), FROM_0),
    "vicon": Case("a.csv", vicon(FIRST), STATED),
    "csv s": csv_case("s", 1),
    "csv ms": csv_case("ms", 1000),
    "csv us": csv_case("us", 10**6),
    "csv ns": csv_case("ns", 10**9),
    "npz": Case("a.npz", npz(FIRST), FROM_0),
    "bvh": bvh_case(),
    "amc": amc_case(),
}


def in_pandas(motion: Motion, folder: Path) -> object:
    return mcz.to_pandas(motion, "channels").index.to_numpy()


def in_xarray(motion: Motion, folder: Path) -> object:
    return mcz.to_xarray(motion).time.values


def in_npz(motion: Motion, folder: Path) -> object:
    mcz.to_npz(motion, folder / "out.npz")
    return np.load(folder / "out.npz")["times"]


def in_mcz(motion: Motion, folder: Path) -> object:
    return write_and_read(motion).times


def in_csv(motion: Motion, folder: Path) -> object:
    mcz.write(motion, folder / "out.mcz")
    mcz.export(folder / "out.mcz", folder / "out", "csv")
    (path,) = (folder / "out").iterdir()
    return mcz.to_pandas(mcz.read(path), "channels").index.to_numpy()


TARGETS = {"pandas": in_pandas, "xarray": in_xarray, "npz": in_npz, "mcz": in_mcz, "csv": in_csv}


def read_case(case: Case, folder: Path) -> Motion:
    path = folder / case.name
    path.write_bytes(case.data)
    return mcz.read(path, skeleton="none" if path.suffix == ".amc" else None, rate=case.rate)


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("source", CASES)
def test_every_target_has_the_times_of_every_source(
    tmp_path: Path, source: str, target: str
) -> None:
    case = CASES[source]
    motion = read_case(case, tmp_path)
    near(motion.times, case.times)
    assert motion.frame_rate == 100
    near(TARGETS[target](motion, tmp_path), case.times)


@pytest.mark.parametrize("source", CASES)
def test_every_source_keeps_its_times_in_a_file_and_in_parts(tmp_path: Path, source: str) -> None:
    case = CASES[source]
    motion = read_case(case, tmp_path)
    mcz.write(motion, tmp_path / "a.mcz")
    mcz.extract(tmp_path / "a.mcz", tmp_path / "b.mcz", frames=(3, 13))
    with mcz.open(tmp_path / "a.mcz") as file, mcz.open(tmp_path / "b.mcz") as part:
        clip, cut = file.only_clip(), part.only_clip()
        near(clip.times, case.times)
        for found in (cut, cut.motion(), motion[3:13], clip.motion((3, 13))):
            near(found.times, case.times[3:13])
        near(motion.without_source().times, case.times)
        near(clip.to_pandas("channels").index, case.times)
        if case.events:
            assert clip.recording is not None
            near([event.time for event in clip.recording.events], np.float32(case.events))
        if case.samples:
            wanted = np.add.outer(case.times, np.arange(case.samples) / (100 * case.samples))
            near(mcz.times(clip, signal="analog"), wanted.ravel())
            near(clip.to_pandas("analog").index, wanted.ravel())
            near(clip.to_xarray().time_analog, wanted.ravel())


def test_info_says_first_last_and_gaps(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    case = CASES["trc"]
    motion = read_case(case, tmp_path)
    mcz.write(motion, tmp_path / "a.mcz")
    for name in ("a.trc", "a.mcz"):
        assert run("info", tmp_path / name) == 0
        shown = capsys.readouterr().out
        assert "15 frames at 100 Hz (0.41 s)" in shown
        assert "time       1.23 s to 1.63 s, 1 gap" in shown
        assert run("info", "--json", tmp_path / name) == 0
        (clip,) = json.loads(capsys.readouterr().out)["clips"]
        assert clip["times"] == {"first": 1.23, "last": 1.63, "gaps": 1}


def test_a_signal_of_times_is_the_axis_of_xarray() -> None:
    motion = markers(3)
    other = Signal(np.zeros((3, 1)), name="frame", channels=(Channel("", "f"),))
    motion = replace(motion, signals=(*motion.signals, times_signal([1.0, 1.5, 1.7]), other))
    data = mcz.to_xarray(motion)
    near(data.time, [1, 1.5, 1.7])
    assert data.signal_frame.shape == (3, 1) and data.frame.values.tolist() == [1, 2, 3]


def test_a_foot_stands_in_each_part_by_itself() -> None:
    """It stands from 1.00 to 1.29 s and, elsewhere, from 3.00 to 3.29 s."""
    numbers = np.array([*range(101, 131), *range(301, 331)])
    values = np.zeros((60, 3))
    values[30:, 0] = 1000.0
    foot = (Joint("LeftFoot", channels=MARKER[0].channels),)
    skeleton = Skeleton(foot, unit_cm=0.1, angle_unit="", up_axis="y")
    motion = Motion(skeleton, (Signal(values),), Fraction(100), frame_numbers=numbers)
    found = mcz.contacts(motion)
    assert [(run.first, run.n_frames) for run in found.runs] == [(0, 30), (30, 30)]


def test_films_last_as_long_as_the_motion(tmp_path: Path) -> None:
    pytest.importorskip("PIL")
    pytest.importorskip("matplotlib")
    made = mcz.render(
        accelerating_marker(GAPPED), tmp_path / "a.gif", fps=10, size=(64, 64), unit="cm", up="y"
    )
    assert made.n_pictures == 41  # 4.0 s


def test_charts_of_signals_by_channel(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    motion = read_case(CASES["c3d"], tmp_path)
    (rows,) = mcz.plot(motion, tmp_path / "a.svg", signal="analog").tables
    label = rows[1][0]
    (again,) = mcz.plot(motion, tmp_path / "b.svg", channels=label).tables
    assert again[1] == rows[1]
    mcz.write(motion, tmp_path / "a.mcz")
    arguments = ["plot", str(tmp_path / "a.mcz"), "-o", str(tmp_path / "c.svg")]
    assert run(*arguments, "--signal", "analog", "--channel", label) == 0
    for options in (
        ["--signal", "forces"],
        ["--channel", "Fz9"],
        ["--signal", "0", "--joint", "a"],
    ):
        assert run(*arguments, "--force", *options) == 2
    with pytest.raises(mcz.OptionError, match="shows all joints, so 'analog' cannot be chosen"):
        mcz.plot(motion, tmp_path / "d.svg", "rate-distortion", signal="analog")


def test_charts_without_a_joint_are_of_the_first_signal(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    channels = tuple(Channel("", f"f{k}", "N") for k in range(12))
    analog = Signal(
        np.zeros((60, 12)), name="analog", role="analog", samples_per_frame=2, channels=channels
    )
    motion = Motion(Skeleton(()), (Signal(np.zeros((30, 0))), analog), Fraction(50))
    plotted = mcz.plot(motion, tmp_path / "a.svg")
    assert plotted.title.endswith("analog, channels") and len(plotted.tables[0]) == 9
    assert plotted.notes == ("8 of 12 channels; choose channels by name (channels=)",)


WALK = [*range(51, 91), *range(131, 171)]


def walk(samples: Path, numbers: list[int]) -> Motion:
    motion = mcz.read(samples / "walk.bvh", unit="cm", up="y")
    signals = (motion.signals[0].cut(0, len(numbers)),)
    return replace(motion, signals=signals, source=None, frame_numbers=np.array(numbers))


def made_of(motion: Motion) -> dict[str, Motion]:
    names = list(motion.skeleton.joint_names)
    return {
        "select": mcz.select(motion, names[:1]),
        "rename": mcz.rename(motion, {names[-1]: "last"}),
        "mirror": mcz.mirror(motion),
        "with_offsets": mcz.with_offsets(motion, motion.skeleton.offsets * 2),
        "retarget": mcz.retarget(motion, motion.skeleton),
        "in_positions": mcz.in_positions(motion),
        "amc": mcz.convert(motion, "amc"),
        "trc": mcz.convert(motion, "trc"),
        "sto": mcz.convert(motion, "sto"),
        "cut": motion[0 : motion.n_frames],
    }


@pytest.mark.parametrize("start", [None, 12.345])
def test_whatever_is_made_of_a_motion_keeps_its_times(samples: Path, start: float | None) -> None:
    motion = replace(walk(samples, WALK), first_time=start)
    for name, made in made_of(motion).items():
        near(made.times, motion.times)
        near(write_and_read(made).times, motion.times)
        assert made.frame_rate == motion.frame_rate, name


@given(
    st.integers(-(10**6), 10**6),
    st.lists(st.sampled_from([1, 1, 1, 2, 7, 500]), max_size=12),
    st.sampled_from([Fraction(100), Fraction(60000, 1001), Fraction(1, 3), Fraction(24)]),
    st.sampled_from([None, 0.0, -2.5, 1234.56789]),
    st.integers(1, 3),
)
def test_times_outlive_parts_files_and_steps(
    first: int, steps: list[int], rate: Fraction, start: float | None, each: int
) -> None:
    numbers = np.cumsum([first, *(step * each for step in steps)])
    motion = markers(
        len(numbers),
        rate,  # type: ignore[arg-type]
        frame_numbers=numbers,
        number_step=each,
        first_time=start,
    )
    since = (numbers - numbers[0]) / float(rate * each)
    wanted = since + ((first - 1) / float(rate * each) if start is None else start)
    exact = {"rtol": 1e-12, "atol": 1e-9}
    np.testing.assert_allclose(motion.times, wanted, **exact)  # type: ignore[arg-type]
    for stop in (1, len(numbers)):
        part = motion[stop // 2 : stop]
        np.testing.assert_allclose(part.times, wanted[stop // 2 : stop], **exact)  # type: ignore[arg-type]
        np.testing.assert_allclose(write_and_read(part).times, wanted[stop // 2 : stop], **exact)  # type: ignore[arg-type]
        np.testing.assert_allclose(write_and_read(part.without_source()).times, part.times, **exact)  # type: ignore[arg-type]


@given(st.lists(st.floats(0, 10, allow_subnormal=False), min_size=1, max_size=8))
def test_any_rising_times_outlive_their_signal(times: list[float]) -> None:
    times = sorted(times)
    for rate in (None, Fraction(30)):
        motion = markers(len(times), rate)  # type: ignore[arg-type]
        kept = motion.at_times(Timeline(np.array(times), rate))
        near(kept.times, times)
        near(write_and_read(kept).times, times)


@pytest.mark.parametrize("rate", [Fraction(10) ** 300, Fraction(1, 10**300)])
def test_absurd_rates_and_times_are_answered(rate: Fraction) -> None:
    motion = markers(3, rate)
    assert mcz.velocities(motion).shape == (3, 1, 3)
    with pytest.raises(mcz.MczError, match="frame rate"):
        mcz.to_npz(motion, io.BytesIO())
    if rate < 1:
        with pytest.raises(mcz.OptionError, match="too many"):
            mcz.resample(motion, 50)


def test_a_rate_that_is_told_makes_gaps_of_frame_numbers(tmp_path: Path) -> None:
    motion = replace(accelerating_marker(GAPPED), frame_rate=None)
    mcz.write(motion, tmp_path / "a.mcz")
    fields = {"fields": "velocities", "window": 5, "stride": 1, "unit": "m", "dtype": "f8"}
    data = mcz.dataset(tmp_path / "a.mcz", source_rate=100, **fields)  # type: ignore[arg-type]
    assert len(data) == 12
    near(data[np.arange(12)]["velocities"][:, :, 0, 0], np.ones((12, 5)))
    near(data.window(6).time, 2.99)


def test_texts_of_events_are_no_formulas() -> None:
    events = [mcz.Event("=1+1", 0.5, "Left"), mcz.Event("\x1b[2J", 1.5)]
    rows = EVENT_EXPORTS["csv"](events).decode().splitlines()
    assert rows[1] == "0.5,'=1+1,Left,," and rows[2].startswith("1.5,\\x1b[2J")
    with np.load(io.BytesIO(EVENT_EXPORTS["npz"]([]))) as arrays:
        assert arrays["times"].shape == arrays["label"].shape == (0,)
