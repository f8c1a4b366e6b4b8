"""Trials of a setting: the clip is written to memory, and measured as a reader has it.

Nothing is trusted that the public reader did not give.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.contract import Codec
from mcz.container.limits import Profile
from mcz.container.reader import Container
from mcz.container.source import open_source
from mcz.errors import ContactWarning, OptionError
from mcz.kinematics import positions_of
from mcz.metrics import Comparison, compare
from mcz.motion import Motion
from mcz.reading.clip import Clip
from mcz.reading.sizes import clip_sizes
from mcz.types import Params
from mcz.writing.clip_writer import file_in_memory
from mcz.writing.prepare import Prepared

Floats = NDArray[np.float64]

BLOCK_FRAMES = 4096  # whose positions are in memory at a time


@dataclass(frozen=True, slots=True)
class Target:
    """What was asked for; the figure of that name must not exceed ``limit``.

    ``falls``: the figure falls as the files get smaller (a size), instead of rising (an error).
    """

    name: str
    limit: float
    falls: bool


class Trials:
    """The figures of a clip at one setting of the dial, measured on a file in memory."""

    def __init__(self, motion: Motion, codec: Codec, params: Params, profile: Profile) -> None:
        self.motion, self.codec, self.params, self.profile = motion, codec, params, profile
        self.alone = replace(motion, signals=motion.signals[:1])
        self.others = 0.0  # bytes of the further signals, which no dial changes

    def given(self, more: Params) -> Trials:
        """Trials with more parameters."""
        return Trials(self.motion, self.codec, {**self.params, **more}, self.profile)

    def __call__(self, target: Target, setting: float) -> float:
        """The figure of ``target`` at a setting of the dial."""
        assert self.codec.dial is not None
        return self.figure(target, {self.codec.dial.parameter: setting})

    def figure(self, target: Target, found: Params) -> float:
        """The figure of ``target`` with these parameters."""
        figure = self._measure(self.alone, target, found)
        if len(self.motion.signals) > 1 and target.falls:
            if not self.others:
                self.others = self._measure(self.motion, target, found) - figure
            figure += self.others
        return figure

    def frame_errors(self, found: Params) -> Floats:
        """The greatest position error of each frame in cm with these parameters, (n_frames,)."""
        clip = self._written(self.alone, found)[1]
        unit, decoded = self.motion.skeleton.unit_cm, clip.motion()
        assert unit is not None
        greatest = np.zeros(self.motion.n_frames)
        for start in range(0, len(greatest), BLOCK_FRAMES):
            rows = slice(start, start + BLOCK_FRAMES)
            ours, theirs = (
                positions_of(motion.skeleton, np.asarray(motion.values[rows], np.float64))
                for motion in (self.alone, decoded)
            )
            distances = np.sqrt(((ours - theirs) ** 2).sum(axis=2))
            greatest[rows] = np.nan_to_num(distances).max(axis=1, initial=0.0) * unit
        return greatest

    def joint_errors(self, found: Params) -> Floats:
        """The mean position error of each joint in cm with these parameters, (n_joints,).

        0 for one that has no point.
        """
        decoded = self._written(self.alone, found)[1].motion()
        figures = compare(self.alone, decoded, virtual_markers=False, shell_cm=None).by_joint
        unit = self.motion.skeleton.unit_cm
        return np.array([(figure.mean_position_error or 0.0) * (unit or 0.0) for figure in figures])

    def _written(self, motion: Motion, found: Params) -> tuple[Container, Clip]:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ContactWarning)  # that of the clip itself counts
            params = {**self.params, **found}
            data = file_in_memory(Prepared(motion), self.codec, params, self.profile)
        container = Container(open_source(data), max_decoded=2**53)
        return container, Clip(container, container.directory.clips[motion.name])

    def _measure(self, motion: Motion, target: Target, found: Params) -> float:
        container, clip = self._written(motion, found)
        if not target.falls:
            figures = compare(motion, clip.motion(), virtual_markers=False, shell_cm=None)
            return _error(target, figures)
        sizes = clip_sizes(container, clip)
        if target.name == "target_bytes":
            return float(sizes.payload + sizes.overhead + sizes.models)
        assert motion.frame_rate is not None
        return float(sizes.payload * 8 * motion.frame_rate / motion.n_frames / 1000)


def _error(target: Target, comparison: Comparison) -> float:
    name = target.name.replace("_error_cm", "_position_error_cm")
    value = getattr(comparison, name)
    if value is None:
        why = "; ".join(comparison.notes) or "no position is known in any frame"
        raise OptionError(f"{target.name} has no meaning: {why}")
    return float(value)
