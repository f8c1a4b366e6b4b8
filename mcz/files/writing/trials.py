"""Trials of parameters: the clip is written to memory, and what a reader decodes is measured.

``meet_bound`` meets a greatest error by finer steps in frames that miss it, ``weigh_joints`` the
mean errors of joints by a weight for each.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.contract import Codec
from mcz.codecs.parameters import Dial
from mcz.container.limits import Profile
from mcz.container.reader import Container
from mcz.container.source import open_source
from mcz.errors import ContactWarning, MotionError, OptionError
from mcz.files.reading.clip import Clip
from mcz.files.reading.sizes import clip_sizes
from mcz.files.writing.clip_writer import Trial, with_values, write_trial
from mcz.files.writing.planning import MEAN_ERROR, Prepared
from mcz.kinematics.joint_names import find_joints
from mcz.kinematics.metrics import Comparison, compare
from mcz.kinematics.metrics.sums import channel_errors
from mcz.kinematics.points import positions_of
from mcz.model.motion import Motion
from mcz.model.types import Floats, JsonObject, Params

BLOCK_FRAMES = 4096  # with positions in memory at a time

REFINEMENT = "refinement"
MOST_OCTAVES = 7
MOST_ROUNDS = 10  # with one step
WIDER = 4  # rounds after which frames one farther away are refined, too
MOST_STEPS = 6
FINER = 0.85  # from one step to the next
USUAL_STEP = 1.0  # of a bound of channels, whose steps follow from it
MOST_CALIBRATIONS = 3
MOST_MEANS, MOST_QUARTERS = 12, 100
COMMON = 0.9  # share of the frames whose error, in bounds, should be within a range
LEAST_COMMON, WANTED_COMMON, MOST_COMMON = 0.55, 0.75, 1.1
MARGIN = 0.3  # octaves added to the miss of a frame
Limits = Sequence[tuple[str, float]]  # a joint or a group of joints, and its limit in cm
QUALITY, WEIGHTS, LIKE, MEMORY = "quality", "weights", "like", "memory"
MOST_WEIGHINGS = 8
OVERCORRECTION = 1.15  # growth of a weight relative to the square of the miss
MOST_WEIGHT = 2.0**24


@dataclass(frozen=True, slots=True)
class Target:
    """A target: the figure of that name must not exceed ``limit``.

    ``falls``: the figure falls as the files get smaller (a size), instead of rising (an error).
    ``weights``, (n_channels,), multiply the errors of channels; None for other figures.
    """

    name: str
    limit: float
    falls: bool
    weights: Floats | None = None


class Trials:
    """The figures of a clip at one setting of the dial, measured on a file in memory."""

    def __init__(self, motion: Motion, codec: Codec, params: Params, profile: Profile) -> None:
        self.motion, self.codec, self.params, self.profile = motion, codec, params, profile
        self.alone = replace(motion, signals=motion.signals[:1])
        self.others = 0.0  # bytes of the further signals, which no dial changes
        # Choices of the first trial, for all, and what they need not repeat.
        self.kept: JsonObject = {MEMORY: codec.memory()} if codec.memory else {}

    def with_params(self, more: Params) -> Trials:
        """Trials with more parameters, and earlier choices."""
        trials = Trials(self.motion, self.codec, {**self.params, **more}, self.profile)
        trials.kept = self.kept
        return trials

    def __call__(self, target: Target, setting: float) -> float:
        """The figure of ``target`` at a setting of the dial."""
        assert self.codec.dial is not None
        return self.figure(target, {self.codec.dial.parameter: setting})

    def figure(self, target: Target, params: Params) -> float:
        figure = self._measure(self.alone, target, params)
        if len(self.motion.signals) > 1 and target.falls:
            if not self.others:
                self.others = self._measure(self.motion, target, params) - figure
            figure += self.others
        return figure

    def frame_errors(self, target: Target, params: Params) -> Floats:
        """The greatest error of each frame with these parameters, (n_frames,).

        Errors of positions in cm, unless ``target`` is one of channels.
        """
        unit, decoded = self.motion.skeleton.unit_cm, self._decode_trial(self.alone, params)
        if target.weights is not None:
            errors = self._weighed_errors(target.weights, decoded)
            known = np.where(np.isfinite(errors), errors, 0.0).reshape(self.motion.n_frames, -1)
            return np.asarray(known.max(axis=1, initial=0.0))
        assert unit is not None
        greatest = np.zeros(self.motion.n_frames)
        for start in range(0, len(greatest), BLOCK_FRAMES):
            rows = slice(start, start + BLOCK_FRAMES)
            ours, theirs = (
                positions_of(motion.skeleton, np.asarray(motion.values[rows], np.float64))
                for motion in (self.alone, decoded)
            )
            distances = np.sqrt(((ours - theirs) ** 2).sum(axis=2))
            greatest[rows] = np.nan_to_num(distances).max(axis=1, initial=0.0) * unit
        return greatest

    def joint_errors(self, params: Params) -> Floats:
        """The mean position error of each joint in cm with these parameters, (n_joints,).

        0 for one without points.
        """
        decoded = self._decode_trial(self.alone, params)
        figures = compare(self.alone, decoded, virtual_markers=False, shell_cm=None).by_joint
        unit = self.motion.skeleton.unit_cm
        return np.array([(figure.mean_position_error or 0.0) * (unit or 0.0) for figure in figures])

    def _weighed_errors(self, weights: Floats, decoded: Motion) -> Floats:
        """The errors of channels times ``weights``, NaN where a value does not count."""
        signal = self.alone.signals[0]
        with_params, decoded_values = (
            np.asarray(one.masked(), np.float64) for one in (signal, decoded.signals[0])
        )
        with np.errstate(all="ignore"):
            errors: Floats = (
                channel_errors(self.motion.skeleton, signal, with_params, decoded_values) * weights
            )
        return errors

    def _write_trial(self, motion: Motion, trial_params: Params) -> Trial:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ContactWarning)  # only the clip's own warnings count
            params = {**self.params, **self.kept, **trial_params}
            trial = write_trial(Prepared(motion), self.codec, params, self.profile)
        if self.codec.has(LIKE):
            self.kept.setdefault(LIKE, trial.header)
        return trial

    def _decode_trial(self, motion: Motion, params: Params) -> Motion:
        """``motion`` as a reader has it."""
        trial = self._write_trial(motion, params)
        if any(signal.scaling is not None for signal in motion.signals):  # of stored numbers
            return _open(trial, motion)[1].motion()
        return replace(motion, signals=tuple(map(with_values, motion.signals, trial.values)))

    def _measure(self, motion: Motion, target: Target, params: Params) -> float:
        if target.weights is not None:
            errors = self._weighed_errors(target.weights, self._decode_trial(motion, params))
            n = np.isfinite(errors).sum(axis=0) if target.name == MEAN_ERROR else 1
            known = np.where(np.isfinite(errors), errors, 0.0)
            sums = known.sum(axis=0) / np.maximum(n, 1)
            return float((sums if target.name == MEAN_ERROR else known).max(initial=0.0))
        if not target.falls:
            decoded = self._decode_trial(motion, params)
            figures = compare(motion, decoded, virtual_markers=False, shell_cm=None)
            return _error(target, figures)
        sizes = clip_sizes(*_open(self._write_trial(motion, params), motion))
        if target.name == "target_bytes":
            return float(sizes.payload + sizes.overhead + sizes.models)
        assert motion.frame_rate is not None
        return float(sizes.payload * 8 * motion.frame_rate / motion.n_frames / 1000)


def _open(trial: Trial, motion: Motion) -> tuple[Container, Clip]:
    container = Container(open_source(trial.data), max_decoded=2**53)
    return container, Clip(container, container.directory.clips[motion.name])


def _error(target: Target, comparison: Comparison) -> float:
    name = target.name.replace("_error_cm", "_position_error_cm")
    value = getattr(comparison, name)
    if value is None:
        why = "; ".join(comparison.notes) or "no position is known in any frame"
        raise OptionError(f"{target.name} has no meaning: {why}")
    return float(value)


def meet_bound(dial: Dial, target: Target, trial: Trials) -> tuple[JsonObject, dict[str, str]]:
    """A step and the refinement of frames that meet the bound, and entries of the quality record.

    Raises OptionError if no tried one does.
    """
    guessed = dial.guess and dial.guess(target.name, target.limit)
    step = min(max(guessed or _first_step(dial, target, trial), dial.low), dial.high)
    for _ in range(MOST_STEPS):
        octaves: NDArray[np.int64] = np.zeros(trial.motion.n_frames, np.int64)
        for number in range(MOST_ROUNDS):
            params = {dial.parameter: step, REFINEMENT: octaves}
            try:
                errors = trial.frame_errors(target, params)
            except MotionError as error:
                text = f"{target.name} {target.limit:g} cannot be met: {error}"
                raise OptionError(text) from error
            if not (errors > target.limit).any():
                reached = float(errors.max(initial=0.0))
                return params, {"target_reached": repr(reached)}
            octaves = _refine(octaves, errors / target.limit, 1 + number // WIDER)
        missed = f"{dial.parameter} {step:g} gives {errors.max():g}"
        step = max(step * FINER, dial.low)
    raise OptionError(f"{target.name} {target.limit:g} cannot be met: {missed}")


def _first_step(dial: Dial, target: Target, trial: Trials) -> float:
    """A step with which most frames keep the bound of their channels closely."""
    step = USUAL_STEP
    for _ in range(MOST_CALIBRATIONS):
        octaves = np.zeros(trial.motion.n_frames, np.int64)
        errors = trial.frame_errors(target, {dial.parameter: step, REFINEMENT: octaves})
        ratio = float(np.quantile(errors, COMMON)) / target.limit if len(errors) else 0.0
        if not ratio or LEAST_COMMON <= ratio <= MOST_COMMON:
            break
        step *= min(max(WANTED_COMMON / ratio, 0.1), 10.0)
    return step


def meet_mean(dial: Dial, target: Target, trial: Trials) -> tuple[JsonObject, dict[str, str]]:
    """The coarsest step that keeps a mean error of channels, in quarters of octaves.

    Raises OptionError if no tried one does.
    """
    place, met, missed = 0, -MOST_QUARTERS, MOST_QUARTERS
    reached, figure = math.inf, math.inf
    for _ in range(MOST_MEANS):
        try:
            figure = trial(target, 2.0 ** (place / 4))
        except MotionError as error:
            raise OptionError(f"{target.name} {target.limit:g} cannot be met: {error}") from error
        if figure <= target.limit:
            met, reached = place, figure
        else:
            missed = place
        if missed - met == 1:
            break
        quarters = math.floor(4 * math.log2(target.limit / figure)) if figure else MOST_QUARTERS
        place = min(max(place + min(max(quarters, -16), 16), met + 1), missed - 1)
    if reached == math.inf:
        raise OptionError(f"{target.name} {target.limit:g} cannot be met; {figure:g} was reached")
    return {dial.parameter: 2.0 ** (met / 4)}, {"target_reached": repr(reached)}


def _refine(octaves: NDArray[np.int64], ratios: Floats, width: int) -> NDArray[np.int64]:
    """More octaves where ``ratios`` (n_frames,) of errors to the bound exceed 1, and near it.

    Frames up to ``width`` away get them, too: those that still miss after several rounds move
    their neighbors, which then miss in turn.
    """
    with np.errstate(divide="ignore"):
        missing = np.where(ratios > 1, np.ceil(np.log2(ratios) + MARGIN), 0.0).astype(np.int64)
    windows = np.lib.stride_tricks.sliding_window_view(np.pad(missing, width), 2 * width + 1)
    finer: NDArray[np.int64] = np.minimum(octaves + windows.max(axis=1, initial=0), MOST_OCTAVES)
    return finer


def weigh_joints(
    dial: Dial, trial: Trials, limits: Limits, params: Params
) -> tuple[JsonObject, dict[str, str]]:
    """Weights with which the joints keep their ``limits``, with the parameters ``params``.

    Also returns entries of the quality record. Raises OptionError if they cannot be kept.
    """
    skeleton = trial.motion.skeleton
    groups = [(name, find_joints(skeleton, name, QUALITY), limit) for name, limit in limits]
    with_params = params.get(WEIGHTS)
    weights = np.ones(skeleton.n_joints) if with_params is None else np.array(with_params)
    for _ in range(MOST_WEIGHINGS):
        errors = trial.joint_errors({**params, WEIGHTS: weights})
        means = [float(errors[joints].mean()) for _, joints, _ in groups]
        if all(mean <= limit for mean, (_, _, limit) in zip(means, groups, strict=True)):
            remarks = {
                f"quality_reached.{name}": repr(mean)
                for mean, (name, _, _) in zip(means, groups, strict=True)
            }
            return {WEIGHTS: weights}, remarks
        for mean, (_, joints, limit) in zip(means, groups, strict=True):
            if mean > limit:
                factor = (mean / limit) ** 2 * OVERCORRECTION
                weights[joints] = np.minimum(weights[joints] * factor, MOST_WEIGHT)
    worst = max(zip(means, groups, strict=True), key=lambda pair: pair[0] / pair[1][2])
    raise OptionError(
        f"quality: {worst[1][0]}={worst[1][2]:g}cm cannot be met with {dial.parameter} "
        f"{params.get(dial.parameter)}; {worst[0]:g} cm was reached"
    )
