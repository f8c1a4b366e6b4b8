"""Codec 16, preset ``awt``: wavelets in time, coefficients allocated to the channels.

SPEC.md, "Codec 16: wavelet", is normative; ``wavelet.py`` has the decoder, this file the encoder's
choices. Source: P. Beaudoin, P. Poulin, M. van de Panne, Adapting wavelet compression to human
motion capture clips, 2007, as M. A. Khan, An efficient algorithm for compression of motion capture
signal using multidimensional quadratic Bezier curve break-and-fit method, 2014, section 5,
describes it; the preset ``khan2014`` is the method of the latter, the defaults improve upon it.

Exactness: lossy; decoding is bit-exact (integers, then binary64 products and sums in the order that
SPEC.md states). A stream holds one channel at one resolution of one segment. An encoder needs the
whole clip in memory.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mcz.codecs.channel_weights import SAMPLED_FRAMES, weights_of
from mcz.codecs.contract import Encoded, SignalSource
from mcz.codecs.parameters import (
    MIDDLE_CODE,
    Dial,
    Parameter,
    choice,
    code_of,
    integer,
    number,
    preset_parameter,
    preset_values,
)
from mcz.codecs.segments import SEGMENT_FRAMES_PARAMETER, sample, segment_frames_of, skeleton_of
from mcz.codecs.wavelet import wavelet
from mcz.codecs.wavelet.reencode import recoder
from mcz.codecs.wavelet.streams import DEAD_ZONE, LEAST_UNIT, Quantizer, anneal
from mcz.codecs.wavelet.wavelet import (
    BITSTREAM,
    WAVELET,
    Frames,
    N,
    Plan,
    Q,
    Transform,
    transform_of,
)
from mcz.errors import MotionError
from mcz.model.types import Bools, Floats, Ints, Params, Settings

FRAMES_A_COEFFICIENT = 8  # by default
DISTORTIONS = ("positions", "channels")
PRESETS: dict[str, Settings] = {
    # As published: any coefficient may be dropped, the whole clip at once, and the requested levels
    # for any length.
    "khan2014": {"a_w": 40.0, "Q": 2, "N": 4, "wavelet": "db2", "distortion": "channels"},
    "default": {"a_w": None, "Q": None, "N": 4, "wavelet": "bior4.4", "distortion": "positions"},
}


def encode(source: SignalSource, params: Params) -> Encoded:
    """Encode the values of ``source`` with unwrapped rotations; invalid values are interpolated.

    Raises MotionError for a value that is not finite, OptionError for parameters that do not fit.
    """
    layout, published = source.layout, params["preset"] == "khan2014"
    chosen = preset_values(PRESETS, params)
    average = chosen["a_w"]
    if average is None:
        average = -(-layout.n_frames // FRAMES_A_COEFFICIENT)
    transform = transform_of(layout, chosen["wavelet"], chosen["N"], as_published=published)
    weights = _weights(source, chosen["distortion"])
    choice = choose(
        coefficients_of(source, transform),
        weights,
        average,
        whole_approximation=not published,
        iterations=params["iterations"],
        seed=params["seed"],
    )
    quantizer = quantizer_of(choice, weights, chosen["Q"])
    frames = segment_frames_of(layout, params["segment_frames"], as_published=published)
    return wavelet.encode(source, Plan("awt", transform, quantizer, frames, choice.kept))


def _weights(source: SignalSource, distortion: str) -> Floats:
    """The threshold of each channel relative to 1, (n_channels,)."""
    layout = source.layout
    skeleton = skeleton_of("awt", layout)
    if distortion == "channels":
        return np.ones(layout.n_channels)
    frames = sample(source, SAMPLED_FRAMES)
    return weights_of(skeleton, frames, "sensitivity", unit_aware=True)


def _weigh(source: SignalSource, options: Params) -> tuple[Floats, None]:
    """Weights of a clip that was encoded with these options; its thresholds are unknown."""
    return _weights(source, preset_values(PRESETS, options)["distortion"]), None


CODEC = BITSTREAM(
    preset=3,
    name="awt",
    encode=encode,
    recode=recoder(_weigh),
    dial=Dial("a_w", 2.0**-20, 2.0**40, rises=True),
    parameters=(
        preset_parameter(PRESETS),
        Parameter(
            "a_w",
            None,
            "coefficients a channel, on average; default: one for 8 frames",
            number("a_w", 0, 2.0**40),
        ),
        Parameter(
            "distortion",
            None,
            "what is lowered: positions (default), or the squared error of channels",
            choice("distortion", DISTORTIONS),
        ),
        Parameter(
            "iterations",
            None,
            "moves of the annealing; default 4000 a channel",
            integer("iterations", 0, 2**40),
        ),
        Parameter("seed", 0, "of the annealing", integer("seed", 0, 2**31 - 1)),
        Q,
        N,
        WAVELET,
        SEGMENT_FRAMES_PARAMETER,
    ),
)


Masks = list[Bools]

LARGEST = 2.0**90
BLOCK_FRAMES = 4096  # analyzed at a time
MOVES = 4000  # of the annealing, for each channel
FINEST = 2.0**-24  # of the greatest coefficient of a channel: the least step
FEWEST_MOVES, MOST_MOVES = 100_000, 20_000_000


@dataclass(frozen=True, slots=True)
class Choice:
    """The allocation that annealing has found.

    ``kept`` are masks band by band, the coarsest first. By channel: ``counts`` of chosen
    coefficients; ``smallest``, the least magnitude of one, and ``smallest_detail``, infinite
    without any; ``dropped``, the greatest of the others, 0 if there are none; ``greatest`` of all.
    The distortion ``before`` and ``after`` annealing is relative to the greatest coefficient.
    """

    kept: Masks
    counts: Ints
    smallest: Floats
    smallest_detail: Floats
    dropped: Floats
    greatest: Floats
    before: float
    after: float


def coefficients_of(source: SignalSource, transform: Transform) -> list[Floats]:
    """The bands of a whole clip, the coarsest first, (coefficients, channels)."""
    frames = Frames("awt", source, transform.wavelet, transform.levels)
    unit, n_frames = 1 << transform.levels, source.layout.n_frames
    length = -(-BLOCK_FRAMES // unit) * unit
    parts = []
    for first in range(0, n_frames, length):
        stop = min(first + length, n_frames)
        parts.append(frames.coefficients(first, stop))
        frames.keep(first, stop)
    if not parts:
        return [np.zeros((0, source.layout.n_channels))] * (transform.levels + 1)
    return [np.concatenate(band) for band in zip(*parts, strict=True)]


def choose(
    bands: Sequence[Floats],
    weights: Floats,
    average: float,
    *,
    whole_approximation: bool,
    iterations: int | None,
    seed: int,
) -> Choice:
    """Keep ``average`` coefficients a channel, those that lower the distortion most.

    An error counts in units of its channel's ``weights`` (n_channels,). With
    ``whole_approximation`` approximations that were not chosen are kept too: they cost little, and
    are as good as zero if steps are as large as they. Raises MotionError for too large a
    coefficient.
    """
    n_bands = [len(band) for band in bands]
    sizes = np.abs(np.concatenate(bands)).T
    if not (sizes <= LARGEST).all():  # phrased so that NaN fails too: sums have overflowed
        raise MotionError("awt: a coefficient exceeds 2^90")
    n_channels, n_each = sizes.shape
    order = np.argsort(-sizes, axis=1, kind="stable")
    ranked = np.take_along_axis(sizes, order, axis=1)
    scale = float(np.max(ranked, initial=0.0)) or 1.0
    tails = np.zeros((n_channels, n_each + 1))
    tails[:, :-1] = np.cumsum((ranked / scale / weights[:, None])[:, ::-1] ** 2, axis=1)[:, ::-1]
    worth = np.count_nonzero(ranked, axis=1)  # a zero needs no keeping
    counts = equal_counts(worth, average)
    before = float(tails[np.arange(n_channels), counts].sum())
    if iterations is None:
        iterations = min(max(FEWEST_MOVES, MOVES * n_channels), MOST_MOVES)
    starts = np.arange(n_channels) * (n_each + 1)
    after = anneal(counts, worth, starts, tails.ravel(), iterations, seed)
    kept = np.zeros((n_channels, n_each), np.bool_)
    np.put_along_axis(kept, order, np.arange(n_each) < counts[:, None], axis=1)
    masked = np.where(kept, sizes, np.inf)
    dropped = np.max(np.where(kept, 0.0, sizes), axis=1, initial=0.0)
    if whole_approximation:
        kept[:, : n_bands[0]] = True
    return Choice(
        np.split(kept.T, np.cumsum(n_bands)[:-1]),
        counts,
        np.min(masked, axis=1, initial=np.inf),
        np.min(masked[:, n_bands[0] :], axis=1, initial=np.inf),
        dropped,
        np.max(sizes, axis=1, initial=0.0),
        before,
        float(after),
    )


def quantizer_of(choice: Choice, weights: Floats, decimals: int | None) -> Quantizer:
    """Quantizer that separates kept from dropped coefficients.

    Without ``decimals`` thresholds are as nearly proportional to ``weights`` as possible.
    """
    if decimals is not None:
        some = np.isfinite(choice.smallest_detail)
        below = np.nextafter(choice.smallest_detail, 0.0)
        thresholds = np.where(some, below, np.max(below[some], initial=0.0))
        return Quantizer(thresholds, decimals, 1.0, (MIDDLE_CODE,) * len(weights))
    some = np.isfinite(choice.smallest)
    floor = FINEST * choice.greatest
    left_out = choice.dropped / weights
    typical = float(np.median(left_out[some]) if some.any() else np.max(left_out, initial=0.0))
    typical = max(typical, float(np.max(floor / weights, initial=0.0)), LEAST_UNIT)
    thresholds = np.clip(typical * weights, choice.dropped, choice.smallest)
    thresholds = np.maximum(thresholds, floor)
    codes = tuple(code_of(float(ratio)) for ratio in thresholds / typical)
    return Quantizer(thresholds, None, typical / DEAD_ZONE, codes)


def equal_counts(most: Ints, average: float) -> Ints:
    """Counts per channel, each at most ``most``, as equal as possible.

    Their sum is ``average`` a channel, or the number of all.
    """
    total = round(min(average * len(most), 2.0**52))
    low, high = 0, int(most.max(initial=0))
    while low < high:  # the greatest common count within the total
        middle = (low + high + 1) // 2
        if int(np.minimum(middle, most).sum()) <= total:
            low = middle
        else:
            high = middle - 1
    counts = np.minimum(low, most)
    more = np.flatnonzero(counts < most)
    counts[more[: max(0, total - int(counts.sum()))]] += 1
    return np.asarray(counts, np.int64)
