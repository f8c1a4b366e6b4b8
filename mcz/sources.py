"""Source files: found, read, and written into an MCZ file one by one.

Part of the joint between motion, codec and container (see ``file.py``).
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

from mcz.codecs import DEFAULT, by_name
from mcz.container import payloads
from mcz.container.directory import Directory
from mcz.container.writer import Writer
from mcz.encoding import Progress, write_clip, write_skeleton
from mcz.errors import MczError, OptionError, SourceError
from mcz.formats import FORMATS, Format, find_asf, format_of
from mcz.motion import Motion, Skeleton

UNIT_CM = {"mm": 0.1, "cm": 1.0, "dm": 10.0, "m": 100.0, "in": 2.54, "ft": 30.48}


def read_skeleton(path: str | os.PathLike[str]) -> Skeleton:
    """The skeleton in an ASF file, with its source."""
    path = Path(path)
    source_format = format_of(path)
    if not source_format.is_skeleton:
        raise OptionError(f"{path}: not a skeleton file")
    skeleton: Skeleton = _named(path, source_format.read, read_bytes(path), path.stem)
    return skeleton


def skeleton_of(
    path: Path, source_format: Format, given: str | os.PathLike[str] | Skeleton | None
) -> Skeleton | None:
    if not source_format.wants_skeleton:
        return None
    if isinstance(given, Skeleton):
        return given
    found = Path(given) if given is not None else find_asf(path)
    return read_skeleton(found) if found is not None else None


def read_source(path: Path, source_format: Format, skeleton: Skeleton | None) -> Motion:
    arguments = (skeleton,) if source_format.wants_skeleton else ()
    motion: Motion = _named(path, source_format.read, read_bytes(path), path.stem, *arguments)
    if motion.source is None:
        return motion
    return replace(motion, source=replace(motion.source, path=path.name))


def _named(path: Path, reader: Any, data: bytes, *arguments: Any) -> Any:
    """What ``reader`` makes of ``data``; its errors say which file."""
    try:
        return reader(data, *arguments)
    except MczError as error:
        error.args = (f"{path}: {error}",)
        raise


def read_bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise SourceError(f"{path}: {error.strerror or error}") from None


def with_facts(motion: Motion, rate: Fraction | float | None, unit: str | None) -> Motion:
    if rate is not None:
        try:
            value = Fraction(rate).limit_denominator(2**52)
        except (ValueError, ZeroDivisionError, OverflowError):
            raise OptionError(f"frame rate {rate!r} is not a number") from None
        if value <= 0:
            raise OptionError(f"frame rate {rate} is not positive")
        motion = replace(motion, frame_rate=value, frame_rate_exact=True)
    if unit is not None:
        if unit not in UNIT_CM:
            raise OptionError(f"unit {unit!r} is not one of {', '.join(UNIT_CM)}")
        motion = replace(motion, skeleton=replace(motion.skeleton, unit_cm=UNIT_CM[unit]))
    return motion


def plain_source(motion: Motion, name: str) -> bytes:
    """The motion as a file of the format ``name``, printed in this package's own style.

    Raises MotionError where that format cannot say what the motion says.
    """
    data: bytes = FORMATS[name].write(replace(motion, source=None))
    return data


class Entry:
    """One source file on its way into an MCZ file, under the relative path ``name``."""

    def __init__(
        self,
        path: Path,
        name: str,
        codec: str = DEFAULT,
        params: Mapping[str, Any] | None = None,
        skeleton: str | os.PathLike[str] | None = None,
        rate: Fraction | float | None = None,
        unit: str | None = None,
        verbatim: bool = False,
        keep_skeleton: bool = False,
    ) -> None:
        if unit is not None and unit not in UNIT_CM:
            raise OptionError(f"unit {unit!r} is not one of {', '.join(UNIT_CM)}")
        self.path, self.name = path, name
        self.codec, self.params = by_name(codec), params or {}
        self.skeleton, self.rate, self.unit = skeleton, rate, unit
        self.verbatim = verbatim
        self.keep_skeleton = keep_skeleton  # under its own name, to be restored as well

    def write(self, writer: Writer, progress: Progress | None = None) -> str:
        """Write the file; return how: "skeleton", "parsed", "alias" or "verbatim"."""
        try:
            return self._parsed(writer, progress)
        except SourceError:
            if not self.verbatim:
                raise
        writer.attachment(self.name, read_bytes(self.path))
        return "verbatim"

    def _parsed(self, writer: Writer, progress: Progress | None) -> str:
        source_format = format_of(self.path)
        if source_format.is_skeleton:
            id_ = write_skeleton(writer, self._unit(read_skeleton(self.path)))
            _alias_once(writer, self.name, id_)
            return "skeleton"
        skeleton = skeleton_of(self.path, source_format, self.skeleton)
        if skeleton is not None:
            skeleton = self._unit(skeleton)
        motion = read_source(self.path, source_format, skeleton)
        motion = with_facts(motion, self.rate, self.unit)
        if motion.source is not None:
            motion = replace(motion, source=replace(motion.source, path=self.name))
        if skeleton is not None:
            motion = self._based(writer, motion, skeleton)
        name = clip_name(self.name, writer.directory)
        write_clip(writer, replace(motion, name=name), self.codec, self.params, progress)
        return "parsed"

    def _unit(self, skeleton: Skeleton) -> Skeleton:
        return replace(skeleton, unit_cm=UNIT_CM[self.unit]) if self.unit else skeleton

    def _based(self, writer: Writer, motion: Motion, skeleton: Skeleton) -> Motion:
        """``motion`` after its ASF was written; a derived skeleton names it as its base."""
        id_ = write_skeleton(writer, skeleton)
        if self.keep_skeleton:
            found = self.skeleton or find_asf(self.path)
            _alias_once(writer, Path(found).name if found else f"{skeleton.name}.asf", id_)
        if motion.skeleton.base is None:
            return motion
        return replace(motion, skeleton=replace(motion.skeleton, base=id_))


def _alias_once(writer: Writer, name: str, id_: bytes) -> None:
    if name not in writer.directory.aliases:
        writer.alias(name, payloads.OF_SKELETON, id_)


def clip_name(path: str, directory: Directory) -> str:
    """The relative path without its suffix, or with it where that name is taken."""
    stem = Path(path).with_suffix("").as_posix()
    return path if stem in directory.clips else stem
