"""Two motions, read side by side in blocks of frames, and the figures of one against the other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from mcz.errors import MotionError
from mcz.kinematics import SHELL_CM, point_set
from mcz.kinematics.contacts import Contacts
from mcz.kinematics.metrics.comparability import (
    common_unit,
    frames_text,
    rows_of,
    same_channels,
    same_points,
)
from mcz.kinematics.metrics.figures import Comparison
from mcz.kinematics.metrics.position_errors import PositionErrors
from mcz.kinematics.metrics.sums import ChannelErrors, Number, Values, times
from mcz.kinematics.points import check_radius
from mcz.model.motion import Motion, Signal, Skeleton

BLOCK = 2**19  # numbers that are worked on at a time: what bounds the memory


def compare(
    original: Motion,
    decoded: Motion,
    *,
    virtual_markers: bool = True,
    shell_cm: float | None = SHELL_CM,
    contacts: Contacts | Sequence[int | str] | bool = False,
) -> Comparison:
    """The figures of ``decoded`` against ``original``, defined in docs/reference/measures.md.

    Without ``virtual_markers`` theirs are None, and with ``shell_cm``, its radius, None those of
    the shell: either takes a quarter of the time or so. ``contacts`` asks how far feet slide that
    stand in the original: True finds the feet by their names; joints, by index or name, are feet
    whose contacts are to be found; ``Contacts`` are taken as they are. Figures that make no sense
    for these two (other channels, other points) are None too, with a note.

    Raises MotionError where the two differ in frames, or in rows a frame, or have no such joint
    as ``contacts`` names, and OptionError where ``shell_cm`` is no length.
    """
    a, b = original.signals[0], decoded.signals[0]
    if a.n_frames != b.n_frames or a.samples_per_frame != b.samples_per_frame:
        raise MotionError(
            f"{original.name!r} has {frames_text(a)}, {decoded.name!r} has {frames_text(b)}: "
            "only the same frames can be compared"
        )
    if shell_cm is not None:
        check_radius(shell_cm)
    notes: list[str] = []
    unit, scale = common_unit(original.skeleton, decoded.skeleton, notes)
    channels = ChannelErrors(original.skeleton, a)
    same = same_channels(original, decoded, notes)
    placed = same_points(original, decoded, notes)
    places = PositionErrors(original, decoded, scale, placed)
    if placed and unit is not None:
        places.enable(virtual_markers, shell_cm, contacts, notes)
    with np.errstate(all="ignore"):  # what overflows is no figure
        for start, left, right in _blocks(original, decoded):
            if same:
                channels.add(left, right)
            if placed:
                places.add(start, left, right)
        further = _further_signals(original, decoded, notes)
    velocities, accelerations = places.velocities(unit), places.accelerations(unit)
    points, markers, shell = places.points, places.markers, places.shell
    return Comparison(
        frames=a.n_frames,
        channels=a.n_channels if same else None,
        mse=channels.mse,
        mse_raw=channels.mse_raw,
        mismatched_values=channels.mismatched if same else None,
        point_set=point_set(original.skeleton) if placed else None,
        points=len(points.counts) if placed else None,
        unit_cm=unit,
        rms_coordinate_error=points.rms,
        mean_position_error=points.mean,
        max_position_error=points.greatest,
        where=places.point_where(),
        mismatched_points=points.mismatched if placed else None,
        sqnr_db=points.sqnr_db,
        mean_velocity_error_cm_s=velocities[0],
        max_velocity_error_cm_s=velocities[1],
        mean_acceleration_error_cm_s2=accelerations[0],
        max_acceleration_error_cm_s2=accelerations[1],
        virtual_marker_mean_cm=times(markers.mean, unit),
        virtual_marker_max_cm=times(markers.greatest, unit),
        shell_radius_cm=None if shell.mean is None else places.shell_cm,
        shell_mean_cm=times(shell.mean, unit),
        shell_max_cm=times(shell.greatest, unit),
        shell_where=places.shell_where(),
        sliding=places.sliding(),
        by_joint=places.by_joint(unit),
        signals=further,
        notes=tuple(notes),
    )


def _blocks(original: Motion, decoded: Motion) -> Iterator[tuple[int, Values, Values]]:
    """First row and values of both, a block of frames at a time."""
    a, b = original.signals[0], decoded.signals[0]
    widths = (
        max(1, m.signals[0].n_channels + 12 * m.skeleton.n_joints) for m in (original, decoded)
    )
    step = max(1, BLOCK // (max(widths) * a.samples_per_frame))
    for start in range(0, a.n_frames, step):
        stop = min(a.n_frames, start + step)
        yield start * a.samples_per_frame, rows_of(a, start, stop), rows_of(b, start, stop)


def named_signals(motion: Motion) -> dict[str, Signal]:
    """The further signals by role, or name; ``#n`` behind it from the second of one on."""
    signals: dict[str, Signal] = {}
    seen: dict[str, int] = {}
    for signal in motion.signals[1:]:
        key = signal.role or signal.name
        seen[key] = n = seen.get(key, -1) + 1
        signals[key if n == 0 else f"{key}#{n}"] = signal
    return signals


def _further_signals(original: Motion, decoded: Motion, notes: list[str]) -> dict[str, Number]:
    """The MSE of every signal that both have beside the motion."""
    figures: dict[str, Number] = {}
    left, right = named_signals(original), named_signals(decoded)
    for name in dict.fromkeys([*left, *right]):
        a, b = left.get(name), right.get(name)
        if a is None or b is None or a.values.shape != b.values.shape:
            notes.append(f"signal {name!r} is not in both, or of another shape")
            continue
        figures[name] = signal_errors(original.skeleton, a, b).mse
    return figures


def signal_errors(skeleton: Skeleton, original: Signal, decoded: Signal) -> ChannelErrors:
    """The errors of a signal of the same shape."""
    errors = ChannelErrors(skeleton, original)
    step = max(1, BLOCK // max(1, original.n_channels * original.samples_per_frame))
    for start in range(0, original.n_frames, step):
        stop = min(original.n_frames, start + step)
        with np.errstate(all="ignore"):  # what overflows is no figure
            errors.add(rows_of(original, start, stop), rows_of(decoded, start, stop))
    return errors
