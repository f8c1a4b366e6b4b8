"""Prefix codes and cosines."""

from __future__ import annotations

import heapq

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.fft import dct

import mcz
from mcz.codecs.coding import prefix_codes as prefix
from mcz.codecs.coding.prefix_codes import MAX_LENGTH, N_CLASSES, class_of, code_lengths, codes_of
from mcz.codecs.transforms.bases import dct_matrix


@pytest.mark.parametrize("n", [*range(1, 40), 60, 120, 240, 999, 2048])
def test_cosines_are_those_of_scipy(n: int) -> None:
    meant = dct(np.eye(n), axis=0, norm="ortho")
    assert np.abs(dct_matrix(n) - meant).max() <= 4e-16


@given(st.lists(st.integers(0, 2**30), min_size=1, max_size=N_CLASSES))
def test_codes_are_whole_and_short(counts: list[int]) -> None:
    lengths = code_lengths(counts)
    assert [bool(length) for length in lengths] == [bool(count) for count in counts]
    codes_of(lengths, "test")
    size = sum(count * length for count, length in zip(counts, lengths, strict=True))
    best = _huffman_size([count for count in counts if count])
    if max(lengths) < MAX_LENGTH:
        assert size == best
    assert size >= best


def _huffman_size(counts: list[int]) -> int:
    """The bits of a code of any lengths."""
    if len(counts) == 1:
        return counts[0]
    heapq.heapify(counts)
    total = 0
    while len(counts) > 1:
        both = heapq.heappop(counts) + heapq.heappop(counts)
        total += both
        heapq.heappush(counts, both)
    return total


@pytest.mark.parametrize("lengths", [[1, 1, 1], [2], [1, 2], [16, 1], [2, 2, 2], [1, 15]])
def test_lengths_that_make_no_code(lengths: list[int]) -> None:
    with pytest.raises(mcz.FormatError):
        codes_of(lengths, "test")


@pytest.mark.parametrize("lengths", [[], [0, 0], [1], [0, 1], [1, 1], [2, 1, 2]])
def test_lengths_that_make_a_code(lengths: list[int]) -> None:
    codes_of(lengths, "test")


@given(st.integers(0, 2**41 - 1))
def test_classes_ascend_with_their_integers(value: int) -> None:
    own, n_bits = class_of(value)
    assert 0 <= own < N_CLASSES
    if value:
        assert class_of(value - 1)[0] in (own, own - 1)
    assert value >= 16 or (own, n_bits) == (value, 0)
    assert prefix._classes(np.array([value]))[0] == own


@given(
    st.integers(1, 9),
    st.integers(1, 40),
    st.integers(0, 40),
    st.floats(0, 1),
    st.integers(0, 2**32 - 1),
)
def test_vectors_survive(n_vectors, n, power, share, seed) -> None:
    random = np.random.default_rng(seed)
    sizes = np.floor(2.0 ** random.uniform(0, power, (n_vectors, n))).astype(np.int64)
    rows = np.where(random.random((n_vectors, n)) < share, sizes, 0) * random.choice([-1, 1], n)
    fields = prefix.fields_of([rows])
    codes = prefix.codes_from(fields, "test")
    assert codes is not None
    data = prefix.build_vectors(rows, np.array([0, n]), codes)
    found = np.zeros_like(rows)
    prefix.parse_vectors(data, found, np.array([0, n]), codes, "test", whole=True)
    np.testing.assert_array_equal(found, rows)
    for bad in (data + b"\x00", data[:-1]):
        with pytest.raises(mcz.FormatError):
            prefix.parse_vectors(bad, np.zeros_like(rows), np.array([0, n]), codes, "t", whole=True)
