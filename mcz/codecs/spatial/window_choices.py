"""Encoder fit of bases to a whole clip, and the number worth their bytes.

Source: Hou 2016, sections 2 and 5.4; mcz/codecs/spatial/README.md describes it. Results may differ
in the last bits between machines; decoded values do not.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from mcz.codecs.basis_models import (
    MAX_ENTRIES,
    MAX_ENTRY,
    MAX_POINTS,
    MAX_SHIFT,
    Basis,
    build_model,
    round_vectors,
)
from mcz.codecs.contract import Model, SignalSource, model_id
from mcz.codecs.parameters import Parameter, Presets, integer, number, preset_parameter, ratio_of
from mcz.codecs.segments import SEGMENT_FRAMES_PARAMETER
from mcz.codecs.source_readers import FrameReader
from mcz.codecs.space import (
    APART,
    COSINES,
    COURSES,
    LEARNED,
    MEAN,
    WEIGHTED,
    SpaceFields,
    columns_of,
)
from mcz.codecs.space_choices import CODER, DOMAIN, STEP, VIRTUAL_MARKERS, Sample
from mcz.codecs.spatial.windows import MAX_WINDOW, Plan
from mcz.codecs.transforms.bases import dct_matrix
from mcz.errors import MotionError
from mcz.model.types import Floats, Ints, Params

LARGEST = 2.0**60  # steps: a window with such a value has a coefficient beyond 2^40 steps
BIT = math.log(2) / 4  # squared steps that a bit is worth; log(2) / 6 would be right for fine steps
THRESHOLD = 0.7  # of a step: smaller coefficients become 0
PER_ONE, PER_OCTAVE = 2.0, 1.5  # about the bits of a coefficient that is not zero
ENTRY, ENTRY_OCTAVE = 0.5, 1.2  # estimated bits of an entry of a basis
LESS_DIGITS = 1.0  # of a vector's entries than log2 of all its coefficients' size in steps
MEAN_STEPS = 8  # a mean is exact to a step divided by this
LONGEST = 1024  # frames: courses of longer windows are too many
ROOM = MAX_ENTRIES - 2**15  # for vectors and courses, in addition to a mean


@dataclass(frozen=True, slots=True)
class Fit:
    """Fit of a whole clip, independent of the step.

    ``columns`` (n_matrices, n_points) are the channels of each matrix, ``vectors`` of each an
    orthonormal basis (n_points, n_points), the vector with the greatest ``energies`` (n_points,),
    sums over all frames, first. ``courses`` (window, window) are such vectors in time, as
    coefficients of cosines; None without. ``mean`` (n_channels,), in units of the weights, was
    subtracted; ``stored`` is the same as a basis.
    """

    columns: Ints
    vectors: tuple[Floats, ...]
    energies: tuple[Floats, ...]
    mean: Floats
    stored: Basis | None = None
    courses: Floats | None = None
    course_energies: Floats | None = None


@dataclass(frozen=True, slots=True)
class WindowOptions:
    """Settings of the caller; None: the encoder chooses."""

    step: float
    window: int
    threshold: float
    segment_frames: int
    prefix: bool
    rank: int | None
    frequencies: int | None


def window_options(params: Params, chosen: Params, step: float) -> WindowOptions:
    """Convert parameters to options; ``chosen`` are settings of a preset."""
    return WindowOptions(
        step,
        chosen["window"],
        chosen["threshold"],
        params["segment_frames"] or 0,
        chosen["coder"] == "prefix",
        params["rank"],
        params["frequencies"],
    )


class Windows:
    """A signal window by window, repeatable, in units of the channels' weights."""

    def __init__(
        self, name: str, source: SignalSource, sample: Sample, options: WindowOptions
    ) -> None:
        self.name, self.source, self.sample = name, source, sample
        n_frames = source.layout.n_frames
        self.n_frames, self.window = n_frames, max(1, min(options.window, n_frames))
        self.step, self.limit = options.step, LARGEST * options.step
        self.weights = np.ones(source.layout.n_channels)
        if sample.codes is not None:
            self.weights = np.array([ratio_of(code) for code in sample.codes])

    def __iter__(self) -> Iterator[Floats]:
        """Yield blocks (frames, n_channels); raises MotionError for values that cannot be coded."""
        reader = FrameReader(self.name, self.source)
        for start in range(0, self.n_frames, self.window):
            with np.errstate(over="ignore"):
                values = reader.next(min(start + self.window, self.n_frames)) / self.weights
            if np.abs(values).max(initial=0.0) > self.limit:
                raise MotionError(f"{self.name}: a coefficient exceeds 2^40 quantizer steps")
            yield values


