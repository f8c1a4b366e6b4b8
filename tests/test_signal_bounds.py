"""Bounds of signals beside the motion: kept exactly, measured, stored, restored."""

from __future__ import annotations

import io
import math
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mcz
from mcz.model.numbers import Grid, GridKind
from mcz.sources.c3d import c3d
from tests.amounts import some
from tests.formats.c3d_files import DEC, INTEL, SGI, Made, make_c3d, real, word
from tests.motions import smooth

Rng = np.random.Generator

GRIDS: dict[str, Grid] = {
    "binary64": Grid(GridKind.BINARY64),
    "binary32": Grid(GridKind.BINARY32),
    "vax": Grid(GridKind.VAX_F),
    "integer": Grid(GridKind.INTEGER),
    "scaled": Grid(GridKind.SCALED, scale=0.37),
    "fixed": Grid(GridKind.FIXED, 6),
    "trimmed": Grid(GridKind.TRIMMED, 4),
    "general": Grid(GridKind.GENERAL, 9),
    "text": Grid(GridKind.TEXT64),
}
COURSES: dict[str, Callable[[Rng, int], np.ndarray]] = {
    "noise": lambda rng, n: rng.normal(size=n),
    "walk": lambda rng, n: rng.normal(size=n).cumsum(),
    "steps": lambda rng, n: rng.integers(-3, 4, n) * 0.61,
    "constant": lambda rng, n: np.full(n, rng.normal()),
    "outlier": lambda rng, n: np.where(rng.random(n) < 0.02, 1e30, rng.normal(size=n)),
    "exponents": lambda rng, n: rng.normal(size=n) * 10.0 ** rng.integers(-30, 30, n),
}


def beside(*signals: mcz.Signal, n_frames: int = 16) -> mcz.Motion:
    motion = smooth(n_frames)
    return replace(motion, signals=(*motion.signals, *signals))


def record_of(motion: mcz.Motion, **params: Any) -> tuple[mcz.Motion, dict[str, str]]:
    """The motion that a file holds, which is sound by every check, and its quality record."""
    target = io.BytesIO()
    written = mcz.write(motion, target, "lossy", step=1.0, levels=1, **params)
    assert mcz.verify(target.getvalue()) == []
    with mcz.open(target.getvalue()) as file:
        clip = file.only_clip()
        assert clip.quality is not None and clip.quality == written.clips[0].quality
        return clip.motion(), dict(clip.quality)


def finite_errors(given: np.ndarray, found: np.ndarray) -> np.ndarray:
    finite = np.isfinite(given)
    assert np.array_equal(given[~finite], found[~finite], equal_nan=True)
    return np.abs(given[finite] - found[finite])


def greatest_error(given: np.ndarray, found: np.ndarray) -> Fraction:
    """The greatest distance of finite numbers, without any rounding."""
    errors = finite_errors(given, found)
    near = np.isfinite(given)
    near[near] = errors >= errors.max() * (1 - 1e-12)
    pairs = zip(given[near].tolist(), found[near].tolist(), strict=True)
    return max(abs(Fraction(a) - Fraction(b)) for a, b in dict.fromkeys(pairs))


def random_column(rng: Rng, grid: Grid, n: int) -> np.ndarray:
    course = COURSES[str(rng.choice(list(COURSES)))]
    values = course(rng, n) * 10.0 ** rng.integers(-3, 6)
    if grid.kind in (GridKind.BINARY32, GridKind.BINARY64, GridKind.VAX_F):
        values = np.clip(values, -1e36, 1e36)
        with np.errstate(under="ignore"):
            values = grid.values(grid.ordinals(values)[0])
        if grid.kind != GridKind.VAX_F and rng.random() < 0.3:
            values[rng.integers(0, n, 3)] = [np.nan, np.inf, -np.inf]
        return values
    values = grid.values(grid.ordinals(values)[0])
    if grid.is_text and rng.random() < 0.3:  # tokens that a source spells in its own way
        values[rng.integers(0, n, 3)] = [np.nan, np.inf, 1 / 3]
    return values


