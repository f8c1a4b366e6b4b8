"""The grammar of a file: what may follow what, as SPEC.md, "Grammar", prints it."""

from __future__ import annotations

from mcz.container.chunks import FLAGS_OF, Chunk, ChunkFlag, ChunkType
from mcz.errors import FormatError, UnsupportedError

# States: what was read last, and so what may follow.
SIGNATURE, START, BODY, CLIP, PACKETS, INDEX, FILE = (
    *("signature", "start", "body", "clip"),
    *("packets", "index", "file"),
)
# Things that are not called as the type of their chunk.
OPEN_DATA, PACKET, END_PACKET = "open DATA", "packet", "end packet"
OTHER, FOOT, END = "ancillary", "FOOT", "end of file"

GRAMMAR: dict[str, dict[str, str]] = {
    "HEAD": {START: BODY},
    "SKEL": {BODY: BODY, FILE: BODY},
    "MODL": {BODY: BODY, FILE: BODY},
    "SRCE": {BODY: BODY, FILE: BODY},
    "ATTA": {BODY: BODY, FILE: BODY},
    "ALIA": {BODY: BODY, FILE: BODY},
    "CLIP": {BODY: CLIP, FILE: CLIP},  # GRAM-09
    "DATA": {CLIP: CLIP},
    OPEN_DATA: {CLIP: PACKETS},
    PACKET: {PACKETS: PACKETS},
    END_PACKET: {PACKETS: CLIP},
    "CEND": {CLIP: BODY},
    OTHER: {BODY: BODY, CLIP: CLIP, FILE: BODY},
    "INDX": {BODY: INDEX, FILE: INDEX},
    FOOT: {BODY: FILE, INDEX: FILE, FILE: FILE},
    END: {FILE: END},
}
NAMED: dict[bytes, str] = {kind: kind.name for kind in ChunkType if kind.name in GRAMMAR}


def thing_of(chunk: Chunk) -> str:
    """The row of the grammar that a closed chunk belongs to; raises FormatError for wrong flags."""
    thing = NAMED.get(chunk.type)
    if chunk.flags != FLAGS_OF.get(chunk.type, 0 if thing else chunk.flags):  # CHUNK-15
        raise FormatError(f"chunk {chunk.label}: flags {chunk.flags:#x}, not those of its type")
    if thing is not None:
        return thing
    if chunk.flags & ChunkFlag.ANCILLARY:  # CHUNK-12
        return OTHER
    raise UnsupportedError(f"chunk {chunk.label} is critical and unknown")  # CHUNK-11


def misplaced(thing: str, label: str, state: str) -> FormatError:
    """The error of a thing that may not stand where it does."""
    if state == START:
        return FormatError(f"the first chunk is {label}, not HEAD")
    if state == INDEX:
        return FormatError(f"INDX is followed by {label}, not by a FOOT")
    if thing == "HEAD":
        return FormatError(f"a second {label}")
    if state == CLIP:
        return FormatError(f"chunk {label} is inside a clip")
    return FormatError(f"{label} is outside a clip")


def after_misplaced(thing: str, state: str) -> str:
    """The state to go on with behind such a thing."""
    began = {"CLIP": CLIP, "INDX": INDEX, OPEN_DATA: PACKETS}.get(thing)
    return began or (BODY if state in (START, INDEX) else state)
