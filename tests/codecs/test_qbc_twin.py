"""Codec 3, ``qbc``, against the plain decoder that was written from SPEC.md alone.

Values are compared bit for bit, and what one decoder refuses the other has to refuse.
"""

from __future__ import annotations

import io
import random
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

import mcz
from mcz.codecs.base import Request, Span
from mcz.errors import FormatError
from mcz.files.signal_info import SignalInfo
from mcz.motion import Motion, Signal
from mcz.numbers import Grid, GridKind
from tests import plain_qbc
from tests.motions import smooth

SETTINGS: tuple[dict[str, Any], ...] = (
    {"d2_lmt": 1},
    {"d2_lmt": 1e-4, "delta": 7},
    {"d2_lmt": 0.2, "delta": 8, "segment_frames": 16},
    {"d2_lmt": 5, "preset": "khan2014"},
    {"d2_lmt": 5, "preset": "khan2014", "middle": "least-squares", "segment_frames": 80},
    {"d2_lmt": 2, "delta": 1, "segment_frames": 5},
    {"d2_lmt": 0.5, "breaks": "fewest", "delta": 16, "segment_frames": 32},
    {"d2_lmt": 0.5, "breaks": "split", "delta": 3, "Q": 4},
    {"d2_lmt": 30, "delta": 1000, "middle": "published"},
)
REAL_SETTINGS: tuple[dict[str, Any], ...] = (
    {"d2_lmt": 1},
    {"d2_lmt": 0.05, "delta": 16, "segment_frames": 64, "breaks": "split"},
    {"d2_lmt": 24, "preset": "khan2014"},
)


LENGTHS = ("tx", "ty", "tz", "length")
REAL_CLIPS = ("cmu/amc/05_01.amc", "cmu/bvh-daz/09_01.bvh", "other/ezc3d-testfiles/FP_Type1.c3d")


class Stored(NamedTuple):
    """A signal as a file holds it: (first frame, frames, streams) of its segments."""

    info: SignalInfo
    segments: list[tuple[int, int, list[bytes]]]

    def plain(self, resolution: int = 0) -> np.ndarray:
        """What the plain decoder makes of the frames that the clip shows."""
        layout = self.info.layout
        stop = layout.n_frames - self.info.spare
        rows = plain_qbc.decode(
            self.info.header,
            [[layout.skeleton.channels[c].kind in LENGTHS for c in g] for g in layout.groups],
            layout.n_frames,
            layout.n_resolutions,
            self.segments,
            resolution,
            stop,
        )
        return np.array(rows, "<f8").reshape(stop, layout.n_channels)[self.info.skip :]

    def fast(self, resolution: int = 0) -> np.ndarray:
        """What the codec makes of these frames."""
        layout, info = self.info.layout, self.info
        n_groups = len(layout.groups)
        headers = [row.header for row in info.rows]
        return info.codec.decode(
            info.header,
            layout,
            [Span(h.first, h.n_frames, h.lead, h.tail, True) for h in headers],
            Request(0, layout.n_frames - info.spare, tuple(range(n_groups)), resolution),
            lambda segment, r, group: self.segments[segment][2][r * n_groups + group],
        )[info.skip :]


def stored(file: Any, clip: Any) -> Stored:
    info = clip.signals[0]
    layout, segments = info.layout, []
    for row in info.rows:
        table, streams = file.container.streams(row, info.counts, None)
        places = [
            table.codec(r, g)
            for r in range(layout.n_resolutions)
            for g in range(len(layout.groups))
        ]
        segments.append((row.header.first, row.header.n_frames, [streams[i] for i in places]))
    return Stored(info, segments)


def written(motion: Motion, settings: dict[str, Any]) -> bytes:
    target = io.BytesIO()
    mcz.write(motion, target, codec="qbc", **settings)
    return target.getvalue()


def loaded(motion: Motion, settings: dict[str, Any]) -> Stored:
    with mcz.open(io.BytesIO(written(motion, settings))) as file:
        return stored(file, file.only_clip())


def check_twins(data: bytes) -> None:
    """Every resolution of the only clip, bit for bit."""
    with mcz.open(io.BytesIO(data)) as file:
        clip = file.only_clip()
        signal = stored(file, clip)
        for resolution in range(signal.info.layout.n_resolutions):
            values, _ = clip.read_masked(resolution=resolution)
            assert signal.plain(resolution).tobytes() == values.astype("<f8").tobytes()


VECTORS = Path(__file__).parents[2] / "conformance" / "vectors"
# Vectors whose fault lies beside header and streams, or shows in the hash of the values alone.
BESIDE = (
    "resolutions-0 samples integers segment-lead-less segment-lead-more segment-lead-none "
    "segment-tail segment-not-fresh marks-byte-missing curves-byte-missing "
    "hash-near hash-order hash-coarse"
).split()


