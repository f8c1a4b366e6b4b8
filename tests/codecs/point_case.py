"""A signal of a codec of points, beside the plain decoder that was written from SPEC.md alone."""

from __future__ import annotations

import random
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mcz.codecs import by_name
from mcz.codecs.base import FindModel, Layout, Model, Request, Segment, Span
from mcz.errors import FormatError
from tests import plain_lsdt


@dataclass(frozen=True)
class Case:
    """A signal as a codec and the plain decoder are given it."""

    name: str
    header: bytes
    layout: Layout
    segments: tuple[Segment, ...]

    def fast(self, start: int = 0, stop: int | None = None) -> bytes | None:
        """The bytes of the values, None where they are refused."""
        spans = [Span(s.first, s.n_frames, s.lead, s.tail, s.fresh) for s in self.segments]
        stop = self.layout.n_frames if stop is None else stop
        request = Request(start, stop, tuple(range(len(self.layout.groups))))
        try:
            values = by_name(self.name).decode(
                self.header, self.layout, spans, request, self.stream
            )
        except FormatError:
            return None
        return values.astype("<f8").tobytes()

    def stream(self, segment: int, resolution: int, group: int) -> bytes:
        return self.segments[segment].streams[resolution * len(self.layout.groups) + group]

    def plain(self) -> bytes | None:
        segments = [
            plain_lsdt.Segment(s.first, s.n_frames, s.streams, s.lead, s.tail, s.fresh)
            for s in self.segments
        ]
        sizes = self.layout.n_channels, self.layout.n_frames
        codec = by_name(self.name).id
        try:
            rows = plain_lsdt.decode(codec, self.header, *sizes, segments, self.find)
        except ValueError:
            return None
        return np.array(rows, "<f8").tobytes()

    def find(self, id_: bytes) -> tuple[int, bytes] | None:
        assert self.layout.find_model is not None
        model = self.layout.find_model(id_)
        return model and (model.kind, model.data)

    def check(self) -> None:
        """All values, and some of the frames alone."""
        values = self.plain()
        assert values == self.fast()
        assert values is not None
        n, size = self.layout.n_frames, 8 * self.layout.n_channels
        for start, stop in ((n // 3, n // 2), (n - n // 5, n)):
            assert values[size * start : size * stop] == self.fast(start, stop)

    def changed(self, chance: random.Random) -> Case:
        """One change of the header, of a stream, or of what is said of a segment."""
        what, i = chance.random(), chance.randrange(len(self.segments))
        segment = self.segments[i]
        if what < 0.2:
            return replace(self, header=changed(self.header, chance))
        if what < 0.35:
            return replace(self, layout=replace(self.layout, find_model=self.other_model(chance)))
        if what < 0.9:
            streams = tuple(changed(stream, chance) for stream in segment.streams)
            segment = replace(segment, streams=streams)
        elif what < 0.95:
            segment = replace(segment, fresh=not segment.fresh)
        else:
            segment = replace(segment, **{chance.choice(["lead", "tail"]): 1})
        return replace(self, segments=(*self.segments[:i], segment, *self.segments[i + 1 :]))

    def other_model(self, chance: random.Random) -> FindModel:
        """Finds changed models in the place of those that there are."""
        seed = chance.randrange(2**32)

        def find(id_: bytes) -> Model | None:
            model = self.find(id_)
            if model is None:
                return None
            other = random.Random(seed)
            return Model(model[0] + (other.random() < 0.1), changed(model[1], other))

        return find

    def check_changes(self, n_changes: int, seed: int) -> int:
        """How many of them both refuse."""
        chance, refused = random.Random(seed), 0
        for _ in range(n_changes):
            other = self.changed(chance)
            found = other.plain()
            assert found == other.fast()
            refused += found is None
        return refused


def changed(data: bytes, chance: random.Random) -> bytes:
    new = bytearray(data or b"\0")
    at = chance.randrange(len(new))
    match chance.randrange(7):
        case 0:
            del new[at:]
        case 1:
            new += bytes([chance.choice((0, 255))])
        case 2:
            new[0] = chance.randrange(256)
        case 3:
            new[at] = chance.randrange(256)
        case _:
            new[at] ^= 1 << chance.randrange(8)
    return bytes(new)


def stored(file: Any, clip: Any) -> Case:
    """The motion of a clip, all frames that the file stores."""
    info = clip.signals[0]
    segments = []
    n_resolutions, n_groups = info.layout.n_resolutions, len(info.layout.groups)
    places = [(r, g) for r in range(n_resolutions) for g in range(n_groups)]
    for row, span in zip(info.rows, info.spans, strict=True):
        table, streams = file.container.streams(row, info.counts, None)
        own = tuple(streams[table.codec(*place)] for place in places)
        segments.append(Segment(span.first, span.n_frames, own, span.lead, span.tail, span.fresh))
    return Case(info.codec.name, info.header, info.layout, tuple(segments))
