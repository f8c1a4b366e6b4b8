"""Invalid, one fault each: rules of codecs that no other vector shows by itself."""

from __future__ import annotations

from collections.abc import Iterable

from tools.vectors import bad_mrdwt, waved
from tools.vectors.craft import Broken, Vector, file_of
from tools.vectors.edits import Edit, both, raw_stream, says, stream
from tools.vectors.motions import HUNDREDTHS, column
from tools.vectors.valid_cut import window


def vectors() -> Iterable[Vector]:
    raw, mrdwt = Broken("invalid/raw"), Broken("invalid/mrdwt")
    _raw(raw)
    _hidden(mrdwt)
    return [*raw.vectors, *mrdwt.vectors]


def _raw(shelf: Broken) -> None:
    """Streams that a reader gets the right values from if it overlooks the fault."""
    motion, wide = column([3.0, 5.0, 9.0, 3.0], HUNDREDTHS), [[300, 500, 900, 300]]
    cases: tuple[tuple[str, str, Edit], ...] = (
        ("width-9-zeros", "Offsets of 9 bytes, the highest of each 0.", _with(wide, 9)),
        ("zero-missing", "The last byte is missing, which is 0.", lambda data: data[:-1]),
    )
    for name, purpose, edit in cases:
        data = file_of(motion, segments=stream(0, edit))
        shelf.add(name, "Codec 0: raw", purpose, data)


def _with(ordinals: list[list[int]], width: int) -> Edit:
    return lambda _: raw_stream(ordinals, (width,))


def _hidden(shelf: Broken) -> None:
    plan = waved.Plan(6, waved.HAAR)
    edits = window(waved.motion_of(plan, [waved.zeros(plan)]), 0, 4)
    said = says(waved.header(plan, coded_frames=b"\x08"))
    data = bad_mrdwt.of_zeros(plan, **{**edits, "CLIP": both(edits["CLIP"], said)})
    purpose = "The last segment ends inside a coefficient, behind all frames that are shown."
    shelf.add("end-inside-hidden", f"{waved.HEADING}; CLIP", purpose, data)
