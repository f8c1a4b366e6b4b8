"""Motions of every shape, and whatever is made of them: it works, or raises an MczError."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mcz
from tests.motions import POSITIONS, skeleton, smooth

SCALARS = tuple(mcz.Channel("", f"c{number}", "V") for number in range(4))


def set_samples_per_frame(motion: mcz.Motion, per_frame: int) -> mcz.Motion:
    values = np.repeat(motion.signals[0].values, per_frame, axis=0)
    return replace(motion, signals=(mcz.Signal(values, samples_per_frame=per_frame),))


def mask_all(motion: mcz.Motion) -> mcz.Motion:
    signal = motion.signals[0]
    nothing = np.zeros(signal.values.shape, bool)
    return replace(motion, signals=(replace(signal, mask=nothing),))


def odd_motion(bones: mcz.Skeleton, values: Any, **arguments: Any) -> mcz.Motion:
    return mcz.Motion(bones, (mcz.Signal(values, **arguments),), frame_rate=100, name="odd")


def shapes() -> dict[str, mcz.Motion]:
    plain = smooth(8)
    points = [mcz.Joint(f"m{n}", channels=POSITIONS, adds_to_offset=False) for n in range(3)]
    markers = odd_motion(mcz.Skeleton(tuple(points), unit_cm=0.1), np.arange(72.0).reshape(8, 9))
    scalars = mcz.Skeleton(tuple(mcz.Joint(c.name, channels=(c,)) for c in SCALARS))
    still = mcz.Skeleton((mcz.Joint("a"), mcz.Joint("b", 0, (0, 1, 0))))
    analog = mcz.Signal(
        np.zeros((24, 2), np.int64),
        name="analog",
        role="analog",
        samples_per_frame=3,
        channels=SCALARS[:2],
    )
    bones = plain.skeleton
    found = {
        "plain": plain,
        "two samples": set_samples_per_frame(plain, 2),
        "three samples of markers": set_samples_per_frame(markers, 3),
        "markers": markers,
        "no joints": odd_motion(mcz.Skeleton(()), np.zeros((8, 0))),
        "own channels": odd_motion(skeleton(), np.zeros((8, 4)), channels=SCALARS),
        "all masked": mask_all(plain),
        "all masked markers": mask_all(markers),
        "analog": replace(plain, signals=(plain.signals[0], analog)),
        "scalars": odd_motion(scalars, np.zeros((8, 4))),
        "two samples of scalars": set_samples_per_frame(odd_motion(scalars, np.zeros((8, 4))), 2),
        "no channels": odd_motion(still, np.zeros((8, 0))),
        "NaN": odd_motion(bones, np.full((8, 10), np.nan)),
        "huge": odd_motion(bones, np.full((8, 10), 1e308)),
        "integers": odd_motion(mcz.Skeleton(tuple(points[:1])), np.ones((8, 3), np.int64)),
        "no rate": replace(plain, frame_rate=None),
        "fast markers": replace(markers, frame_rate=Fraction(10) ** 300),
        "late": replace(plain, frame_numbers=2**52 - np.arange(8, 0, -1)),
        "early": replace(markers, frame_numbers=np.arange(8) - 2**52 + 1),
        "for ever": replace(plain, frame_numbers=np.r_[1 - 2**52, np.arange(6), 2**52 - 1]),
        "timed": replace(plain, first_time=-0.1),
        "half a character": replace(markers, name="\ud800"),
        "no units": replace(plain, skeleton=replace(bones, unit_cm=None, up_axis="")),
        "no angle unit": replace(plain, skeleton=replace(bones, angle_unit="")),
        "gaps": replace(plain, frame_numbers=np.array([1, 2, 3, 7, 8, 9, 20, 21])),
    }
    parts = {f"{name}, {n} frames": motion[:n] for name, motion in found.items() for n in (0, 1)}
    return found | parts


SHAPES = shapes()
PLOTTED = ["plain", "two samples", "no joints", "all masked", "NaN", "huge", "gaps"]  # it is slow
PLOTTED += ["plain, 0 frames", "plain, 1 frames", "huge, 1 frames"]


def write_clip(motion: mcz.Motion, folder: Path) -> Path:
    mcz.write(motion, folder / "a.mcz", force=True)
    return folder / "a.mcz"


def windows(motion: mcz.Motion, folder: Path, **arguments: Any) -> None:
    data = mcz.dataset(write_clip(motion, folder), **arguments)
    assert len(list(data)) == len(data)
    repr(data), data.shapes, data.names


def clip_arrays(motion: mcz.Motion, folder: Path) -> None:
    with mcz.open(write_clip(motion, folder)) as file:
        clip = file.only_clip()
        for name in ("positions", "rotations", "root", "velocities", "accelerations", "contacts"):
            try:
                getattr(clip, name)()
            except mcz.MczError:
                continue
        assert clip.values[:].shape == clip.read().shape
        clip._repr_html_()


USES: dict[str, Callable[[mcz.Motion, Path], Any]] = {
    "to_glb": lambda m, _: mcz.to_glb(m),
    "to_usda": lambda m, _: mcz.to_usda(m),
    "to_xarray": lambda m, _: mcz.to_xarray(m),
    "to_pandas": lambda m, _: mcz.to_pandas(m),
    "to_pandas of channels": lambda m, _: mcz.to_pandas(m, "channels"),
    "to_npz": lambda m, folder: mcz.to_npz(m, folder / "a.npz", force=True),
    "to_movement": lambda m, _: mcz.to_movement(m),
    "to_pybvh": lambda m, _: mcz.to_pybvh(m),
    "to_ezc3d": lambda m, _: mcz.to_ezc3d(m),
    "plot": lambda m, folder: mcz.plot(m, folder / "a.svg", force=True),
    "render": lambda m, folder: mcz.render(m, folder / "a.png", size=(64, 64), force=True),
    "positions": lambda m, _: mcz.positions(m),
    "rotations": lambda m, _: mcz.rotations(m),
    "root": lambda m, _: mcz.root(m),
    "velocities": lambda m, _: mcz.velocities(m),
    "accelerations": lambda m, _: mcz.accelerations(m),
    "resample": lambda m, _: mcz.resample(m, 30),
    "contacts": lambda m, _: mcz.contacts(m, [0]),
    "in_positions": lambda m, _: mcz.in_positions(m),
    "mirror": lambda m, _: mcz.mirror(m),
    "select": lambda m, _: mcz.select(m, ["hips"]),
    "compare": lambda m, _: mcz.compare(m, m),
    "retarget": lambda m, _: mcz.retarget(m, m.skeleton, {"hips": "hips"}),
    "a part": lambda m, _: m[2:5],
    "a notebook": lambda m, _: m._repr_html_(),
    "dataset": lambda m, folder: windows(m, folder, fields="channels,root,rot6d"),
    "windows": lambda m, folder: windows(m, folder, fields="positions,velocities", window=2),
    "resampled windows": lambda m, folder: windows(m, folder, fields="quat", rate=30, window=2),
    "a clip": clip_arrays,
    **{
        f"export {to}": lambda m, folder, to=to: mcz.export(
            write_clip(m, folder), folder / to, to=to, force=True
        )
        for to in ("bvh", "amc", "c3d", "trc", "mot", "sto", "csv", "npz", "glb", "usda")
    },
}


@pytest.mark.parametrize("use", USES)
def test_every_shape_works_or_is_refused(use: str, tmp_path: Path) -> None:
    for name, motion in SHAPES.items():
        if use == "plot" and name not in PLOTTED:
            continue
        try:
            USES[use](motion, tmp_path)
        except mcz.MczError as error:
            assert name != "plain", error
        except Exception as error:
            raise AssertionError(f"{use} of {name}: {error!r}") from error


@pytest.mark.parametrize("name", ["two samples", "three samples of markers"])
def test_several_samples_are_no_poses(name: str) -> None:
    for use in (mcz.positions, mcz.rotations, mcz.velocities, mcz.to_glb, mcz.to_usda):
        with pytest.raises(mcz.MotionError, match="one pose a frame is needed, but the signal has"):
            use(SHAPES[name])
    table = mcz.to_xarray(SHAPES[name])
    assert table["channels"].shape == SHAPES[name].signals[0].values.shape
    assert "positions" not in table


def test_tables_without_frames_have_their_columns() -> None:
    motion = smooth(5)
    for what in ("positions", "channels", "quat"):
        empty, full = mcz.to_pandas(motion[:0], what), mcz.to_pandas(motion, what)
        assert len(empty) == 0 and list(empty.columns) == list(full.columns)
    assert mcz.positions(motion[:0]).shape == (0, *mcz.positions(motion).shape[1:])
