"""Windows of frames: clips cut from others, or that show a part of what they store."""

from __future__ import annotations

import io
from dataclasses import replace
from typing import Any

import numpy as np

from mcz.container import payloads
from mcz.editing.extraction import extract
from mcz.motion import Motion
from mcz.schema import varint
from tools.vectors.build.edits import Edit, both, put
from tools.vectors.build.files import rehash

CUT_HEADING = "Cutting without re-encoding"


def as_shown(part: Any, skip: int) -> Any:
    """A request of stored frames as one of those that are shown."""
    (clip, name, option, frames, *rest), arrays = part
    start, stop = (int(word) - skip for word in frames.split(":"))
    return (clip, name, option, f"{start}:{stop}", *rest), arrays


def cut(data: bytes, **how: Any) -> bytes:
    """What ``extract`` leaves of a file."""
    out = io.BytesIO()
    extract(data, out, **how)
    return out.getvalue()


def shown(motion: Motion, start: int, stop: int) -> Motion:
    """Frames start <= f < stop alone, with their numbers."""
    signals = tuple(signal.cut(start, stop) for signal in motion.signals)
    return replace(motion, signals=signals, frame_numbers=np.arange(start, stop) + 1)


def window(
    motion: Motion, start: int, stop: int, *, skip: int | None = None, spare: int | None = None
) -> dict[str, Any]:
    """Edits that make a file of ``motion`` show frames start <= f < stop of its first signal."""
    skip = start if skip is None else skip
    spare = motion.n_frames - stop if spare is None else spare
    clip: Edit = both(
        put(payloads.Clip, "n_frames", varint(stop - start)),
        put(payloads.Clip, "signals.0.skip", varint(skip)),
        put(payloads.Clip, "signals.0.spare", varint(spare)),
    )
    values = motion.signals[0].cut(start, stop).values
    cend: Edit = both(put(payloads.Cend, "n_frames", varint(stop - start)), rehash(values))

    def row(found: Any) -> Any:
        signals = (replace(found.signals[0], skip=skip, spare=spare), *found.signals[1:])
        return replace(found, n_frames=stop - start, signals=signals)

    return {"CLIP": clip, "CEND": cend, "row": row}
