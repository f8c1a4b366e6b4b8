"""The streams of one channel of one segment: its quantized wavelet coefficients, band by band.

SPEC.md, "Codec 16: wavelet", is normative and has the steps below in the same order; names of
fields are its own. One compiled function codes for encoder and decoder. The choice of thresholds
and quantizer steps (Khan 2016, eq. 2; mcz/codecs/wavelet/README.md) and the annealing of ``awt``
bind no decoder.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from mcz.codecs.coding.residuals import FAULT, bits, clamp, code_residual, side_of
from mcz.codecs.coding.streams import (
    choose_predictor,
    decode_stream,
    encode_stream,
    scale_of,
    start_states,
)
from mcz.codecs.parameters import code_of, ratio_of
from mcz.errors import FormatError, MotionError, OptionError
from mcz.kernels import kernel
from mcz.kernels.types import Bytes, Floats, IntColumns, Ints
from mcz.model.schema import read_varint, varint

MAX_INDEX = 1 << 40  # of a coefficient: sums of neighbors then stay far below 2^53
OWN = 0, 0  # first context and mixer: a stream has its own


def predict(values: Ints, at: int, predictor: int) -> int:
    """An approximation from those before it, by one of the four predictors."""
    step = values[at - 1] - values[at - 2] if at > 1 else 0
    if predictor == 0:
        return int(values[at - 1])
    if predictor == 1:
        return int(values[at - 1] + (step >> 1))
    if predictor == 2:
        return int(values[at - 1] + step)
    before = values[at - 2] - values[at - 3] if at > 2 else 0
    return int(values[at - 1] + ((3 * step - 2 * before) >> 2))  # MRDWT-25


@kernel
def code_approximations(
    state: Ints, data: Bytes, values: Ints, count: int, predictor: int, scale: int
) -> int:
    """Code values[1:count] in place, values[0] being known; return the index of a fault or -1."""
    fast = slow = scale << 4
    near = side_1 = side_2 = 0
    for at in range(1, count):
        predicted = predict(values, at, predictor)
        momentum = side_of(values[at - 1] - values[at - 2]) if at > 1 else 3  # MRDWT-25
        sides = side_1, side_2, momentum
        near_class = clamp(near + 3, 0, 7)
        error = code_residual(
            state, data, values[at] - predicted, (fast, slow), near_class, sides, OWN
        )
        if error == FAULT or abs(predicted + error) > MAX_INDEX:  # MRDWT-26
            return at
        values[at] = predicted + error
        size = abs(error) << 4
        near = (near + bits(size) - bits(slow)) >> 1
        fast += (size - fast) >> 1
        slow += (size - slow) >> 5  # MRDWT-25
        side_2, side_1 = side_1, side_of(error)
    return -1


@kernel
def code_details(
    state: Ints, data: Bytes, values: Ints, count: int, coarser: IntColumns, shift: int, least: int
) -> int:
    """Code values[:count] in place; return the index of a fault or -1.

    ``coarser`` has the activity in the next coarser band and the side of its coefficients, (2, n);
    coefficient ``at`` lies above its column (at + shift) // 2. No value that is not zero is smaller
    than ``least``.
    """
    n_coarser = coarser.shape[1]
    run = last = before = side_1 = side_2 = 0
    for at in range(count):
        above = (at + shift) >> 1  # MRDWT-28
        activity = beside = 0
        other = 3
        if above < n_coarser:
            activity, other = coarser[0, above], coarser[1, above]
            beside = coarser[0, above - 1] if above > 0 else 0
        if above + 1 < n_coarser:
            beside += coarser[0, above + 1]
        scales = 11 * last + 5 * before, 8 * activity + 4 * beside
        given = values[at]
        size = max(0, abs(given) - least + 1)
        fault = code_residual(
            state,
            data,
            -size if given < 0 else size,
            scales,
            min(bits(run), 7),
            (side_1, side_2, other),
            OWN,
        )
        if fault == FAULT or abs(fault) > MAX_INDEX - least:  # MRDWT-29
            return at
        run = run + 1 if fault == 0 else 0  # MRDWT-28
        before, last = last, abs(fault)
        side_2, side_1 = side_1, side_of(fault)
        values[at] = 0 if fault == 0 else fault + least - 1 if fault > 0 else fault - least + 1
    return -1


MASK = (1 << 31) - 1  # a Lehmer generator: the same numbers on every machine


def next_seed(seed: int) -> int:
    return seed * 48271 % MASK


@kernel
def anneal(
    counts: Ints, most: Ints, starts: Ints, tails: Floats, iterations: int, seed: int
) -> float:
    """Move coefficients between channels, ``counts`` in place, and return the distortion.

    ``tails[starts[c] + k]`` is the distortion of channel c that keeps its k largest coefficients,
    ``k <= most[c]``. A move takes some from one channel and gives them to another; one
    that adds to the distortion is accepted the less often the later it comes. The last tenth of
    the moves accepts only what lowers it. The best allocation that was found is kept.
    """
    n_channels = len(counts)
    total = 0.0
    for c in range(n_channels):
        total += tails[starts[c] + counts[c]]
    if n_channels < 2 or total <= 0:
        return total
    best, best_counts = total, np.empty(n_channels, np.int64)
    best_counts[:] = counts
    hot, cold = total / n_channels / 8, total / n_channels * 1e-7
    cooling = math.exp(math.log(cold / hot) / max(1, iterations))
    heat = hot
    state = 1 + seed % (MASK - 1)
    for _ in range(16):  # small seeds differ from the first move on
        state = next_seed(state)
    greatest = 1
    for c in range(n_channels):
        greatest = max(greatest, counts[c])
    for step in range(iterations):
        state = next_seed(state)
        giver = state % n_channels
        state = next_seed(state)
        taker = state % n_channels
        state = next_seed(state)
        left = iterations - step
        widest = 1 + greatest * left // (4 * iterations)
        moved = min(1 + state % widest, counts[giver], most[taker] - counts[taker])
        state = next_seed(state)
        heat *= cooling
        if giver == taker or moved <= 0:
            continue
        g, t = starts[giver] + counts[giver], starts[taker] + counts[taker]
        change = (tails[g - moved] - tails[g]) + (tails[t + moved] - tails[t])
        if change > 0 and (10 * left <= iterations or state >= MASK * math.exp(-change / heat)):
            continue
        counts[giver] -= moved
        counts[taker] += moved
        total += change
        if total < best:
            best = total
            best_counts[:] = counts
    counts[:] = best_counts
    return best


N_SETS = 5  # start tables: the approximation, then the details from the coarsest on
CONSTANT = 63  # in place of a scale: every coefficient is the first one


@dataclass(frozen=True, slots=True)
class Coding:
    """Settings shared by the streams of a signal.

    The codec's name, for messages; presence of step codes; the least magnitude of a detail other
    than zero; the place of a coefficient in the next coarser band.
    """

    name: str
    scaled: bool
    least: int
    shift: int


def build_streams(bands: Sequence[Ints], step: int, coding: Coding) -> list[bytes]:
    """The streams of ``bands``, the approximation first, then the details from the coarsest."""
    most = [MAX_INDEX, *(MAX_INDEX - 1 for _ in bands[1:])]
    if any(len(band) and np.abs(band).max() > n for band, n in zip(bands, most, strict=True)):
        raise MotionError(f"{coding.name}: a coefficient exceeds 2^40 quantizer steps")
    streams = [_build_approximations(bands[0], step, coding, any(b.any() for b in bands[1:]))]
    coarser = _activity(bands[0], len(bands[0]))
    for number, band in enumerate(bands[1:], 1):
        streams.append(_build_details(band, coarser, min(number, N_SETS - 1), coding))
        coarser = _magnitudes(band, coding)
    return streams


def parse_streams(
    stream: Callable[[int], bytes], counts: Sequence[int], limits: Sequence[int], coding: Coding
) -> tuple[list[Ints], int]:
    """The first ``limits`` of ``counts`` coefficients of every band, and the step code.

    Raises FormatError on bad bytes.
    """
    prefixes = _prefixes(counts, limits, coding)
    band, step, known = _parse_approximations(stream(0), counts[0], prefixes[0], coding)
    bands, coarser = [band], _activity(band, counts[0])
    for number in range(1, len(counts)):
        data = stream(number)
        if data and not known:  # MRDWT-19
            raise FormatError(f"{coding.name}: details are present, but the channel has no step")
        band = _parse_details(
            data, counts[number], prefixes[number], coarser, min(number, N_SETS - 1), coding
        )
        bands.append(band)  # MRDWT-20
        coarser = _magnitudes(band, coding)
    return [band[:n] for band, n in zip(bands, limits, strict=True)], step


def _prefixes(counts: Sequence[int], limits: Sequence[int], coding: Coding) -> list[int]:
    """Coefficients to decode per band: each band is the context of the next."""
    prefixes = list(limits)
    for number in range(len(counts) - 1, 0, -1):
        context = (prefixes[number] + coding.shift) // 2 + 3
        prefixes[number - 1] = max(prefixes[number - 1], context)
    return [min(prefix, count) for prefix, count in zip(prefixes, counts, strict=True)]


def _activity(approximations: Ints, count: int) -> Ints:
    """Context of details from approximations: the size of their second difference, without sign."""
    out = np.zeros((2, len(approximations)), np.int64)
    out[0, 1:-1] = np.abs(np.diff(approximations, 2))  # MRDWT-27
    out[1] = 3  # MRDWT-27
    return out if len(approximations) == count else out[:, :-1]  # the last is not yet known


def _magnitudes(details: Ints, coding: Coding) -> Ints:
    """Context of the next finer details: size and sign."""
    sizes = np.maximum(0, np.abs(details) - coding.least + 1)  # MRDWT-27
    return np.stack([sizes, np.where(details == 0, 0, np.where(details > 0, 1, 2))])


def _build_approximations(band: Ints, step: int, coding: Coding, has_details: bool) -> bytes:
    if not band.any() and not (coding.scaled and has_details):
        return b""
    codes = bytes((step,)) if coding.scaled else b""
    first = varint(_zigzag(int(band[0])))
    if (band == band[0]).all():
        return bytes((CONSTANT,)) + codes + first
    predictor, halves = choose_predictor(band)
    body = encode_stream(
        start_states("wavelet")[0],
        2 * len(band) + 256,
        lambda state, data: (
            code_approximations(state, data, band.copy(), len(band), predictor, scale_of(halves))
            < 0
        ),
        f"{coding.name}: an approximation",
    )
    return bytes((halves | predictor << 6,)) + codes + first + body


def _build_details(band: Ints, coarser: Ints, number: int, coding: Coding) -> bytes:
    if not band.any():
        return b""
    return encode_stream(
        start_states("wavelet")[number],
        2 * len(band) + 256,
        lambda state, data: (
            code_details(state, data, band.copy(), len(band), coarser, coding.shift, coding.least)
            < 0
        ),
        f"{coding.name}: a detail",
    )


def _parse_approximations(
    stream: bytes, count: int, prefix: int, coding: Coding
) -> tuple[Ints, int, bool]:
    """The first ``prefix`` of ``count`` approximations, the step code, and whether it is known."""
    band = np.zeros(prefix, np.int64)
    if not stream:
        return band, 0, not coding.scaled
    form, step, at = stream[0], 0, 1
    if coding.scaled:
        if len(stream) < 2:
            raise FormatError(
                f"{coding.name}: the stream of an approximation is truncated before its step"
            )
        step, at = stream[1], 2
    folded, at = read_varint(stream, at)
    first = (folded >> 1) ^ -(folded & 1)
    if abs(first) > MAX_INDEX:  # MRDWT-24
        raise FormatError(f"{coding.name}: first coefficient {first} is out of range")
    halves, predictor = form & 63, form >> 6
    if halves == CONSTANT:
        if predictor or at != len(stream):  # MRDWT-21, MRDWT-22
            raise FormatError(
                f"{coding.name}: form {form:#04x} does not fit the {len(stream) - at} bytes "
                "that follow"
            )
        return np.full(prefix, first, np.int64), step, True  # MRDWT-23
    band[:1] = first
    decode_stream(
        stream[at:],
        start_states("wavelet")[0],  # MRDWT-30
        lambda state, data: (
            code_approximations(state, data, band, prefix, predictor, scale_of(halves)) < 0
        ),
        f"{coding.name}: an approximation",
        whole=prefix == count,  # MRDWT-31
    )
    return band, step, True


def _parse_details(
    stream: bytes, count: int, prefix: int, coarser: Ints, number: int, coding: Coding
) -> Ints:
    band = np.zeros(prefix, np.int64)
    if stream:
        decode_stream(
            stream,
            start_states("wavelet")[number],  # MRDWT-30
            lambda state, data: (
                code_details(state, data, band, prefix, coarser, coding.shift, coding.least) < 0
            ),
            f"{coding.name}: a detail",
            whole=prefix == count,  # MRDWT-31
        )
    return band


def _zigzag(value: int) -> int:
    return 2 * value if value >= 0 else -2 * value - 1


DEAD_ZONE = 0.8  # of a step: smaller coefficients become 0, if the step follows the threshold
LEAST_UNIT = 2.0**-100
GREATEST_LEAST = 2**39
TOO_LARGE = 2.0**41  # in place of numbers beyond all integers: the coder refuses it, by name


@dataclass(frozen=True, slots=True)
class Quantizer:
    """Thresholds (n_channels,) and the quantization of a coefficient.

    With ``decimals`` it is rounded to so many, halves away from zero; otherwise steps follow the
    thresholds, as ``unit`` times the values of each channel's ``codes``.
    """

    thresholds: Floats
    decimals: int | None
    unit: float
    codes: tuple[int, ...]

    @property
    def least(self) -> int:
        """The least magnitude of details other than zero."""
        if self.decimals is None or not len(self.thresholds):
            return 1
        least = math.floor(float(self.thresholds.min()) * 10.0**self.decimals + 0.5)
        return min(max(1, least), GREATEST_LEAST)

    def indices(self, coefficients: Floats, channel: int, *, detail: bool) -> Ints:
        """The integers of one band of a channel."""
        sizes = np.abs(coefficients)
        with np.errstate(over="ignore"):
            if self.decimals is not None:
                scaled = sizes * 10.0**self.decimals
                small = sizes <= self.thresholds[channel]
            else:
                scaled = sizes / (self.unit * ratio_of(self.codes[channel]))
                small = scaled < DEAD_ZONE
        indices = np.floor(scaled + 0.5)
        if detail:
            indices[small] = 0
        # NaN too, if sums have overflowed
        capped = np.where(indices <= TOO_LARGE, indices, TOO_LARGE)
        return np.where(coefficients < 0, -capped, capped).astype(np.int64)


def make_quantizer(
    weights: Floats, T_g: float, decimals: int | None, name: str = "T_g"
) -> Quantizer:
    """The quantizer whose thresholds are T_g times ``weights``; ``name`` is that of T_g."""
    thresholds = T_g * weights
    unit = T_g / DEAD_ZONE if T_g > 0 else 1.0
    codes = tuple(code_of(float(weight)) for weight in weights)
    if decimals is None and (not T_g > 0 or unit < LEAST_UNIT):
        raise OptionError(f"with {name}={T_g:g} there is no quantizer step; give Q")
    return Quantizer(thresholds, decimals, unit, codes)
