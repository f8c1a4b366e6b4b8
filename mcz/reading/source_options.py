"""Facts of a source file that its caller states, and how it is to be taken."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from fractions import Fraction

from mcz.errors import OptionError
from mcz.formats.arrays.kinds import kinds_of, with_kinds
from mcz.formats.arrays.shaped import with_model
from mcz.motion import Motion, Skeleton
from mcz.units import facing, in_unit, unit_cm_of


@dataclass(frozen=True, slots=True)
class SourceOptions:
    """What the caller says of a source file.

    ``skeleton`` is the ASF of an AMC, "none" for none. ``rate`` in frames a second, ``unit``,
    ``up``, the axis that points up ("y", "-z"), ``forward``, the one that a figure faces, and
    ``handedness`` ("right", "left") say what the file does not; ``force_rate``: the rate holds also
    where the file states one. ``arrays`` says what plain arrays are, ``model`` how long the bones
    of bodies are, see ``mcz.read``. ``verbatim``: a file that cannot be parsed is kept as an
    attachment. ``keep_skeleton``: an ASF is restored as well, under its own name. ``flat``: a file
    for which several skeletons around may be meant is kept without one. Raises OptionError for an
    unknown unit, axis, kind of arrays, or a rate that is no positive number.
    """

    skeleton: str | os.PathLike[str] | None = None
    rate: Fraction | float | None = None
    force_rate: bool = True
    unit: str | None = None
    up: str | None = None
    arrays: str | None = None
    model: str | os.PathLike[str] | None = None
    verbatim: bool = False
    keep_skeleton: bool = False
    flat: bool = False
    forward: str | None = None
    handedness: str | None = None

    def __post_init__(self) -> None:
        if self.rate is not None:
            checked_rate(self.rate)
        if self.unit is not None:
            unit_cm_of(self.unit)
        facing(Skeleton(()), *self.axes)
        if self.arrays is not None:
            kinds_of(self.arrays)

    @property
    def axes(self) -> tuple[str | None, str | None, str | None]:
        """What is said of axes, as ``facing`` takes it."""
        return self.up, self.forward, self.handedness

    def applied_to(self, motion: Motion) -> Motion:
        """``motion`` with the facts that are stated; raises MotionError for arrays that differ."""
        if self.arrays is not None:
            motion = with_kinds(motion, self.arrays)
        if self.model is not None:
            motion = with_model(motion, self.model)
        if self.rate is not None and (self.force_rate or motion.frame_rate is None):
            rate = checked_rate(self.rate)
            motion = motion.at_rate(rate)
        if self.unit is not None:
            motion = replace(motion, skeleton=in_unit(motion.skeleton, self.unit))
        if any(self.axes):
            motion = replace(motion, skeleton=facing(motion.skeleton, *self.axes))
        return motion

    def completing(self, motion: Motion) -> Motion:
        """``motion`` with those of the facts that it does not say itself."""
        skeleton = motion.skeleton
        unknown = replace(
            self,
            force_rate=False,
            unit=self.unit if skeleton.unit_cm is None else None,
            up=None if skeleton.up_axis else self.up,
            forward=None if skeleton.forward_axis else self.forward,
            handedness=None if skeleton.handedness else self.handedness,
        )
        return unknown.applied_to(motion)


def checked_rate(rate: Fraction | float) -> Fraction:
    """``rate`` as a Fraction; raises OptionError where it is no positive number."""
    try:
        exact = rate if isinstance(rate, Fraction) else Fraction(float(rate))
        value = exact.limit_denominator(2**52)
    except (TypeError, ValueError, OverflowError):
        raise OptionError(f"frame rate {rate!r} is not a number") from None
    if value <= 0:
        raise OptionError(f"frame rate {rate} is not positive")
    return value
