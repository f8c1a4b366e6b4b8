"""Source files on disk -> Motion or Skeleton, with facts from the caller."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

from mcz.errors import MczError, OptionError, SourceError, reason_of
from mcz.model.motion import Motion, Skeleton
from mcz.model.units import in_unit, unit_cm_of, with_axes
from mcz.sources import FORMATS, HEAD_BYTES, Format, format_of, has_known_suffix, likely_formats
from mcz.sources.arrays.skeletons import kinds_of, with_kinds
from mcz.sources.tables.motion_bids import MOTION_SUFFIX, with_side_files


def read_skeleton(path: str | os.PathLike[str]) -> Skeleton:
    """The skeleton in an ASF file, with its source."""
    path = Path(path)
    source_format, data = load(path)
    if not source_format.is_skeleton:
        raise OptionError("the file is not a skeleton", path=path)
    skeleton: Skeleton = _read_with(path, source_format.read, data, path.stem)
    if skeleton.source is None:
        return skeleton
    return replace(skeleton, source=replace(skeleton.source, path=path.name))


def load(path: Path) -> tuple[Format, bytes]:
    """The format of a source file, see ``format_of``, and its bytes; raises SourceError."""
    if not has_known_suffix(path):  # refused, whatever its content
        format_of(path, _start_of(path))
    data = read_bytes(path)
    return format_of(path, data), data


def content_note(path: str | os.PathLike[str], source_format: Format) -> str:
    """A remark on a file whose suffix does not fit its format, "" if it does."""
    suffix = Path(path).suffix.lower()
    if suffix in source_format.suffixes:
        return ""
    return f"its content is {source_format.suffix[1:].upper()}, but its suffix is {suffix}"


def read_source(
    path: Path, source_format: Format, skeleton: Skeleton | None, data: bytes
) -> Motion:
    """The motion in the bytes ``data`` of the file ``path``."""
    arguments = (skeleton,) if source_format.wants_skeleton else ()
    motion: Motion = _read_with(path, source_format.read, data, path.stem, *arguments)
    if path.name.endswith(MOTION_SUFFIX):
        motion = with_side_files(motion, path)
    if note := content_note(path, source_format):
        notes = filter(None, (note, motion.metadata.get("source-note", "")))
        metadata = dict(motion.metadata) | {"source-note": "; ".join(notes)}
        motion = replace(motion, metadata=metadata)
    if motion.source is None:
        return motion
    return replace(motion, source=replace(motion.source, path=path.name))


def _read_with(path: Path, reader: Any, data: bytes, *arguments: object) -> Any:
    if not data:
        raise SourceError("the file is empty", path=path)
    try:
        return reader(data, *arguments)
    except MczError as error:
        error.add(path=path, note=_other_content(path, data))
        raise


def _other_content(path: Path, data: bytes) -> str | None:
    """A note if an unreadable file begins like one of another suffix."""
    formats = [FORMATS[name] for name in likely_formats(data)]
    suffixes = [
        known.suffix for known in formats if known.is_motion is None or known.is_motion(data)
    ]
    return (
        f"it looks like {suffixes[0]}" if suffixes and path.suffix.lower() not in suffixes else None
    )


def _start_of(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            return file.read(HEAD_BYTES)
    except OSError:
        return b""


def read_bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise SourceError(reason_of(error), path=path) from None


@dataclass(frozen=True, slots=True)
class SourceOptions:
    """Facts about a source file that its caller states.

    ``skeleton`` is the ASF of an AMC, "none" for none. ``rate`` in frames a second, ``unit``,
    ``up``, the axis that points up ("y", "-z"), ``forward``, the facing of a figure, and
    ``handedness`` ("right", "left") apply if the file states none; ``force_rate``: the rate applies
    also if the file states one. ``arrays`` is the meaning of plain arrays, ``model`` has the
    lengths of bones of bodies, see ``mcz.read``. ``verbatim``: a file that cannot be parsed is kept
    as an attachment. ``keep_skeleton``: an ASF is restored as well, under its own name. ``flat``: a
    file with several possible skeletons nearby is read without one. Raises OptionError for an
    unknown unit, axis, kind of arrays, or a rate that is not a positive number.
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
            parse_rate(self.rate)
        if self.unit is not None:
            unit_cm_of(self.unit)
        with_axes(Skeleton(()), *self.axes)
        if self.arrays is not None:
            kinds_of(self.arrays)

    @property
    def axes(self) -> tuple[str | None, str | None, str | None]:
        """The stated axes, as ``with_axes`` takes them."""
        return self.up, self.forward, self.handedness

    def applied_to(self, motion: Motion) -> Motion:
        """``motion`` with the facts that are stated; raises MotionError for arrays that differ."""
        if self.arrays is not None:
            motion = with_kinds(motion, self.arrays)
        if self.model is not None:
            from mcz.sources.arrays.body_models import with_model

            motion = with_model(motion, self.model)
        if self.rate is not None and (self.force_rate or motion.frame_rate is None):
            rate = parse_rate(self.rate)
            motion = motion.at_rate(rate)
        if self.unit is not None:
            motion = replace(motion, skeleton=in_unit(motion.skeleton, self.unit))
        if any(self.axes):
            motion = replace(motion, skeleton=with_axes(motion.skeleton, *self.axes))
        return motion

    def completing(self, motion: Motion) -> Motion:
        """``motion`` with the facts that it lacks."""
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


def parse_rate(rate: Fraction | float) -> Fraction:
    """``rate`` as a Fraction; raises OptionError unless it is a positive number."""
    try:
        exact = rate if isinstance(rate, Fraction) else Fraction(float(rate))
        value = exact.limit_denominator(2**52)
    except (TypeError, ValueError, OverflowError):
        raise OptionError(f"frame rate {rate!r} is not a number") from None
    if value <= 0:
        raise OptionError(f"frame rate {rate} must be positive")
    return value
