"""Notes on facts that a format cannot hold, so that nothing is lost unnoticed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from mcz.files.reading.source_files import recording
from mcz.kinematics.points import point_set
from mcz.kinematics.rest_pose import NO_LENGTHS, has_no_lengths
from mcz.model.checks import ArgumentType, check_arguments
from mcz.model.clock import TIMES, TOLERANCE, numbers_or_rows
from mcz.model.motion import A_MOTION, Motion
from mcz.sources.c3d.plain import KNOWN
from mcz.sources.c3d.recording import Recording, parameters_of
from mcz.sources.tables.signals import text_columns

MOST_NAMES = 8
POINTS = ("c3d", "trc")  # formats in which joints become points
SCENES = ("glb", "usda")
GROUPS = ("POINT", "ANALOG", "FORCE_PLATFORM", "EVENT", "TRIAL")  # of C3D, written or named
SHAPED = ("bvh", "amc", *POINTS, *SCENES)  # a skeleton or its points
UNNUMBERED = ("bvh", "sto", "mot", *SCENES)
FORMATS = ("csv", "npz", "bids", "sto", "mot", *SHAPED)
FORMAT = ArgumentType(f"one of {', '.join(FORMATS)}", lambda value: value in FORMATS)
HELD_ROLES = {"c3d": KNOWN}  # formats that hold other signals, and the roles of these
ROOT = "root"  # the only name that ASF has for it


def keep_supported_signals(motion: Motion, to: str) -> Motion:
    """``motion`` with only the signals that a format of ``mcz.convert`` can hold."""
    roles = HELD_ROLES.get(to, ())
    return motion.with_signals(
        [k for k, s in enumerate(motion.signals) if not k or s.role in roles]
    )


@check_arguments(motion=A_MOTION, to=FORMAT)
def conversion_losses(motion: Motion, to: str) -> tuple[str, ...]:
    """List the facts of ``motion`` that a file of the format ``to`` cannot hold, a text each.

    ``to`` is "csv", "npz", "glb", "usda", "bids" or a format of ``mcz.convert``. Metadata are left
    out of every format, and are not listed. Raises OptionError for another format. An impossible
    conversion raises its own error.
    """
    return tuple(_conversion_losses(motion, to))


def _conversion_losses(motion: Motion, to: str) -> Iterator[str]:
    if to in SHAPED and has_no_lengths(motion.skeleton):
        yield f"{NO_LENGTHS}: all joints lie at the root until rest offsets are set"
    known = HELD_ROLES.get(to, ())
    others = [s.name for s in motion.signals[1:] if s.role not in (TIMES, *known)]
    if others:
        yield f"left out: signal {', '.join(others)}"
    yield from text_column_note(motion.metadata)
    names = [channel.label for channel in motion.skeleton.channels if not channel.kind]
    if names and to in (*POINTS, *SCENES) and point_set(motion.skeleton) != "markers":
        more = " ..." if len(names) > MOST_NAMES else ""
        yield f"left out: {', '.join(names[:MOST_NAMES])}{more}, which move nothing"
    yield from recording_facts(recording(motion))
    if to == "c3d":
        yield from _groups(motion)
    yield from _numbers(motion, to)
    if to in COUNTING:
        yield from describe_lost_times(motion, to)
    if to == "amc":
        yield from _acclaim_names(motion)


def first_gap(motion: Motion, columns: Sequence[int] | None = None) -> str | None:
    """Describe the first missing value of ``columns`` by joint and frame; None without any."""
    chosen = range(motion.skeleton.n_channels) if columns is None else columns
    bad = ~np.isfinite(np.asarray(motion.signals[0].masked(), np.float64)[:, chosen])
    if not bad.any():
        return None
    frame, place = np.argwhere(bad)[0]
    owners = [j for j, joint in enumerate(motion.skeleton.joints) for _ in joint.channels]
    joint = motion.skeleton.addresses()[owners[chosen[place]]]
    return f"joint {joint!r} has no value in frame {frame}, of {bad.sum()} missing or not finite"


def _acclaim_names(motion: Motion) -> Iterator[str]:
    roots = [joint.name for joint in motion.skeleton.joints if joint.parent < 0]
    if roots and roots[0] != ROOT:
        yield f"joint {roots[0]!r} is called {ROOT}"
    bones = [joint.name for joint in motion.skeleton.joints if joint.parent >= 0]
    unnamable = [name for name in bones if not name or any(c <= " " or c in "()" for c in name)]
    if unnamable:
        names = ", ".join(map(repr, unnamable[:MOST_NAMES])) + (
            " ..." if len(unnamable) > MOST_NAMES else ""
        )
        yield f"ASF cannot hold the joint names {names}: they have _ instead"


def text_column_note(metadata: Mapping[str, str]) -> Iterator[str]:
    """The columns of text of a table: no other file has them."""
    if texts := text_columns(metadata):
        yield f"left out: columns of text: {texts}"


def recording_facts(recorded: Recording | None) -> Iterator[str]:
    """Yield the facts of a C3D besides its numbers, which no other file, nor a plain C3D, has."""
    if recorded is None:
        return
    counts = ((len(recorded.events), "event"), (len(recorded.platforms), "force platform"))
    facts = [f"{count} {noun}{'s' if count > 1 else ''}" for count, noun in counts if count]
    if facts:
        yield f"left out: {', '.join(facts)}"


def _groups(motion: Motion) -> Iterator[str]:
    """The groups of parameters of a C3D that a plain one has not."""
    source = motion.source
    if source is None or recording(motion) is None:
        return
    parameters = parameters_of(source.format, source.template, source.detail).found
    groups = [
        group for group in dict.fromkeys(group for group, _ in parameters) if group not in GROUPS
    ]
    if groups:
        more = " ..." if len(groups) > MOST_NAMES else ""
        yield f"left out: parameters of {', '.join(groups[:MOST_NAMES])}{more}"


def _numbers(motion: Motion, to: str) -> Iterator[str]:
    numbers = motion.frame_numbers
    if numbers is None or not len(numbers):
        return
    if to in UNNUMBERED and (numbers != np.arange(1, len(numbers) + 1)).any():
        yield f"left out: frame numbers, which begin with {numbers[0]}"
    elif to == "c3d" and first_number(motion) != numbers[0]:
        first = f"they begin with {first_number(motion)}, as the times say"
        yield f"left out: frame numbers, which begin with {numbers[0]}: {first}"
    elif to == "c3d" and (np.diff(numbers) != 1).any():
        yield f"left out: frame numbers but the first, {numbers[0]}: C3D counts on"


COUNTING = ("bvh", "amc", "c3d")


def drop_time_signal(motion: Motion, to: str) -> Motion:
    """``motion`` for a file that counts frames: without a signal of times.

    The first frame of a C3D has the number that implies its time.
    """
    if to == "c3d":
        first = first_number(motion)
        if first != numbers_or_rows(motion.frame_numbers, motion.n_frames)[:1].sum():
            numbers = first + np.arange(motion.n_frames)
            motion = replace(motion, frame_numbers=numbers, first_time=None, number_step=1)
    if not motion.signals_of(TIMES):
        return motion
    return motion.with_signals([k for k, s in enumerate(motion.signals) if s.role != TIMES])


def first_number(motion: Motion) -> int:
    """The number of the first frame in a C3D, if frame 1 is at 0 s; else the motion's."""
    numbers = numbers_or_rows(motion.frame_numbers, motion.n_frames)
    line, rate = motion.timeline, motion.frame_rate
    own = int(numbers[0]) if len(numbers) else 0
    if line is None or rate is None or not len(line.times):
        return own
    first = float(line.regular_times[0]) * float(rate) + 1
    if abs(first - own) / float(rate) <= line.rounding / 2 + TOLERANCE or not 0 <= first < 2**32:
        return own
    return round(first)


