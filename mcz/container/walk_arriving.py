"""Walking a file while it is being written: its parts as their bytes arrive, each once.

SPEC.md, "Strict reading" and "Open DATA and packets", are normative. INDX and COPY are not compared
with the rest, which is not kept.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import BinaryIO

from mcz.container.bounds import NOBODY, Bounds
from mcz.container.chunks import COPY, SIGNATURE, Chunk, check_signature
from mcz.container.copies import parse_copies
from mcz.container.directory import SegmentRow
from mcz.container.scan import Walker
from mcz.container.source import ByteSource
from mcz.container.strict_ancillary import check_ancillary
from mcz.errors import TruncatedError
from mcz.schema import MAX_COUNT

MOST_AT_ONCE = 64 * 1024  # bytes that are taken from the stream where it has them


class PipeSource(ByteSource):
    """A stream that is read front to back; it need not be seekable, and its end is not known."""

    def __init__(self, stream: BinaryIO, name: str = "stream") -> None:
        super().__init__(stream, name=name, size=MAX_COUNT)
        self.block = 0  # nothing is waited for that is not needed yet
        self._start = 0  # offset of the first byte that is kept
        self._kept = bytearray()

    def _request(self, offset: int, size: int) -> bytes:
        stop = offset + size - self._start
        while len(self._kept) < stop:
            more = self._more(stop - len(self._kept))
            if not more:
                raise TruncatedError(f"the stream ended at {self._start + len(self._kept)}")
            self._kept += more
        self.n_requests += 1
        self.n_bytes += size
        return bytes(self._kept[offset - self._start : stop])

    def _more(self, wanted: int) -> bytes:
        """Some of the bytes that come next, waiting for the first of them alone if possible."""
        if hasattr(self._stream, "read1"):
            data: bytes = self._stream.read1(MOST_AT_ONCE)
        else:
            data = self._stream.read(wanted)
        return data

    @property
    def start(self) -> int:
        """What lies before was let go."""
        return self._start

    @property
    def end(self) -> int:
        """The bytes that have come."""
        return self._start + len(self._kept)

    def kept(self, at: int) -> bytes:
        """What has come of the bytes from ``at`` on, which is not before what was let go."""
        return bytes(self._kept[at - self._start :])

    def forget(self, before: int) -> None:
        """Let go of what lies before an offset."""
        del self._kept[: max(0, before - self._start)]
        self._start = max(self._start, before)

    def has_ended(self, at: int) -> bool:
        """Whether the stream ends at ``at``; waits until it goes on or ends."""
        try:
            self.read(at, 1)
        except TruncatedError:
            return True
        return False


@dataclass(frozen=True, slots=True)
class Arrival:
    """A chunk, or a packet of an open DATA, that has come; ``chunk`` is None for a FOOT.

    ``data`` are its bytes, of the first packet with the header of its DATA. ``segment`` is what it
    holds of a clip, ``payload`` the payload of the segment, or of a closed chunk.
    """

    chunk: Chunk | None
    data: bytes
    segment: SegmentRow | None
    payload: bytes


class ArrivingWalker(Walker):
    """A strict walk along a stream."""

    def __init__(self, stream: BinaryIO, name: str = "stream") -> None:
        self.pipe = PipeSource(stream, name)
        super().__init__(self.pipe, False, True, Bounds(NOBODY))

    def arrivals(self) -> Iterator[Arrival]:
        """All that comes up to the end of the stream, which is one behind a FOOT.

        Raises FormatError at the first fault, TruncatedError where the stream ends too early.
        """
        check_signature(self.pipe)
        at = len(SIGNATURE)
        while True:
            for end in self.steps(at):
                yield self._arrival(at, end)
                self.pipe.forget(end)
                at = end
            del self.found.chunks[:-1]  # attachments look at the last
            self.found.ends.clear()
            if self.chunk is None and self.pipe.has_ended(at):
                return

    def _arrival(self, at: int, end: int) -> Arrival:
        data = self.pipe.read(at, end - at)
        chunk, segment, payload = self.chunk, None, b""
        if self.clip is not None and self.clip.segments:
            segment = self.clip.segments.pop()  # its place in the stream is of no use any more
            payload = self.pipe.read(segment.offset, segment.size)
        elif chunk is not None and chunk.length is not None:
            payload = self.pipe.read(chunk.payload_offset, chunk.length)
        return Arrival(chunk, data, segment, payload)

    def _index(self, chunk: Chunk) -> None:
        self._outside(chunk)
        self._payload(chunk)
        self.index = chunk

    def _check_ancillary(self, chunk: Chunk, payload: bytes) -> None:
        """Check the form of copies: what they are of was let go, and is less than came before."""
        size = chunk.offset + chunk.size
        if chunk.type == COPY:
            parse_copies(payload, chunk, size)
        else:
            check_ancillary(chunk, payload, size, self.found, self._payload)
