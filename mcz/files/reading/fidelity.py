"""The relation of an output to the source file of its clip, in one word."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from typing import TYPE_CHECKING

from mcz.errors import FormatError

if TYPE_CHECKING:
    from mcz.files.reading.clip import Clip

RESTORED = "restored"  # the file whose SHA-256 is stored, byte for byte
CUT = "cut"  # some of its frames, with all numbers unchanged
LOSSY = "lossy"  # approximate numbers, printed like the source's
FILTERED = "filtered"  # numbers of a post filter
SALVAGED = "salvaged"  # its intact parts
CONVERTED = "converted"  # a file of another format, or numbers
GIVEN_BACK = (RESTORED, CUT, LOSSY)  # words for all of a clip


def fidelity_of(clip: Clip) -> str:
    """The word for the file that all of ``clip`` restores; the file of a sound clip is checked."""
    record: Mapping[str, str] = {}
    with suppress(FormatError):  # of a damaged file
        record = clip.quality or {}
    if "cut-resolution" in record or not all(info.codec.lossless for info in clip.signals):
        return LOSSY
    return CUT if "cut-frames" in record else RESTORED
