"""Codec 3, ``qbc``, against the plain decoder that was written from SPEC.md alone.

Values are compared bit for bit, and what one decoder refuses the other has to refuse.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import mcz
from mcz.codecs.base import Layout
from tests import plain_qbc
from tests.codecs.twins import VECTORS, Segments, Twins, rough
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


def plain(
    header: bytes, layout: Layout, segments: Segments, resolution: int, stop: int
) -> list[list[float]]:
    kinds = [channel.kind for channel in layout.skeleton.channels]
    groups = [[kinds[c] in LENGTHS for c in group] for group in layout.groups]
    sizes = layout.n_frames, layout.n_resolutions
    return plain_qbc.decode(header, groups, *sizes, segments, resolution, stop)


TWINS = Twins("qbc", plain)
# Vectors whose fault lies beside header and streams, or shows in the hash of the values alone.
BESIDE = (
    "resolutions-0 samples integers segment-lead-less segment-lead-more segment-lead-none "
    "segment-tail segment-not-fresh marks-byte-missing curves-byte-missing "
    "hash-near hash-order hash-coarse"
).split()


@pytest.mark.parametrize("settings", SETTINGS, ids=str)
def test_smooth_clips(settings: dict[str, Any]) -> None:
    for n_frames in (0, 1, 2, 3, 33, 64, 100):
        TWINS.check(TWINS.written(smooth(n_frames), settings))


@pytest.mark.parametrize("settings", SETTINGS, ids=str)
@pytest.mark.parametrize("seed", [1, 2])
def test_rough_clips(settings: dict[str, Any], seed: int) -> None:
    TWINS.check(TWINS.written(rough(70 + seed, seed), settings))


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
    TWINS.check_cut({"d2_lmt": 0.1, "segment_frames": 16, "delta": delta}, cut, tmp_path)


@pytest.mark.parametrize("path", sorted(VECTORS.glob("valid/qbc/*")), ids=lambda p: p.stem)
def test_valid_vectors(path: Path) -> None:
    TWINS.check(path.read_bytes())


@pytest.mark.parametrize("path", sorted(VECTORS.glob("invalid/qbc/*")), ids=lambda p: p.stem)
def test_invalid_vectors(path: Path) -> None:
    """Both decoders refuse them, where a decoder without a container can know the fault."""
    if path.stem not in BESIDE:
        TWINS.check_refused(path)


@pytest.mark.parametrize("seed", range(5))
def test_changed_streams(seed: int) -> None:
    signal = TWINS.loaded(smooth(40 + seed), SETTINGS[(1, 2, 3, 6, 8)[seed]])
    TWINS.check_changes(signal, 60, seed)


@pytest.mark.real
@pytest.mark.parametrize("settings", REAL_SETTINGS, ids=str)
@pytest.mark.parametrize("name", REAL_CLIPS)
def test_real_clip(name: str, settings: dict[str, Any], data: Path) -> None:
    TWINS.check(TWINS.written(mcz.read(data / name), settings))
