"""``resample``: the same motion at another frame rate."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from mcz.errors import MotionError, OptionError
from mcz.kinematics.chain import IDENTITY, Chain, Floats, Link, chain_of
from mcz.kinematics.euler import ORDERS, euler_angles
from mcz.kinematics.rotation_vectors import matrices_of_vectors, nearest_vector
from mcz.motion import Motion, Signal, Skeleton, frame_rate_of
from mcz.poses.conversions import from_matrices, slerp

MOST_VALUES = 2**31  # of what is made: a rate of 1e9 would be a mistake, not a wish


@dataclass(frozen=True, slots=True)
class Times:
    """The new frames between the old: frame ``before`` and the next, and how far between, 0 to 1.

    ``before`` int64 (n,), ``share`` float64 (n,): 0 where a new frame falls upon an old one.
    """

    before: NDArray[np.int64]
    share: Floats

    @property
    def after(self) -> NDArray[np.int64]:
        return self.before + (self.share > 0)


def resample(motion: Motion, rate: Fraction | float, *, drop_signals: bool = False) -> Motion:
    """``motion`` at ``rate`` frames a second, from its first frame to at most its last.

    Joints of three rotations, a quaternion or a rotation vector turn the shortest way at a constant
    speed from frame to frame (slerp); one or two angles of a joint, and three about two axes, go
    the shorter way round each. Positions, lengths and all else run along Catmull-Rom splines
    through four frames. A frame that coincides with one of ``motion`` is that frame, bit for bit.
    No filter is applied: at a lower rate what is faster than half of it folds back, as wherever
    frames are left out. A value between frames of which one is unknown is unknown: gaps stay gaps.

    Other signals cannot follow: OptionError unless ``drop_signals``. The result has no source and
    no frame numbers. Raises OptionError where the rate of ``motion`` is unknown, MotionError for a
    ``rate`` that is none.
    """
    wanted = frame_rate_of(rate, motion.name)
    if motion.frame_rate is None:
        raise OptionError(f"motion {motion.name!r}: its frame rate is unknown; say it when reading")
    if len(motion.signals) > 1 and not drop_signals:
        names = ", ".join(signal.name for signal in motion.signals[1:])
        raise OptionError(
            f"motion {motion.name!r}: signals beside the motion ({names}) are not resampled; leave "
            "them out with drop_signals=True"
        )
    if motion.signals[0].samples_per_frame > 1:
        raise MotionError(f"motion {motion.name!r}: several samples a frame")
    times = times_of(motion.n_frames, Fraction(motion.frame_rate), wanted, motion.signals[0])
    own = motion.signals[0].channels is not None
    old = np.asarray(motion.values, np.float64)
    values = resampled(None if own else motion.skeleton, old, times)
    mask = None
    if motion.signals[0].mask is not None:
        mask = ~np.isnan(values)
    signal = Signal(values, name=motion.signals[0].name, mask=mask)
    if motion.signals[0].channels is not None:
        signal = replace(signal, channels=motion.signals[0].channels)
    return replace(
        motion,
        signals=(signal,),
        frame_rate=wanted,
        source=None,
        frame_numbers=None,
        metadata={k: v for k, v in motion.metadata.items() if k != "frame-numbers"},
    )


def times_of(n_frames: int, rate: Fraction, wanted: Fraction, signal: Signal) -> Times:
    """Where the frames of rate ``wanted`` lie among ``n_frames`` at ``rate``, in exact arithmetic.

    Raises OptionError where they would be too many.
    """
    if not n_frames:
        return Times(np.empty(0, np.int64), np.empty(0))
    count = resampled_frames(n_frames, rate, wanted)
    step = rate / wanted
    if count * max(1, signal.n_channels) > MOST_VALUES:
        raise OptionError(f"{n_frames} frames at {rate} a second make {count} at {wanted}")
    return times_at(range(count), step)


def resampled_frames(n_frames: int, rate: Fraction, wanted: Fraction) -> int:
    """How many frames there are at ``wanted`` a second, from the first to at most the last."""
    return int((n_frames - 1) * wanted / rate) + 1 if n_frames else 0


def times_at(frames: Iterable[int], step: Fraction) -> Times:
    """Where new frames lie among the old, each ``step`` old ones after the one before."""
    places = [divmod(frame * step.numerator, step.denominator) for frame in frames]
    before = np.array([whole for whole, _ in places], np.int64)
    return Times(before, np.array([rest / step.denominator for _, rest in places]))


def resampled(skeleton: Skeleton | None, old: Floats, times: Times) -> Floats:
    """``resample`` of the rows of ``old``; ``skeleton`` None where channels are of no joint."""
    if not times.share.any():
        return old[times.before]
    new = splines(old, times)
    if skeleton is not None and skeleton.angle_unit:
        chain = chain_of(skeleton)
        for link in chain.links:
            if link.turns:
                _turn(chain, link, old, new, times)
    return new


def splines(old: Floats, times: Times) -> Floats:
    """Catmull-Rom splines through the rows of ``old``, straight on where a neighbour is missing."""
    p0, p1 = _rows(old, times.before - 1), old[times.before]
    p2, p3 = old[times.after], _rows(old, times.after + 1)
    with np.errstate(invalid="ignore", over="ignore"):
        p0 = np.where(np.isnan(p0), 2 * p1 - p2, p0)
        p3 = np.where(np.isnan(p3), 2 * p2 - p1, p3)
        t = times.share[:, None]
        curve: Floats = p1 + t / 2 * (
            (p2 - p0) + t * ((2 * p0 - 5 * p1 + 4 * p2 - p3) + t * (3 * (p1 - p2) + p3 - p0))
        )
    return np.where(t > 0, curve, p1)


def _rows(old: Floats, frames: NDArray[np.int64]) -> Floats:
    """Rows of ``old``, NaN where a frame lies outside."""
    rows = old[np.clip(frames, 0, len(old) - 1)]
    rows[(frames < 0) | (frames >= len(old))] = np.nan
    return rows


def _turn(chain: Chain, link: Link, old: Floats, new: Floats, times: Times) -> None:
    """Fill the columns that turn a joint in the frames that are between frames."""
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
        found = chain.turned_by(link, IDENTITY, np.ascontiguousarray(old.T), [])
    return np.ascontiguousarray(np.moveaxis(found, 2, 0))


def _angles(turns: Floats, order: str, guess: Floats, full: float) -> Floats:
    """The Euler angles of matrices (n, 3, 3), of all solutions those nearest to ``guess``."""
    found = euler_angles(np.moveaxis(turns, 0, 2), order) * (full / (2 * np.pi))
    half = full / 2
    other = np.stack([found[:, 0] + half, half - found[:, 1], found[:, 2] + half], axis=1)
    near, far = (each - np.round((each - guess) / full) * full for each in (found, other))
    nearer = np.abs(near - guess).sum(axis=1) <= np.abs(far - guess).sum(axis=1)
    return np.where(nearer[:, None], near, far)
