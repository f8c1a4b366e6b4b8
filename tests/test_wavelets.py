"""The wavelet transform: against PyWavelets, and a part of it against the whole."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import pywt
from hypothesis import given
from hypothesis import strategies as st

from mcz import OptionError
from mcz.codecs.transforms import wavelets
from mcz.codecs.transforms.wavelets import IDS, INLINE, MAX_TAPS, WAVELETS, Wavelet, by_id, by_name

REGISTERED = tuple(WAVELETS)
OTHERS = ("db10", "sym7", "coif3", "bior1.3", "bior2.2", "bior6.8", "rbio3.5", "dmey")
NAMES = st.sampled_from(REGISTERED + OTHERS)
SIZES = st.one_of(st.integers(1, 40), st.sampled_from([63, 64, 65, 127, 201]))
LEVELS = st.integers(0, 6)


def signal_of(n: int, seed: int = 0, channels: int = 3) -> np.ndarray:
    return np.random.default_rng(seed).normal(0, 10, (n, channels))


def reference(signal: np.ndarray, name: str, levels: int) -> list[np.ndarray]:
    """The bands by PyWavelets, which warns where a signal is short for so many levels."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        return list(pywt.wavedec(signal, name, mode="symmetric", level=levels, axis=0))


def whole(signal: np.ndarray, wavelet: Wavelet, levels: int) -> list[np.ndarray]:
    n = len(signal)
    return wavelets.analyze(signal, 0, 0, n, wavelet.lengths(n, levels), wavelet)


def synthesize_range(
    bands: list[np.ndarray], wavelet: Wavelet, start: int, stop: int
) -> np.ndarray:
    """Frames of a range from no more than the coefficients that it needs."""
    levels = len(bands) - 1
    ranges = wavelets.needed_ranges(start, stop, levels, wavelet.n_taps)
    places = [ranges[levels], *reversed(ranges[1:])] if levels else [ranges[0]]
    cut = [band[a:b] if len(band) else band for band, (a, b) in zip(bands, places, strict=True)]
    return wavelets.synthesize(cut, [a for a, _ in ranges[1:]], start, stop, wavelet)


@given(NAMES, SIZES, LEVELS)
def test_analysis_is_that_of_pywavelets(name: str, n: int, levels: int) -> None:
    signal, (_, wavelet) = signal_of(n), by_name(name)
    found, meant = whole(signal, wavelet, levels), reference(signal, name, levels)
    assert [band.shape for band in found] == [band.shape for band in meant]
    for a, b in zip(found, meant, strict=True):
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-9)


@given(NAMES, SIZES, LEVELS)
def test_synthesis_is_that_of_pywavelets(name: str, n: int, levels: int) -> None:
    """Any coefficients, not only those of a signal; PyWavelets adds a sample to odd lengths."""
    wavelet = by_name(name)[1]
    lengths = wavelet.lengths(n, levels)
    sizes = [lengths[levels], *reversed(lengths[1:])] if levels else [n]
    bands = [signal_of(size, seed) for seed, size in enumerate(sizes)]
    meant = pywt.waverec(bands, name, mode="symmetric", axis=0)[:n]
    np.testing.assert_allclose(synthesize_range(bands, wavelet, 0, n), meant, rtol=0, atol=1e-9)


@given(NAMES, SIZES, LEVELS, st.data())
def test_any_range_is_the_same_as_in_the_whole(name: str, n: int, levels: int, data) -> None:
    wavelet = by_name(name)[1]
    bands = whole(signal_of(n), wavelet, levels)
    for band in data.draw(st.sets(st.integers(1, levels))) if levels else ():
        bands[band] = np.zeros((0, 3))  # details that are left out
    start = data.draw(st.integers(0, n - 1))
    stop = data.draw(st.integers(start + 1, n))
    full = synthesize_range(bands, wavelet, 0, n)
    part = synthesize_range(bands, wavelet, start, stop)
    assert part.tobytes() == full[start:stop].tobytes()


@given(NAMES, SIZES, st.integers(0, 4), st.data())
def test_analysis_of_windows_is_that_of_the_whole(name: str, n: int, levels: int, data) -> None:
    """Segment by segment, with no more frames than ``Wavelet.lead`` and ``mirrored`` say."""
    signal, (_, wavelet) = signal_of(n), by_name(name)
    lengths, unit = wavelet.lengths(n, levels), 1 << levels
    inner = range(unit, n, unit)
    cuts = data.draw(st.sets(st.sampled_from(inner))) if inner else set()
    bounds = [0, *sorted(cuts), n]
    parts = []
    for first, stop in zip(bounds, bounds[1:], strict=False):
        at = max(0, first - -(-wavelet.lead(levels) // unit) * unit)
        end = min(n, max(stop, -(-wavelet.mirrored(levels) // unit) * unit))
        parts.append(wavelets.analyze(signal[at:end], at, first, stop, lengths, wavelet))
    for number, meant in enumerate(whole(signal, wavelet, levels)):
        joined = np.concatenate([part[number] for part in parts])
        assert joined.tobytes() == meant.tobytes()


@pytest.mark.parametrize("name", REGISTERED)
def test_the_registry_has_the_filters_of_pywavelets(name: str) -> None:
    id_, wavelet = by_name(name)
    assert id_ == IDS[name] and by_id(id_) is wavelet
    theirs = pywt.Wavelet(name)
    assert wavelet.lo == tuple(theirs.rec_lo) and wavelet.hi == tuple(theirs.rec_hi)
    low, high = wavelet.analysis
    np.testing.assert_allclose(low, theirs.dec_lo, rtol=0, atol=1e-15)
    np.testing.assert_allclose(high, theirs.dec_hi, rtol=0, atol=1e-15)


@pytest.mark.parametrize("name", OTHERS)
def test_other_wavelets_are_inline(name: str) -> None:
    id_, wavelet = by_name(name)
    assert id_ == INLINE and wavelet.lo == tuple(pywt.Wavelet(name).rec_lo)


@pytest.mark.parametrize("name", ["", "nosuch", "db0", "DB3 ", "morl", "gaus1", "cmor1.5-1.0"])
def test_unknown_names_are_refused(name: str) -> None:
    with pytest.raises(OptionError, match="wavelet .*is unknown; the wavelets are haar, db2"):
        by_name(name)


def test_a_wavelet_with_too_many_taps_is_refused() -> None:
    assert pywt.Wavelet("db38").rec_len > MAX_TAPS
    with pytest.raises(OptionError, match="wavelet 'db38': .*76"):
        by_name("db38")