@pytest.mark.parametrize("first", some(range(0, 300, 50), 3))
def test_no_bound_is_exceeded(first: int) -> None:
    for seed in range(first, first + 50):
        rng = np.random.default_rng(seed)
        names = rng.choice(list(GRIDS), 4)
        if not (set(names) - {"integer"}):
            names[0] = "binary32"
        grids = tuple(GRIDS[name] for name in names)
        values = np.stack([random_column(rng, grid, 256) for grid in grids], axis=1)
        mask = rng.random(values.shape) < 0.9 if rng.random() < 0.3 else None
        channels = tuple(mcz.Channel("", name, "N") for name in names)
        signal = mcz.Signal(values, grids, "forces", 16, mask, channels=channels)
        spread = float(np.nanmedian(np.abs(values))) or 1.0
        bounds = {
            error: spread * 10.0 ** rng.uniform(-5, 0.5)
            for error in ("max_error", "mean_error")
            if rng.random() < 0.7
        }
        found, record = record_of(
            beside(signal), **{f"forces.{error}": bound for error, bound in bounds.items()}
        )
        decoded = found.signals[1].values
        for column in range(len(grids)):
            most = greatest_error(values[:, column], decoded[:, column])
            assert most <= Fraction(bounds.get("max_error", 1e300)), (seed, names[column])
            known = np.isfinite(signal.masked()[:, column])
            own = finite_errors(values[known, column], decoded[known, column])
            mean = math.fsum(own) / max(1, len(own))
            assert mean <= bounds.get("mean_error", 1e300), (seed, names[column])
        if bounds:
            with np.errstate(invalid="ignore"):
                off = np.abs(signal.masked() - decoded)
            off = off[np.isfinite(off)]
            assert float(record["signal.forces.max_error"]) == off.max()
            assert float(record["signal.forces.mean_error"]) == pytest.approx(off.mean())


@pytest.mark.parametrize("name", ["binary64", "binary32", "vax", "fixed"])
def test_bytes_fall_by_what_the_bound_leaves_out(name: str) -> None:
    rng = np.random.default_rng(1)
    values = GRIDS[name].values(GRIDS[name].ordinals(rng.normal(size=(4096, 1)) * 100)[0])
    signal = mcz.Signal(values, (GRIDS[name],), "emg", 256, channels=volts())
    sizes = []
    for bound in (0.0, 0.05, 0.5, 5.0):
        target = io.BytesIO()
        params = {"emg.max_error": bound}
        mcz.write(beside(signal), target, "lossy", step=1.0, levels=1, **params)
        sizes.append(len(target.getvalue()))
    saved = -8 * np.diff(sizes) / 4096  # bits a number for a tenth of the error
    assert (saved > 3.0).all() and (saved[1:] < 3.7).all()


def chain_of(*kinds: str, angle_unit: str = "rad") -> mcz.Skeleton:
    joints = (
        mcz.Joint(
            f"j{j}",
            j - 1,
            (0.0, 0.0, 20.0 * (j > 0)),
            channels=tuple(mcz.Channel(k, "" if k else f"q{i}") for i, k in enumerate(kinds)),
        )
        for j in range(3)
    )
    return mcz.Skeleton(tuple(joints), unit_cm=1.0, angle_unit=angle_unit)


SKELETONS = {
    "plain": chain_of("", "", ""),
    "angles": chain_of("rz", "rx", "ry", angle_unit="deg"),
    "quaternions": chain_of("qw", "qx", "qy", "qz"),
    "vectors": chain_of("vx", "vy", "vz"),
    "positions": chain_of("tx", "ty", "tz"),
}


def smooth_courses(rng: Rng, name: str, n: int) -> np.ndarray:
    """Smooth courses of 3 joints, (n, channels), with a little noise."""
    skeleton = SKELETONS[name]
    phases = np.arange(n)[:, None] * rng.uniform(0.02, 0.1, skeleton.n_channels)
    courses = np.sin(phases + rng.uniform(0, 6, skeleton.n_channels))
    courses += rng.normal(size=courses.shape) * 10.0 ** rng.uniform(-5, -2)
    if name == "quaternions":
        parts = courses.reshape(n, 3, 4) + np.array([1.5, 0, 0, 0])
        return (parts / np.linalg.norm(parts, axis=2, keepdims=True)).reshape(n, 12)
    return courses * {"angles": 60.0, "positions": 30.0}.get(name, 1.0)


@pytest.mark.parametrize("name", SKELETONS)
@pytest.mark.parametrize("target", ["max_error", "mean_error"])
def test_channels_of_the_motion_keep_a_bound(name: str, target: str) -> None:
    skeleton = SKELETONS[name]
    for seed in range(10):
        rng = np.random.default_rng(seed)
        values = smooth_courses(rng, name, 100)
        bound = float(values.std() * 10.0 ** rng.uniform(-3.5, -1))
        motion = mcz.Motion(skeleton, (mcz.Signal(values),), Fraction(60), name="moving")
        stream = io.BytesIO()
        mcz.write(motion, stream, "lossy", **{target: bound})
        with mcz.open(stream.getvalue()) as file:
            clip = file.only_clip()
            errors = np.abs(clip.motion().values - values)
            assert clip.quality is not None and clip.quality[f"param.{target}"] == str(bound)
            reached = float(clip.quality["target_reached"])
        measured = errors.max() if target == "max_error" else errors.mean(axis=0).max()
        assert measured <= bound and measured == pytest.approx(reached)
        assert measured > bound / 10