def plan_of(
    name: str,
    source: SignalSource,
    sample: Sample,
    options: WindowOptions,
    *,
    apart: bool,
    mean: bool,
    courses: bool,
) -> Plan:
    """The plan of an encoder: as many bases of the clip itself as are worthwhile.

    ``apart``: x, y and z have bases of their own; ``mean``: it is subtracted first; ``courses``:
    there is a basis in time too, unless windows are too long. Raises MotionError for values that
    cannot be coded.
    """
    windows = Windows(name, source, sample, options)
    courses = courses and windows.window <= LONGEST
    fields = SpaceFields(
        flags=WEIGHTED if sample.codes else 0,
        basis=COSINES,
        model=None,
        step=options.step,
        weights=list(sample.codes) if sample.codes else None,
    )
    models: tuple[Model, ...] = ()
    n_frequencies = windows.window
    if windows.n_frames and len(windows.weights):
        if len(windows.weights) > MAX_POINTS * (3 if apart else 1):
            raise MotionError(f"{name}: {len(windows.weights)} channels are more than {MAX_POINTS}")
        clip_fit = fit(windows, apart=apart, mean=mean, courses=courses)
        bases, n_frequencies = _bases(windows, clip_fit, options)
        models = (build_model(bases),)
        fields.basis, fields.model = LEARNED, model_id(models[0])
        candidates = ((APART, apart), (MEAN, mean), (COURSES, courses))
        fields.flags |= sum(flag for flag, is_there in candidates if is_there)
    return Plan(
        windows.window,
        n_frequencies,
        fields,
        models,
        (),
        options.threshold,
        options.segment_frames,
        options.prefix,
    )


def fit(windows: Windows, *, apart: bool, mean: bool, courses: bool) -> Fit:
    """Bases of all windows together: eigenvectors of the sum of their products."""
    columns = columns_of(len(windows.weights), apart=apart)
    average, stored = _mean(windows) if mean else (np.zeros(len(windows.weights)), None)
    in_space = [np.zeros((part.size, part.size)) for part in columns]
    in_time = np.zeros((windows.window, windows.window))
    for values in windows:
        rest = values - average
        for total, part in zip(in_space, columns, strict=True):
            total += rest[:, part].T @ rest[:, part]
        if courses and len(rest) == windows.window:
            cosines = dct_matrix(len(rest)) @ rest
            in_time += cosines @ cosines.T
    pairs = [_principal(total.astype("<f8").tobytes(), len(total)) for total in in_space]
    vectors, energies = (tuple(parts) for parts in zip(*pairs, strict=True))
    in_courses = (
        _principal(in_time.astype("<f8").tobytes(), len(in_time)) if courses else (None, None)
    )
    return Fit(columns, vectors, energies, average, stored, *in_courses)


def _mean(windows: Windows) -> tuple[Floats, Basis]:
    """The mean of all frames, and its stored form; if that is far off, it replaces the mean.

    It is rounded to parts of a step, or as fine as possible.
    """
    total = first = None
    # relative to the first frame, so that constant channels have no rounding
    for values in windows:
        first = values[0] if first is None else first
        part = (values - first).sum(axis=0)
        total = part if total is None else total + part
    assert first is not None and total is not None
    mean = first + total / windows.n_frames
    plain = mean * windows.weights
    finest = MEAN_STEPS / (windows.step * float(windows.weights.min()))
    finest = min(finest, MAX_ENTRY / max(float(np.abs(plain).max()), 1.0))
    shift = np.clip(np.floor(np.log2(finest)), 0, MAX_SHIFT).astype(np.int64)
    entries = np.clip(np.rint(np.ldexp(plain, shift)), -MAX_ENTRY, MAX_ENTRY)
    stored = Basis(shift[None], entries[None].astype(np.int64))
    near = stored.vectors[0] / windows.weights
    is_off = float(np.abs(near - mean).max()) > windows.step / MEAN_STEPS
    return near if is_off else mean, stored


@lru_cache(maxsize=8)
def _principal(products: bytes, n: int) -> tuple[Floats, Floats]:
    """Unit eigenvectors (n, n) of a matrix of products, as rows, and their energies (n,).

    The greatest comes first; the largest entry of each is positive.
    """
    energies, vectors = np.linalg.eigh(np.frombuffer(products, "<f8").reshape(n, n))
    vectors = vectors.T[::-1]
    largest = np.take_along_axis(vectors, np.abs(vectors).argmax(axis=1)[:, None], axis=1)
    return vectors * np.where(largest < 0, -1.0, 1.0), np.maximum(energies[::-1], 0.0)


