"""BVH: bytes -> Motion, and back.

SPEC.md, "Source reconstruction", is normative for the way back. Values are a stream of numbers in
the order of the hierarchy; how many there are counts, not what ``Frames:`` says.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import chain, islice

import numpy as np

from mcz.errors import MotionError, SourceError
from mcz.model.motion import POSITION_KINDS, Joint, Motion, Skeleton, Source
from mcz.model.types import Values
from mcz.sources.restore import restore
from mcz.sources.tables.signals import read_signal
from mcz.sources.tables.times import frame_rate, frame_time
from mcz.sources.text.hierarchy import read_hierarchy, write_hierarchy
from mcz.sources.text.layout import FrameLayout, Pattern, runs_of
from mcz.sources.text.rows import Token, line_of, read_rows, tail_end
from mcz.sources.text.source import Arriving, Frame, Lines, check_text, source_of, text_encoding

_FRAMES = re.compile(rb"\s*Frames\s*:\s*([^\s]+)", re.IGNORECASE)
_FRAME_TIME = re.compile(rb"\s*Frame\s+Time\s*:\s*([^\s]+)", re.IGNORECASE)
MOST_SPREAD = 64  # bytes of "Frame Time:" on a line before that of its number
_MOTION = re.compile(rb"\bMOTION\b", re.IGNORECASE)
_BLANKS = re.compile(rb"[\x00-\x20]*")
_TOKENS = re.compile(rb"#[^\n]*|[^\x00-\x20]+")


def read(data: bytes, name: str = "motion") -> Motion:
    """The motion in a BVH file; ``name`` becomes its name.

    Length unit and up axis are unknown. Raises SourceError, with the number of the line.
    """
    check_text(data)
    encoding = text_encoding(data)
    joints, at, n_strays = read_hierarchy(data, encoding)
    n_columns = sum(len(joint.channels) for joint in joints)
    count, time, body = _motion_section(data, at, n_columns)
    rows = read_rows(data, body, n_columns, _Frames(data, n_columns))
    signal = read_signal(data, rows)
    skeleton = Skeleton(with_positions(joints, signal.values), unit_cm=None)
    rate, exact = frame_rate(data[slice(*time)].decode("latin-1"))
    header = (data[: count[0]], data[count[1] : body])
    return Motion(
        skeleton,
        (signal,),
        rate,
        exact,
        name,
        _notes(encoding, n_strays, data[slice(*count)], rows.n_rows),
        source_of("bvh", data, header, rows, data[slice(*count)]),
    )


def arrive(lines: Iterator[bytes], skeleton: Skeleton | None = None) -> Arriving:
    """A BVH file whose lines come one by one; waits for its first frame.

    A frame is complete with the line of its last number. What position channels do to the offset is
    decided by the first frame alone; see ``with_positions``.
    """
    source = Lines(lines)
    header = bytearray()
    for line in source:
        header += line
        last = max(0, len(header) - len(line) - MOST_SPREAD)
        if _FRAME_TIME.search(header, last) and _MOTION.search(header):
            break
    data = bytes(header)
    check_text(data)
    encoding = text_encoding(data)
    joints, at, n_strays = read_hierarchy(data, encoding)
    n_columns = sum(len(joint.channels) for joint in joints)
    if not n_columns:
        raise SourceError("no joint has channels")
    count, time, body = _motion_section(data, at, n_columns)
    frames = _read_arriving(chain([data[body:]], source), source, n_columns)
    first = list(islice(frames, 1))
    values = np.array([row for _, row in first]).reshape(-1, n_columns)
    rate, exact = frame_rate(data[slice(*time)].decode("latin-1"))
    declared = data[slice(*count)]
    number = int(declared[:40]) if declared.isdigit() else None
    notes = _notes(encoding, n_strays, declared, -1 if number is None else number)
    bones = Skeleton(with_positions(joints, values), unit_cm=None)
    return Arriving(bones, chain(first, frames), rate, exact, notes, declared=number)


def _read_arriving(lines: Iterable[bytes], source: Lines, n_columns: int) -> Iterator[Frame]:
    """The frames that the numbers of ``lines`` make."""
    words: list[bytes] = []
    for line in lines:
        for match in _TOKENS.finditer(line):
            if match[0][:1] == b"#":
                continue
            words.append(match[0])
            if len(words) == n_columns:
                yield None, source.numbers(words)
                words = []
    if words:
        raise source.error(f"the last frame has {len(words)} of {n_columns} values")


def _notes(encoding: str, n_strays: int, count: bytes, n_rows: int) -> dict[str, str]:
    """Notes on oddities of the file, as metadata."""
    metadata = {"name-encoding": encoding} if encoding != "utf-8" else {}
    notes = []
    if (count.lstrip(b"0") or b"0") != b"%d" % n_rows:
        notes.append(f"{count[:40].decode('latin-1')} frames are declared, {n_rows} are there")
    if n_strays:
        notes.append(f"{n_strays} words that mean nothing stand among the joints")
    if notes:
        metadata["source-note"] = "; ".join(notes)
    return metadata


def _motion_section(
    data: bytes, at: int, n_columns: int
) -> tuple[tuple[int, int], tuple[int, int], int]:
    """Find the frame count, the frame time and the first frame."""
    frames = _FRAMES.match(data, at)
    if frames is None:
        raise SourceError("'Frames:' must follow MOTION", line=line_of(data, at))
    time = _FRAME_TIME.match(data, frames.end())
    if time is None:
        raise SourceError("'Frame Time:' must follow 'Frames:'", line=line_of(data, frames.end()))
    blanks = _BLANKS.match(data, time.end())
    stop = blanks.end() if blanks else time.end()
    if n_columns and stop < len(data):
        line = data.rfind(b"\n", time.end(), stop) + 1
    else:
        line = data.find(b"\n", time.end(), stop) + 1
    return frames.span(1), time.span(1), line or stop


class _Frames:
    """The tokens of the frame that begins at an offset; see ``rows.Frames``."""

    def __init__(self, data: bytes, n_columns: int) -> None:
        self.data, self.n_columns = data, n_columns

    def __call__(self, at: int) -> tuple[list[Token], int] | None:
        tokens: list[Token] = []
        for match in _TOKENS.finditer(self.data, at):
            if match[0][:1] == b"#":
                continue
            if not self.n_columns:
                raise SourceError("no joint has channels", line=line_of(self.data, match.start()))
            tokens.append((*match.span(), len(tokens)))
            if len(tokens) == self.n_columns:
                return tokens, tail_end(self.data, match.end())
        if tokens:
            raise SourceError(
                f"the last frame has {len(tokens)} of {self.n_columns} values",
                line=line_of(self.data, tokens[0][0]),
            )
        line_end = self.data.find(b"\n", at) + 1
        return ([], line_end) if line_end and not self.n_columns else None


def with_positions(joints: Sequence[Joint], values: Values) -> tuple[Joint, ...]:
    """The joints, with what their position channels do to the offset.

    BVH does not say it, and programs differ, so the values decide: positions replace the offset
    if they lie nearer to it than to zero. A root goes by its first frame, all other joints
    together by the majority of them, each by all frames. Ties, such as a zero offset, mean "add".
    """
    decided = list(joints)
    votes, others = 0, []
    column = 0
    for index, joint in enumerate(joints):
        kinds = [channel.kind for channel in joint.channels]
        columns = [column + k for k, kind in enumerate(kinds) if kind in POSITION_KINDS]
        offset = [
            joint.offset[POSITION_KINDS.index(kind)] for kind in kinds if kind in POSITION_KINDS
        ]
        column += len(kinds)
        if not columns or not len(values):
            continue
        positions = values[:1, columns] if joint.parent < 0 else values[:, columns]
        with np.errstate(over="ignore", invalid="ignore"):
            to_offset, to_zero = np.abs(positions - offset).sum(), np.abs(positions).sum()
        if joint.parent < 0:
            decided[index] = replace(joint, adds_to_offset=not to_offset < to_zero)
        else:
            others.append(index)
            votes += int(to_offset < to_zero) - int(to_zero < to_offset)
    for index in others:
        decided[index] = replace(joints[index], adds_to_offset=votes <= 0)
    return tuple(decided)


def write(motion: Motion) -> bytes:
    """The BVH file of ``motion``: its own source with its values, or a plain one.

    Raises MotionError for what BVH cannot say; see ``write_hierarchy``.
    """
    source = motion.source
    if source is None or source.format != "bvh":
        source = _plain_source(motion)
    return restore(motion, source)


def _plain_source(motion: Motion) -> Source:
    """The source of a file in one plain style."""
    mask = motion.signals[0].mask
    if mask is not None and not mask.all():
        raise MotionError("BVH cannot omit values, but some are invalid")
    text, order = write_hierarchy(motion.skeleton)
    columns = [column for joint in order for column in motion.skeleton.columns(joint)]
    runs = runs_of([(b" " if k else b"", column, 0) for k, column in enumerate(columns)])
    time = frame_time(motion.frame_rate)
    header = (text + "MOTION\nFrames: ").encode(), f"\nFrame Time: {time}\n".encode()
    template, detail = FrameLayout(header, (Pattern(runs, b"\n"),)).build()
    return Source("bvh", template, detail)
