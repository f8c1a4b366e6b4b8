"""Decode and re-encode clips that cannot be cut as stored, if the caller allows it.

``extraction.py`` and ``replacing.py`` use it; SPEC.md, "Cutting without re-encoding" and "Replacing
a joint", define their notes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mcz.errors import MotionError, OptionError
from mcz.files.editing.cutting import WITHOUT_CHANNELS, ClipCut, add_note, joint_of_column
from mcz.files.editing.recoding import recorded_options
from mcz.files.reading.clip import Clip
from mcz.files.reading.source_info import stating_rate
from mcz.model.motion import Motion, Signal
from mcz.model.types import Settings
from mcz.sources import FORMATS

OF_JOINTS = ("contacts", "quality")  # settings that name joints, which may be missing


def check_anew(clip: Clip, *, whole: bool = False) -> None:
    """Raise OptionError for a clip that cannot be encoded again; ``whole``: all joints."""
    info = clip.signals[0]
    if info.exact and not (whole and "param.lossless" in (clip.quality or {})):
        raise OptionError(
            "some of its joints are coded exactly, and would not be any more", clip=clip.name
        )
    if not info.codec.lossless and (clip.quality or {}).get("codec") != info.codec.name:
        raise OptionError(
            "no quality record states its settings; decode it and encode it again", clip=clip.name
        )


def settings_of(clip: Clip) -> Settings:
    """The settings of a clip that differ from the defaults."""
    codec = clip.signals[0].codec
    usual = codec.options({})
    settings = recorded_options(codec, clip.quality or {})
    if codec.promise:
        settings.pop("preset", None)  # the setting of the dial is its result
    return {name: value for name, value in settings.items() if value != usual[name]}


def with_own_source(motion: Motion, clip: Clip) -> tuple[Motion, str | None]:
    """The rest of ``clip`` with a source of its own values, or without one and the reason."""
    motion = stating_rate(motion, clip.frame_numbers)
    if motion.source is None:
        return motion, None
    source = motion.source.of_no_file()
    try:
        FORMATS[source.format].write(replace(motion, source=source))
    except MotionError as error:
        metadata = dict(motion.metadata)
        add_note(metadata, "source-note", f"the source file was left out: {error}")
        left = replace(motion, metadata=metadata).without_source()
        return left.at_times(motion.timeline), str(error)
    signals = tuple(map(_on_binary_grids, motion.signals))
    return replace(motion, signals=signals, source=source), None


def _on_binary_grids(signal: Signal) -> Signal:
    if all(grid.is_text for _, _, grid in signal.grid_blocks()):
        return signal
    ordinals, exact = signal.to_ordinals()
    values = signal.values.copy()
    for rows, columns, grid in signal.grid_blocks():
        nearest = grid.values(ordinals[rows][:, columns])
        stray = ~exact[rows][:, columns] & np.isfinite(nearest)
        if not grid.is_text:
            values[rows, columns] = np.where(stray, nearest, values[rows, columns])
    return replace(signal, values=values)


def joints_alone(cut: ClipCut) -> Motion:
    """Decode the joints of a cut: other joints have no channels, and there is no source."""
    motion = cut.clip.motion((cut.start, cut.stop), cut.resolution)
    if cut.joints is None:
        return motion
    owners = np.array(joint_of_column(motion.skeleton))
    columns = np.flatnonzero(np.isin(owners, sorted(cut.joints)))
    joints = tuple(
        joint if index in cut.joints else replace(joint, channels=())
        for index, joint in enumerate(motion.skeleton.joints)
    )
    skeleton = replace(motion.skeleton, joints=joints, base=cut.clip.skeleton_id, source=None)
    whole = motion.signals[0]
    number = {int(column): place for place, column in enumerate(columns)}
    signal = Signal(
        whole.values[:, columns],
        grids=tuple(whole.grids[column] for column in columns),
        name=whole.name,
        mask=None if whole.mask is None else whole.mask[:, columns],
        grid_changes=tuple((r, number[c], g) for r, c, g in whole.grid_changes if c in number),
        ordinals=None if whole.ordinals is None else whole.ordinals[:, columns],
    )
    metadata = dict(motion.metadata)
    add_note(metadata, "skeleton-note", WITHOUT_CHANNELS)
    made = replace(
        motion,
        skeleton=skeleton,
        signals=(signal, *motion.signals[1:]),
        source=None,
        metadata=metadata,
    )
    return made.at_times(motion.timeline)


def settings_of_joints(clip: Clip) -> Settings:
    """The settings of a clip that suit some of its joints alone."""
    codec = clip.signals[0].codec
    settings = {k: v for k, v in settings_of(clip).items() if k not in OF_JOINTS}
    # Point positions of the base are kept: with fewer joints they would be derived again.
    return settings | {"domain": "channels"} if codec.has("domain") else settings
