"""The end of a clip in a damaged file: does the part behind lost bytes still belong to it?

SPEC.md, "Salvage", is normative.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from mcz.container.chunks import FRAMING, ChunkType
from mcz.container.parser_drivers import chunks_in
from mcz.errors import FormatError

LEAST_BETWEEN = 2 * FRAMING  # bytes in which a CEND and the next CLIP can have been
Owners = Mapping[tuple[int, int], str]  # offset and size of segments and CENDs -> name of the clip
NOBODY: Owners = MappingProxyType({})


class Bounds:
    """Knowledge of the end of the clip that is open; ``owners``: that of an index.

    ``doubt``: it may have ended, and another one have begun, in bytes that are lost.
    """

    def __init__(self, owners: Owners) -> None:
        self.owners = owners
        self.doubt = False
        self._fault: int | None = None  # where what cannot be taken in began, up to here

    def begin(self) -> None:
        """Note that a clip begins or ends here."""
        self.doubt = False

    def begin_fault(self, at: int) -> None:
        """Note that what lies at ``at`` cannot be taken in."""
        self._fault = at if self._fault is None else self._fault

    def skip(self, to: int) -> bool:
        """Note that nothing is known up to ``to``; return whether there is a doubt."""
        self.doubt = self.doubt or to - (self._fault or 0) >= LEAST_BETWEEN
        return self.doubt

    def is_sound(self) -> None:
        """Note that what followed was taken in."""
        self._fault = None

    def settle(self, payload: bytes, offset: int, own: bytes) -> bool:
        """Let the REPT with ``payload`` tell; return False where it is in another clip.

        ``offset``: where that begins; ``own``: the payload of the CLIP that is open.
        """
        try:
            held = [c.payload for c in chunks_in(payload, offset) if c.chunk.type == ChunkType.CLIP]
        except FormatError:  # what is no REPT says nothing
            return True
        self.doubt = held != [own]
        return not held or held == [own]

    def check(self, clip: str, kind: str, offset: int, size: int) -> None:
        """Raise FormatError for what may belong to another clip than ``clip``."""
        owner = self.owners.get((offset, size))
        if owner == clip:
            self.doubt = False
        elif owner is not None or self.doubt:  # SALV-10
            raise FormatError(
                f"{kind} at {offset} lies behind bytes that may have ended clip {clip!r}"
            )
