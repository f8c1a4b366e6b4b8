"""Sizes and errors as targets: the dial of a codec is turned until they are met, and it is proved.

Every trial is a file in memory that the public reader opens; nothing is trusted that it did not
measure.
"""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from operator import itemgetter
from typing import Any

from mcz.codecs.contract import Codec
from mcz.codecs.parameters import Dial
from mcz.container.reader import Container
from mcz.container.source import open_source
from mcz.container.writer import Writer
from mcz.errors import MotionError, OptionError
from mcz.metrics import compare
from mcz.motion import Motion
from mcz.reading.clip import Clip
from mcz.reading.sizes import clip_sizes
from mcz.writing.clip_writer import Progress, asked, write_clip
from mcz.writing.positions import as_codec_wants

GOAL = 0.985  # of a target: near enough to stop
PROMISED = 0.97  # of a target: what is less is remarked upon
MOST_TRIALS = 60
CLOSE = 1.00002  # between a setting that meets the target and one that does not
NEAR, NEIGHBORS = 1.01, 24  # where figures jump: settings tried beside the one that was found

Point = tuple[float, float]  # a setting and its figure


@dataclass(frozen=True, slots=True)
class Target:
    """What was asked for; the figure of that name must not exceed ``limit``.

    ``falls``: the figure falls as the files get smaller (a size), instead of rising (an error).
    """

    name: str
    limit: float
    falls: bool


def write_tuned(
    writer: Writer,
    motion: Motion,
    codec: Codec,
    params: Mapping[str, Any],
    progress: Progress | None = None,
) -> dict[str, str] | None:
    """``write_clip``, a size or an error among ``params`` met first.

    The quality record says what was reached. Raises OptionError where a target cannot be met or has
    no meaning for this clip.
    """
    options = codec.options(params)
    motion = as_codec_wants(writer, motion, codec, options)
    targets = asked(options)
    if not targets or codec.dial is None:
        return write_clip(writer, motion, codec, params, progress)
    target = _target(motion, codec.dial, options, targets)
    trial = _Trials(motion, codec, params, writer)
    setting, reached, ended = search(codec.dial, target, trial)
    remark = None
    if reached < PROMISED * target.limit:
        dial = codec.dial.parameter
        why = f"the range of {dial} ends there" if ended else f"no {dial} that was tried is nearer"
        remark = f"{target.name} {target.limit:g}: {reached:g} was reached; {why}"
    remarks = {"target_reached": repr(reached)} | ({"target_remark": remark} if remark else {})
    found = dict(params) | {codec.dial.parameter: int(setting) if codec.dial.whole else setting}
    return write_clip(writer, motion, codec, found, progress, remarks=remarks)


def _target(
    motion: Motion, dial: Dial, options: Mapping[str, Any], targets: Mapping[str, Any]
) -> Target:
    if len(targets) > 1:
        raise OptionError(f"{' and '.join(targets)} are asked for, only one can be")
    ((name, limit),) = targets.items()
    if options[dial.parameter] is not None:
        raise OptionError(f"{name} is asked for and {dial.parameter} is given, only one can be")
    if name == "kbps" and not (motion.frame_rate and motion.n_frames):
        raise OptionError(
            "kbps has no meaning: the frame rate is unknown (--rate says it) or there are no frames"
        )
    if name.endswith("_cm") and motion.skeleton.unit_cm is None:
        raise OptionError(f"{name} has no meaning: the length unit is unknown; --unit says it")
    return Target(name, float(limit), falls=not name.endswith("_cm"))


class _Trials:
    """The figures of a clip at one setting of the dial, measured on a file in memory."""

    def __init__(
        self, motion: Motion, codec: Codec, params: Mapping[str, Any], writer: Writer
    ) -> None:
        self.motion, self.codec, self.params, self.writer = motion, codec, params, writer
        self.alone = replace(motion, signals=motion.signals[:1])
        self.others = 0.0  # bytes of the further signals, which no dial changes

    def __call__(self, target: Target, setting: float) -> float:
        figures = self._measure(self.alone, target, setting)
        if len(self.motion.signals) > 1 and target.falls:
            if not self.others:
                whole = self._measure(self.motion, target, setting)
                self.others = whole - figures
            figures += self.others
        return figures

    def _measure(self, motion: Motion, target: Target, setting: float) -> float:
        assert self.codec.dial is not None
        out = io.BytesIO()
        scratch = Writer(out, profile=self.writer.profile)
        params = dict(self.params) | {self.codec.dial.parameter: setting}
        write_clip(scratch, motion, self.codec, params, quality=False)
        scratch.finish()
        container = Container(open_source(out.getvalue()), max_decoded=2**53)
        clip = Clip(container, container.directory.clips[motion.name])
        if not target.falls:
            found = compare(motion, clip.motion(), virtual_markers=False, shell_cm=None)
            return _error(target, found)
        sizes = clip_sizes(container, clip)
        if target.name == "target_bytes":
            return float(sizes.payload + sizes.overhead + sizes.models)
        assert motion.frame_rate is not None
        return float(sizes.payload * 8 * motion.frame_rate / motion.n_frames / 1000)


