"""The clips of Kwak and Bajic's tables, and those at hand that stand beside them.

A clip is coded as markers: those of a C3D file, the points of a skeleton, or a set of markers that
is made of a skeleton's virtual ones.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import mcz
from mcz.bench.cases import Case, find_cases
from mcz.errors import MczError, OptionError
from mcz.kinematics.points import in_positions
from mcz.model.motion import Motion, Signal

Floats = NDArray[np.float64]

# The paper's test clips.
MARKERS = ("13_29", "85_12", "86_02", "86_08")
SKELETONS = ("17_08", "17_10", "85_12", "15_04")
OURS = ("01_01", "14_08")  # skeletons beside them
NAMES = tuple(dict.fromkeys((*MARKERS, *SKELETONS, *OURS)))
LEAST_FRAMES = 1000  # of C3D files that are no clips of the paper
BVH_POINTS = 38  # of the conversion that the literature uses
FRAME_RATE = Fraction(120)  # of CMU's files; an AMC says none
CMU_UNIT_CM = 2.54 / 0.45  # of its skeletons and what is converted from them
CMU = re.compile(r"\d+_\d+$")

# What is coded.
MARKED, MADE, POINTS, VIRTUAL = "markers", "41 virtual markers", "points", "with virtual markers"

# 41 of the virtual markers of CMU's skeleton, about where a set of that many has its own: four on
# the head, five on the trunk, four on the pelvis, seven on an arm, seven on a leg.
_SIDE = (
    *("clavicle+y", "humerus+x", "radius+y", "radius+z", "wrist+x", "wrist+z", "hand+y"),
    *("femur+x", "femur+z", "tibia+x", "foot+x", "foot+z", "toes+x", "toes+z"),
)
MARKERS_41 = (
    *("head+x", "head+y", "head+z", "upperneck+z"),
    *("lowerneck+z", "thorax+x", "thorax+z", "upperback+x", "upperback+z"),
    *("lhipjoint+x", "lhipjoint+z", "rhipjoint+x", "rhipjoint+z"),
    *(f"{side}{name}" for side in "lr" for name in _SIDE),
)


@dataclass(frozen=True, slots=True)
class Clip:
    """A file and what of it is coded."""

    case: Case
    form: str

    @property
    def name(self) -> str:
        """
        >>> Clip(Case("cmu/01_01.c3d"), MARKED).name, Clip(Case("13_29.amc"), MADE).name
        ('01_01.c3d', '13_29.amc, 41 markers')
        """
        name = Path(self.case.path).name
        return f"{name}, 41 markers" if self.form == MADE else name

    @property
    def stem(self) -> str:
        return self.case.name

    @property
    def is_markers(self) -> bool:
        return self.form in (MARKED, MADE)


def find_clips(paths: Sequence[str], unit: str | None) -> list[Clip]:
    """Markers, then skeletons; raises OptionError where there is none."""
    cases = find_cases(paths, unit)
    clips = [*_markers(cases), *_skeletons(cases)]
    if not clips:
        raise OptionError(
            f"kwak: neither a C3D file of {LEAST_FRAMES} frames nor one of {', '.join(NAMES)} here"
        )
    return clips


def _of_suffix(cases: Sequence[Case], suffix: str) -> list[Case]:
    return [case for case in cases if Path(case.path).suffix.lower() == suffix]


def _markers(cases: Sequence[Case]) -> Iterator[Clip]:
    files = {case.name: case for case in reversed(_of_suffix(cases, ".c3d")) if _is_long(case)}
    for name in MARKERS:
        if name in files:
            yield Clip(files.pop(name), MARKED)
            continue
        for case in _of_suffix(cases, ".amc"):
            if case.name == name and _has_41(case):
                yield Clip(case, MADE)
                break
    for name in sorted(files):
        yield Clip(files[name], MARKED)


def _is_long(case: Case) -> bool:
    try:
        motion = mcz.read(case.path, unit=case.unit)
    except MczError:  # no C3D file, or no such unit
        return False
    is_known = bool(motion.skeleton.unit_cm and motion.frame_rate and motion.values.size)
    return is_known and (motion.n_frames >= LEAST_FRAMES or case.name in MARKERS)


def _has_41(case: Case) -> bool:
    try:
        motion_in_positions(Clip(case, MADE))
    except MczError:
        return False
    return True


def _skeletons(cases: Sequence[Case]) -> Iterator[Clip]:
    for name in dict.fromkeys((*SKELETONS, *OURS)):
        files = [case for case in _of_suffix(cases, ".bvh") if case.name == name]
        found = [case for case in files if _n_points(case) == BVH_POINTS]
        found += [case for case in _of_suffix(cases, ".amc") if case.name == name]
        if found:
            yield Clip(found[0], POINTS)


def _n_points(case: Case) -> int:
    try:
        return int(mcz.positions(mcz.read(case.path)).shape[1])
    except MczError:
        return 0


@lru_cache(maxsize=2)
def source_of(clip: Clip) -> Motion:
    """The motion of a file, its first signal alone, with what CMU's files do not say of themselves.

    Of a BVH without its first frame: a pose that was put there by the conversion, of which no
    paper's count of frames knows. Raises SourceError or OptionError.
    """
    motion = mcz.read(clip.case.path, unit=clip.case.unit)
    skeleton, signal = motion.skeleton, motion.signals[0]
    if Path(clip.case.path).suffix.lower() == ".bvh" and motion.n_frames > 1:
        signal = signal.cut(1, motion.n_frames)
    if skeleton.unit_cm is None and CMU.match(clip.stem):
        skeleton = replace(skeleton, unit_cm=CMU_UNIT_CM)
    rate = motion.frame_rate or FRAME_RATE
    return replace(motion, skeleton=skeleton, frame_rate=rate, signals=(signal,), source=None)


@lru_cache(maxsize=4)
def motion_in_positions(clip: Clip) -> Motion:
    """Markers of a clip as input of the codec. Raises MotionError, OptionError too."""
    motion = source_of(clip)
    if clip.form == MARKED:
        return _trim_unseen(motion)
    if clip.form == MADE:
        return _virtual_markers(motion)
    return in_positions(motion, virtual_markers=clip.form == VIRTUAL)


def _trim_unseen(motion: Motion) -> Motion:
    """Without the frames at both ends in which no marker was seen."""
    mask = motion.signals[0].mask
    if mask is None or not mask.any():
        return motion
    seen = np.flatnonzero(mask.any(axis=1))
    return replace(motion, signals=(motion.signals[0].cut(int(seen[0]), int(seen[-1]) + 1),))


def _virtual_markers(motion: Motion) -> Motion:
    """41 virtual markers in mm; raises OptionError where the skeleton is not CMU's."""
    whole = in_positions(motion, virtual_markers=True)
    names = [joint.name for joint in whole.skeleton.joints]
    missing = [name for name in MARKERS_41 if name not in names]
    if missing:
        raise OptionError(f"{motion.name}: no virtual marker {missing[0]}")
    numbers = np.array([names.index(name) for name in MARKERS_41])
    scale = 10 * (whole.skeleton.unit_cm or 1.0)
    columns = (3 * numbers[:, None] + np.arange(3)).ravel()
    joints = tuple(whole.skeleton.joints[n] for n in numbers)
    skeleton = replace(whole.skeleton, joints=joints, unit_cm=0.1, base=None)
    signal = Signal(np.asarray(whole.values[:, columns], np.float64) * scale)
    return replace(whole, skeleton=skeleton, signals=(signal,))
