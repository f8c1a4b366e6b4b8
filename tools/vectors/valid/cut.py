"""Valid: clips that were cut from others without re-encoding."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from mcz.codecs.lossless import lossless
from mcz.formats import bvh
from mcz.formats.notes import join_notes
from mcz.motion import Channel, Joint, Motion, Signal, Skeleton, Source
from mcz.numbers import Grid, GridKind
from tools.vectors.build.cuts import CUT_HEADING, cut, shown, window
from tools.vectors.build.files import Vector, Whole, file_of, partial
from tools.vectors.build.motions import (
    HUNDREDTHS,
    dance,
    wave,
    with_exceptions,
    with_grid_changes,
    with_mask,
)
from tools.vectors.build.source_files import ODD, PLAIN, take


def vectors() -> Iterable[Vector]:
    shelf = Whole("valid/cut")
    _frames(shelf)
    _signals(shelf)
    _notes(shelf)
    _joints(shelf)
    _sources(shelf)
    return shelf.vectors


def _frames(shelf: Whole) -> None:
    long = dance(8)
    for start, stop in ((1, 5), (3, 6), (4, 4), (0, 7)):
        motion = shown(long, start, stop)
        data = cut(file_of(long, segment_frames=3), frames=(start, stop))
        purpose = f"Frames {start} to {stop - 1} of 8, of segments of 3, 3 and 2 frames."
        size = stop - start
        parts = tuple(partial(motion, (a, size), (1,)) for a in {0, size // 2})
        spec = f"{CUT_HEADING}; CLIP; DATA; CEND"
        shelf.hold(f"frames-{start}-{stop}", spec, purpose, data, motion, parts=parts)
    motion = replace(shown(long, 7, 8), frame_numbers=None)
    purpose = "Two segments are stored before the only frame that is shown; no reader needs them."
    data = file_of(long, segment_frames=3, **window(long, 7, 8))
    shelf.hold("segments-before", f"{CUT_HEADING}; CLIP", purpose, data, motion)


def _signals(shelf: Whole) -> None:
    samples = Signal(
        np.arange(32, dtype=np.int64).reshape(16, 2) * 1000 - 7,
        (Grid(GridKind.INTEGER),) * 2,
        name="analog",
        role="analog",
        samples_per_frame=2,
        channels=(Channel("", "emg", "V"), Channel("", "force", "N")),
    )
    whole = replace(dance(8), signals=(*dance(8).signals, samples))

    def longer(made: Any) -> Any:
        """The segments of the second signal are one."""
        parts = [part for part in made if part[0].signal == 0]
        return [*parts, *other]

    other: list[Any] = []

    def keep(made: Any) -> Any:
        other[:] = [part for part in made if part[0].signal == 1]
        return made

    file_of(whole, segments=keep)
    data = cut(file_of(whole, segment_frames=3, segments=longer), frames=(4, 6))
    purpose = "Each signal has frames of its own before and after those that are shown."
    motion = shown(whole, 4, 6)
    parts = (partial(motion, (1, 2)), partial(motion, (0, 1), (1,)))
    shelf.hold("two-signals", f"{CUT_HEADING}; CLIP", purpose, data, motion, parts=parts)


def _notes(shelf: Whole) -> None:
    for name, whole in (
        ("exceptions", with_exceptions()),
        ("grid-changes", with_grid_changes()),
        ("mask", with_mask()),
    ):
        start, stop = 1, whole.n_frames - 1
        data = cut(file_of(whole), frames=(start, stop))
        purpose = f"A clip with {name}, in frames that are shown and in others."
        motion = shown(whole, start, stop)
        shelf.hold(name, f"{CUT_HEADING}; Group notes; Masks", purpose, data, motion)


def _joints(shelf: Whole) -> None:
    columns = [wave(12, seed) for seed in range(4)]
    table = np.array([columns[c] for c in (0, 1, 2, 3, 2, 1)]).T  # two copies
    joints = tuple(Joint(f"dial {j}", j - 1, channels=_scalars(2 * j)) for j in range(3))
    whole = Motion(Skeleton(joints), (Signal(table, (HUNDREDTHS,) * 6),), name="dials")
    data = cut(file_of(whole, codec=lossless.CODEC), joints=[1])
    motion = _joint_alone(whole, (1,))
    purpose = "One of three joints: the others keep their places in the skeleton."
    shelf.hold(
        "joint",
        f"{CUT_HEADING}; SKEL",
        purpose,
        data,
        motion,
        parts=(partial(motion, (2, 5), (1,)),),
    )
    table = np.array([columns[c] for c in (0, 1, 2, 3, 2, 3)]).T
    whole = replace(whole, signals=(Signal(table, (HUNDREDTHS,) * 6),))
    data = cut(file_of(whole, codec=lossless.CODEC), joints=[1, 2], frames=(2, 12))
    motion = shown(_joint_alone(whole, (1, 2)), 2, 12)
    purpose = "Copies of channels of a group that has another number since joints were cut."
    parts = (partial(motion, (0, 3), (2,)),)
    spec = f"{CUT_HEADING}; Codec 128: lossless"
    shelf.hold("copies", spec, purpose, data, motion, parts=parts)


def _scalars(first: int) -> tuple[Channel, ...]:
    return tuple(Channel("", f"needle {c}") for c in (first, first + 1))


def _joint_alone(motion: Motion, kept: tuple[int, ...]) -> Motion:
    columns = [c for joint in kept for c in motion.skeleton.columns(joint)]
    joints = tuple(
        joint if index in kept else replace(joint, channels=())
        for index, joint in enumerate(motion.skeleton.joints)
    )
    signal = motion.signals[0]
    values, grids = signal.values[:, columns], tuple(signal.grids[c] for c in columns)
    return replace(motion, skeleton=Skeleton(joints), signals=(Signal(values, grids),))


def _sources(shelf: Whole) -> None:
    for name, text in (("plain", PLAIN), ("odd", ODD)):
        whole = take(text, name)
        start, stop = 1, whole.n_frames - 1
        data = cut(file_of(whole, segment_frames=2), frames=(start, stop))
        motion = replace(shown(whole, start, stop), source=_cut_source(whole, start, stop))
        shelf.hold(
            f"source-{name}",
            f"{CUT_HEADING}; Source reconstruction; Frame notes of AMC and BVH",
            f"A BVH file without its first and last frame ({name}).",
            data,
            motion,
            sources=((f"{name}.bvh", bvh.write(motion)),),
            modes=("arrays", "sources"),
        )


def _cut_source(motion: Motion, start: int, stop: int) -> Source:
    source = motion.source
    assert source is not None
    if source.notes is None:
        return source
    notes = join_notes([(0, stop - start, source.notes.cut(start, stop))])
    return replace(source, notes=notes)
