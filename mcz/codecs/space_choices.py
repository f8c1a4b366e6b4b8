"""Encoder choice of bases, weights and a step.

Source: Hou 2016; mcz/codecs/spatial/README.md describes it.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from mcz.codecs.basis_models import (
    MAX_POINTS,
    Basis,
    build_model,
    falling_digits,
    known_models,
    parse_bases,
    read_bases,
    round_vectors,
)
from mcz.codecs.channel_weights import RULES, weights_of
from mcz.codecs.contract import Layout, Model, SignalSource, model_id
from mcz.codecs.parameters import Parameter, choice, code_of, in_range, integer, number, ratio_of
from mcz.codecs.segments import skeleton_of
from mcz.codecs.source_readers import fill_gaps
from mcz.codecs.space import (
    APART,
    COSINES,
    LEARNED,
    N_COORDINATES,
    WEIGHTED,
    SpaceFields,
    columns_of,
)
from mcz.codecs.transforms.bases import dct_matrix, learn_basis
from mcz.errors import AccessError, MotionError, OptionError, reason_of
from mcz.kinematics.angles import Unwrapper
from mcz.model.motion import POSITION_KINDS, Skeleton
from mcz.model.types import Floats

DEFAULT_SHARE = 1 / 100  # of the spread of a clip's points: the default step
DEFAULT_DEGREES = 0.2  # of channels: the step for a rotation of average effect
THRESHOLD = 0.6  # of a step: smaller coefficients become 0
BLOCKS, BLOCK_FRAMES = 16, 240  # sample of an encoder
SPARSITY, ITERATIONS = 12, 30  # of bases of the clip itself, from its principal components on
MOST_DIGITS, LEAST_DIGITS = 7, 3  # binary digits of the first and the last vectors of such bases
LARGEST = 2.0**80
LEAST, MOST = 2.0**-60, 2.0**60  # steps
WHICH = ("auto", "known", "cosines", "learned")


InTime = Callable[[Floats], Floats]


def cosines(block: Floats) -> Floats:
    """Coefficients in time of a block of frames, (frames, n_channels)."""
    return dct_matrix(len(block)) @ block


def frame_differences(block: Floats) -> Floats:
    """Differences between consecutive frames of a block."""
    return np.asarray(np.diff(block, axis=0), np.float64)


@dataclass(frozen=True, slots=True)
class Choice:
    """Chosen fields of SPACE, and the models that they name."""

    fields: SpaceFields
    models: tuple[Model, ...] = ()
    known: tuple[Model, ...] = ()


@dataclass(frozen=True, slots=True)
class Sample:
    """Sampled blocks of frames, (frames, n_channels) each, gaps filled, in units of weights."""

    blocks: tuple[Floats, ...]
    apart: bool
    codes: tuple[int, ...] | None  # of the weights
    n_frames: int  # of the whole signal

    @property
    def frames(self) -> Floats:
        return np.concatenate(self.blocks)

    def matrices(self, frames: Floats) -> list[Floats]:
        """The points of each matrix, (frames, n_points)."""
        return [frames[:, columns] for columns in columns_of(frames.shape[1], apart=self.apart)]


def sample_of(name: str, source: SignalSource) -> Sample:
    """Sample a signal; raises MotionError for one that the codec cannot code."""
    layout = source.layout
    skeleton = skeleton_of(name, layout)
    apart = are_positions(skeleton)
    if layout.n_channels // (N_COORDINATES if apart else 1) > MAX_POINTS:
        raise MotionError(
            f"{name}: {layout.n_channels} channels exceed the {MAX_POINTS} of a matrix"
        )
    size = min(layout.n_frames, BLOCK_FRAMES)
    last = layout.n_frames - size
    n_blocks = min(BLOCKS, max(1, layout.n_frames // BLOCK_FRAMES))
    starts = sorted({round(last * k / max(1, n_blocks - 1)) for k in range(n_blocks)})
    blocks = [_block(skeleton, source, start, start + size) for start in starts if size]
    if any(np.abs(block).max(initial=0.0) > LARGEST for block in blocks):
        raise MotionError(f"{name}: a coefficient exceeds 2^40 quantizer steps")
    if not blocks:
        blocks = [np.zeros((0, layout.n_channels))]
    return _sample(skeleton, blocks, layout.n_frames)


def _sample(skeleton: Skeleton, blocks: Sequence[Floats], n_frames: int) -> Sample:
    """``blocks`` in units of weights, which positions do without."""
    if are_positions(skeleton) or not skeleton.n_channels:
        return Sample(tuple(blocks), are_positions(skeleton), None, n_frames)
    weights = weights_of(skeleton, np.concatenate(blocks), RULES[0], unit_aware=True)
    codes = tuple(code_of(float(weight)) for weight in weights)
    scales = np.array([ratio_of(code) for code in codes])
    return Sample(tuple(block / scales for block in blocks), False, codes, n_frames)


def _block(skeleton: Skeleton, source: SignalSource, start: int, stop: int) -> Floats:
    values = np.asarray(source.values(start, stop), np.float64)
    valid = source.valid(start, stop)
    valid = np.isfinite(values) if valid is None else valid & np.isfinite(values)
    unwrapped = Unwrapper(skeleton)(np.where(valid, values, np.nan))
    return fill_gaps(unwrapped, valid, np.full(values.shape[1], np.nan))


def are_positions(skeleton: Skeleton) -> bool:
    """Return True if the channels are x, y and z of one point after the other."""
    kinds = [channel.kind for channel in skeleton.channels]
    return bool(kinds) and kinds == list(POSITION_KINDS) * (len(kinds) // N_COORDINATES)


def default_step(sample: Sample) -> float:
    """The default step: a share of the spread of a frame's points."""
    if not sample.apart:
        return DEFAULT_DEGREES
    parts = [part for part in sample.matrices(sample.frames) if part.size]
    spread = math.sqrt(sum(float(np.mean(part.var(axis=1))) for part in parts))
    return min(max(spread * DEFAULT_SHARE, LEAST), MOST) if 0 < spread < math.inf else 1.0


