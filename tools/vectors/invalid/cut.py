"""Invalid, one fault each: what a clip shows of its stored frames."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from mcz.container import payloads
from tools.vectors.build.cuts import CUT_HEADING, window
from tools.vectors.build.edits import both, put
from tools.vectors.build.files import Broken, Vector, file_of
from tools.vectors.build.motions import dance

WHOLE = dance(8)


def vectors() -> Iterable[Vector]:
    shelf = Broken("invalid/cut")
    windows: tuple[tuple[str, str, dict[str, Any]], ...] = (
        ("skip-beyond", "One frame more is skipped than is stored.", {"skip": 3}),
        ("spare-beyond", "One frame more is spare than is stored.", {"spare": 4}),
        ("skip-less", "A frame is stored that is neither shown nor skipped.", {"skip": 1}),
        ("spare-less", "A frame is stored that is neither shown nor spare.", {"spare": 2}),
        ("shown-later", "Other frames are shown than the hash is of.", {"skip": 3, "spare": 2}),
        (
            "skip-2-53",
            "So many frames are skipped that their sum with the others is no count.",
            {"skip": 2**53 - 5},
        ),
        ("spare-2-53", "2^53 - 1 spare frames.", {"spare": 2**53 - 1}),
        ("skip-2-50", "2^50 stored frames, of which 8 are there.", {"skip": 2**50}),
    )
    for name, purpose, changes in windows:
        _add(shelf, name, "CLIP; DATA", purpose, **window(WHOLE, 2, 5, **changes))
    edits = window(WHOLE, 2, 5)
    opened = both(put(payloads.Clip, "flags", b"\1"), put(payloads.Clip, "n_frames", b"\0"))
    purpose = "A clip that does not know its frames skips some."
    _add(shelf, "open", "CLIP", purpose, **edits | {"CLIP": both(edits["CLIP"], opened)})
    for field in ("skip", "spare"):
        purpose = f"INDX says another {field} than CLIP."
        table = _indexed(field)
        _add(shelf, f"index-{field}", "INDX; Strict reading", purpose, **edits, table=table)
    purpose = "A skip that is not in its shortest form."
    overlong = both(edits["CLIP"], put(payloads.Clip, "signals.0.skip", b"\x82\0"))
    _add(shelf, "skip-varint", "Conventions; CLIP", purpose, **edits | {"CLIP": overlong})
    return shelf.vectors


def _add(shelf: Broken, name: str, spec: str, purpose: str, **edits: Any) -> None:
    data = file_of(WHOLE, segment_frames=3, **edits)
    shelf.add(name, f"{CUT_HEADING}; {spec}", purpose, data)


def _indexed(field: str) -> Any:
    def edit(fields: Any) -> Any:
        row = fields.clips[0].signals[0]
        setattr(row, field, getattr(row, field) + 1)
        return fields

    return edit
