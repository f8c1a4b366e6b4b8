"""Versions of the format: the one that this package writes, and those that it reads.

SPEC.md, "Versions", is normative.
"""

from __future__ import annotations

from construct import Container, Int8ul

from mcz.errors import UnsupportedError
from mcz.hints import Hint
from mcz.model.schema import CheckedBeside

FORMAT = 0, 99  # the draft of 1.0, which reads itself alone
FORMAT_NAME = f"{FORMAT[0]}.{FORMAT[1]}"


def _is_read(needs_minor: int, record: Container) -> bool:
    """Return true, or raise UnsupportedError where a file or clip needs another reader."""
    needed = record.needs_major, needs_minor  # HEAD-04
    words = f"it needs format {needed[0]}.{needed[1]}, this reader knows {FORMAT_NAME}"
    if needed > FORMAT:  # HEAD-01, CLIP-23
        raise UnsupportedError(words)
    if not needed[0] and needed != FORMAT:  # HEAD-03
        raise UnsupportedError(words, hint=Hint.OLD_FORMAT)
    return True


NEEDS_MINOR = CheckedBeside(Int8ul, _is_read)
