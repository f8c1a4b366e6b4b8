"""The chunks that a REPT holds again. SPEC.md, "REPT", is normative."""

from __future__ import annotations

from mcz.container.chunks import ChunkType
from mcz.container.events import ChunkEvent, Fault
from mcz.container.grammar import START
from mcz.container.parser import Parser
from mcz.errors import FormatError


def chunks_in(payload: bytes, offset: int) -> list[ChunkEvent]:
    """The chunks in the ``payload`` of a REPT, which begins at ``offset``; raises FormatError."""
    stop = offset + len(payload)
    parser, found = Parser(stop, at=offset, state=START), []
    parser.feed(payload)
    while parser.at < stop:
        event = parser.next()
        if isinstance(event, Fault):
            raise event.error
        if not isinstance(event, ChunkEvent):
            raise FormatError(f"REPT before {offset} holds other things than chunks")
        found.append(event)
    kinds = [event.chunk.type for event in found]
    middle = set(kinds[1:-1]) <= {ChunkType.SKEL, ChunkType.MODL}
    if kinds[:1] != [ChunkType.HEAD] or kinds[-1:] != [ChunkType.CLIP] or not middle:
        held = " ".join(kind.decode() for kind in kinds)
        raise FormatError(f"REPT before {offset} holds {held or 'nothing'}")
    return found
