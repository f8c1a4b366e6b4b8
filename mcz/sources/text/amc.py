"""AMC (Acclaim motion capture data): bytes -> Motion, and back.

SPEC.md, "Source reconstruction", is normative for the way back. A frame is a line with its number
and then a line for each bone: its name and its values. Bones may come in any order and may be
missing, from the file or from some frames.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from itertools import chain, islice

import numpy as np
from numpy.typing import NDArray

from mcz.errors import MotionError, SourceError
from mcz.model.motion import Motion, Skeleton, Source
from mcz.model.text_format import quote
from mcz.sources.restore import restore
from mcz.sources.tables.signals import read_signal
from mcz.sources.text.bones import fit_skeleton, flat_skeleton, match_bones, match_names
from mcz.sources.text.layout import FRAME_NUMBER, FrameLayout, Pattern, RowNotes, runs_of
from mcz.sources.text.rows import Token, TokenRows, line_of, number_frames, read_rows, tail_end
from mcz.sources.text.source import (
    Arriving,
    Frame,
    Lines,
    check_first_line,
    check_text,
    source_of,
    text_encoding,
)

_BLANK = rb"[\x00-\x09\x0b-\x20]"
_FIRST_FRAME = re.compile(rb"(?m)^" + _BLANK + rb"*+[-+]?[0-9]++" + _BLANK + rb"*+$")
_FIRST_BONE = re.compile(
    _FIRST_FRAME.pattern + rb"\s++[^\W\d][^\s,;]*+[ \t]++[-+.]?[0-9]"  # a name and its values
)
_LINES = re.compile(rb"[^\n]+")
_WORDS = re.compile(rb"[^\x00-\x20]+")
_NUMBER = re.compile(rb"[-+]?[0-9]+")
HARMLESS = b"#", b":fully-specified", b":degrees"  # lines that need not be understood
MOST_DIGITS = 15  # of a frame number, its sign included
NO_SKELETON = "no ASF: a flat list of bones with plain scalar channels, without kinematics"
DERIVED = "the channels of the AMC differ from those of its ASF"


def read(data: bytes, name: str = "motion", skeleton: Skeleton | None = None) -> Motion:
    """The motion in an AMC file; ``name`` becomes its name; the frame rate is unknown.

    If the bones do not fit ``skeleton``, the motion's skeleton is derived from it, with ``base``
    b"", to be replaced with the id of ``skeleton``; the metadata say so. Raises
    SourceError, with the number of the line.
    """
    check_text(data)
    check_first_line(data, HARMLESS)
    match = _FIRST_FRAME.search(data)
    if match is None:
        raise SourceError("no line with a frame number; not an AMC file, or it has no frames")
    begin = match.start()
    encoding = text_encoding(data)
    try:
        frames = _Frames(data, _first_bones(data, begin))
        fitted, rows = _read_frames(data, begin, skeleton, frames, encoding)
    except _UnknownBone:
        frames = _Frames(data, _all_bones(data, begin))
        fitted, rows = _read_frames(data, begin, skeleton, frames, encoding)
    metadata = {"name-encoding": encoding} if encoding != "utf-8" else {}
    if fitted is not skeleton:
        metadata["skeleton-note"] = NO_SKELETON if skeleton is None else DERIVED
    return Motion(
        fitted,
        (read_signal(data, rows),),
        name=name,
        metadata=metadata,
        source=source_of("amc", data, (data[:begin],), rows),
        frame_numbers=rows.numbers,
    )


def _read_frames(
    data: bytes, begin: int, skeleton: Skeleton | None, frames: _Frames, encoding: str
) -> tuple[Skeleton, TokenRows]:
    """The skeleton that fits the bones, and all frames."""
    counts = {bone.decode(encoding): count for bone, count in frames.counts.items()}
    if len(counts) < len(frames.counts):
        raise SourceError("two bones have the same name")
    unit = _unit(data[:begin])
    if skeleton is None:
        fitted, columns = flat_skeleton(counts, unit)
    else:
        fitted, columns = fit_skeleton(skeleton, counts, unit)
    frames.columns = {bone: columns[bone.decode(encoding)] for bone in frames.counts}
    return fitted, number_frames(read_rows(data, begin, fitted.n_channels, frames))


def _unit(header: bytes) -> str:
    return "rad" if re.search(rb"(?im)^\s*:RADIANS\b", header) else "deg"


class _UnknownBone(Exception):
    """A bone that did not come in the first frame; the whole file must be searched for bones."""


class _Frames:
    """The tokens of the frame that begins at an offset; see ``rows.Frames``.

    ``counts``: how many values each bone has; ``columns``: the column of its first one.
    """

    def __init__(self, data: bytes, counts: Mapping[bytes, int]) -> None:
        self.data, self.counts = data, counts
        self.columns: Mapping[bytes, int] = {}

    def __call__(self, at: int) -> tuple[list[Token], int] | None:
        tokens: list[Token] = []
        seen: set[bytes] = set()
        end = at
        for words in _word_lines(self.data, at):
            start, stop = words[0].span()
            if len(words) == 1 and _NUMBER.fullmatch(words[0][0]):
                if tokens:
                    break
                tokens.append((start, stop, FRAME_NUMBER))
            else:
                if not tokens:
                    raise self._error(start, f"expected a frame number, not {quote(words[0][0])}")
                if words[0][0] in seen:
                    raise self._error(start, f"bone {quote(words[0][0])} occurs twice in a frame")
                seen.add(words[0][0])
                tokens += self._bone(words)
            end = words[-1].end()
        return (tokens, tail_end(self.data, end)) if tokens else None

    def _bone(self, words: list[re.Match[bytes]]) -> list[Token]:
        bone, count = words[0][0], len(words) - 1
        if bone not in self.counts:
            raise _UnknownBone
        if count != self.counts[bone]:
            raise self._error(
                words[0].start(),
                f"{count} values for bone {quote(bone)}, but {self.counts[bone]} elsewhere",
            )
        column = self.columns[bone]
        return [(*word.span(), column + k) for k, word in enumerate(words[1:])]

    def _error(self, at: int, message: str) -> SourceError:
        return SourceError(message, line=line_of(self.data, at))


def bones(data: bytes, *, whole: bool = False) -> dict[str, int]:
    """The bones of the first frame, or of the ``whole`` file: how many values each has.

    Nothing if there is no frame.
    """
    match = _FIRST_FRAME.search(data)
    if match is None:
        return {}
    names = (_all_bones if whole else _first_bones)(data, match.start())
    encoding = text_encoding(data)
    return {bone.decode(encoding): count for bone, count in names.items()}


def is_amc(data: bytes) -> bool:
    """Tell whether there is a line with a frame number, and then one with a bone and its values."""
    return _FIRST_BONE.search(data) is not None


def arrive(lines: Iterator[bytes], skeleton: Skeleton | None = None) -> Arriving:
    """An AMC file whose lines come one by one; waits for its first frame.

    The first frame is complete when all bones of ``skeleton`` with channels have come, or the next
    frame begins; a later one when all bones of the first have come. Raises SourceError without a
    skeleton, and for bones that do not fit it or come late.
    """
    if skeleton is None:
        raise SourceError("an AMC read line by line needs its skeleton")
    source = Lines(lines)
    header, number = _header(source)
    if number is None:
        raise SourceError("no line with a frame number; not an AMC file, or it has no frames")
    frames = _ArrivingFrames(source, header, skeleton)
    rows = frames.rows(number)
    first = list(islice(rows, 1))
    note = {} if frames.skeleton is skeleton else {"skeleton-note": DERIVED}
    return Arriving(frames.skeleton, chain(first, rows), metadata=note, first_number=number)


def _header(source: Lines) -> tuple[bytes, int | None]:
    """The lines before the first frame, and its number, None if there is none."""
    header = bytearray()
    for line in source:
        if not header:
            check_text(line)
            check_first_line(line, HARMLESS)
        if _FIRST_FRAME.fullmatch(line.rstrip(b"\n")):
            return bytes(header), _frame_number(source, _WORDS.findall(line)[0])
        header += line
    return bytes(header), None


def _frame_number(source: Lines, text: bytes) -> int:
    if len(text) > MOST_DIGITS:
        raise source.error(f"{quote(text)} is too large for a frame number")
    return int(text)


class _ArrivingFrames:
    """The frames of an AMC as their lines come; ``skeleton`` fits the bones of the first."""

    def __init__(self, source: Lines, header: bytes, skeleton: Skeleton) -> None:
        self.source, self.skeleton = source, skeleton
        self._unit = _unit(header)
        self._columns: Mapping[str, int] = {}
        self._counts: dict[str, int] | None = None  # of the values of each bone of the first frame

    def rows(self, number: int) -> Iterator[Frame]:
        """All frames, the first of which has this number."""
        bones: dict[str, list[bytes]] = {}
        done = False
        for line in self.source:
            words = _WORDS.findall(line)
            if not words or words[0].startswith(b"#"):
                continue
            if len(words) == 1 and _NUMBER.fullmatch(words[0]):
                if not done:
                    yield number, self._row(bones)
                number, bones, done = _frame_number(self.source, words[0]), {}, False
                continue
            self._add(bones, words, done)
            if self._is_whole(bones):
                yield number, self._row(bones)
                done = True
        if self._counts is not None and not done and next(reversed(self._counts)) not in bones:
            count = f"{len(bones)} of {len(self._counts)} bones"
            raise self.source.error(f"frame {number} has {count}: the source was cut off")
        if not done:
            yield number, self._row(bones)

    def _add(self, bones: dict[str, list[bytes]], words: list[bytes], done: bool) -> None:
        name = words[0].decode("utf-8", "backslashreplace")
        if name in bones:
            raise self.source.error(f"bone {quote(name)} occurs twice in a frame")
        count = None if self._counts is None else self._counts.get(name)
        if done or (self._counts is not None and count is None):
            raise self.source.error(f"bone {quote(name)} is not in the first frame")
        if count is not None and count != len(words) - 1:
            raise self.source.error(
                f"{len(words) - 1} values for bone {quote(name)}, but {count} elsewhere"
            )
        bones[name] = words[1:]

    def _is_whole(self, bones: Mapping[str, list[bytes]]) -> bool:
        if self._counts is not None:
            return len(bones) == len(self._counts)
        joints = {joint.name for joint in self.skeleton.joints if joint.channels}
        return joints <= set(match_names(self.skeleton, dict.fromkeys(bones, 0)).values())

    def _row(self, bones: Mapping[str, list[bytes]]) -> NDArray[np.float64]:
        """The values of a frame, (n_channels,), NaN if a bone did not come."""
        if self._counts is None:
            self._counts = {name: len(texts) for name, texts in bones.items()}
            lacking = match_bones(self.skeleton, self._counts)
            if lacking.is_foreign:
                raise self.source.error(
                    f"the skeleton has none of the bones: {' '.join(lacking.lacking[:8])[:200]}"
                )
            self.skeleton, self._columns = fit_skeleton(self.skeleton, self._counts, self._unit)
        row = np.full(self.skeleton.n_channels, np.nan)
        values = self.source.numbers([text for texts in bones.values() for text in texts])
        at = 0
        for name, texts in bones.items():
            column = self._columns[name]
            row[column : column + len(texts)] = values[at : at + len(texts)]
            at += len(texts)
        return row


def _word_lines(data: bytes, at: int) -> Iterator[list[re.Match[bytes]]]:
    """The words of every line from ``at`` on that is neither blank nor a comment."""
    for line in _LINES.finditer(data, at):
        words = list(_WORDS.finditer(data, *line.span()))
        if words and not words[0][0].startswith(b"#"):
            yield words


def _first_bones(data: bytes, begin: int) -> dict[bytes, int]:
    """The bones of the first frame with their numbers of values, in order."""
    bones: dict[bytes, int] = {}
    numbers = 0
    for words in _word_lines(data, begin):
        if len(words) == 1 and _NUMBER.fullmatch(words[0][0]):
            numbers += 1
            if numbers > 1:
                break
        else:
            bones.setdefault(words[0][0], len(words) - 1)
    return bones


def _all_bones(data: bytes, begin: int) -> dict[bytes, int]:
    """All bones of the file with the number of values that they have first, in order."""
    bones: dict[bytes, int] = {}
    for words in _word_lines(data, begin):
        if len(words) > 1 or not _NUMBER.fullmatch(words[0][0]):
            bones.setdefault(words[0][0], len(words) - 1)
    return bones


def write(motion: Motion) -> bytes:
    """The AMC file of ``motion``: its own source with its values, or a plain one.

    Raises MotionError for names with blanks, and for joints that are valid only in part.
    """
    source = motion.source
    if source is None or source.format != "amc":
        source = _plain_source(motion)
    return restore(motion, source)


def _plain_source(motion: Motion) -> Source:
    """The source of a file in CMU's style; a frame leaves out the joints without valid values."""
    skeleton = motion.skeleton
    mask = motion.signals[0].mask
    present = np.ones((motion.n_frames, skeleton.n_joints), np.bool_)
    for index, joint in enumerate(skeleton.joints):
        if _WORDS.fullmatch(joint.name.encode()) is None or joint.name[0] in "#:":
            raise MotionError(f"AMC cannot hold the joint name {joint.name!r}")
        columns = skeleton.columns(index)
        if mask is not None and len(columns):
            valid = mask[:, columns.start : columns.stop]
            present[:, index] = valid.all(axis=1)
            if (valid.any(axis=1) != present[:, index]).any():
                raise MotionError(f"AMC cannot omit some channels of joint {joint.name!r}")
    if len(set(skeleton.addresses())) != len({joint.name for joint in skeleton.joints}):
        raise MotionError("AMC needs unique joint names")
    unit = "RADIANS" if skeleton.angle_unit == "rad" else "DEGREES"
    if not motion.n_frames:
        return _source(unit, (), None)
    rows, numbers = np.unique(present, axis=0, return_inverse=True)
    patterns = tuple(_plain_pattern(skeleton, row) for row in rows)
    return _source(unit, patterns, RowNotes(numbers.ravel().astype(np.int64)))


def _source(unit: str, patterns: tuple[Pattern, ...], notes: RowNotes | None) -> Source:
    header = f":FULLY-SPECIFIED\n:{unit}\n".encode()
    template, detail = FrameLayout((header,), patterns).build()
    return Source("amc", template, detail, notes)


def _plain_pattern(skeleton: Skeleton, present: np.ndarray) -> Pattern:
    items = [(b"", FRAME_NUMBER, 0)]
    for index, joint in enumerate(skeleton.joints):
        if present[index]:
            items += [
                (b" " if k else b"\n" + joint.name.encode() + b" ", column, 0)
                for k, column in enumerate(skeleton.columns(index))
            ]
    return Pattern(runs_of(items), b"\n")
