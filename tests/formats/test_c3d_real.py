"""The real C3D files of the folder that MCZ_DATA names: values against others, the whole path."""

from __future__ import annotations

import contextlib
import functools
import io
import os
import struct
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import mcz
from mcz import Motion
from mcz.sources.c3d import c3d
from mcz.sources.c3d.layout import parse_layout
from tests.amounts import some
from tests.formats.c3d_files import DEC, SGI, real_of

DATA = Path(os.environ.get("MCZ_DATA", "no-data"))
pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif("MCZ_DATA" not in os.environ, reason="MCZ_DATA is not set"),
]
# Read by neither ezc3d nor c3d, or not rightly; compared with a reading by the header alone.
HEADER_ONLY = {
    "MACsample.c3d": "ezc3d: no SGI; c3d: two scales",
    "mocap36.c3d": "parameters out of form",
    "badParameterOffset.c3d": "parameters out of form",
    "bad_parameter_section.c3d": "parameters out of form",
    "kyowadengyo.c3d": "POINT:USED is wrong, and ezc3d goes by it",
}
SLOW = {"BKINtechnologies.c3d"}  # ezc3d takes half a minute for its parameters, c3d no second

# Channels of which ezc3d takes the magnitude of ANALOG:OFFSET, a word that has no sign there.
MAGNITUDES = {"shd01.c3d": 3, "128analogchannels.c3d": 18}

Arrays = tuple[NDArray[np.float64], NDArray[np.bool_], NDArray[np.float64] | None]


def files() -> list[Path]:
    paths = sorted(p for p in DATA.rglob("*") if p.suffix.lower() == ".c3d")
    return [path for path in paths if path.name not in ("empty.c3d", "zero-filled.c3d")]


@functools.lru_cache(maxsize=1)
def by_ezc3d(path: Path) -> Any:
    return pytest.importorskip("ezc3d").c3d(str(path))


def ezc3d_arrays(path: Path) -> Arrays:
    """Points, validity and analog in physical units, by ezc3d."""
    found = by_ezc3d(path)
    points = np.moveaxis(found["data"]["points"][:3], (0, 1, 2), (2, 1, 0))
    return points, ~np.isnan(points).any(axis=2), found["data"]["analogs"][0].T


def c3d_arrays(path: Path) -> Arrays:
    """Points and validity by c3d, and no analog."""
    reader = pytest.importorskip("c3d")
    with warnings.catch_warnings(), path.open("rb") as stream:
        warnings.simplefilter("ignore")
        with contextlib.redirect_stdout(io.StringIO()):
            frames = [p for _, p, _ in reader.Reader(stream).read_frames(copy=True)]
    points = np.array(frames, np.float64)
    return points[:, :, :3], points[:, :, 3] >= 0, None


def header_arrays(path: Path) -> Arrays:
    """Points and validity by the header alone."""
    data = path.read_bytes()
    processor = data[512 * (data[0] - 1) + 3]
    prefix = ">" if processor == SGI else "<"
    n_points, n_analog, first, last = struct.unpack_from(f"{prefix}4H", data, 2)
    (block,) = struct.unpack_from(f"{prefix}H", data, 16)
    n_frames, n_words = last - first + 1, 4 * n_points + n_analog
    integers = real_of(data[12:16], processor) > 0
    kind = "i2" if integers else "f4"
    assert integers or processor != DEC
    words = np.frombuffer(data, f"{prefix}{kind}", n_frames * n_words, 512 * (block - 1))
    frames = words.reshape(n_frames, n_words)[:, : 4 * n_points].astype(np.float64)
    points = frames.reshape(n_frames, n_points, 4)
    return points[:, :, :3], points[:, :, 3] >= 0, None


