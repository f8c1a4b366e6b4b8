"""The edits of a row: fields, slices, streams, chunks, and the bytes of the file.

README.md has the notation. Edits of chunks and their streams come first, in the order of the row;
then all is repaired, and those of INDEX, INDX, FOOT and ``file`` come where each is made.
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from mcz.container.chunks import Chunk, ChunkFlag, implied_by
from mcz.container.directory import Index
from mcz.model.schema import build, read_varint, varint
from tools.vectors.engine.fields import SCHEMAS, STREAMS, VIEWS, place_of, swap_items
from tools.vectors.engine.layout import (
    Layout,
    Part,
    foot_of,
    index_payload,
    listing_of,
    previous_of,
    stop_of,
)
from tools.vectors.engine.notation import integer, read_bytes

FIELD = re.compile(
    r"(?P<name>\w{4,})(?:#(?P<number>-?\d+))?(?:/(?P<stream>\d+))?(?P<own>:\w*)?"
    r"(?P<path>(?:\.\w+)*)(?:\[(?P<slice>[-\w:]+)\])?"
)
EDIT = re.compile(FIELD.pattern + r"\s*(?P<operator>=|\+=|\^=)\s*(?P<value>.*)", re.DOTALL)
FRONT = 16  # bytes of a chunk before its payload
HEADER = {"signal", "first", "n_frames", "lead", "tail", "flags"}
PACKET = {"kind", "sequence", "fresh"}
LATE = ("INDEX", "INDX", "FOOT", "file")


@dataclass(frozen=True)
class Target:
    """A place that an edit names."""

    name: str
    number: int
    stream: int | None
    own: str | None  # of the chunk's header; empty for all its bytes
    path: str
    slice: str | None

    @classmethod
    def of(cls, match: re.Match[str] | None) -> Target:
        if match is None:
            raise ValueError("an edit names no place")
        fields = match.groupdict()
        stream, own = fields["stream"], fields["own"]
        return cls(
            fields["name"],
            int(fields["number"] or 0),
            None if stream is None else int(stream),
            None if own is None else own[1:],
            fields["path"][1:],
            fields["slice"],
        )

    @property
    def type(self) -> bytes:
        if self.name in STREAMS:
            return b"DATA"
        return VIEWS[self.name].type if self.name in VIEWS else self.name.encode()


class Editor:
    """The edits of one row on one file."""

    def __init__(self, base: bytes, edits: Sequence[str], constants: Mapping[str, str]) -> None:
        self.layout = Layout(base)
        self.constants = constants
        self.edits = [edit.strip() for edit in edits]
        self.indexed: list[tuple[Part, Part]] = []  # an ancillary chunk, the CLIP it belongs to

    def data(self) -> bytes:
        """The edited file."""
        late = [edit for edit in self.edits if edit.removeprefix("swap ").startswith(LATE)]
        for edit in self.edits:
            if edit not in late:
                self._apply(edit)
        layout = self.layout
        layout.settle()
        layout.place()
        feet = indexes = 0
        index: Part | None = None
        places: dict[int, Part] = {}  # of the INDX of the base file, by their offsets there
        for part in list(layout.parts):
            if part.type == b"INDX":
                self._index(part, indexes, late, places)
                layout.place()
                index, indexes = part, indexes + 1
            elif part.type == b"FOOT":
                part.payload = foot_of(index)
                before = bytes(part.payload)
                self._late(part, "FOOT", feet, late)
                if part.payload != before and part.payload[4:8] == before[4:8]:
                    crc = zlib.crc32(part.payload[:4] + part.payload[8:])
                    part.payload = part.payload[:4] + crc.to_bytes(4, "little") + part.payload[8:]
                layout.place()
                index, feet = None, feet + 1
        whole = layout.signature + b"".join(part.build() for part in layout.parts)
        for edit in late:
            match = EDIT.fullmatch(edit)
            if match and match["name"] == "file":
                whole = self._change_field(None, whole, Target.of(match), match)
        return whole

    def _index(self, part: Part, number: int, late: Sequence[str], places: dict[int, Part]) -> None:
        was, previous = listing_of(part, self.layout.data)
        if previous is not None:
            before = places[previous.offset]
            was.start, previous = stop_of(before), previous_of(before)
        places[(part.place or 0) - FRONT] = part
        listing = self.layout.index_content(was)
        for chunk, owner in self.indexed:
            row = Chunk(chunk.type, 1, chunk.offset - FRONT, len(chunk.payload))
            if row.offset >= listing.start and row.offset < part.offset:
                clips = listing.new.clips.values()
                own = [clip for clip in clips if clip.clip.payload_offset == owner.offset]
                (own[0].ancillary if own else listing.behind).append(row)
        made = Part(b"INDX", build(listing.record(), "INDX"))
        self._late(made, "INDEX", number, late)
        part.payload = index_payload(made.payload, previous)
        self._late(part, "INDX", number, late)

    def _late(self, part: Part, name: str, number: int, late: Sequence[str]) -> None:
        schema = {"INDEX": Index}.get(name) or SCHEMAS.get(name)
        for edit in late:
            verb, *places = edit.split()
            if verb == "swap":
                one, other = (Target.of(FIELD.fullmatch(place)) for place in places)
                if (one.name, one.number) == (name, number):
                    part.payload = swap_items(schema, part.payload, one.path, other.path)
                continue
            match = EDIT.fullmatch(edit)
            if match is None:
                raise ValueError(f"{edit!r} is no edit")
            target = Target.of(match)
            if target.name == name and target.number == number:
                if target.own is not None:
                    self._outer(part, target, match)
                else:
                    part.payload = self._change_field(schema, part.payload, target, match)

    def _apply(self, edit: str) -> None:
        verb, _, rest = edit.partition(" ")
        match = EDIT.fullmatch(edit)
        if match is not None:
            self._edit(match)
        elif verb in ("drop", "copy", "move", "insert", "swap"):
            getattr(self, f"_{verb}")(rest)
        else:
            raise ValueError(f"{edit!r} is no edit")

    def _part(self, text: str) -> Part:
        match = FIELD.fullmatch(text.strip())
        if match is None:
            raise ValueError(f"{text!r} is no part of a file")
        target = Target.of(match)
        return self.layout.find(target.type, target.number)

    def _drop(self, rest: str) -> None:
        self.layout.parts.remove(self._part(rest))

    def _place(self, where: str, words: str) -> int:
        index = self.layout.parts.index(self._part(words))
        return index if where == "before" else index + 1

    def _copy(self, rest: str) -> None:
        """``copy SKEL after CEND``: the same chunk a second time."""
        what, where, anchor = rest.split()
        part = self._part(what)
        twin = replace(part, place=None, segment=None, frame=dict(part.frame))
        self.layout.parts.insert(self._place(where, anchor), twin)

    def _move(self, rest: str) -> None:
        what, where, anchor = rest.split()
        part, beside = self._part(what), self._part(anchor)
        self.layout.parts.remove(part)
        self.layout.parts.insert(self.layout.parts.index(beside) + (where == "after"), part)

    def _insert(self, rest: str) -> None:
        """``insert xtra+1 after CEND = "more"``: a chunk with flags."""
        head, _, value = rest.partition("=")
        what, where, anchor = head.split()
        type_, _, flags = what.partition("+")
        part = Part(type_.encode(), self._bytes(value), int(flags or 0))
        place = self._place(where, anchor)
        self.layout.parts.insert(place, part)
        before = [p for p in self.layout.parts[:place] if p.type in (b"CLIP", b"CEND", b"FOOT")]
        clips = [p for p in before if p.type == b"CLIP"]
        if part.flags & ChunkFlag.ANCILLARY and clips and before[-1].type != b"CLIP":
            self.indexed.append((part, clips[-1]))

    def _swap(self, rest: str) -> None:
        """``swap CLIP.signals.0 CLIP.signals.1``: items of a list."""
        one, other = (Target.of(FIELD.fullmatch(word)) for word in rest.split())
        part, view = self.layout.find(one.type, one.number), VIEWS.get(one.name)
        if view is None:
            part.payload = swap_items(SCHEMAS[one.name], part.payload, one.path, other.path)
        else:
            inner = swap_items(view.schema, view.read(part.payload), one.path, other.path)
            part.payload = view.write(part.payload, inner)

    def _edit(self, match: re.Match[str]) -> None:
        target = Target.of(match)
        part = self.layout.find(target.type, target.number)
        if target.own is not None:
            self._outer(part, target, match)
        elif target.stream is not None:
            self._stream(part, target, match)
        elif target.name in VIEWS:
            view = VIEWS[target.name]
            inner = self._change_field(view.schema, view.read(part.payload), target, match)
            part.payload = view.write(part.payload, inner)
        elif target.path in HEADER and part.type in (b"DATA", b"packet"):
            segment = part.taken_apart()
            value = integer(match["value"])
            segment.header = replace(segment.header, **{target.path: value})
        elif target.path == "streams":
            self._streams(part, match)
        else:
            schema = SCHEMAS.get(target.name)
            part.payload = self._change_field(schema, part.payload, target, match)

    def _stream(self, part: Part, target: Target, match: re.Match[str]) -> None:
        segment, index = part.taken_apart(), target.stream or 0
        segment.streams += [b""] * (index + 1 - len(segment.streams))
        schema = STREAMS.get(target.name)
        segment.streams[index] = self._change_field(schema, segment.streams[index], target, match)

    def _streams(self, part: Part, match: re.Match[str]) -> None:
        """``DATA.streams = 0 0 "new" 1``: streams of now by number, or bytes in parentheses."""
        segment = part.taken_apart()
        segment.streams = [
            segment.streams[int(word)] if word.isdigit() else self._bytes(word)
            for word in re.findall(r"\([^()]*\)|\d+", match["value"])
        ]

    def _outer(self, part: Part, target: Target, match: re.Match[str]) -> None:
        """The header of a chunk or packet, or its bytes as they are written."""
        value = match["value"]
        if target.own == "":
            part.outer.append(lambda data: self._change_field(None, data, target, match))
        elif target.own == "number" and part.packet is not None:
            implied = implied_by(integer(value), part.packet.implied[8:])
            part.packet = replace(part.packet, implied=implied)
            part.frame["number"] = implied
        elif target.own in PACKET and part.packet is not None:
            part.packet = replace(part.packet, **{target.own: integer(value)})
        else:
            part.frame[str(target.own)] = self._bytes(value)

    def _bytes(self, text: str) -> bytes:
        return read_bytes(text, self._lookup, self.constants)

    def _lookup(self, text: str) -> bytes:
        match = FIELD.fullmatch(text)
        if match is None:
            raise ValueError(f"{text!r} is no place in a file")
        target = Target.of(match)
        part = self.layout.find(target.type, target.number)
        data, schema = part.payload, SCHEMAS.get(target.name)
        if target.stream is not None:
            data, schema = part.taken_apart().streams[target.stream], STREAMS.get(target.name)
        elif target.name in VIEWS:
            data, schema = VIEWS[target.name].read(data), VIEWS[target.name].schema
        start, stop = place_of(schema, data, target.path, target.slice)
        return data[start:stop]

    def _change_field(
        self, schema: object, data: bytes, target: Target, match: re.Match[str]
    ) -> bytes:
        start, stop = place_of(schema, data, target.path, target.slice)
        value, old = match["value"], data[start:stop]
        if match["operator"] == "+=":
            new = varint(read_varint(old, 0)[0] + integer(value))
        elif match["operator"] == "^=":
            mask = self._bytes(value)
            new = bytes(a ^ b for a, b in zip(old, mask, strict=True))
        else:
            new = self._bytes(value)
        return data[:start] + new + data[stop:]


def edit_file(
    base: bytes, edits: Sequence[str], constants: Mapping[str, str] | None = None
) -> bytes:
    """The file ``base`` with these edits."""
    return Editor(base, edits, constants or {}).data() if edits else base
