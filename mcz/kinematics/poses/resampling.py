"""``resample``: the same motion at another frame rate."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from math import ceil

import numpy as np

from mcz.errors import MotionError, OptionError
from mcz.kinematics.chain import IDENTITY, Chain, Link, chain_of, knows_angles
from mcz.kinematics.poses.conversions import (
    Quaternion,
    from_matrices,
    scalar_quaternions,
    slerp,
    slerp_quaternions,
)
from mcz.kinematics.rotations import ORDERS, euler_angles, matrices_of_vectors, nearest_vector
from mcz.model.checks import check_arguments
from mcz.model.clock import TIMES, Timeline, known_timeline
from mcz.model.motion import A_MOTION, Motion, Signal, Skeleton, frame_rate_of
from mcz.model.types import Floats, Ints

ALIGNED = 1e-6  # of a frame: a new frame so near to an old one coincides with it
MOST_VALUES = 2**31  # limit of the result: a rate of 1e9 is a mistake


@dataclass(frozen=True, slots=True)
class FrameTimes:
    """The new frames between the old: frame ``before`` and the next, and the share between, 0 to 1.

    ``before`` int64 (n,), ``share`` float64 (n,): 0 where a new frame coincides with an old one.
    ``runs``, int64 (n, 2), are the first and last old frame without a break in time, None: all.
    ``weights``, (2, n): the time between the two frames, divided by the time from the frame before,
    and to the frame after; None: equal distances, 1/2.
    """

    before: Ints
    share: Floats
    runs: Ints | None = None
    weights: Floats | None = None

    @property
    def after(self) -> Ints:
        return self.before + (self.share > 0)


@check_arguments(motion=A_MOTION)
def resample(
    motion: Motion, rate: Fraction | float, *, drop_signals: bool = False, components: bool = False
) -> Motion:
    """``motion`` at ``rate`` frames a second, from its first frame to at most its last.

    Joints of three rotations, a quaternion or a rotation vector turn the shortest way at a constant
    speed from frame to frame (slerp); one or two angles of a joint, and three about two axes, go
    the shorter way round each. Positions, lengths and all other channels follow Catmull-Rom splines
    through four frames. A frame that coincides with one of ``motion`` equals it bit for bit. No
    filter is applied: at a lower rate, motion faster than half of it folds back (aliasing). New
    frames lie between old ones by their times: a value between frames of which one is unknown is
    unknown. If frames are missing, the result has no frames either, and its frame numbers skip
    them.

    Four plain scalars side by side whose norm is 1 in every frame are a quaternion too, and turn;
    ``source-note`` of the result lists them. OptionError if these overlap, or if columns with
    the names of a quaternion have another norm. ``components``: plain scalars are always splines.

    Other signals cannot follow: OptionError unless ``drop_signals``. The result has no source, and
    keeps the times. Raises OptionError if the times of ``motion`` are unknown, MotionError for a
    bad ``rate``.
    """
    new_rate = frame_rate_of(rate, motion.name)
    timeline, first = known_timeline(motion.name, motion.timeline), motion.signals[0]
    others = [signal.name for signal in motion.signals[1:] if signal.role != TIMES]
    if others and not drop_signals:
        raise OptionError(
            f"signals other than the motion ({', '.join(others)}) cannot be resampled; leave "
            "them out with drop_signals=True",
            clip=motion.name,
        )
    if first.samples_per_frame > 1:
        raise MotionError("several samples a frame", clip=motion.name)
    numbers, times = times_of(timeline, new_rate, first)
    own = first.channels is not None
    old = np.asarray(motion.values, np.float64)
    values = resample_rows(None if own else motion.skeleton, old, times)
    metadata = dict(motion.metadata)
    if not components and times.share.any():
        quaternions = scalar_quaternions(motion.skeleton, first.channels, old)
        turn_scalars(quaternions, old, values, times)
        if quaternions:
            columns = ", ".join(f"{four[0] + 1} to {four[-1] + 1}" for four in quaternions)
            note = f"columns {columns} were resampled as quaternions"
            metadata["source-note"] = "; ".join(filter(None, (metadata.get("source-note"), note)))
    new = timeline.regular_times[:1] + numbers / float(new_rate)
    mask = ~np.isnan(values) if first.mask is not None else None
    start = float(new[0] * float(new_rate)) if len(new) else 0.0
    base = round(start) if abs(start) < 2**52 and abs(start - round(start)) < ALIGNED else 0
    counted = numbers + base + 1
    resampled_motion = replace(
        motion,
        signals=(replace(Signal(values, name=first.name, mask=mask), channels=first.channels),),
        frame_rate=new_rate,
        source=None,
        frame_numbers=None if (counted == np.arange(1, len(counted) + 1)).all() else counted,
        number_step=1,
        metadata=metadata,
    )
    return resampled_motion.at_times(Timeline(new, new_rate, timeline.rounding))


def times_of(timeline: Timeline, rate: Fraction, signal: Signal) -> tuple[Ints, FrameTimes]:
    """The frames at ``rate`` within the runs of ``timeline``, and their places.

    Counted from 0 at its first time, in exact arithmetic if times lie at whole multiples of 1 /
    rate. Raises OptionError if they would be too many.
    """
    most_rows = MOST_VALUES // max(1, signal.n_channels)
    parts: list[tuple[Ints, FrameTimes]] = []
    for run in timeline.runs:
        frames, lie = frames_within(timeline, rate, run)
        most_rows -= max(0, frames.stop - frames.start)  # too many for len()
        if most_rows < 0:
            raise too_many_frames_error(timeline, rate)
        parts.append((np.array(frames, np.int64), lie(frames)))
    if not parts:
        return np.empty(0, np.int64), FrameTimes(np.empty(0, np.int64), np.empty(0))
    numbers, places = zip(*parts, strict=True)
    if len(parts) == 1:
        return numbers[0], places[0]
    ends = np.array(timeline.runs, np.int64) - [0, 1]
    half = [np.full((2, len(n)), 0.5) for n in numbers]
    weights = [h if f.weights is None else f.weights for f, h in zip(places, half, strict=True)]
    times = FrameTimes(
        np.concatenate([each.before for each in places]),
        np.concatenate([each.share for each in places]),
        np.repeat(ends, [len(each) for each in numbers], axis=0),
        np.concatenate(weights, axis=1),
    )
    return np.concatenate(numbers), times


def too_many_frames_error(timeline: Timeline, rate: Fraction) -> OptionError:
    """The error for too many new frames."""
    since = timeline.times[-1] - timeline.times[0]
    return OptionError(
        f"{len(timeline.times)} frames in {since:g} s give too many frames at {rate} a second"
    )


def frames_within(
    timeline: Timeline, new_rate: Fraction, run: tuple[int, int]
) -> tuple[range, Callable[[range], FrameTimes]]:
    """New frames within a run of old ones, and a function that locates them."""
    start, stop = run
    places, rate = timeline.ticks, timeline.rate
    if places is not None and rate and places[stop - 1] - places[start] == stop - start - 1:
        step, first = rate / new_rate, int(places[start])
        frames = range(ceil(first / step), int((first + stop - start - 1) / step) + 1)
        return frames, lambda frames: _shift_times(times_at(frames, step), start - first)
    since = (timeline.regular_times[start:stop] - timeline.regular_times[0]) * float(new_rate)
    frames = range(ceil(since[0] - ALIGNED), int(since[-1] + ALIGNED) + 1)
    return frames, lambda frames: _locate_frames(np.array(frames, np.float64), since, start)


def _shift_times(times: FrameTimes, by: int) -> FrameTimes:
    return FrameTimes(times.before + by, times.share)


def _locate_frames(frames: Floats, since: Floats, start: int) -> FrameTimes:
    """The places of ``frames`` among old ones at ``since``, rising, from frame ``start`` on."""
    before = np.clip(np.searchsorted(since, frames, side="right") - 1, 0, max(0, len(since) - 2))
    after = np.minimum(before + 1, len(since) - 1)
    with np.errstate(invalid="ignore", divide="ignore"):
        share = np.nan_to_num((frames - since[before]) / (since[after] - since[before]))
    share[share < ALIGNED] = 0.0
    upon = share > 1 - ALIGNED
    steps = np.concatenate([[np.nan], np.diff(since), [np.nan] * 2])  # up to each frame
    own = steps[before + 1]
    with np.errstate(invalid="ignore"):  # times that are all one
        weights = np.stack([own / (own + steps[before]), own / (own + steps[before + 2])])
    weights = np.nan_to_num(weights, nan=0.5)
    return FrameTimes(before + upon + start, np.where(upon, 0.0, share), weights=weights)


MOST_FRAMES = 2**28


def count_resampled_frames(n_frames: int, rate: Fraction, new_rate: Fraction) -> int:
    """Number of frames at rate ``new_rate``, from the first to at most the last."""
    count = int((n_frames - 1) * new_rate / rate) + 1 if n_frames else 0
    if count > MOST_FRAMES:
        raise OptionError(
            f"{count} frames at {float(new_rate):g} a second exceed the limit of {MOST_FRAMES}"
        )
    return count


def times_at(frames: Iterable[int], step: Fraction) -> FrameTimes:
    """Times of new frames in old frames, ``step`` apart."""
    places = [divmod(frame * step.numerator, step.denominator) for frame in frames]
    before = np.array([whole for whole, _ in places], np.int64)
    return FrameTimes(before, np.array([rest / step.denominator for _, rest in places]))


def resample_rows(skeleton: Skeleton | None, old: Floats, times: FrameTimes) -> Floats:
    """``resample`` of the rows of ``old``; ``skeleton`` None for channels without a joint."""
    if not times.share.any():
        return old[times.before]
    new = spline_rows(old, times)
    is_posed = skeleton is not None and any(channel.kind for channel in skeleton.channels)
    if skeleton is not None and is_posed and knows_angles(skeleton):
        chain = chain_of(skeleton)
        for link in chain.links:
            if link.turns:
                _turn(chain, link, old, new, times)
    return new


def turn_scalars(
    quaternions: Sequence[Quaternion], old: Floats, new: Floats, times: FrameTimes
) -> None:
    """Fill the columns of quaternions among plain scalars in the frames that are between frames."""
    between = np.flatnonzero(times.share > 0)
    before, after, share = times.before[between], times.after[between], times.share[between]
    for four in quaternions:
        columns = slice(four[0], four[-1] + 1)
        new[between, columns] = slerp_quaternions(old[before, columns], old[after, columns], share)


def spline_rows(old: Floats, times: FrameTimes) -> Floats:
    """Catmull-Rom splines through the rows of ``old``, straight where a neighbor is missing."""
    runs = times.runs
    low, high = (0, len(old) - 1) if runs is None else (runs[:, 0], runs[:, 1])
    p0, p1 = _rows(old, times.before - 1, low, high), old[times.before]
    p2, p3 = old[times.after], _rows(old, times.after + 1, low, high)
    before, after = times.weights if times.weights is not None else np.full((2, 1), 0.5)
    with np.errstate(invalid="ignore", over="ignore"):
        way = p2 - p1
        first = np.where(np.isnan(p0), way, (p2 - p0) * before[:, None])
        last = np.where(np.isnan(p3), way, (p3 - p1) * after[:, None])
        t = times.share[:, None]
        bend = 3 * way - 2 * first - last + t * (first + last - 2 * way)
        curve: Floats = p1 + t * (first + t * bend)
    return np.where(t > 0, curve, p1)


def _rows(old: Floats, frames: Ints, low: Ints | int, high: Ints | int) -> Floats:
    """Rows of ``old``, NaN where a frame lies outside of ``low`` to ``high``."""
    rows = old[np.clip(frames, 0, len(old) - 1)]
    rows[(frames < low) | (frames > high)] = np.nan
    return rows


def _turn(chain: Chain, link: Link, old: Floats, new: Floats, times: FrameTimes) -> None:
    """Fill the columns that turn a joint in the frames between old frames."""
    between = np.flatnonzero(times.share > 0)
    before, after = times.before[between], times.after[between]
    share = times.share[between]
    if link.quaternion and len(link.turns) == 1:
        columns = np.array(link.quaternion, np.int64)
        turns = _matrices(chain, link, old)
        middle = slerp(turns[before], turns[after], share)
        quaternions = from_matrices(middle[:, None], "quat")[:, 0]
        near = (quaternions * old[np.ix_(before, columns)]).sum(axis=1)
        new[np.ix_(between, columns)] = np.where(near < 0, -1.0, 1.0)[:, None] * quaternions
        return
    full = 2 * np.pi / chain.radians
    if link.vector:
        columns = np.array(link.vector, np.int64)
        first, last = (old[np.ix_(rows, columns)] * chain.radians for rows in (before, after))
        new[np.ix_(between, columns)] = _vectors(first, last, share) / chain.radians
    angles = np.array(link.angles, np.int64)
    first, last = old[np.ix_(before, angles)], old[np.ix_(after, angles)]
    way = last - first
    way -= np.round(way / full) * full
    guess = first + way * share[:, None]
    new[np.ix_(between, angles)] = guess
    order = link.freedoms
    if order in ORDERS:
        turns = _matrices(chain, link, old)
        middle = slerp(turns[before], turns[after], share)
        known = np.isfinite(middle).all(axis=(1, 2))
        rows = np.ix_(between[known], angles)
        new[rows] = _angles(middle[known], order, guess[known], full)


def _vectors(first: Floats, last: Floats, share: Floats) -> Floats:
    """Rotation vectors (n, 3), in radians, a ``share`` of the shortest way to the last, (n,)."""
    start, end = (np.moveaxis(matrices_of_vectors(ends.T), 2, 0) for ends in (first, last))
    middle = from_matrices(slerp(start, end, share)[:, None], "rotvec")[:, 0]
    return np.array([nearest_vector(*pair) for pair in zip(middle, first, strict=True)])


def _matrices(chain: Chain, link: Link, old: Floats) -> Floats:
    """The product of a joint's own turns, (n_frames, 3, 3)."""
    with np.errstate(invalid="ignore", divide="ignore"):
        turns = chain.apply_turns(link, IDENTITY, np.ascontiguousarray(old.T), [])
    return np.ascontiguousarray(np.moveaxis(turns, 2, 0))


def _angles(turns: Floats, order: str, guess: Floats, full: float) -> Floats:
    """The Euler angles of matrices (n, 3, 3) that are nearest to ``guess``."""
    angles = euler_angles(np.moveaxis(turns, 0, 2), order) * (full / (2 * np.pi))
    half = full / 2
    other = np.stack([angles[:, 0] + half, half - angles[:, 1], angles[:, 2] + half], axis=1)
    near, far = (each - np.round((each - guess) / full) * full for each in (angles, other))
    nearer = np.abs(near - guess).sum(axis=1) <= np.abs(far - guess).sum(axis=1)
    return np.where(nearer[:, None], near, far)