def test_a_bound_of_channels_has_units() -> None:
    motion = mcz.Motion(
        chain_of("tx", "rz", angle_unit="deg"),
        (mcz.Signal(np.cumsum(np.random.default_rng(0).normal(size=(60, 6)), axis=0)),),
        Fraction(60),
    )
    found = io.BytesIO()
    mcz.write(motion, found, "lossy", max_error="0.2deg,0.5mm")
    with mcz.open(found.getvalue()) as file:
        errors = np.abs(file.only_clip().motion().values - motion.values).max(axis=0)
    assert (errors <= [0.05, 0.2] * 3).all()
    for text, message in (
        ("1mm", "channel rz is in deg"),
        ("0", "but a lossy codec needs a bound above 0"),
    ):
        with pytest.raises(mcz.OptionError, match=message):
            mcz.write(motion, io.BytesIO(), "lossy", max_error=text)
    mcz.write(motion, io.BytesIO(), "mrdwt", mean_error=0.5)  # other codecs search their dial


def volts(unit: str = "V") -> tuple[mcz.Channel, ...]:
    return (mcz.Channel("", "biceps", unit),)


def emg(unit: str = "V", role: str = "", name: str = "emg") -> mcz.Signal:
    values = np.sort(np.random.default_rng(2).normal(size=(16, 1)), axis=0)
    return mcz.Signal(values, name=name, channels=volts(unit), role=role)


@pytest.mark.parametrize(
    ("unit", "text", "bound"),
    [
        ("V", "0.5mV", 0.0005),
        ("mV", "0.5 mV", 0.5),
        ("uV", "1e-1mV", 100.0),
        ("N.mm", "0.2Nm", 200.0),
        ("deg", "0.01rad", np.degrees(0.01)),
        ("weird", "3weird", 3.0),
        ("", "0.25", 0.25),
        ("V", "1N,0.25V", 0.25),
    ],
)
def test_bounds_have_units(unit: str, text: str, bound: float) -> None:
    motion = beside(emg(unit))
    found, record = record_of(motion, **{"emg.max_error": text})
    error = np.abs(found.signals[1].values - motion.signals[1].values).max()
    assert 0 <= error <= bound * (1 + 1e-15) and record["param.emg.max_error"] == text


@pytest.mark.parametrize(
    ("params", "message"),
    [
        (
            {"emg.max_error": "1N"},
            "in V, which 1N does not fit; add a bound for it, such as 1N,5",
        ),
        ({"emg.max_error": "-1"}, "write a number and optionally a unit, such as 0.5mV"),
        ({"emg.max_error": "much"}, "write a number and optionally a unit, such as 0.5mV"),
        ({"emg.mean_error": "1.2.3V"}, "write a number and optionally a unit, such as 0.5mV"),
        (
            {"analog.max_error": 1},
            r"no signal besides the motion is called 'analog'; there are \['emg'\]",
        ),
        ({"emg.most_error": 1}, "no parameter 'emg.most_error'"),
    ],
)
def test_what_makes_no_sense_is_refused(params: dict[str, Any], message: str) -> None:
    with pytest.raises(mcz.OptionError, match=message):
        record_of(beside(emg()), **params)


def test_a_lossless_codec_takes_no_bound() -> None:
    with pytest.raises(mcz.OptionError, match="codec fast is lossless; choose a lossy codec"):
        mcz.write(beside(emg()), io.BytesIO(), "fast", **{"emg.max_error": 1})


def test_times_and_residuals_stay_exact() -> None:
    times = mcz.Signal(np.arange(16.0)[:, None], name="t", channels=volts("s"), role="times")
    with pytest.raises(mcz.OptionError, match="'times' must stay exact: they order the frames"):
        record_of(beside(times), **{"times.max_error": 1})


def test_the_motion_may_stay_exact() -> None:
    motion = beside(emg())
    found, record = record_of(motion, lossless="all", **{"emg.max_error": 0.3})
    assert np.array_equal(found.signals[0].values, motion.signals[0].values)
    assert 0 < float(record["signal.emg.max_error"]) <= 0.3