def in_file_order(motion: Motion) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Points and outputs as the file has them, and which are valid."""
    assert motion.source is not None
    source = motion.source
    split = parse_layout(source.format, source.template, source.detail).split
    shape = motion.n_frames, len(split.order)
    values, valid = np.empty((*shape, 3)), np.ones(shape, np.bool_)
    named = [motion.signals[0], *(s for s in motion.signals[1:] if s.name == "outputs")]
    for signal, points in zip(named, (split.points, split.outputs), strict=False):
        values[:, points] = signal.values.reshape(motion.n_frames, len(points), 3)
        if signal.mask is not None:
            valid[:, points] = signal.mask[:, ::3]
    return values, valid


def test_values_are_what_others_read() -> None:
    counts = {"ezc3d": 0, "c3d": 0, "header": 0}
    for path in files():
        motion = c3d.read(path.read_bytes(), path.stem)
        signal = motion.signals[0]
        values, valid = in_file_order(motion)
        shape = valid.shape
        how, points, theirs, analog = _oracle(path, shape)
        counts[how] += 1
        if how == "header" and signal.grids[0].scale != 1.0:
            points = points * signal.grids[0].scale
        assert np.array_equal(theirs, valid), path
        both = valid & theirs
        assert np.allclose(values[both], points[both], rtol=1e-6, atol=0), path
        if how == "ezc3d":
            assert np.array_equal(values[both], points[both]), path
        if analog is not None and analog.size:
            found = next(s for s in motion.signals if s.name == "analog").values
            differ = ~((found == analog) | (np.isnan(found) & np.isnan(analog))).all(axis=0)
            assert differ.sum() == MAGNITUDES.get(path.name, 0), path
    print(counts)
    assert counts["ezc3d"] > 60


def test_offsets_without_a_sign_are_those_of_c3d() -> None:
    """The files in which ezc3d has another offset: c3d has ours."""
    for name in MAGNITUDES:
        path = next(p for p in files() if p.name == name)
        motion = c3d.read(path.read_bytes(), path.stem)
        analog = next(s for s in motion.signals if s.name == "analog")
        reader = pytest.importorskip("c3d")
        with warnings.catch_warnings(), path.open("rb") as stream:
            warnings.simplefilter("ignore")
            general, scales, offsets = reader.Reader(stream).get_analog_transform_parameters()
        assert analog.scaling is not None
        assert np.array_equal(analog.scaling.offsets, offsets)
        assert np.array_equal(analog.scaling.scales, scales) and general == analog.scaling.general


def test_events_platforms_and_axes_are_what_ezc3d_reads() -> None:
    counts = {"events": 0, "platforms": 0, "up": 0}
    for path in files():
        if path.name in HEADER_ONLY or path.name in SLOW:
            continue
        try:
            parameters = by_ezc3d(path)["parameters"]
        except (OSError, RuntimeError, ValueError):
            continue
        motion = c3d.read(path.read_bytes(), path.stem)
        found = mcz.recording(motion)
        assert found is not None
        counts["events"] += _same_events(found, parameters.get("EVENT", {}))
        counts["platforms"] += _same_platforms(found, parameters.get("FORCE_PLATFORM", {}))
        stated = parameters["POINT"].get("Y_SCREEN", {"value": [""]})["value"]
        signed = {"+X": "x", "+Y": "y", "+Z": "z", "-X": "-x", "-Y": "-y", "-Z": "-z"}
        up = signed.get(stated[0] if stated else "", "")
        assert motion.skeleton.up_axis == up, path
        counts["up"] += bool(up)
    print(counts)
    assert counts["events"] >= 9 and counts["platforms"] >= 50 and counts["up"] >= 42


def _same_events(found: mcz.Recording, stated: Any) -> bool:
    n_events = int(stated["USED"]["value"][0]) if "USED" in stated else 0
    if not n_events or "TIMES" not in stated:
        return False
    minutes, seconds = np.array(stated["TIMES"]["value"]).reshape(2, -1)[:, :n_events]
    assert [event.time for event in found.events] == (60 * minutes + seconds).tolist()
    for name, key in (("label", "LABELS"), ("context", "CONTEXTS"), ("subject", "SUBJECTS")):
        if key in stated:
            texts = [text.strip() for text in stated[key]["value"][:n_events]]
            assert [getattr(event, name) for event in found.events] == texts
    return True


def _same_platforms(found: mcz.Recording, stated: Any) -> bool:
    n_platforms = int(stated["USED"]["value"][0]) if "USED" in stated else 0
    assert len(found.platforms) == n_platforms
    for number, platform in enumerate(found.platforms):
        of = {key: np.array(stated[key]["value"]) for key in ("TYPE", "CORNERS", "ORIGIN")}
        assert platform.type == of["TYPE"].ravel()[number]
        assert np.array_equal(np.array(platform.corners).T, of["CORNERS"][:, :, number])
        assert np.array_equal(platform.origin, of["ORIGIN"].reshape(3, -1)[:, number])
        channels = np.array(stated["CHANNEL"]["value"]).reshape(-1, n_platforms)
        assert np.array_equal(platform.channels, channels[:, number])
        if platform.calibration:
            matrix = np.array(stated["CAL_MATRIX"]["value"])[:, :, number]
            assert np.array_equal(platform.calibration, matrix)
    return n_platforms > 0


def _oracle(path: Path, shape: tuple[int, int]) -> tuple[str, Any, Any, Any]:
    if path.name in HEADER_ONLY:
        return "header", *header_arrays(path)
    if path.name in SLOW:
        return "c3d", *c3d_arrays(path)
    try:
        arrays = ezc3d_arrays(path)
        missed = arrays[0].shape[:2] != shape  # ezc3d goes by parameters, which may be missing
        if not missed and (arrays[2] is None or arrays[2].size or _has_no_analog(path)):
            return "ezc3d", *arrays
    except (OSError, RuntimeError, ValueError):
        pass
    return "c3d", *c3d_arrays(path)


def _has_no_analog(path: Path) -> bool:
    return path.read_bytes()[4:6] == b"\0\0"


def test_rotations_are_what_ezc3d_reads() -> None:
    ezc3d = pytest.importorskip("ezc3d")
    path = next(path for path in files() if path.name == "C3DRotationExample.c3d")
    motion = c3d.read(path.read_bytes(), path.stem)
    signal = motion.signals[1]
    assert signal.name == "rotations" and signal.channels is not None
    assert signal.channels[17].name == "pelvis_4X4 m11"
    matrices = signal.values.reshape(motion.n_frames, -1, 17)[:, :, :16]
    theirs = np.moveaxis(ezc3d.c3d(str(path))["data"]["rotations"], (0, 1, 2, 3), (3, 2, 1, 0))
    assert np.allclose(matrices.reshape(theirs.shape), theirs, rtol=1e-6, equal_nan=True)


def test_every_file_goes_through_an_mcz_file(tmp_path: Path) -> None:
    n = 0
    for path in some(files(), 3):
        mcz.encode(path, tmp_path / "clip.mcz", codec="raw", force=True)
        with mcz.open(tmp_path / "clip.mcz") as file:
            (clip,) = file.clips.values()
            assert clip.source_bytes() == path.read_bytes(), path
            stop = clip.n_frames - 1
            if stop > 3:
                again = c3d.read(clip.source_bytes((2, stop)), path.stem)
                part = clip.motion((2, stop))
                for one, other in zip(part.signals, again.signals, strict=True):
                    assert np.array_equal(one.values, other.values, equal_nan=True), path
        n += 1
    print(f"{n} files")