def choose_space(name: str, sample: Sample, step: float, basis: str, in_time: InTime) -> Choice:
    """Choose the bases that ``basis`` names, or those with the smallest estimated size.

    ``in_time`` is the codec's transform over time before the one in space. Raises OptionError if
    the named one does not fit.
    """
    fields = SpaceFields(
        flags=(APART if sample.apart else 0) | (WEIGHTED if sample.codes else 0),
        basis=COSINES,
        model=None,
        step=step,
        weights=list(sample.codes) if sample.codes else None,
    )
    frames = sample.frames
    if not frames.shape[1]:
        return Choice(fields)
    n_points = [part.shape[1] for part in sample.matrices(frames)]
    candidates: list[tuple[Choice, list[Floats]]] = []
    if basis in ("auto", "cosines") or not len(frames):
        candidates.append((Choice(fields), [dct_matrix(n) for n in n_points]))
    known = [m for m in known_models().values() if _fits(m, n_points)] if basis != "learned" else []
    if basis in ("auto", "known"):
        candidates += [(_with_model(fields, known=model), _vectors(model)) for model in known]
    if len(frames) and (basis == "learned" or (basis == "auto" and not known)):
        model = learn_model(sample)
        candidates.append((_with_model(fields, model=model), _vectors(model)))
    if basis not in WHICH:
        model = _read_model(basis)
        if not _fits(model, n_points):
            raise OptionError(f"{name}: the bases of {basis} do not fit {n_points} points")
        candidates.append((_with_model(fields, model=model), _vectors(model)))
    if not candidates:
        raise OptionError(f"{name}: no well-known bases have {n_points} points")
    if len(candidates) == 1:
        return candidates[0][0]
    sizes = [_expected_bytes(sample, in_time, v, step, c.models) for c, v in candidates]
    return candidates[sizes.index(min(sizes))][0]


def live_choice(name: str, layout: Layout, step: float | None, basis: str) -> Choice:
    """Choose a space before any frame is known: well-known bases, or else cosines.

    Raises OptionError without a step, or if ``basis`` names bases of the motion itself.
    """
    if step is None:
        raise OptionError(f"{name}: a live stream needs a step")
    sample, basis = live_sample(name, layout, basis)
    return choose_space(name, sample, step, basis, frame_differences)


def live_sample(name: str, layout: Layout, basis: str) -> tuple[Sample, str]:
    """A sample without frames, and the bases available then; raises OptionError for others."""
    if basis == "learned":
        raise OptionError(
            f"{name}: basis=learned needs all frames; learn a basis beforehand with mcz train"
        )
    skeleton = skeleton_of(name, layout)
    n_points = layout.n_channels // (N_COORDINATES if are_positions(skeleton) else 1)
    if n_points > MAX_POINTS:
        raise MotionError(f"{name}: {n_points} points exceed the {MAX_POINTS} of a matrix")
    sample = _sample(skeleton, [np.zeros((1, layout.n_channels))], 0)
    return sample, basis_at_hand(sample) if basis == "auto" else basis


def basis_at_hand(sample: Sample) -> str:
    """The bases that do not depend on the motion: well-known ones if some fit, or cosines."""
    n_points = [part.shape[1] for part in sample.matrices(sample.frames)]
    fits = any(_fits(model, n_points) for model in known_models().values())
    return "known" if fits else "cosines"


