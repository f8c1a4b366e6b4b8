"""Codecs ``lsdt-frame`` and ``lsdt-clip``: bounds, segments, bases, live coding."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

import mcz
from mcz.codecs import basis_models
from mcz.model.motion import Signal
from tests.codecs.lossy import (
    Direct,
    amc,
    bytes_of,
    encode_and_decode,
    encode_file,
    markers,
)

CODECS = ["lsdt-frame", "lsdt-clip"]
CODERS = st.sampled_from(["mixed", "prefix"])
THRESHOLD = 0.6
ROUNDED = 1.05  # what a basis of 7 binary digits may add to an error, and more


# Bounds


@given(
    st.sampled_from(CODECS),
    st.integers(1, 130),
    st.integers(1, 6),
    st.floats(-3, 6),
    CODERS,
    st.sampled_from(["cosines", "learned"]),
    st.one_of(st.none(), st.integers(1, 60)),
)
@example("lsdt-frame", 1, 1, 0.0, "prefix", "learned", None)
@example("lsdt-clip", 2, 1, 0.0, "mixed", "learned", 1)
def test_a_coefficient_loses_at_most_the_threshold(
    codec, n_frames, n_markers, power, coder, basis, segment_frames
) -> None:
    """Bases are orthogonal: the rms over a window, or a frame, is bounded as a coefficient is."""
    motion = markers(n_frames, n_markers)
    step = 2.0**power
    params = {"step": step, "coder": coder, "basis": basis, "segment_frames": segment_frames}
    params |= {"window": 24} if codec == "lsdt-clip" else {}
    decoded = encode_and_decode(codec, motion, **{k: v for k, v in params.items() if v is not None})
    squares = (decoded - motion.values) ** 2
    parts = (
        [squares[a : a + 24] for a in range(0, n_frames, min(24, segment_frames or 24))]
        if codec == "lsdt-clip"
        else list(squares)
    )
    if codec == "lsdt-clip" and segment_frames is not None:
        parts = [squares]
    for part in parts:
        assert np.sqrt(part.mean()) <= THRESHOLD * step * ROUNDED + 1e-9


@pytest.mark.parametrize("codec", CODECS)
def test_errors_do_not_add_up(codec) -> None:
    """The last frames are as good as the first."""
    motion = markers(1500, 5)
    error = np.abs(encode_and_decode(codec, motion, step=1.0) - motion.values)
    assert error[-100:].mean() < 1.5 * error[:100].mean()


# Gaps, odd shapes, values that cannot be coded


def test_a_basis_that_is_not_there_or_does_not_fit(tmp_path: Path) -> None:
    with pytest.raises(mcz.AccessError):
        encode_file("lsdt-clip", markers(10), basis=str(tmp_path / "no.bases"))
    other = tmp_path / "five.bases"
    other.write_bytes(basis_models.build_bases([np.eye(5)] * 3))
    with pytest.raises(mcz.OptionError, match="do not fit"):
        encode_file("lsdt-clip", markers(10, 4), basis=str(other))
    other.write_bytes(other.read_bytes()[:20])
    with pytest.raises(mcz.FormatError):
        encode_file("lsdt-clip", markers(10, 5), basis=str(other))


# Segments and requests


def test_a_window_decodes_without_the_others() -> None:
    coded = Direct("lsdt-clip", markers(100, 3), step=0.2, window=20)
    whole, data = coded.read(), coded.stream(0, 0, 0)
    from mcz.codecs.spatial.windows import windows_of
    from mcz.model.schema import varint

    parts = list(windows_of(data, 5, "test"))
    for kept in range(5):  # the others are damaged
        broken = [part if i == kept else b"\xff" * len(part) for i, part in enumerate(parts)]
        stream = b"".join(varint(len(part)) + part for part in broken)
        decoded = coded.read(
            20 * kept, 20 * kept + 20, changes=coded.with_stream((0, 0, 0), stream)
        )
        np.testing.assert_array_equal(decoded, whole[20 * kept : 20 * kept + 20])


@pytest.mark.parametrize("params", [{"preset": "hou2016"}, {"segment_frames": 50}], ids=str)
def test_prefix_codes_are_those_of_segments_as_the_limit_leaves_them(params) -> None:
    motion = markers(120, 2)
    limit = 37 * 8 * 6  # bytes of 37 frames
    params = {"step": 0.1, "basis": "cosines", "coder": "prefix", **params}
    coded = Direct("lsdt-frame", motion, segment_bytes=limit, **params)
    assert [span.n_frames for span in coded.spans] == [37, 37, 37, 9]
    assert np.abs(coded.read() - motion.values).max() < 0.3


def test_frames_behind_a_request_may_be_damaged() -> None:
    coded = Direct("lsdt-frame", markers(300, 3), step=0.2)
    data = coded.stream(0, 0, 0)
    change = coded.with_stream((0, 0, 0), data[: len(data) // 2])
    np.testing.assert_array_equal(coded.read(0, 100, changes=change), coded.read(0, 100))
    with pytest.raises(mcz.FormatError):
        coded.read(changes=change)


# Bases


def test_an_archive_has_the_well_known_models_too() -> None:
    data = basis_models.known_models()["cmu31"].data
    for profile in ("base", "large"):
        out = io.BytesIO()
        mcz.write(markers(20, 31), out, codec="lsdt-clip", basis="known", profile=profile)
        assert (data in out.getvalue()) == (profile == "large")


def test_well_known_bases_are_nearly_orthogonal() -> None:
    """Rounding to few digits must not let errors grow."""
    models = basis_models.known_models()
    assert models
    for model in models.values():
        for basis in basis_models.parse_bases(model.data):
            assert basis.entries.shape[0] == basis.entries.shape[1]
            assert np.linalg.cond(basis.vectors) < 1.25


def test_what_is_smaller_is_chosen() -> None:
    """A clip of one frame does not pay for a basis; a long one of few directions does."""
    few = Direct("lsdt-clip", markers(3, 9), basis="auto")
    assert few.models == ((), ())
    random = np.random.default_rng(5)
    mixed = random.normal(size=(1500, 2)).cumsum(axis=0) @ random.normal(size=(2, 27))
    motion = markers(1500, 9)
    motion = replace(motion, signals=(Signal(mixed),))
    assert Direct("lsdt-clip", motion, basis="auto", step=0.1).models[0]


# Real clips


@pytest.mark.real
@pytest.mark.parametrize("codec", CODECS)
def test_a_real_clip_at_its_target(data: Path, codec: str) -> None:
    motion = amc(data, "17_10")
    held = encode_file(codec, motion, mean_error_cm=0.3)
    with mcz.open(held) as file:
        decoded = file.only_clip().motion()
    distance = np.sqrt(((mcz.positions(decoded) - mcz.positions(motion)) ** 2).sum(axis=2)).mean()
    assert 0.97 * 0.3 <= distance * motion.skeleton.unit_cm <= 0.3
    most = {"lsdt-clip": 16_000, "lsdt-frame": 34_000}[codec]
    assert bytes_of(held) < most


@pytest.mark.real
def test_the_well_known_basis_beats_cosines(data: Path) -> None:
    motion = amc(data, "49_02")
    known, plain = (
        bytes_of(encode_file("lsdt-clip", motion, mean_error_cm=0.5, basis=basis))
        for basis in ("known", "cosines")
    )
    assert known < 0.85 * plain


def test_clips_of_a_file_share_a_basis(tmp_path: Path) -> None:
    path = tmp_path / "b.bases"
    path.write_bytes(basis_models.build_bases([np.eye(4)] * 3))
    for seed in range(3):
        motion = replace(markers(50, 4, seed), name=f"c{seed}")
        mcz.write(motion, tmp_path / f"{seed}.mcz", "lsdt-clip", basis=str(path), step=0.1)
    mcz.merge(sorted(tmp_path.glob("*.mcz")), tmp_path / "all.mcz")
    assert (tmp_path / "all.mcz").read_bytes().count(b"MODL") == 1
    with mcz.open(tmp_path / "all.mcz") as file:
        for seed in range(3):
            decoded = file.clips[f"c{seed}"].read()
            assert np.abs(decoded - markers(50, 4, seed).values).max() < 2
