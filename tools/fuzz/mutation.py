"""Changes of an .mcz file that keep it readable as far as the change: ``repair.py`` does the rest.

``Mutation`` is used with libFuzzer's mutations of bytes, and with plain ones where there is none.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from mcz.codecs import ENTRIES
from mcz.container import payloads
from mcz.container.chunks import FRAME, SEGMENT, Packet
from mcz.container.encodings import decode_data
from mcz.container.segments import parse_segment_header
from mcz.errors import MczError
from mcz.model.schema import MAX_COUNT, build, parse
from tools.fuzz.repair import (
    Piece,
    Pieces,
    join_pieces,
    pieces_of,
    table_of,
    with_header,
    with_payload,
    with_streams,
)

Bytes = Callable[[bytes, int], bytes]  # bytes and at most how many -> other bytes
NUMBERS = (0, 1, 2, 3, 7, 8, 16, 63, 64, 127, 128, 255, 256, 4095, 2**16, 2**31 - 1, 2**32, 2**40)
CLIP_NUMBERS = ("n_frames", "rate_numerator", "rate_denominator", "flags")
SIGNAL_NUMBERS = ("samples_per_frame", "skip", "spare", "codec", "codec_version", "n_resolutions")
MOST_STEPS = 4  # changes of one file


@dataclass(slots=True)
class Mutation:
    """One mutated file; ``rng`` chooses where, ``change`` changes bytes."""

    rng: random.Random
    change: Bytes

    def of(self, data: bytes, most: int, raw: float = 0.1) -> bytes:
        """Other bytes than ``data``, at most so many; ``raw`` is how often nothing is repaired."""
        if self.rng.random() < raw:
            return self.change(data, most)
        try:
            pieces = pieces_of(data)
        except MczError:
            return self.change(data, most)
        if not pieces:
            return self.change(data, most)
        index = None
        for _ in range(self.rng.choice((1, 1, 1, 2, 3, MOST_STEPS))):
            step = self.rng.choices(STEPS, WEIGHTS)[0]
            pieces = step(self, pieces) or pieces
        if self.rng.random() < 0.04:
            index = self._index
        made = join_pieces(pieces, index)
        return made if len(made) <= most else self.change(data, most)

    def _index(self, content: bytes) -> bytes:
        return self.change(content, len(content) + 16)

    def _bytes(self, data: bytes, more: int) -> bytes:
        """Other bytes, mostly as many: streams and headers say how long they are."""
        if not data or self.rng.random() < 0.4:
            return self.change(data, len(data) + more)
        out = bytearray(data)
        for _ in range(self.rng.choice((1, 1, 2, 3))):
            at = self.rng.randrange(len(out))
            if self.rng.random() < 0.7:
                out[at] ^= 1 << self.rng.randrange(8)
            else:
                out[at] = self.rng.choice((0, 1, 2, 127, 128, 254, 255, out[at] - 1 & 255))
        return bytes(out)

    def _near(self, value: int) -> int:
        """Another number, near or at the edge of something."""
        near = (value + 1, value - 1, 2 * value, value // 2, value + self.rng.choice(NUMBERS))
        chosen = self.rng.choice((*near, *near, self.rng.choice(NUMBERS)))
        return min(max(chosen, 0), MAX_COUNT)

    def _one(self, pieces: Pieces, *kinds: bytes) -> int | None:
        """The place of a piece of one of these types, None without any."""
        places = [n for n, piece in enumerate(pieces) if piece.type in kinds]
        return self.rng.choice(places) if places else None

    # Streams and segments ------------------------------------------------------

    def streams(self, pieces: Pieces) -> Pieces | None:
        """One stream of a segment, or of a packet."""
        return self._segment(pieces, self._stream)

    def _segment(self, pieces: Pieces, edit: Callable[[bytes], bytes]) -> Pieces | None:
        which = self._one(pieces, b"DATA")
        if which is None:
            return None
        piece = pieces[which]
        if piece.packets is None:
            return with_payload(pieces, which, edit(piece.payload))
        if not piece.packets:
            return None
        n = self.rng.randrange(len(piece.packets))
        packet = piece.packets[n]
        if packet.kind == SEGMENT:
            packet = replace(packet, body=edit(packet.body))
        else:
            packet = replace(packet, body=self._bytes(packet.body, 16))
        return _with_packets(pieces, which, (*piece.packets[:n], packet, *piece.packets[n + 1 :]))

    def _stream(self, payload: bytes) -> bytes:
        table = table_of(payload)
        if table is None or not table.streams:
            return self.change(payload, len(payload) + 16)
        streams = list(table.streams)
        n = self.rng.randrange(len(streams))
        if self.rng.random() < 0.05:
            streams[n] = self.rng.choice(streams)
        else:
            streams[n] = self._bytes(streams[n], 32) or streams[n]
        return with_streams(payload, table, streams)

    def segments(self, pieces: Pieces) -> Pieces | None:
        """One field of a segment before its table, or the table itself."""
        return self._segment(pieces, self._head)

    def _head(self, payload: bytes) -> bytes:
        try:
            header, _ = parse_segment_header(payload)
        except MczError:
            return self.change(payload, len(payload) + 16)
        name = self.rng.choice(("signal", "first", "n_frames", "lead", "tail", "flags"))
        value = getattr(header, name)
        new = value ^ 1 << self.rng.randrange(4) if name == "flags" else self._near(value)
        return with_header(payload, **{name: new})

    def frames(self, pieces: Pieces) -> Pieces | None:
        """Another number of frames, wherever that of the only segment of a clip is told."""
        clip, end = self._one(pieces, b"CLIP"), None
        if clip is None:
            return None
        end = next((n for n in range(clip, len(pieces)) if pieces[n].type == b"CEND"), None)
        data = [n for n in range(clip, end or clip) if pieces[n].type == b"DATA"]
        if end is None or not data or any(pieces[n].packets is not None for n in data):
            return None
        try:
            fields = parse(payloads.Cend, pieces[end].payload, "CEND")
            last = parse_segment_header(pieces[data[-1]].payload)[0]
            more = self._near(last.n_frames) - last.n_frames
            changed = list(pieces)
            changed[data[-1]] = _edit_header(pieces[data[-1]], n_frames=last.n_frames + more)
            fields.n_frames += more
            changed[end] = replace(pieces[end], payload=build(fields, "CEND"))
            begin = parse(payloads.Clip, pieces[clip].payload, "CLIP")
            begin.n_frames += more if begin.n_frames else 0
            changed[clip] = replace(pieces[clip], payload=build(begin, "CLIP"))
        except (MczError, TypeError):
            return None
        return changed

    # Headers and other payloads --------------------------------------------------

    def header(self, pieces: Pieces) -> Pieces | None:
        """The codec's own header of a signal."""

        def edit(fields: Any) -> None:
            long = [signal for signal in fields.signals if signal.header]
            signal = self.rng.choice(long if self.rng.random() < 0.98 else fields.signals)
            signal.header = self._bytes(bytes(signal.header), 16)

        return self._clip(pieces, edit)

    def numbers(self, pieces: Pieces) -> Pieces | None:
        """One number of CLIP."""

        def edit(fields: Any) -> None:
            signal = self.rng.choice(fields.signals)
            of, name = self.rng.choice(
                [(fields, n) for n in CLIP_NUMBERS] + 2 * [(signal, n) for n in SIGNAL_NUMBERS]
            )
            near = self._near(getattr(of, name))
            setattr(
                of,
                name,
                self.rng.choice([home.id for home in ENTRIES.values()])
                if name == "codec"
                else near,
            )

        return self._clip(pieces, edit)

    def details(self, pieces: Pieces) -> Pieces | None:
        """Grids, groups, channels, metadata and what restores the source."""

        def edit(fields: Any) -> None:
            signal = self.rng.choice(fields.signals)
            kind = self.rng.randrange(4)
            if kind == 0 and signal.grids:
                run = self.rng.choice(signal.grids)
                run.n_channels = self._near(run.n_channels)
            elif kind == 1:
                signal.groups.kind = self.rng.randrange(4)
                signal.groups.sizes = [self.rng.randrange(1, 4) for _ in range(3)]
            elif kind == 2 and fields.source:
                detail = bytes(fields.source.detail)
                fields.source.detail = self._bytes(detail, 16)
            elif fields.metadata:
                pair = self.rng.choice(fields.metadata)
                pair.value = self.change(pair.value.encode(), 64).decode("latin-1")

        return self._clip(pieces, edit)

    def _clip(self, pieces: Pieces, edit: Callable[[Any], None]) -> Pieces | None:
        which = self._one(pieces, b"CLIP")
        if which is None:
            return None
        try:
            fields = parse(payloads.Clip, pieces[which].payload, "CLIP")
            edit(fields)
            payload = build(fields, "CLIP")
        except (MczError, IndexError, TypeError):
            return None
        return with_payload(pieces, which, payload)

    def payload(self, pieces: Pieces) -> Pieces | None:
        """The bytes of a payload, whatever they are."""
        which = self.rng.randrange(len(pieces))
        return self._payload(pieces, which)

    def model(self, pieces: Pieces) -> Pieces | None:
        """The bytes of a model or of a template, which is inflated."""
        which = self._one(pieces, b"MODL", b"SRCE")
        if which is None:
            return None
        if pieces[which].type == b"MODL":
            return self._payload(pieces, which)
        try:
            fields = parse(payloads.Srce, pieces[which].payload, "SRCE")
            text = decode_data(fields.data, fields.flags, fields.size, "SRCE")
            fields.data = self._bytes(text, 32)
            fields.size, fields.flags = len(fields.data), payloads.STORED
            return with_payload(pieces, which, build(fields, "SRCE"))
        except MczError:
            return None

    def _payload(self, pieces: Pieces, which: int) -> Pieces | None:
        piece = pieces[which]
        if piece.type == b"FOOT" or piece.packets is not None:
            return None
        return with_payload(pieces, which, self._bytes(piece.payload, 32))

    # Chunks and packets ----------------------------------------------------------

    def chunks(self, pieces: Pieces) -> Pieces | None:
        """A chunk left out, twice, elsewhere, or with other flags."""
        n, other = self.rng.randrange(len(pieces)), self.rng.randrange(len(pieces))
        kind, piece = self.rng.randrange(4), pieces[n]
        if kind == 0:
            return [*pieces[:n], *pieces[n + 1 :]] if len(pieces) > 1 else None
        if kind == 1:
            return [*pieces[:other], piece, *pieces[other:]]
        if kind == 2:
            rest = [*pieces[:n], *pieces[n + 1 :]]
            return [*rest[:other], piece, *rest[other:]]
        return [*pieces[:n], replace(piece, flags=self.rng.randrange(4)), *pieces[n + 1 :]]

    def packets(self, pieces: Pieces) -> Pieces | None:
        """A packet left out, twice, elsewhere, or of another kind."""
        places = [n for n, piece in enumerate(pieces) if piece.packets]
        if not places:
            return None
        which = self.rng.choice(places)
        packets = list(pieces[which].packets or ())
        n, other = self.rng.randrange(len(packets)), self.rng.randrange(len(packets))
        kind = self.rng.randrange(5)
        if kind == 0:
            del packets[n]
        elif kind == 1:
            packets.insert(other, packets[n])
        elif kind == 2:
            packets.insert(other, packets.pop(n))
        elif kind == 3:
            packets[n] = replace(packets[n], fresh=not packets[n].fresh)
        else:
            packets[n] = replace(packets[n], kind=self.rng.choice((SEGMENT, FRAME)))
        return _with_packets(pieces, which, tuple(packets))


