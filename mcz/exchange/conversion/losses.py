"""Notes on facts that a format cannot hold, so that nothing is lost unnoticed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from mcz.exchange.conversion.counted_times import COUNTING, first_number, lost_times
from mcz.files.reading.source_info import recording
from mcz.kinematics import point_set
from mcz.kinematics.rest_pose import NO_LENGTHS, has_no_lengths
from mcz.model.clock import TIMES
from mcz.model.motion import Motion
from mcz.sources.c3d.plain import KNOWN
from mcz.sources.c3d.recording import Recording, parameters_of
from mcz.sources.tables.signals import text_columns

MOST_NAMES = 8
POINTS = ("c3d", "trc")  # what becomes of joints are points
SCENES = ("glb", "usda")
GROUPS = ("POINT", "ANALOG", "FORCE_PLATFORM", "EVENT", "TRIAL")  # of C3D, written or named
SHAPED = ("bvh", "amc", *POINTS, *SCENES)  # a skeleton or its points
UNNUMBERED = ("bvh", "sto", "mot", *SCENES)
HELD = {"c3d": KNOWN}  # roles of signals beside the motion, of the formats that hold any
ROOT = "root"  # the only name that ASF has for it


def held(motion: Motion, to: str) -> Motion:
    """``motion`` with the signals alone that a format of ``mcz.convert`` has a place for."""
    roles = HELD.get(to, ())
    return motion.with_signals(
        [k for k, s in enumerate(motion.signals) if not k or s.role in roles]
    )


def left_out(motion: Motion, to: str) -> tuple[str, ...]:
    """List the facts of ``motion`` that a file of the format ``to`` cannot hold, a text each.

    ``to`` is "csv", "npz", "glb", "usda" or a format of ``mcz.convert``. Metadata are left out of
    every format, and are not named. What makes a format impossible is an error of the conversion.
    """
    return tuple(_left_out(motion, to))


def _left_out(motion: Motion, to: str) -> Iterator[str]:
    if to in SHAPED and has_no_lengths(motion.skeleton):
        yield f"{NO_LENGTHS}: all joints lie where the root is, until rest offsets are given"
    known = HELD.get(to, ())
    others = [s.name for s in motion.signals[1:] if s.role not in (TIMES, *known)]
    if others:
        yield f"left out: signal {', '.join(others)}"
    yield from of_text(motion.metadata)
    names = [channel.label for channel in motion.skeleton.channels if not channel.kind]
    if names and to in (*POINTS, *SCENES) and point_set(motion.skeleton) != "markers":
        more = " ..." if len(names) > MOST_NAMES else ""
        yield f"left out: {', '.join(names[:MOST_NAMES])}{more}, which move nothing"
    yield from of_recording(recording(motion))
    if to == "c3d":
        yield from _groups(motion)
    yield from _numbers(motion, to)
    if to in COUNTING:
        yield from lost_times(motion, to)
    if to == "amc":
        yield from _acclaim_names(motion)


def first_gap(motion: Motion, columns: Sequence[int] | None = None) -> str | None:
    """Describe the first missing value of ``columns`` by joint and frame; None if all are there."""
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
    odd = [name for name in bones if not name or any(c <= " " or c in "()" for c in name)]
    if odd:
        shown = ", ".join(map(repr, odd[:MOST_NAMES])) + (" ..." if len(odd) > MOST_NAMES else "")
        yield f"ASF cannot hold the joint names {shown}: they have _ instead"


def of_text(metadata: Mapping[str, str]) -> Iterator[str]:
    """The columns of text of a table: no other file has them."""
    if texts := text_columns(metadata):
        yield f"left out: columns of text: {texts}"


def of_recording(told: Recording | None) -> Iterator[str]:
    """Yield the facts of a C3D beside its numbers, which no other file, nor a plain C3D, has."""
    if told is None:
        return
    counts = ((len(told.events), "event"), (len(told.platforms), "force platform"))
    found = [f"{count} {what}{'s' if count > 1 else ''}" for count, what in counts if count]
    if found:
        yield f"left out: {', '.join(found)}"


def _groups(motion: Motion) -> Iterator[str]:
    """The groups of parameters of a C3D that a plain one has not."""
    source = motion.source
    if source is None or recording(motion) is None:
        return
    found = parameters_of(source.format, source.template, source.detail).found
    groups = [group for group in dict.fromkeys(group for group, _ in found) if group not in GROUPS]
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
