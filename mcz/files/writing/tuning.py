"""Sizes and errors as targets: the dial of a codec is searched until they are verified.

Every trial is a file in memory; what a reader decodes of it is measured.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from operator import itemgetter

import numpy as np

from mcz.codecs.contract import Codec
from mcz.codecs.parameters import Dial
from mcz.container.limits import Profile
from mcz.errors import MotionError, OptionError
from mcz.files.writing.planning import (
    MAX_ERROR,
    MEAN_ERROR,
    ClipPlan,
    Prepared,
    check_bones,
    find_targets,
    plan_clip,
    split_bounds,
)
from mcz.files.writing.signal_bounds import limits_of, parse_bound, with_bounds
from mcz.files.writing.trials import (
    QUALITY,
    REFINEMENT,
    Limits,
    Target,
    Trials,
    meet_bound,
    meet_mean,
    weigh_joints,
)
from mcz.hints import Hint
from mcz.kinematics.points import positions_of
from mcz.model.motion import Motion
from mcz.model.types import JsonObject, Params

PRESET, LIMITS = "preset", "limits"
GOAL = 0.985  # of a target: near enough to stop
AIM = 0.5 * (1 + GOAL)
PROMISED = 0.97  # of a target: less is remarked upon
MOST_TRIALS = 60
MOST_TURNS = 4  # of weights and a target, each adjusted to the other
CLOSE = 1.00002  # between a setting that meets the target and one that does not
MOST_GUIDED = 4  # trials that follow the dial's guesses
GUESSED = 1.25  # from a setting that was guessed to the next
MOST_EQUAL = 3  # equal figures in a row: the next setting is the last of the range
NEAR_FACTOR, NEIGHBORS = 1.01, 24  # where figures jump: settings tried near the best one

Tuned = tuple[JsonObject, dict[str, str]]  # parameters, and entries of the quality record
Point = tuple[float, float]  # a setting and its figure
Bracket = tuple[Point, Point, bool]  # one that meets the target, one that misses, if a range ended


def tuned_plan(prepared: Prepared, codec: Codec, params: Params, profile: Profile) -> ClipPlan:
    """The plan of a clip that meets the size or the error among ``params``.

    Raises OptionError if a target cannot be met or has no meaning for this clip, and as
    ``plan_clip``.
    """
    wishes, bounds = split_bounds(params)
    motion, bounded = (
        with_bounds(prepared.motion, codec, bounds) if bounds else (prepared.motion, {})
    )
    options, remarks = tune(motion, codec, wishes, profile)
    plan = plan_clip(replace(prepared, motion=motion), codec, options, profile)
    return replace(plan, remarks=remarks | bounded)


def tune(motion: Motion, codec: Codec, params: Params, profile: Profile) -> Tuned:
    """``params`` with a setting of the dial that meets the targets among them, on trial files."""
    options = codec.options(params)
    targets = find_targets(options)
    _check_preset(codec, params, options, targets)
    promise = codec.promise if motion.signals[0].n_channels else None
    if not targets and promise and codec.dial and options[codec.dial.parameter] is None:
        targets = promise(options)
        if motion.skeleton.unit_cm is None:
            raise OptionError(
                f"{codec.name}: a preset bounds the error in cm, but the length unit is "
                f"unknown; set it, or give {codec.dial.parameter}",
                hint=Hint.UNIT,
            )
        check_bones(motion.skeleton, f"{codec.name}: a preset that promises an error in cm")
    limits = options.get(QUALITY)
    if codec.dial is None or not (targets or limits):
        return {**params}, {}
    target = _target(motion, codec.dial, options, targets) if targets else None
    trial = Trials(motion, codec, params, profile)
    if target and target.weights is not None and codec.has(LIMITS):
        trial = trial.with_params({LIMITS: target.limit / target.weights})
    if limits:
        settings, remarks = _with_quality(codec, target, trial, limits)
    else:
        settings, remarks = _meet_target(codec, target, trial)
    return {**trial.params, **trial.kept, **settings}, remarks


def _check_preset(codec: Codec, params: Params, options: Params, targets: Params) -> None:
    """Check that a preset that promises an error is the only option that does."""
    if not (codec.promise and codec.dial) or params.get(PRESET) is None:
        return
    others = [*targets, *([codec.dial.parameter] if options[codec.dial.parameter] else [])]
    if others:
        raise OptionError(f"{PRESET} and {others[0]} exclude each other; give one of them")


def _with_quality(codec: Codec, target: Target | None, trial: Trials, limits: Limits) -> Tuned:
    """Weights of joints, and settings that meet a target.

    Not with a coarser step for all joints, which the weights would allow: that took more bytes.
    """
    assert codec.dial is not None
    _check_unit(trial.motion, QUALITY)
    weights: JsonObject = {}
    for _ in range(MOST_TURNS):
        settings, remarks = _meet_target(codec, target, trial.with_params(weights))
        weights, settings_kept = weigh_joints(codec.dial, trial, limits, {**settings, **weights})
        both = {**settings, **weights}
        if target is None or trial.figure(target, both) <= target.limit:
            return both, {**remarks, **settings_kept}
    name = "" if target is None else f"{target.name} {target.limit:g}"
    raise OptionError(f"{QUALITY} and {name} cannot be met together")


def _meet_target(codec: Codec, target: Target | None, trial: Trials) -> Tuned:
    assert codec.dial is not None
    if target is None:
        return {}, {}
    if target.name.startswith("max_error") and codec.has(REFINEMENT):
        if target.weights is None:
            _check_places(trial.motion, codec.dial, target)
        return meet_bound(codec.dial, target, trial)
    if target.weights is not None and codec.has(LIMITS):
        return meet_mean(codec.dial, target, trial)
    return _search_dial(codec.dial, target, trial)


def _check_unit(motion: Motion, name: str) -> None:
    if motion.skeleton.unit_cm is None:
        raise OptionError(f"{name} has no meaning: the length unit is unknown", hint=Hint.UNIT)
    check_bones(motion.skeleton, name)


def _check_places(motion: Motion, dial: Dial, target: Target) -> None:
    skeleton = motion.skeleton
    try:
        positions_of(skeleton, np.zeros((0, skeleton.n_channels)))
    except MotionError as error:
        raise OptionError(
            f"{target.name} {target.limit:g} has no meaning: {error}; give {dial.parameter}"
        ) from error


def _search_dial(dial: Dial, target: Target, trial: Trials) -> Tuned:
    setting, reached, ended = search(dial, target, trial)
    remarks = {"target_reached": repr(reached)}
    if reached < PROMISED * target.limit:
        why = f"no {dial.parameter} that was tried is nearer"
        why = f"the range of {dial.parameter} ends there" if ended else why
        remarks["target_remark"] = f"{target.name} {target.limit:g}: {reached:g} was reached; {why}"
    return {dial.parameter: int(setting) if dial.is_integer else setting}, remarks


def _target(motion: Motion, dial: Dial, options: Params, targets: Params) -> Target:
    if len(targets) > 1:
        raise OptionError(f"{' and '.join(targets)} exclude each other; give one of them")
    ((name, limit),) = targets.items()
    if options[dial.parameter] is not None:
        raise OptionError(f"{name} and {dial.parameter} exclude each other; give one of them")
    if name == "kbps" and not (motion.frame_rate and motion.n_frames):
        raise OptionError(
            "kbps has no meaning: the frame rate is unknown, or there are no frames", hint=Hint.RATE
        )
    if name in (MAX_ERROR, MEAN_ERROR):
        return _channel_target(motion, name, str(limit))
    if name.endswith("_cm"):
        _check_unit(motion, name)
    return Target(name, float(limit), falls=not name.endswith("_cm"))


def _channel_target(motion: Motion, name: str, text: str) -> Target:
    signal = motion.signals[0]
    channels = motion.skeleton.channels if signal.channels is None else signal.channels
    limits = limits_of(motion.skeleton, channels, name, text)
    limit = parse_bound(name, text.split(",")[0])[0]
    if not limit > 0 or not (limits > 0).all():
        raise OptionError(f"{name} is {text!r}, but a lossy codec needs a bound above 0")
    return Target(name, limit, falls=False, weights=limit / limits)


def search(
    dial: Dial, target: Target, measure: Callable[[Target, float], float]
) -> tuple[float, float, bool]:
    """The setting nearest to the target, of those tried, without exceeding it.

    Returns the setting, its figure, and whether the range of the dial ended before the target.
    Raises OptionError if no setting meets it. A figure such as a greatest error may jump up and
    down.
    """
    points: list[Point] = []

    def measured(target: Target, setting: float) -> float:
        points.append((setting, measure(target, setting)))
        return points[-1][1]

    bracket = _follow_guesses(dial, target, measured) or _bracket(dial, target, measured)
    meets, misses, ended = bracket
    if ended:
        return *meets, True
    for _ in range(MOST_TRIALS):
        low, high = sorted((meets[0], misses[0]))
        is_next = high / low < CLOSE or (dial.is_integer and high - low <= 1)
        if meets[1] >= GOAL * target.limit or is_next:
            break
        setting = _interpolate_setting(meets, misses, target.limit)
        if dial.is_integer:  # strictly between the two
            setting = min(max(round(setting), low + 1), high - 1)
        point = setting, _measure_figure(dial, measured, target, setting)
        if point[1] <= target.limit:
            meets = point
        else:
            misses = point
    met = (point for point in reversed(points) if point[1] <= target.limit)
    best = max(met, key=itemgetter(1))
    if best[1] < PROMISED * target.limit:
        best = _search_beside(best, dial, target, measure)
    return *best, False


def _search_beside(
    best: Point, dial: Dial, target: Target, measure: Callable[[Target, float], float]
) -> Point:
    """A setting near ``best`` that keeps the promise, or else the best of all."""
    middle = best[0]
    for power in range(1, NEIGHBORS + 1):
        beside = (middle * NEAR_FACTOR**power, middle / NEAR_FACTOR**power)
        if dial.is_integer:
            beside = (middle + power, middle - power)
        for setting in beside:
            if dial.low <= setting <= dial.high:
                point = setting, _measure_figure(dial, measure, target, setting)
                if point[1] <= target.limit:
                    best = max(best, point, key=itemgetter(1))
        if best[1] >= PROMISED * target.limit:
            break
    return best


def _bracket(dial: Dial, target: Target, measure: Callable[[Target, float], float]) -> Bracket:
    guessed = dial.guess and dial.guess(target.name, target.limit)
    setting = _fit_range(dial, guessed or 1.0)
    point = setting, _measure_figure(dial, measure, target, setting)
    first_meets = point[1] <= target.limit
    falls = target.falls != dial.rises  # as the dial goes up
    upwards = first_meets != falls  # direction of the other side of the target
    factor, same = GUESSED if guessed else 2.0, 1
    while True:
        end = dial.high if upwards else dial.low
        if setting == end:
            if first_meets:
                return point, point, True
            raise OptionError(
                f"{target.name} {target.limit:g} cannot be met: {dial.parameter} {setting:g} "
                f"gives {point[1]:g}"
            )
        moved = setting * factor if upwards else setting / factor
        setting = end if same == MOST_EQUAL else _fit_range(dial, moved)
        factor = min(factor * 2, 2.0**8)
        other = setting, _measure_figure(dial, measure, target, setting)
        if (other[1] <= target.limit) != first_meets:
            return (point, other, False) if first_meets else (other, point, False)
        same = same + 1 if other[1] == point[1] else 1
        point = other


def _follow_guesses(
    dial: Dial, target: Target, measure: Callable[[Target, float], float]
) -> Bracket | None:
    """A bracket from settings at which the dial's guesses expect the target.

    They are right about how figures change, if not about those of a clip. None if there are no
    guesses, or none on the other side of the target.
    """
    aim = AIM * target.limit
    meets: Point | None = None
    misses: Point | None = None
    setting = dial.guess(target.name, aim) if dial.guess and not dial.is_integer else None
    for _ in range(MOST_GUIDED):
        if setting is None or not dial.low < setting < dial.high:
            return None
        point = setting, _measure_figure(dial, measure, target, setting)
        if point[1] <= target.limit:
            meets = point
        else:
            misses = point
        if meets and (misses or meets[1] >= GOAL * target.limit):
            return meets, misses or meets, False
        assert dial.guess is not None
        here, wanted = (dial.guess(target.name, figure or aim) for figure in (point[1], aim))
        setting = setting * wanted / here if here and wanted and point[1] < math.inf else None
    return None


def _measure_figure(
    dial: Dial, measure: Callable[[Target, float], float], target: Target, setting: float
) -> float:
    """The figure of a setting; one that the codec refuses as too fine has an infinite size."""
    try:
        return measure(target, int(setting) if dial.is_integer else setting)
    except MotionError as error:
        if setting > 1 if dial.rises else setting < 1:
            if target.falls:
                return math.inf
            raise OptionError(f"{target.name} {target.limit:g} cannot be met: {error}") from error
        raise


def _fit_range(dial: Dial, setting: float) -> float:
    return min(max(round(setting) if dial.is_integer else setting, dial.low), dial.high)


def _interpolate_setting(meets: Point, misses: Point, limit: float) -> float:
    """A setting between two, where a straight line in logarithms meets the target, or halfway."""
    low, high = math.log(meets[0]), math.log(misses[0])
    share = 0.5
    if 0 < meets[1] < misses[1] < math.inf:
        target = math.log(AIM * limit)
        share = (target - math.log(meets[1])) / (math.log(misses[1]) - math.log(meets[1]))
    return math.exp(low + min(max(share, 0.05), 0.95) * (high - low))
