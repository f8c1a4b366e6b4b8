"""Invalid, one fault each: INDX against the chunks."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from mcz.container import payloads
from mcz.schema import parse, varint
from tools.vectors.craft import Broken, Vector
from tools.vectors.edits import at, plus


def vectors() -> Iterable[Vector]:
    shelf = Broken("invalid/index")
    cases: tuple[tuple[str, str, Callable[[Any], None]], ...] = (
        ("clip-name", "Another name of the clip.", _clip(name="dancf")),
        ("n-frames", "Another number of frames.", _clip(n_frames=5)),
        ("rate", "Another frame rate.", _clip(rate_numerator=60)),
        ("skeleton", "Another skeleton.", _clip(skeleton=b"s" * 16)),
        ("clip-left-out", "The clip is left out.", lambda fields: fields.clips.clear()),
        ("codec", "Another version of the codec.", _signal(codec_version=1)),
        ("channels", "Another number of channels.", _signal(n_channels=5)),
        ("clip-offset", "The clip is said to be a byte further on.", _moved),
        ("segment-gap", "The segment is said to be a byte further on.", _later),
        ("segment-flags", "Other flags of the segment.", _segment(6, 0)),
        ("segment-signal", "A segment of a signal that is not there.", _segment(2, 1)),
        ("segment-frames", "Another number of frames of the segment.", _segment(3, 3)),
        ("shared-id", "Another id of the skeleton.", _other_id),
        ("head", "Another copy of HEAD.", _other_head),
        ("attachment-too-many", "An attachment that is not there.", _ghost),
        ("alias-too-many", "An alias that is not there.", _ghost_alias),
    )
    for name, purpose, change in cases:
        shelf.edited(name, "INDX; Strict reading", f"INDX: {purpose}", table=_silent(change))
    shelf.edited("INDX-size", "INDX; Conventions", "INDX inflates to a byte less.", INDX=_resized)
    purpose = "A byte follows the deflate stream."
    shelf.edited("INDX-deflate", "INDX; Conventions", purpose, INDX=plus(b"\0"))
    return shelf.vectors


def _silent(change: Callable[[Any], None]) -> Callable[[Any], Any]:
    def edit(fields: Any) -> Any:
        change(fields)
        return fields

    return edit


def _clip(**changes: Any) -> Callable[[Any], None]:
    return lambda fields: fields.clips[0].update(changes)


def _signal(**changes: Any) -> Callable[[Any], None]:
    return lambda fields: fields.clips[0].signals[0].update(changes)


def _segment(place: int, value: int) -> Callable[[Any], None]:
    """Change one of the seven fields of the segment, all of one byte."""

    def change(fields: Any) -> None:
        row = fields.clips[0]
        assert len(row.segments) == 7
        row.segments = at(place, bytes((value,)))(row.segments)

    return change


def _moved(fields: Any) -> None:
    fields.clips[0].offset += 1


def _later(fields: Any) -> None:
    row = fields.clips[0]
    row.segments = at(0, bytes((row.segments[0] + 1,)))(row.segments)
    row.cend_gap -= 1


def _other_id(fields: Any) -> None:
    fields.shared[0].id = b"?" * 16


def _other_head(fields: Any) -> None:
    fields.head = at(1, b"\7")(fields.head)


def _ghost(fields: Any) -> None:
    fields.attachments.append({"name": "ghost.txt", "size": 0, "parts": []})


def _ghost_alias(fields: Any) -> None:
    fields.aliases.append({"name": "ghost.bvh", "of": 0, "target": b"dance"})


def _resized(payload: bytes) -> bytes:
    fields = parse(payloads.INDX, payload, "INDX")
    return varint(fields.size + 1) + bytes(fields.data)
