"""Codec 18, ``pca``: components, bounds, steps, and the published figures."""

from __future__ import annotations

import numpy as np
from hypothesis import example, given
from hypothesis import strategies as st

from mcz.kinematics.angles import unwrap
from tests.codecs.lossy import Direct, clip_of, encode_and_decode, random_walks
from tests.motions import smooth

KINDS = st.lists(st.sampled_from(["rx", "ry", "tx", "sx"]), min_size=1, max_size=8)


# Bounds


@given(
    st.integers(1, 150),
    KINDS,
    st.integers(0, 6),
    st.sampled_from(["default", "khan2014"]),
    st.one_of(st.none(), st.integers(1, 60)),
)
def test_all_components_lose_only_rounding(
    n_frames, kinds, decimals, preset, segment_frames
) -> None:
    """Half a step for each component, the mean, and the basis that is rounded."""
    motion = random_walks(n_frames, kinds)
    extra = {} if segment_frames is None else {"segment_frames": segment_frames}
    decoded = encode_and_decode("pca", motion, preset=preset, q=len(kinds), Q=decimals, **extra)
    meant = unwrap(motion.values, motion.skeleton)
    most = (len(kinds) + 1) * 1.1 * 10.0**-decimals + 1e-9 * (1 + np.abs(meant).max())
    assert np.abs(decoded - meant).max() <= most


@given(st.integers(2, 150), KINDS, st.integers(1, 8))
@example(2, ["rx"] * 4, 1)
def test_the_error_is_near_that_of_the_components_left_out(n_frames, kinds, q) -> None:
    motion = random_walks(n_frames, kinds)
    meant = unwrap(motion.values, motion.skeleton)
    rest = meant - meant.mean(axis=0)
    lost = float((np.linalg.svd(rest, compute_uv=False)[q:] ** 2).sum()) / rest.size
    decoded = float(np.mean((encode_and_decode("pca", motion, q=q, Q=5) - meant) ** 2))
    assert decoded <= lost * 1.001 + 1e-8
    coarse = float(np.mean((encode_and_decode("pca", motion, q=q) - meant) ** 2))
    assert coarse <= 12 * lost + 1e-4 * (1 + float(np.mean(meant**2)))


# Streams


def test_a_segment_is_read_up_to_what_is_wanted() -> None:
    """Frames behind it may be damaged."""
    coded = Direct("pca", smooth(400), Q=5, q=9)
    data = coded.stream(0, 0, 0)
    cut = {"fetch": lambda *_: data[: len(data) * 3 // 4]}
    assert coded.read(0, 90, changes=cut).tobytes() == coded.read(0, 90).tobytes()


def test_presets() -> None:
    assert Direct("pca", smooth(100), preset="khan2014").header == b"\x02"
    assert Direct("pca", smooth(100)).header == b"\xff"
    assert Direct("pca", smooth(100), Q=3).header == b"\x03"
    rough = clip_of(np.random.default_rng(3).normal(0, 1000, (6000, 30)), ["tx"] * 30)
    assert len(Direct("pca", rough, preset="khan2014", q=30).segments) == 1