def test_a_clip_may_have_no_motion() -> None:
    motion = mcz.Motion(mcz.Skeleton(()), (mcz.Signal(np.empty((16, 0))), emg("mV")), Fraction(100))
    stream = io.BytesIO()
    mcz.write(motion, stream, "lossy", **{"emg.mean_error": "50uV"})
    with mcz.open(stream.getvalue()) as file:
        errors = np.abs(file.only_clip().motion().signals[1].values - motion.signals[1].values)
    assert 0 < errors.mean() <= 0.05


def test_what_is_coarser_than_the_bound_stays() -> None:
    values = np.random.default_rng(3).integers(-50, 50, (4096, 1)) * 0.5
    signal = mcz.Signal(values, (Grid(GridKind.BINARY32),), "emg", 256, channels=volts())
    found, record = record_of(beside(signal), **{"emg.max_error": 0.2})
    assert np.array_equal(found.signals[1].values, values)
    assert record["signal.emg.max_error"] == "0.0"


def read_c3d(processor: int, size: int) -> mcz.Motion:
    """A C3D file with analog channels in N, Nmm and V."""

    def reals(*values: float) -> tuple[int, tuple[int, ...], bytes]:
        return 4, (len(values),), b"".join(real(value, processor) for value in values)

    file: Made = make_c3d(64, 2, 3, 8, processor=processor, size=size)
    offsets = b"".join(word(value, processor) for value in (100, -5, 0))
    file.parameters.setdefault("ANALOG", {}).update(
        SCALE=reals(0.25, -2.0, 0.001),
        OFFSET=(2, (3,), offsets),
        GEN_SCALE=(4, (), real(0.5, processor)),
        UNITS=file.texts([b"N", b"Nmm", b"mV"]),
    )
    return c3d.read(file.build(), "clip")


@pytest.mark.parametrize("processor", [INTEL, DEC, SGI])
@pytest.mark.parametrize("size", [2, 4])
def test_a_restored_file_keeps_the_bound(processor: int, size: int, tmp_path: Path) -> None:
    motion = read_c3d(processor, size)
    motion = replace(motion, skeleton=replace(motion.skeleton, unit_cm=0.1))
    path = tmp_path / "clip.mcz"
    params = {"analog.max_error": "5N,60Nmm,0.01mV"}
    mcz.write(motion, path, "lossy", step=1.0, levels=0, force=True, **params)
    assert mcz.verify(path) == []
    with mcz.open(path) as file:
        clip = file.only_clip()
        assert not clip.can_restore()
        decoded, restored = clip.motion(), c3d.read(clip.source_bytes(), "clip")
    for found in (decoded, restored):
        signals = {signal.role: signal for signal in (*motion.signals, *found.signals)}
        given = next(signal for signal in motion.signals if signal.role == "analog")
        errors = np.abs(given.values - signals["analog"].values)
        assert (errors.max(axis=0) <= [5, 60, 0.01]).all() and errors.max() > 0
        assert signals["analog"].grids == given.grids


def test_a_text_loses_decimals(tmp_path: Path) -> None:
    rng, n = np.random.default_rng(4), 40
    forces, gaps = rng.normal(size=2 * n).cumsum(), {7, 33}
    lines = ["Devices", "200", ",,Plate", "Frame,Sub Frame,Fx", ",,N"]
    cells = ["" if row in gaps else f"{force:.6f}" for row, force in enumerate(forces)]
    lines += [f"{1 + row // 2},{row % 2},{cell}" for row, cell in enumerate(cells)]
    lines += ["", "Trajectories", "100", ",,Head,,", "Frame,Sub Frame,X,Y,Z", ",,mm,mm,mm"]
    lines += [f"{1 + k},0,{k}.25,{k % 7}.5,{k}.125" for k in range(n)]
    source, target = tmp_path / "take.csv", tmp_path / "take.mcz"
    source.write_text("\r\n".join(lines) + "\r\n", "utf-8")
    role = next(s.role or s.name for s in mcz.read(source).signals[1:])
    mcz.encode(source, target, codec="lossy", params={"step": 0.1, f"{role}.max_error": "0.02N"})
    assert mcz.verify(target) == []
    with mcz.open(target) as file:
        text = file.only_clip().source_bytes().decode("utf-8")
    found = [line.split(",")[2] for line in text.split("\r\n")[5 : 5 + 2 * n]]
    assert [row for row, cell in enumerate(found) if not cell] == sorted(gaps)
    known = [row for row in range(2 * n) if row not in gaps]
    errors = [abs(Fraction(found[row]) - Fraction(cells[row])) for row in known]
    assert 0 < max(errors) <= Fraction("0.02")
    assert max(len(found[row].partition(".")[2]) for row in known) == 2
