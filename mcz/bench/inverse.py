"""The way back: a motion as positions, as inverse kinematics makes them a motion again."""

from __future__ import annotations

from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

import mcz
from mcz.errors import OptionError
from mcz.motion import ROTATION_KINDS, Motion, Signal, Skeleton

Floats = NDArray[np.float64]


def way_back(
    motion: Motion, *, virtual_markers: bool = False, noise_cm: float = 0.0, seed: int = 0
) -> dict[str, Any]:
    """Errors of ``motion`` after ``in_positions`` and ``from_positions``, and frames a second.

    ``noise_cm`` is the rms length of normal noise that is added to every position. Angles are in
    degrees and compared modulo whole turns: ``angle_*`` of each joint by the Euler angles nearest
    to the original's that turn it alike, ``channel_*`` as they stand. ``position_*_cm`` are from
    the positions before the noise. Raises OptionError for noise where the unit is unknown.
    """
    seen = mcz.in_positions(motion, virtual_markers=virtual_markers)
    if noise_cm:
        seen = _noisy(seen, noise_cm, seed)
    start = perf_counter()
    solved, fit = mcz.from_positions(seen, motion.skeleton)
    seconds = perf_counter() - start
    raw, nearest = angle_errors(motion.skeleton, motion.values, solved.values)
    missed = np.linalg.norm(mcz.positions(solved) - mcz.positions(motion), axis=2)
    missed = missed[np.isfinite(missed)] * (motion.skeleton.unit_cm or np.nan)
    return {
        **_figures("angle", nearest, "deg"),
        **_figures("channel", raw, "deg"),
        **_figures("position", missed, "cm"),
        "residual_mean_cm": fit.mean_error_cm,
        "residual_max_cm": fit.max_error_cm,
        "frames_per_second": motion.n_frames / seconds if seconds else None,
    }


def angle_errors(skeleton: Skeleton, before: Floats, after: Floats) -> tuple[Floats, Floats]:
    """Errors of the rotation channels in degrees, (n_frames, n_rotations), modulo whole turns.

    First as they stand; then, where three channels of a joint turn about different axes, with the
    other three angles that make the same turn wherever those are nearer.
    """
    turn = 360.0 if skeleton.angle_unit == "deg" else 2 * np.pi
    raw: list[Floats] = []
    nearest: list[Floats] = []
    for index, joint in enumerate(skeleton.joints):
        pairs = zip(joint.channels, skeleton.columns(index), strict=True)
        found = [(channel.kind, c) for channel, c in pairs if channel.kind in ROTATION_KINDS]
        columns = [column for _, column in found]
        error = _modulo(after[:, columns] - before[:, columns], turn)
        raw.append(error)
        if len(found) == 3 and len({kind for kind, _ in found}) == 3:
            other = after[:, columns] * [1, -1, 1] + turn / 2
            other_error = _modulo(other - before[:, columns], turn)
            nearer = (other_error**2).sum(axis=1) < (error**2).sum(axis=1)
            error = np.where(nearer[:, None], other_error, error)
        nearest.append(error)
    empty = np.zeros((len(before), 0))
    in_degrees = 360.0 / turn
    return (
        np.concatenate([empty, *raw], axis=1) * in_degrees,
        np.concatenate([empty, *nearest], axis=1) * in_degrees,
    )


def _modulo(difference: Floats, turn: float) -> Floats:
    return difference - turn * np.rint(difference / turn)


def _figures(name: str, errors: Floats, unit: str) -> dict[str, float | None]:
    sizes = np.abs(errors[np.isfinite(errors)])
    if not sizes.size:
        return {f"{name}_{what}_{unit}": None for what in ("rms", "mean", "max")}
    return {
        f"{name}_rms_{unit}": float(np.sqrt((sizes * sizes).mean())),
        f"{name}_mean_{unit}": float(sizes.mean()),
        f"{name}_max_{unit}": float(sizes.max()),
    }


def _noisy(motion: Motion, noise_cm: float, seed: int) -> Motion:
    unit_cm = motion.skeleton.unit_cm
    if unit_cm is None:
        raise OptionError(f"motion {motion.name!r}: noise in cm needs a length unit")
    signal = motion.signals[0]
    spread = noise_cm / unit_cm / np.sqrt(3)
    noise = np.random.default_rng(seed).normal(0.0, spread, signal.values.shape)
    noisy = Signal(
        signal.values + noise, (), signal.name, signal.samples_per_frame, mask=signal.mask
    )
    return Motion(
        motion.skeleton, (noisy,), motion.frame_rate, motion.frame_rate_exact, motion.name
    )
