"""Source files: found, read, and written into an MCZ file one by one.

Part of the joint between motion, codec and container (see ``file.py``).
"""

from __future__ import annotations

import hashlib
import io
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from copy import copy
from dataclasses import replace
from fractions import Fraction
from itertools import chain, count
from pathlib import Path
from typing import Any, BinaryIO

from mcz.codecs import DEFAULT, by_name
from mcz.container import payloads
from mcz.container.directory import Directory
from mcz.container.limits import Profile
from mcz.container.strict import is_plain_path
from mcz.container.writer import Writer
from mcz.errors import LimitError, MczError, MotionError, OptionError, SourceError
from mcz.files.encoding import Progress, write_skeleton
from mcz.files.tuning import write_tuned
from mcz.formats import FORMATS, Format, find_asf, format_of
from mcz.motion import Motion, Skeleton

Digest = bytes | Callable[[], bytes]
UNIT_CM = {"mm": 0.1, "cm": 1.0, "dm": 10.0, "m": 100.0, "in": 2.54, "ft": 30.48}


def unit_cm_of(unit: str) -> float:
    """Centimeters of a length unit, a key of ``UNIT_CM``; raises OptionError for another."""
    if unit not in UNIT_CM:
        raise OptionError(f"unit {unit!r} is not one of {', '.join(UNIT_CM)}")
    return UNIT_CM[unit]


def in_unit(skeleton: Skeleton, unit: str | None) -> Skeleton:
    """``skeleton`` in the length unit of that name, None: as it is; raises OptionError."""
    return skeleton if unit is None else replace(skeleton, unit_cm=unit_cm_of(unit))


def read_skeleton(path: str | os.PathLike[str]) -> Skeleton:
    """The skeleton in an ASF file, with its source."""
    path = Path(path)
    source_format = format_of(path)
    if not source_format.is_skeleton:
        raise OptionError(f"{path}: not a skeleton file")
    skeleton: Skeleton = _named(path, source_format.read, read_bytes(path), path.stem)
    if skeleton.source is None:
        return skeleton
    return replace(skeleton, source=replace(skeleton.source, path=path.name))


def skeleton_of(
    path: Path, source_format: Format, given: str | os.PathLike[str] | Skeleton | None
) -> Skeleton | None:
    if not source_format.wants_skeleton:
        return None
    if isinstance(given, Skeleton):
        return given
    found = Path(given) if given is not None else find_asf(path)
    return read_skeleton(found) if found is not None else None


def read_source(
    path: Path, source_format: Format, skeleton: Skeleton | None, data: bytes | None = None
) -> Motion:
    """The motion in the file ``path``, whose bytes are ``data`` if they were read already."""
    arguments = (skeleton,) if source_format.wants_skeleton else ()
    data = read_bytes(path) if data is None else data
    motion: Motion = _named(path, source_format.read, data, path.stem, *arguments)
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
            exact = rate if isinstance(rate, Fraction) else Fraction(float(rate))
            value = exact.limit_denominator(2**52)
        except (TypeError, ValueError, OverflowError):
            raise OptionError(f"frame rate {rate!r} is not a number") from None
        if value <= 0:
            raise OptionError(f"frame rate {rate} is not positive")
        motion = replace(motion, frame_rate=value, frame_rate_exact=True)
    if unit is not None:
        motion = replace(motion, skeleton=in_unit(motion.skeleton, unit))
    return motion


def plain_source(motion: Motion, name: str) -> bytes:
    """The motion as a file of the format ``name``, printed in this package's own style.

    Raises MotionError where that format cannot say what the motion says.
    """
    data: bytes = FORMATS[name].write(replace(motion, source=None))
    return data


class Draft:
    """A file that is being written in steps: a step that fails leaves no trace.

    ``paths`` tells what the file restores under each path: the SHA-256 of those bytes, or a
    function that finds it. With ``hold`` False what is written goes straight to ``sink``, so that
    nothing can be taken back; that needs no memory and suits a file of one step.
    """

    def __init__(
        self,
        sink: BinaryIO,
        profile: Profile,
        directory: Directory | None = None,
        paths: Mapping[str, Digest] | None = None,
        *,
        hold: bool = True,
    ) -> None:
        self._sink, self._pending, self._hold = sink, io.BytesIO(), hold
        self.paths = dict(paths or {})
        offset = directory.end if directory is not None else 0
        self.writer = Writer(self, profile=profile, directory=directory, offset=offset)
        self._commit()

    def write(self, data: bytes, /) -> int:
        return (self._pending if self._hold else self._sink).write(data)

    def _commit(self) -> None:
        self._sink.write(self._pending.getbuffer())
        self._pending = io.BytesIO()

    @contextmanager
    def step(self) -> Iterator[None]:
        """What the block writes is kept when the block ends well."""
        before, offset = _snapshot(self.writer.directory), self.writer.offset
        try:
            yield
        except MczError:
            self._pending = io.BytesIO()
            self.writer.rewind(before, offset)
            raise
        self._commit()

    def holds(self, path: str, digest: bytes) -> bool:
        """Whether the file restores these bytes as ``path``; raises where it restores others."""
        if path not in self.paths:
            return False
        there = self.paths[path]
        if (there if isinstance(there, bytes) else there()) == digest:
            return True
        raise SourceError(f"the file already restores another {path!r}; rename this one")

    def finish(self) -> None:
        self.writer.finish()
        self._commit()