def _bases(
    windows: Windows, clip_fit: Fit, options: WindowOptions
) -> tuple[list[Basis | Floats], int]:
    limit = ROOM if clip_fit.courses is None else ROOM // 2
    most = min(clip_fit.columns.shape[1], limit // clip_fit.columns.size)
    spatial = [
        _round_vectors(vectors[:most], energies[:most], options.step)
        for vectors, energies in zip(clip_fit.vectors, clip_fit.energies, strict=True)
    ]
    in_time: Basis | None = None
    if clip_fit.courses is not None and clip_fit.course_energies is not None:
        in_time = _round_vectors(clip_fit.courses, clip_fit.course_energies, options.step)
    gains = _gains(windows, clip_fit, [len(b.shifts) for b in spatial], in_time, options)
    ranks, n_frequencies = _counts(gains, spatial, in_time, options)
    bases: list[Basis | Floats] = [
        _truncate_basis(b, r) for b, r in zip(spatial, ranks, strict=True)
    ]
    if in_time is not None:
        in_time = _truncate_basis(in_time, n_frequencies)
        n_used = int(np.flatnonzero(in_time.entries.any(axis=0)).max(initial=0)) + 1
        n_used = max(n_used, n_frequencies)
        bases.append(Basis(in_time.shifts, in_time.entries[:, :n_used]))
    if clip_fit.stored is not None:
        bases.append(clip_fit.stored)
    return bases, n_frequencies


def _round_vectors(vectors: Floats, energies: Floats, step: float) -> Basis:
    """Round entries to the digits at which a further one would cost as much as it gains."""
    least = math.ceil(math.log2(vectors.shape[1]) / 2) + 1  # or a vector is rounded away
    sizes = np.sqrt(energies) / step
    digits = np.ceil(np.log2(np.maximum(sizes, 1.0)) - LESS_DIGITS)
    return round_vectors(vectors, np.clip(digits, least, MAX_SHIFT).astype(np.int64))


def _truncate_basis(basis: Basis, count: int) -> Basis:
    return Basis(basis.shifts[:count], basis.entries[:count])


def _gains(
    windows: Windows,
    clip_fit: Fit,
    counts: Sequence[int],
    in_time: Basis | None,
    options: WindowOptions,
) -> list[Floats]:
    """Gain of each coefficient over all windows, in squared steps: (vectors, frequencies).

    That is the error without it less that with it, less its bits.
    """
    n_frequencies = windows.window if in_time is None else len(in_time.shifts)
    gains = [np.zeros((count, n_frequencies)) for count in counts]
    for values in windows:
        temporal = dct_matrix(len(values))[:n_frequencies]
        if clip_fit.courses is not None and len(values) == windows.window:
            temporal = clip_fit.courses[:n_frequencies] @ dct_matrix(len(values))
        rows = (temporal @ ((values - clip_fit.mean) / options.step)).T
        parts = zip(gains, clip_fit.columns, clip_fit.vectors, strict=True)
        for gain, columns, vectors in parts:
            sizes = np.abs(vectors[: len(gain)] @ rows[columns])
            worth = sizes**2 - 1 / 12 - BIT * (PER_ONE + PER_OCTAVE * np.log2(1 + sizes))
            gain[:, : sizes.shape[1]] += np.where(sizes >= options.threshold, worth, 0.0)
    return gains


def _counts(
    gains: Sequence[Floats], spatial: Sequence[Basis], in_time: Basis | None, options: WindowOptions
) -> tuple[list[int], int]:
    """The vectors of each matrix and the frequencies with which the sum of gains is greatest."""
    total = np.zeros(gains[0].shape[1])
    if in_time is not None:
        total -= _cost(in_time)[: len(total)]
    ranks: list[Ints] = []
    for gain, basis in zip(gains, spatial, strict=True):
        sums = gain.cumsum(axis=0).cumsum(axis=1) - _cost(basis)[:, None]
        best = sums.argmax(axis=0)
        if options.rank is not None:
            best = np.full(len(best), min(options.rank, len(basis.shifts)) - 1)
        total += np.take_along_axis(sums, best[None], axis=0)[0]
        ranks.append(best)
    at = int(total.argmax()) if options.frequencies is None else options.frequencies - 1
    at = min(at, len(total) - 1)
    return [int(best[at]) + 1 for best in ranks], at + 1


def _cost(basis: Basis) -> Floats:
    """The bits of the first vectors in squared steps, (n_vectors,)."""
    bits = (ENTRY + ENTRY_OCTAVE * np.log2(1.0 + np.abs(basis.entries))).sum(axis=1)
    result: Floats = BIT * (bits + 8).cumsum()
    return result


def parameters_of(presets: Presets) -> tuple[Parameter, ...]:
    """Parameters of a codec with these presets."""
    window = presets["default"]["window"]
    return (
        preset_parameter(presets),
        STEP,
        Parameter(
            "window", None, f"frames a window; default {window}", integer("window", 1, MAX_WINDOW)
        ),
        Parameter(
            "threshold",
            None,
            f"threshold in steps, below which coefficients become 0; default {THRESHOLD}",
            number("threshold", 0.5, 2.0**20),
        ),
        Parameter(
            "rank",
            None,
            "vectors of each basis in space; default: as many as pay",
            integer("rank", 1, MAX_POINTS),
        ),
        Parameter(
            "frequencies",
            None,
            "coefficients of each row in time; default: as many as pay",
            integer("frequencies", 1, MAX_WINDOW),
        ),
        CODER,
        DOMAIN,
        VIRTUAL_MARKERS,
        SEGMENT_FRAMES_PARAMETER,
    )