def _edit_header(piece: Piece, **fields: int) -> Piece:
    return replace(piece, payload=with_header(piece.payload, **fields))


def _with_packets(pieces: Pieces, which: int, packets: tuple[Packet, ...]) -> Pieces:
    return [*pieces[:which], replace(pieces[which], packets=packets), *pieces[which + 1 :]]


STEPS: tuple[Callable[[Mutation, Pieces], Pieces | None], ...] = (
    Mutation.streams,
    Mutation.header,
    Mutation.model,
    Mutation.frames,
    Mutation.segments,
    Mutation.numbers,
    Mutation.details,
    Mutation.payload,
    Mutation.chunks,
    Mutation.packets,
)
WEIGHTS = (60, 15, 12, 6, 4, 4, 5, 3, 2, 4)


def plain_change(rng: random.Random) -> Bytes:
    """Changes of bytes without libFuzzer: bits, numbers, cuts, copies."""

    def change(data: bytes, most: int) -> bytes:
        out = bytearray(data)
        for _ in range(rng.choice((1, 1, 1, 2, 4))):
            at = rng.randrange(len(out) + 1)
            kind = rng.randrange(6)
            if kind == 0 or not out:
                out.insert(at, rng.randrange(256))
            elif kind == 1:
                del out[at : at + rng.choice((1, 1, 2, 4, 8))]
            elif kind == 2:
                out[at : at + 1] = bytes((rng.choice((0, 1, 2, 127, 128, 254, 255)),))
            elif kind == 3:
                source = rng.randrange(len(out))
                out[at:at] = out[source : source + rng.randrange(1, 9)]
            else:
                out[at % len(out)] ^= 1 << rng.randrange(8)
        return bytes(out[:most])

    return change
