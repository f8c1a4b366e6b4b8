"""What ``mcz info --json`` says of a recording."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

from mcz.reading.recording import Recording
from mcz.types import JsonObject


def document_of(recording: Recording | None) -> JsonObject | None:
    """The recording as JSON has it: what is unknown or no number is None; texts may be empty."""
    if recording is None:
        return None
    found: JsonObject = _plain(asdict(recording))
    return found | {"up_axis": recording.up_axis}


def _plain(thing: object) -> Any:
    if isinstance(thing, dict):
        return {key: _plain(value) for key, value in thing.items()}
    if isinstance(thing, (list, tuple)):
        return [_plain(value) for value in thing]
    if isinstance(thing, float) and not math.isfinite(thing):
        return None
    return thing
