"""Content of a C3D file beside its data: a template and a detail.

SPEC.md, "Source reconstruction", is normative and has the tables of C3dTemplate, C3dDetail,
C3dField and C3dOutputsTemplate.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

from construct import Int8ul

from mcz.errors import FormatError, LimitError
from mcz.model.schema import SIZED, UVARINT, Record, bounded, build, counted, field, one_of, parse
from mcz.sources.c3d.parameters import (
    DEC,
    INTEL,
    MAX_COUNT,
    ROTATION_WORDS,
    SGI,
    ByteOrder,
    Split,
    split_of,
)

FORMAT, OUTPUTS_FORMAT = "c3d", "c3d-outputs"  # names in the registry of source formats
MAX_ZEROS = 2**20  # that a detail counts instead of holding them
MAX_SHARED_TAIL = 512  # bytes after the data that belong to the clip; more go into the template


class FieldKind(IntEnum):
    """Quantity that a field counts."""

    COUNT = 0  # frames, in a word
    COUNT_FLOAT = 1  # frames, in a float
    FIRST = 2  # number of the first frame, in a word
    LAST = 3  # of the last
    FIRST_LONG = 4  # in two words, the low one first
    LAST_LONG = 5
    ROTATIONS = 6  # block of the rotations, in a word

    @property
    def size(self) -> int:
        return (
            4 if self in (FieldKind.COUNT_FLOAT, FieldKind.FIRST_LONG, FieldKind.LAST_LONG) else 2
        )


_WORD = bounded(UVARINT, 0, MAX_COUNT)  # C3D-05

_POSITIVE_WORD = bounded(_WORD, 1, MAX_COUNT)


class C3dField(Record):
    """A field of the head of a C3D that differs by clip."""

    at: int = field(UVARINT, "offset in head, not before the end of the field before")
    kind: int = field(one_of(Int8ul, tuple(FieldKind)), "content of the field")  # C3D-09


class C3dTemplate(Record):
    """Template of C3D."""

    processor: int = field(one_of(Int8ul, (INTEL, DEC, SGI)), "84 Intel, 85 DEC, 86 SGI")  # C3D-01
    word: int = field(
        one_of(Int8ul, (2, 4)), "bytes of a word of the data: 2 integers, 4 floats"
    )  # C3D-02
    points: int = field(_WORD, "points")
    channels: int = field(_WORD, "analog channels")
    subframes: int = field(_POSITIVE_WORD, "analog samples a frame")
    unsigned: int = field(
        bounded(Int8ul, 0, 1), "1: analog words are 0 to 65535; 0: they have a sign, or word is 4"
    )  # C3D-03
    rotations: int = field(_WORD, "rotations; 0 if word is 2")
    ratio: int = field(_POSITIVE_WORD, "samples a frame of a rotation")  # C3D-06
    head: bytes = field(SIZED, "the file up to the data section, fields filled with zeros")
    fields: list[C3dField] = field(counted(C3dField), "the fields of head, in order")
    gap: bytes = field(
        SIZED, "bytes between the data section and the rotations; empty without rotations"
    )
    tail: bytes = field(SIZED, "bytes after the data")


class C3dOutputsTemplate(Record):
    """Template of C3D with model outputs."""

    outputs: list[int] = field(
        counted(UVARINT), "runs of points, alternately no outputs and outputs"
    )
    file: C3dTemplate = field(C3dTemplate, "the file")


class C3dDetail(Record):
    """Detail of C3D."""

    n_frames: int = field(UVARINT, "frames of the source file")
    first: int = field(UVARINT, "number of its first frame")
    values: bytes = field(SIZED, "bytes of all fields, one after the other")
    tail: bytes = field(SIZED, "more bytes after the data")
    zeros: int = field(UVARINT, "zero bytes after both tails")


@dataclass(frozen=True, slots=True)
class C3dLayout:
    """A template and a detail, parsed; see C3dTemplate and C3dDetail.

    ``head`` here has the fields in place; ``tail`` is all that follows the data; ``outputs`` is
    that of C3dOutputsTemplate, () if all points are points.
    """

    order: ByteOrder
    word: int
    n_points: int
    n_channels: int
    subframes: int
    unsigned: bool
    n_frames: int
    first: int
    head: bytes
    fields: tuple[tuple[int, FieldKind], ...]
    n_rotations: int = 0
    ratio: int = 1
    gap: bytes = b""
    tail: bytes = b""
    outputs: tuple[int, ...] = ()

    @property
    def split(self) -> Split:
        """Split of the points into points and outputs."""
        return split_of(self.outputs, self.n_points)

    @property
    def behind(self) -> int:
        """Offset of the tail in the file."""
        rotations = self.n_rotations * self.ratio * ROTATION_WORDS * 4 * self.n_frames
        words = 4 * self.n_points + self.n_channels * self.subframes
        return len(self.head) + self.n_frames * words * self.word + len(self.gap) + rotations

    @property
    def format(self) -> str:
        """The source format that has a place for all of it."""
        return OUTPUTS_FORMAT if self.outputs else FORMAT

    def build(self) -> tuple[bytes, bytes]:
        """The bytes of the template and of the detail."""
        head = bytearray(self.head)
        values = b""
        for at, kind in self.fields:
            values += head[at : at + kind.size]
            head[at : at + kind.size] = bytes(kind.size)
        tail = self.tail.rstrip(b"\0")
        tail += bytes(max(0, len(self.tail) - len(tail) - MAX_ZEROS))
        shared = len(tail) > MAX_SHARED_TAIL
        file = C3dTemplate(
            processor=self.order.processor,
            word=self.word,
            points=self.n_points,
            channels=self.n_channels,
            subframes=self.subframes,
            unsigned=int(self.unsigned),
            rotations=self.n_rotations,
            ratio=self.ratio,
            head=bytes(head),
            fields=[C3dField(at=at, kind=kind) for at, kind in self.fields],
            gap=self.gap,
            tail=tail if shared else b"",
        )
        detail = C3dDetail(
            n_frames=self.n_frames,
            first=self.first,
            values=values,
            tail=b"" if shared else tail,
            zeros=len(self.tail) - len(tail),
        )
        outputs = list(self.outputs)
        template = C3dOutputsTemplate(outputs=outputs, file=file) if outputs else file
        return build(template, "source template"), build(detail, "source detail")


def parse_layout(source_format: str, template: bytes, detail: bytes) -> C3dLayout:
    """The layout of a clip whose source is ``FORMAT`` or ``OUTPUTS_FORMAT``.

    Raises FormatError on bad bytes.
    """
    outputs: tuple[int, ...] = ()
    if source_format == OUTPUTS_FORMAT:
        parsed = parse(C3dOutputsTemplate, template, "source template")
        shared, outputs = parsed.file, tuple(parsed.outputs)
        if 0 in outputs[1:]:  # C3D-17
            raise FormatError("source template: a run has no points")
        if sum(outputs) != shared.points:  # C3D-18
            raise FormatError(
                f"source template: runs of {sum(outputs)} points, but there are {shared.points}"
            )
    else:
        shared = parse(C3dTemplate, template, "source template")
    own = parse(C3dDetail, detail, "source detail")
    if own.zeros > MAX_ZEROS:  # C3D-13
        raise LimitError(f"source detail: {own.zeros} zeros, limit {MAX_ZEROS}")
    if shared.word == 4 and shared.unsigned:  # C3D-04
        raise FormatError("source template: floats cannot be unsigned")
    # C3D-07, C3D-08
    if (shared.rotations and shared.word != 4) or (shared.gap and not shared.rotations):
        raise FormatError("source template: rotations must be floats, and a gap needs rotations")
    head, fields = bytearray(shared.head), []
    end = n_used = 0
    for entry in shared.fields:
        kind = FieldKind(entry.kind)
        if not end <= entry.at <= len(head) - kind.size:  # C3D-10, C3D-11
            raise FormatError(f"source template: a field at {entry.at}, {end} or more expected")
        end = entry.at + kind.size
        head[entry.at : end] = own.values[n_used : n_used + kind.size]
        n_used += kind.size
        fields.append((entry.at, kind))
    if n_used != len(own.values) or len(head) != len(shared.head):  # C3D-12
        raise FormatError(f"source detail: fields have {len(own.values)} bytes, not {n_used}")
    return C3dLayout(
        ByteOrder(shared.processor),
        shared.word,
        shared.points,
        shared.channels,
        shared.subframes,
        bool(shared.unsigned),
        own.n_frames,
        own.first,
        bytes(head),
        tuple(fields),
        shared.rotations,
        shared.ratio,
        shared.gap,
        shared.tail + own.tail + bytes(own.zeros),
        outputs,
    )


def ordered_fields(
    fields: Sequence[tuple[int, FieldKind]], size: int
) -> tuple[tuple[int, FieldKind], ...]:
    """The fields that lie within ``size`` bytes, sorted, without those that overlap others."""
    ordered: list[tuple[int, FieldKind]] = []
    end = 0
    for at, kind in sorted(fields):
        if end <= at <= size - kind.size:
            ordered.append((at, kind))
            end = at + kind.size
    return tuple(ordered)
