"""The state of posewave after all rows of a vector: the digests of SPEC.md, "A traced row"."""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Sequence

from tools.spec_traces.posewave import Model, Row, decode_level

VECTORS = {"dependent": (70, 3, True), "pauses": (160, 5, False)}  # frames, levels, dependent
CLASSES = (0, 0, 0, 1, 1, 1, *(3,) * 6, *(2,) * 6)  # of the channels
HEAD = 676


def levels_of(frames: int, levels: int) -> list[tuple[int, int]]:
    """Kind and rows of each level of a segment, the coarsest first."""
    n = [frames]
    while len(n) <= levels and n[-1] > 1:
        n.append((n[-1] + 1) // 2)
    last = len(n) - 1
    details = [(max(1, 6 - (last - i + 1)), n[last - i] // 2) for i in range(1, last + 1)]
    return [(0, n[last]), *details]


def decode_head(model: Model, classes: Sequence[int]) -> list[bool]:
    """Decode which channels are kept, and pass over their numbers."""
    coder, before, kept = model.coder, 1, list[bool]()
    for one in classes:
        k = 0 if one else 1
        before = coder.adaptive(HEAD + 2 * k + before)
        own, length = 2 * k + before, 0
        while coder.adaptive(HEAD + 6 + 40 * own + length):
            length += 1
        if length > 1:
            coder.adaptive(HEAD + 252 + 40 * own + length)
        coder.number(length - 2)
        if length:
            coder.adaptive(HEAD + 246 + own)
        kept.append(bool(before))
    return kept


def decode_state(vector: str, streams: Sequence[bytes]) -> Model:
    """The model after all rows of the segment of ``vector``, whose channels are all kept."""
    frames, levels, dependent = VECTORS[vector]
    model, details = Model(CLASSES, dependent=dependent), list[list[Row]]()
    for level, ((kind, n_rows), stream) in enumerate(
        zip(levels_of(frames, levels), streams, strict=True)
    ):
        model.coder.start(stream)
        if level == 0 and not all(decode_head(model, CLASSES)):
            raise ValueError("a channel is not kept")
        decoder, _ = decode_level(model, kind, n_rows, details)
        if kind:
            details.append(decoder.rows)
    return model


def numbers_of(model: Model) -> list[float]:
    """The numbers of the state, in the order of SPEC.md."""
    n = len(model.usual)
    return [
        *model.variances,
        *(model.lower[b][a] for b in range(1, n) for a in range(b)),
        model.seen,
        *model.tap,
        *model.tap_energy,
        *model.level_size,
        *(weight for weights in model.own_size for weight in weights),
        *model.usual,
    ]


def digest(numbers: Sequence[float]) -> str:
    """SHA-256 of numbers as binary64, the low byte first."""
    return hashlib.sha256(struct.pack(f"<{len(numbers)}d", *numbers)).hexdigest()