def _error(target: Target, comparison: Any) -> float:
    name = target.name.replace("_error_cm", "_position_error_cm")
    value = getattr(comparison, name)
    if value is None:
        why = "; ".join(comparison.notes) or "no position is known in any frame"
        raise OptionError(f"{target.name} has no meaning: {why}")
    return float(value)


def search(
    dial: Dial, target: Target, measure: Callable[[Target, float], float]
) -> tuple[float, float, bool]:
    """The setting that comes nearest to the target, of those tried, without exceeding it.

    Returns the setting, its figure, and whether the range of the dial ended before the target.
    Raises OptionError where no setting meets it. A figure may jump, up and down: a greatest error
    does.
    """
    meets, misses, ended = _bracket(dial, target, measure)
    if ended:
        return *meets, True
    best = meets
    for _ in range(MOST_TRIALS):
        if meets[1] >= GOAL * target.limit or _neighboring(dial, meets[0], misses[0]):
            break
        setting = _between(meets, misses, target.limit)
        if dial.whole:  # strictly between the two
            low, high = sorted((meets[0], misses[0]))
            setting = min(max(round(setting), low + 1), high - 1)
        found = setting, _figure(dial, measure, target, setting)
        if found[1] <= target.limit:
            meets = found
            best = max(found, best, key=itemgetter(1))
        else:
            misses = found
    if best[1] < PROMISED * target.limit:
        best = _beside(best, dial, target, measure)
    return *best, False


def _beside(
    best: Point, dial: Dial, target: Target, measure: Callable[[Target, float], float]
) -> Point:
    """A setting beside ``best`` that keeps the promise, or else the best of all."""
    middle = best[0]
    for power in range(1, NEIGHBORS + 1):
        beside = (middle * NEAR**power, middle / NEAR**power)
        if dial.whole:
            beside = (middle + power, middle - power)
        for setting in beside:
            if dial.low <= setting <= dial.high:
                found = setting, _figure(dial, measure, target, setting)
                if found[1] <= target.limit:
                    best = max(best, found, key=itemgetter(1))
        if best[1] >= PROMISED * target.limit:
            break
    return best


def _bracket(
    dial: Dial, target: Target, measure: Callable[[Target, float], float]
) -> tuple[Point, Point, bool]:
    """A setting that meets the target and one that does not, or the end of the range."""
    setting = min(max(1.0, dial.low), dial.high)
    found = setting, _figure(dial, measure, target, setting)
    first_meets = found[1] <= target.limit
    falls = target.falls != dial.rises  # as the dial goes up
    upwards = first_meets != falls  # where the other side of the target lies
    factor = 2.0
    while True:
        end = dial.high if upwards else dial.low
        if setting == end:
            if first_meets:
                return found, found, True
            raise OptionError(
                f"{target.name} {target.limit:g} cannot be met: {dial.parameter} {setting:g} "
                f"gives {found[1]:g}"
            )
        moved = setting * factor if upwards else setting / factor
        setting = _fitting(dial, moved)
        factor = min(factor * 2, 2.0**8)
        other = setting, _figure(dial, measure, target, setting)
        if (other[1] <= target.limit) != first_meets:
            return (found, other, False) if first_meets else (other, found, False)
        found = other


def _figure(
    dial: Dial, measure: Callable[[Target, float], float], target: Target, setting: float
) -> float:
    """The figure of a setting; one that the codec refuses as too fine has no bound on its size."""
    try:
        return measure(target, int(setting) if dial.whole else setting)
    except MotionError:
        if target.falls and (setting > 1 if dial.rises else setting < 1):
            return math.inf
        raise


def _fitting(dial: Dial, setting: float) -> float:
    """The setting of the dial nearest to the one that is wanted."""
    return min(max(round(setting) if dial.whole else setting, dial.low), dial.high)


def _neighboring(dial: Dial, a: float, b: float) -> bool:
    """Whether no setting that would tell more lies between two."""
    return _ratio(a, b) < CLOSE or (dial.whole and abs(a - b) <= 1)


def _ratio(a: float, b: float) -> float:
    return max(a, b) / min(a, b)


def _between(meets: Point, misses: Point, limit: float) -> float:
    """A setting between two, where a straight line in logarithms meets the target, or halfway."""
    low, high = math.log(meets[0]), math.log(misses[0])
    share = 0.5
    if 0 < meets[1] < misses[1] < math.inf:
        wanted = math.log(0.5 * (1 + GOAL) * limit)
        share = (wanted - math.log(meets[1])) / (math.log(misses[1]) - math.log(meets[1]))
    return math.exp(low + min(max(share, 0.05), 0.95) * (high - low))
