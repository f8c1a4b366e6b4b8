"""Files to motions: a clip, several, or what a query takes; in part, coarse, or as salvaged.

Nothing here knows Blender. All errors are ``mcz.MczError`` on one line.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path

import numpy as np

import mcz

SUFFIXES = (".mcz", ".bvh", ".amc", ".c3d", ".trc")
MOST_FOUND = 500  # clips that a search lists


@dataclass(frozen=True)
class Wanted:
    """Selection of clips and frames of a file.

    ``clip`` names one; ``where`` is a query that takes several; ``every``: all of them. ``first``
    <= frame < ``stop`` (0: to the end), every ``step``-th; ``resolution`` leaves out that many of
    the finest details, and is lowered to what a clip has. ``skeleton`` is the ASF of an AMC.
    ``salvage`` reads what a damaged file still holds.
    """

    clip: str = ""
    where: str = ""
    every: bool = False
    first: int = 0
    stop: int = 0
    step: int = 1
    resolution: int = 0
    skeleton: str = ""
    salvage: bool = False


@dataclass(frozen=True)
class Loaded:
    """A motion and where its frames lie: ``numbers`` (n_frames,) from 0, those of the clip."""

    motion: mcz.Motion
    numbers: np.ndarray
    rate: Fraction | None  # of the clip's own frames
    notes: tuple[str, ...]


def loaded(path: str, wanted: Wanted) -> Iterator[tuple[int, Loaded]]:
    """Each motion that is wanted, and how many there are."""
    if Path(path).suffix.lower() != ".mcz":
        yield 1, _from_source(path, wanted)
        return
    with mcz.open(path, salvage=wanted.salvage) as file:
        notes = tuple(file.damage)
        clips = _chosen(file, wanted)
        for clip in clips:
            yield len(clips), _from_clip(clip, wanted, notes)


def _chosen(file: mcz.File, wanted: Wanted) -> list[mcz.Clip]:
    if wanted.clip:
        return [file.only_clip(wanted.clip)]
    if wanted.where:
        return file.select_clips(None, wanted.where)
    return list(file) if wanted.every and len(file) else [file.only_clip()]


def _from_clip(clip: mcz.Clip, wanted: Wanted, notes: tuple[str, ...]) -> Loaded:
    frames = _range(clip.n_frames, wanted, clip.name)
    resolution = clip.signals[0].coarser(wanted.resolution)
    if resolution < wanted.resolution:
        notes += (f"clip {clip.name!r} has resolutions 0 to {resolution}",)
    motion = clip.motion(frames, resolution, decimate=True)
    step = 2**resolution
    return _stepped(motion, frames[0], step, wanted.step, clip.frame_rate, notes)


def _from_source(path: str, wanted: Wanted) -> Loaded:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", mcz.SkeletonWarning)
        motion = mcz.read(path, skeleton=wanted.skeleton or None)
    notes = tuple(str(w.message) for w in caught if issubclass(w.category, mcz.SkeletonWarning))
    start, stop = _range(motion.n_frames, wanted, motion.name)
    if (start, stop) != (0, motion.n_frames):
        signals = tuple(signal.cut(start, stop) for signal in motion.signals)
        motion = replace(motion, signals=signals, frame_numbers=None, source=None)
    return _stepped(motion, start, 1, wanted.step, motion.frame_rate, notes)


def _range(n_frames: int, wanted: Wanted, name: str) -> tuple[int, int]:
    stop = wanted.stop or n_frames
    if not 0 <= wanted.first < stop <= n_frames and n_frames:
        raise mcz.OptionError(f"{name!r} has {n_frames} frames, not {wanted.first}:{stop}")
    return wanted.first, stop


def _stepped(
    motion: mcz.Motion,
    first: int,
    apart: int,
    step: int,
    rate: Fraction | None,
    notes: tuple[str, ...],
) -> Loaded:
    """Every ``step``-th frame of ``motion``, whose own are ``apart`` frames of the clip apart."""
    rows = np.arange(0, motion.n_frames, step)
    per_frame = motion.signals[0].samples_per_frame
    values = motion.values[:: step * per_frame]
    signal = mcz.Signal(np.ascontiguousarray(values, np.float64))
    if len(motion.signals) > 1:
        left = ", ".join(signal.name for signal in motion.signals[1:])
        notes += (f"{motion.name!r}: left out: {left}",)
    thin = replace(motion, signals=(signal,), frame_numbers=None, source=None)
    return Loaded(thin, first + apart * rows, rate, notes)


def found(path: str, text: str) -> list[tuple[str, str]]:
    """The clips of an archive that ``text`` finds, at most 500: names, and a line about each.

    ``text`` is a query of MCZ where it reads as one, such as ``n_frames > 500 and subject == 5``.
    Otherwise every word of it is to be in the name or the metadata. Raises MczError.
    """
    with mcz.open(path) as file:
        try:
            clips = list(file.find(text)) if text.strip() else list(file)
        except mcz.OptionError:
            words = text.lower().split()
            clips = [clip for clip in file if all(word in _text(clip) for word in words)]
        return [(clip.name, _line(clip)) for clip in clips[:MOST_FOUND]]


def _text(clip: mcz.Clip) -> str:
    return "\n".join([clip.name, *clip.metadata.values()]).lower()


def _line(clip: mcz.Clip) -> str:
    rate = f" at {float(clip.frame_rate):g} Hz" if clip.frame_rate else ""
    said = "; ".join(f"{key}: {value}" for key, value in list(clip.metadata.items())[:4])
    return f"{clip.n_frames} frames{rate}, {clip.codec}{'; ' if said else ''}{said}"