def _with_model(
    fields: SpaceFields, model: Model | None = None, known: Model | None = None
) -> Choice:
    used = model or known
    assert used is not None
    fields = replace(fields, basis=LEARNED, model=model_id(used))
    return Choice(fields, (model,) if model else (), (known,) if known else ())


def _read_model(path: str) -> Model:
    try:
        return read_bases(Path(path))
    except OSError as error:
        raise AccessError(reason_of(error), path=path) from None


def _fits(model: Model, n_points: Sequence[int]) -> bool:
    shapes = [basis.entries.shape for basis in parse_bases(model.data)]
    return shapes == [(n, n) for n in n_points]


def _vectors(model: Model) -> list[Floats]:
    return [basis.vectors for basis in parse_bases(model.data)]


def learn_model(sample: Sample) -> Model:
    """Bases of the changes from frame to frame, computed once for the same sample.

    For a single frame they are of the frame itself.
    """
    steps = np.concatenate([frame_differences(block) for block in sample.blocks])
    if not len(steps):
        steps = sample.frames
    digest = hashlib.sha256(steps.tobytes()).digest()
    return _learn_cached(digest, _SampleKey(steps), sample.apart)


class _SampleKey:
    """Steps that compare by their digest as the key of a cache."""

    def __init__(self, steps: Floats) -> None:
        self.steps = steps

    def __hash__(self) -> int:
        return 0

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _SampleKey)


@lru_cache(maxsize=4)
def _learn_cached(_digest: bytes, key: _SampleKey, apart: bool) -> Model:
    bases: list[Basis | Floats] = []
    for columns in columns_of(key.steps.shape[1], apart=apart):
        points = key.steps[:, columns]
        learned_basis = learn_basis(
            points,
            sparsity=min(SPARSITY, points.shape[1]),
            iterations=ITERATIONS,
            growth=0,
            start=np.ascontiguousarray(np.linalg.eigh(points.T @ points)[1].T),
        )
        digits = falling_digits(len(learned_basis.basis), MOST_DIGITS, LEAST_DIGITS)
        bases.append(round_vectors(learned_basis.basis, digits))
    return build_model(bases)


def _expected_bytes(
    sample: Sample, in_time: InTime, vectors: Sequence[Floats], step: float, models: Sequence[Model]
) -> float:
    """Estimated size of the signal with these vectors, including their models."""
    bits = 0.0
    for block in sample.blocks:
        for part, basis in zip(sample.matrices(in_time(block)), vectors, strict=True):
            sizes = np.abs(part @ np.linalg.inv(basis)) / step
            # Small ones count too: changes add up until they are coded, and a basis that spreads
            # them thinly must not pass for one that needs no coefficients.
            bits += 1.5 * float(np.log2(1 + sizes).sum())
            bits += 2.0 * float(np.minimum(1.0, sizes).sum())
    looked_at = sum(map(len, sample.blocks))
    whole = sample.n_frames / looked_at if looked_at else 0.0
    return bits / 8 * whole + sum(len(model.data) for model in models)


def _parse_basis(text: object) -> str:
    if not isinstance(text, (str, Path)):
        raise OptionError(f"basis is {text!r}; it must be {', '.join(WHICH)} or a file name")
    return str(text)


STEP = Parameter(
    "step",
    None,
    "quantizer step, in length units of positions, in degrees of average effect of channels; "
    "default: 1/100 of the points' spread, 0.2 degrees",
    number("step", LEAST, MOST),
)
THRESHOLD_PARAMETER = Parameter(
    "threshold",
    None,
    f"threshold in steps, below which coefficients become 0; default {THRESHOLD}",
    number("threshold", 0.5, 2.0**20),
)
BASIS = Parameter(
    "basis",
    "auto",
    f"{', '.join(WHICH)}, or a file that mcz train wrote",
    in_range(f"{', '.join(WHICH)}, a path", _parse_basis),
)
CODER = Parameter(
    "coder",
    None,
    "mixed, the default, or prefix: prefix codes after Huffman, as published",
    choice("coder", ("mixed", "prefix"), {"adaptive": "mixed"}),
)
DOMAIN = Parameter(
    "domain",
    "positions",
    "positions: the positions of the points are coded; channels: the channels as they are",
    choice("domain", ("positions", "channels")),
)


def _flag(text: object) -> bool:
    words = {"true": True, "yes": True, "1": True, "false": False, "no": False, "0": False}
    flag = words.get(str(text).lower())
    if flag is None:
        raise OptionError(f"virtual_markers is {text!r}; it must be true or false")
    return flag


VIRTUAL_MARKERS = Parameter(
    "virtual_markers",
    False,
    "with positions: three virtual markers a joint, too, so that its roll is kept",
    in_range("true, false", _flag),
)
WINDOW = Parameter(
    "window", None, "frames a window, which is the delay; default 240", integer("window", 1, 2048)
)