def describe_lost_times(motion: Motion, to: str) -> Iterator[str]:
    """Times that such a file cannot state, in words: their begin, and breaks."""
    line, rate, name = motion.timeline, motion.frame_rate, to.upper()
    if line is None or not len(line.times):
        return
    if rate is None:
        yield f"left out: times, which {name} cannot state without a frame rate"
        return
    numbers, step = numbers_or_rows(motion.frame_numbers, motion.n_frames), 1
    frames = np.arange(len(numbers), dtype=np.float64)
    if to == "amc":
        yield f"left out: the frame rate, {float(rate):g} a second"
        frames, step = numbers.astype(np.float64) - 1, motion.number_step
    elif to == "c3d":
        frames += first_number(motion) - 1
    even, times = frames / float(rate * step), line.regular_times
    allowed = line.rounding + TOLERANCE
    if abs(times[0] - even[0]) > allowed:
        first = f"{times[0]:.6g} s: {name} begins at {even[0]:.6g} s"
        yield f"left out: the time of the first frame, {first}"
    errors = (times - times[0]) - (even - even[0])
    if np.abs(errors).max() <= 2 * allowed:
        return
    gaps = np.diff(times)[np.isnan(line.steps)]
    if len(gaps):
        many = f"{len(gaps)} gaps in time, the longest" if len(gaps) > 1 else "a gap in time"
        yield f"left out: {many} of {gaps.max():.6g} s: {name} has frame after frame"
    else:
        yield f"left out: times that are not uniform: {name} has frame after frame"
