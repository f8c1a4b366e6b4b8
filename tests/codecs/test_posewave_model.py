"""The model of codec 13: every integer comes back, hostile bytes end, loops agree bit by bit."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from mcz.codecs.posewave.model import make_model, new_rows, no_rows, start_tables
from mcz.codecs.posewave.model_kernels import NO_CHOICE, begin_level, code_rows
from mcz.codecs.posewave.state import MAX_INDEX, N_CLASSES, Model
from mcz.coding import mixing
from mcz.kernels.types import Floats, Ints

NO_EXPONENTS = np.zeros(1000, np.int64), 0
LENGTHS = 3, 2, 5, 9, 18, 35  # rows of the levels of 72 frames


def code_level(
    model: Model,
    level: int,
    data: NDArray[np.uint8],
    q: Ints,
    above: list[Floats],
    y: Floats | None = None,
    lam: float = NO_CHOICE,
) -> int:
    """Code a level, where ``above`` has the coarser ones, and add it; return a row of a fault."""
    n = q.shape[1]
    here, none = new_rows(len(q), n), no_rows(n)
    parent = above[level - 1][3:] if level > 1 else none
    grand = above[level - 2][3:] if level > 2 else none
    given = np.zeros((1, n)) if y is None else y
    begin_level(model, level)
    means = np.zeros(q.shape)
    found = code_rows(
        model, data, q, given, means, here, parent, grand, level, 0, len(q), lam, *NO_EXPONENTS
    )
    assert np.isfinite(means).all()
    above.append(here)
    return found


def encode(levels: list[Ints], classes: Ints) -> list[bytes]:
    model, above, out = make_model(classes, start_tables()[0]), list[Floats](), []
    for level, q in enumerate(levels):
        data = np.zeros(1000 + 20 * q.size, np.uint8)
        mixing.start(model.coder, data, 1)
        assert code_level(model, level, data, q, above) == -1
        out.append(data[: mixing.finish(model.coder, data)].tobytes())
    return out


def decode(streams: list[bytes], lengths: list[int], classes: Ints) -> list[Ints]:
    model, above, out = make_model(classes, start_tables()[0]), list[Floats](), []
    for level, stream in enumerate(streams):
        data = np.frombuffer(stream, np.uint8).copy()
        q = np.zeros((lengths[level], len(classes)), np.int64)
        mixing.start(model.coder, data, 0)
        if code_level(model, level, data, q, above) != -1:
            raise ValueError(f"level {level} is broken")
        assert mixing.coded_size(model.coder) == len(stream)
        out.append(q)
    return out


def some_levels(seed: int, n: int, scale: float) -> list[Ints]:
    rng = np.random.default_rng(seed)
    mix = rng.normal(size=(n, n)) / np.sqrt(n)
    rows = [
        rng.normal(size=(length, n)) @ mix * scale * 2.0**-k for k, length in enumerate(LENGTHS)
    ]
    return [np.rint(part * rng.exponential(size=(len(part), 1))).astype(np.int64) for part in rows]


@settings(max_examples=40, deadline=None)
@given(st.data())
def test_any_integers(data: st.DataObject) -> None:
    n = data.draw(st.integers(1, 70) | st.just(130), "channels")
    most = data.draw(st.sampled_from([0, 1, 3, 60, 1 << 14, MAX_INDEX]), "most")
    seed = data.draw(st.integers(0, 2**32), "seed")
    rng = np.random.default_rng(seed)
    lengths = data.draw(st.lists(st.integers(1, 6), min_size=1, max_size=6), "rows")
    levels = [rng.integers(-most, most, (rows, n), endpoint=True) for rows in lengths]
    classes = rng.integers(0, N_CLASSES, n)
    streams = encode([q.copy() for q in levels], classes)
    for q, found in zip(levels, decode(streams, lengths, classes), strict=True):
        np.testing.assert_array_equal(q, found)


def test_choices() -> None:
    """What an encoder chooses lies within one of what it quantizes, and comes back."""
    n, lam = 20, 0.1
    rng = np.random.default_rng(5)
    model, above = make_model(np.arange(n) % N_CLASSES, start_tables()[0]), list[Floats]()
    again, levels, streams = None, [], []
    for level, length in enumerate(LENGTHS):
        y = rng.normal(size=(length, n)) * rng.exponential(2.0, size=(length, 1))
        q, data = np.zeros((length, n), np.int64), np.zeros(1 << 16, np.uint8)
        mixing.start(model.coder, data, 1)
        assert code_level(model, level, data, q, above, y=y, lam=lam) == -1
        size = mixing.finish(model.coder, data)
        kept = np.abs(q).max(1) > 0
        assert (np.abs(y - q)[kept] < 2).all() and (np.abs(y)[~kept] < 2).all()
        levels.append(q)
        streams.append(data[:size].tobytes())
    again = decode(streams, list(LENGTHS), np.arange(n) % N_CLASSES)
    for q, found in zip(levels, again, strict=True):
        np.testing.assert_array_equal(q, found)


@settings(max_examples=30, deadline=None)
@given(st.binary(max_size=300), st.integers(1, 66))
def test_hostile_bytes(noise: bytes, n: int) -> None:
    """Any bytes decode to integers in range, or to a fault."""
    model, above = make_model(np.zeros(n, np.int64), start_tables()[0]), list[Floats]()
    for level in range(3):
        data = np.frombuffer(noise[level:], np.uint8).copy()
        q = np.zeros((8, n), np.int64)
        mixing.start(model.coder, data, 0)
        found = code_level(model, level, data, q, above)
        assert -1 <= found < 8
        assert (np.abs(q) <= MAX_INDEX).all()
        if found >= 0:
            break
