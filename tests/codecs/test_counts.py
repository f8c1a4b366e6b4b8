"""Counts of a converter, the laws that make binary32 numbers of them, and rests: form 34."""

import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mcz.bench.measure import write_file
from mcz.coding.ordinals import heads, streams
from mcz.coding.ordinals.count_search import find_counts
from mcz.coding.ordinals.counts import BINARY32, Law, parse_law
from mcz.coding.ordinals.units import find_unit
from mcz.errors import FormatError
from mcz.motion import Channel, Joint, Motion, Signal, Skeleton

OWN = (BINARY32, BINARY32)
VOLT = 10 / 65535  # of a converter of 16 bits
TERMS = st.none() | st.floats(-(2.0**80), 2.0**80)
LAWS = st.builds(Law, st.floats(2.0**-200, 2.0**80), TERMS, TERMS)


def coded(column: np.ndarray) -> bytes:
    return streams.build_stream(column[:, None], [OWN], 0, {}, 1)


def decoded(stream: bytes, n_rows: int) -> list[int]:
    columns: list[int] = streams.parse_stream(stream, [BINARY32], n_rows, version=1)[0][
        :, 0
    ].tolist()
    return columns


def signal_of(n_rows: int = 500, seed: int = 3) -> np.ndarray:
    """What a converter counted: a walk."""
    return 32768 + np.random.default_rng(seed).integers(-40, 41, n_rows).cumsum()


@given(LAWS, st.lists(st.integers(-(2**44), 2**44 - 1) | st.integers(-9, 9), min_size=1))
def test_every_step_of_a_law_is_rounded_by_itself(law: Law, counts: list[int]) -> None:
    expected = []
    for count in counts:
        number = float(count) * law.unit
        number = number if law.offset is None else number + law.offset
        (number,) = struct.unpack("<f", struct.pack("<f", number))
        number = number if law.shift is None else number + law.shift
        expected.append(struct.unpack("<i", struct.pack("<f", number))[0])
    words = np.array(expected, np.int64)
    ordinals = np.where(words < 0, -1 - (words & 0x7FFFFFFF), words)
    assert law.ordinals(np.array(counts, np.int64)).tolist() == ordinals.tolist()


@given(LAWS, st.booleans())
def test_fields_say_the_law(law: Law, rests: bool) -> None:
    fields = law.fields(rests=rests)
    assert parse_law(fields, 8, law.unit) == (law, rests, len(fields))
    for size in range(8, len(fields)):
        with pytest.raises(FormatError, match="law"):
            parse_law(fields[:size], 8, law.unit)


@pytest.mark.parametrize(
    "law",
    [
        Law(VOLT, -0.31),
        Law(VOLT, 0.0, -5.0087),  # once rounded between 4 and 8, once more near 0
        Law(7.6296273e-08, None, -0.0024),
        Law(1 / 3, 1e4),
    ],
)
def test_laws_are_found(law: Law) -> None:
    ordinals = law.ordinals(signal_of())
    found = find_counts(ordinals, None)
    assert found is not None
    assert not found.rests.any()
    assert (found.law.ordinals(found.counts) == ordinals).all()
    assert len(coded(ordinals)) < 0.7 * len(streams.build_stream(ordinals[:, None], [OWN], 0, {}))


def test_what_a_law_is_off_are_rests() -> None:
    ordinals = Law(VOLT, -0.31).ordinals(signal_of())
    ordinals[::7] += 1
    ordinals[100] = 0
    found = find_counts(ordinals, None)
    assert found is not None
    assert found.rests.any()
    stream = coded(ordinals)
    assert stream[1] == heads.COUNTS
    assert decoded(stream, 500) == ordinals.tolist()


def test_only_what_saves_bits_is_taken_for_counts() -> None:
    noise = np.random.default_rng(1).normal(size=600)
    walk = np.cumsum(noise)
    for values in (noise, walk, walk[:8], np.repeat(walk[:9], 3), walk * 1e-40, walk * 1e36):
        ordinals = BINARY32.ordinals(values.astype(np.float32).astype(float))[0]
        assert find_counts(ordinals, find_unit(ordinals)) is None
    infinite = Law(VOLT).ordinals(signal_of())
    infinite[5] = BINARY32.ordinals(np.array([np.inf]))[0][0]
    assert find_counts(infinite, None) is None


def test_multiples_stay_multiples_unless_they_lie_apart() -> None:
    counts = signal_of()
    whole = Law(2.0**-10).ordinals(counts)
    assert find_counts(whole, find_unit(whole)) is None
    apart = Law(160 * 2.0**-20, 75 * 2.0**-20).ordinals(counts - 32768)
    multiples = find_unit(apart)
    found = find_counts(apart, multiples)
    assert multiples is not None and found is not None
    assert found.law.unit > 30 * multiples[0]


@given(
    st.floats(1e-6, 1e6),
    st.floats(-1e3, 1e3),
    st.integers(0, 5),
    st.integers(20, 60),
    st.randoms(use_true_random=False),
)
def test_any_column_comes_back(
    unit: float, offset: float, noise: int, n_rows: int, chance: object
) -> None:
    seed = chance.randrange(2**32)  # type: ignore[attr-defined]
    many = np.random.default_rng(seed)
    ordinals = Law(unit, offset).ordinals(many.integers(-3000, 3000, n_rows))
    ordinals += many.integers(-noise, noise + 1, n_rows)
    assert decoded(coded(ordinals), n_rows) == ordinals.tolist()


def test_a_signal_is_of_version_1_where_it_helps() -> None:
    skeleton = Skeleton((Joint("plate", channels=(Channel("", "force", "V"),)),))
    counts = BINARY32.values(Law(VOLT, -0.31).ordinals(signal_of(2000)))
    noise = np.random.default_rng(1).normal(size=2000).astype(np.float32).astype(float)
    quiet = np.where(np.arange(2000) < 1400, 0.25, counts)  # shows only in the last places
    for values, version in ((counts, 1), (noise, 0), (quiet, 1), (values_of_none(), 0)):
        signal = Signal(values.reshape(-1, 1), (BINARY32,))
        assert version_of(Motion(skeleton, (signal,))) == version


def values_of_none() -> np.ndarray:
    return np.empty(0)


def version_of(motion: Motion) -> int:
    import mcz

    with mcz.open(write_file(motion, "lossless", {})) as file:
        version: int = file.only_clip().signals[0].codec_version
    return version