def _snapshot(directory: Directory) -> Directory:
    kept = copy(directory)
    for name in ("shared", "attachments", "aliases", "clips"):
        setattr(kept, name, dict(getattr(directory, name)))
    return kept


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
        if unit is not None:
            unit_cm_of(unit)
        self.path, self.name = path, name
        self.codec, self.params = by_name(codec), params or {}
        self.skeleton, self.rate, self.unit = skeleton, rate, unit
        self.verbatim = verbatim
        self.keep_skeleton = keep_skeleton  # under its own name, to be restored as well
        self.reason = ""  # why it was kept verbatim

    def write(self, draft: Draft, progress: Progress | None = None) -> str:
        """Write the file; return how: "skeleton", "parsed", "present" or "verbatim"."""
        check_name(self.name)
        data = read_bytes(self.path)
        digest = hashlib.sha256(data).digest()
        if draft.holds(self.name, digest):
            return "present"
        given = self._given_skeleton()
        try:
            with draft.step():
                result = self._parsed(draft.writer, data, given, progress)
        except (SourceError, MotionError, LimitError) as error:
            if not self.verbatim:
                raise
            self.reason = str(error)
            with draft.step():
                draft.writer.attachment(self.name, data)
            result = "verbatim"
        draft.paths[self.name] = digest
        return result

    def _given_skeleton(self) -> Skeleton | None:
        """The skeleton that was asked for; that it cannot be read is not the source's fault."""
        if self.skeleton is None or self.path.suffix.lower() != ".amc":
            return None
        return self._unit(read_skeleton(self.skeleton))

    def _parsed(
        self, writer: Writer, data: bytes, given: Skeleton | None, progress: Progress | None
    ) -> str:
        source_format = format_of(self.path)
        if source_format.is_skeleton:
            id_ = write_skeleton(writer, self._unit(read_skeleton(self.path)))
            _alias_once(writer, self.name, id_)
            return "skeleton"
        skeleton = skeleton_of(self.path, source_format, given)
        if skeleton is not None:
            skeleton = self._unit(skeleton)
        motion = read_source(self.path, source_format, skeleton, data)
        motion = with_facts(motion, self.rate, self.unit)
        if motion.source is not None:
            motion = replace(motion, source=replace(motion.source, path=self.name))
        if skeleton is not None:
            motion = self._based(writer, motion, skeleton)
        name = clip_name(self.name, writer.directory)
        motion = replace(motion, name=name)
        write_tuned(writer, motion, self.codec, self.params, progress)
        return "parsed"

    def _unit(self, skeleton: Skeleton) -> Skeleton:
        return replace(skeleton, unit_cm=UNIT_CM[self.unit]) if self.unit else skeleton

    def _based(self, writer: Writer, motion: Motion, skeleton: Skeleton) -> Motion:
        """``motion`` after its ASF was written; a derived skeleton names it as its base."""
        id_ = write_skeleton(writer, skeleton)
        if self.keep_skeleton:
            path = skeleton.source.path if skeleton.source is not None else ""
            _alias_once(writer, path or f"{skeleton.name}.asf", id_)
        if motion.skeleton.base is None:
            return motion
        return replace(motion, skeleton=replace(motion.skeleton, base=id_))


def name_skeleton(writer: Writer, skeleton: Skeleton) -> None:
    """Write the skeleton, and the name under which its own file is restored, if it has one."""
    path = skeleton.source.path if skeleton.source is not None else ""
    if path:
        _alias_once(writer, path, write_skeleton(writer, skeleton))


def _alias_once(writer: Writer, name: str, id_: bytes) -> None:
    check_name(name)
    if name not in writer.directory.aliases:
        writer.alias(name, payloads.OF_SKELETON, id_)


def check_name(path: str) -> None:
    """Raise MotionError where a file cannot be stored and restored under ``path``."""
    try:
        path.encode("utf-8")
    except UnicodeEncodeError:
        raise MotionError(
            f"the name {os.fsencode(path)!r} is not UTF-8, as MCZ keeps names; rename the file"
        ) from None
    if not is_plain_path(path):
        raise MotionError(f"source path {path!r} is not relative and plain; rename the file")


def clip_name(path: str, directory: Directory) -> str:
    """The relative path without its suffix; with it, or a number, where that name is taken."""
    names = chain((Path(path).with_suffix("").as_posix(), path), (f"{path}#{n}" for n in count(2)))
    return next(name for name in names if name not in directory.clips)