def rough(n_frames: int, seed: int) -> Motion:
    """Noise, spikes, steps, turns, constants and gaps beside the sines."""
    generator = np.random.default_rng(seed)
    motion = smooth(n_frames)
    values = np.array(motion.signals[0].values)
    values[:, 0] = generator.normal(size=n_frames) * 1e4
    values[:, 1] += (generator.random(n_frames) < 0.05) * 1e6
    values[:, 2] = np.cumsum(generator.integers(-9, 10, n_frames))
    values[:, 3] = (np.arange(n_frames) * 17.0 + 180) % 360 - 180
    values[:, 4] = 12.5
    values[:, 5] = -0.0
    mask = generator.random(values.shape) < np.linspace(0, 2, 10)
    grids = (Grid(GridKind.BINARY64),) * 10
    return replace(motion, signals=(Signal(np.where(mask, values, np.nan), grids, mask=mask),))


@pytest.mark.parametrize("settings", SETTINGS, ids=str)
def test_smooth_clips(settings: dict[str, Any]) -> None:
    for n_frames in (0, 1, 2, 3, 33, 64, 100):
        check_twins(written(smooth(n_frames), settings))


@pytest.mark.parametrize("settings", SETTINGS, ids=str)
@pytest.mark.parametrize("seed", [1, 2])
def test_rough_clips(settings: dict[str, Any], seed: int) -> None:
    check_twins(written(rough(70 + seed, seed), settings))


@pytest.mark.parametrize(
    "cut",
    [
        {"resolution": 1},
        {"joints": ["spine", "knee"]},
        {"frames": (70, 90)},
        {"frames": (0, 5), "resolution": 1},
        {"frames": (149, 150)},
        {"frames": (40, 41)},
        {"frames": (9, 9)},
    ],
    ids=str,
)
@pytest.mark.parametrize("delta", [1, 8, 16])
def test_extracted_clips(cut: dict[str, Any], delta: int, tmp_path: Path) -> None:
    source, target = tmp_path / "all.mcz", tmp_path / "cut.mcz"
    settings = {"d2_lmt": 0.1, "segment_frames": 16, "delta": delta}
    source.write_bytes(written(smooth(150), settings))
    mcz.extract(source, target, **cut)
    check_twins(target.read_bytes())


@pytest.mark.parametrize("path", sorted(VECTORS.glob("valid/qbc/*")), ids=lambda p: p.stem)
def test_valid_vectors(path: Path) -> None:
    check_twins(path.read_bytes())


@pytest.mark.parametrize("path", sorted(VECTORS.glob("invalid/qbc/*")), ids=lambda p: p.stem)
def test_invalid_vectors(path: Path) -> None:
    """Both decoders refuse them, where a decoder without a container can know the fault."""
    if path.stem not in BESIDE:
        with mcz.open(path) as file:
            signal = stored(file, file.only_clip())
        assert outcome(signal.plain, 0) is None
        assert outcome(signal.fast, 0) is None


def changed(signal: Stored, chance: random.Random) -> Stored:
    """One change of the header or of a stream."""
    header = bytearray(signal.info.header)
    segments = [(first, n, [bytearray(s) for s in own]) for first, n, own in signal.segments]
    full = [s for _, _, own in segments for s in own if s]
    chosen = header if chance.random() < 0.15 else chance.choice(full)
    at = chance.randrange(len(chosen))
    match chance.randrange(6):
        case 0:
            del chosen[at:]
        case 1:
            chosen += bytes([chance.choice((0, 255))])
        case 2:
            chosen[:] = chance.choice(full)
        case 3:
            chosen[0] = chance.randrange(256)
        case _:
            chosen[at] ^= 1 << chance.randrange(8)
    info = replace(signal.info, header=bytes(header))
    return Stored(info, [(first, n, [bytes(s) for s in own]) for first, n, own in segments])


def outcome(decode: Any, resolution: int) -> bytes | None:
    """The bytes of the values; None where they are refused."""
    try:
        values: np.ndarray = decode(resolution)
    except (ValueError, FormatError):
        return None
    return values.astype("<f8").tobytes()


@pytest.mark.parametrize("seed", range(5))
def test_changed_streams(seed: int) -> None:
    chance = random.Random(seed)
    refused = 0
    signal = loaded(smooth(40 + seed), SETTINGS[(1, 2, 3, 6, 8)[seed]])
    for _ in range(60):
        other = changed(signal, chance)
        resolution = chance.randrange(2)
        plain = outcome(other.plain, resolution)
        assert plain == outcome(other.fast, resolution)
        refused += plain is None
    assert 10 < refused < 60


@pytest.mark.real
@pytest.mark.parametrize("settings", REAL_SETTINGS, ids=str)
@pytest.mark.parametrize("name", REAL_CLIPS)
def test_real_clip(name: str, settings: dict[str, Any], data: Path) -> None:
    check_twins(written(mcz.read(data / name), settings))
