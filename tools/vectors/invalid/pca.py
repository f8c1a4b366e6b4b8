"""Invalid, one fault each: headers, segments and streams of ``pca``.

Where a reader can overlook the fault, the hash is that of what it then decodes.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from mcz.codecs.pca.pca import SCALED
from mcz.codecs.pca.streams import MAX_INDEX
from mcz.container import payloads
from tools.vectors.build import pca_clips
from tools.vectors.build.edits import all_integers, headed, plus, put, says, stream, two_rows
from tools.vectors.build.files import Broken, Vector, rehash
from tools.vectors.build.pca_clips import (
    HEADING,
    Part,
    Plan,
    file_with,
    motion_of,
    part_of,
    stream_of,
)
from tools.vectors.invalid.common import every_codec

SPEC = f"{HEADING}; Residuals"


def vectors() -> Iterable[Vector]:
    shelf = Broken("invalid/pca")
    _headers(shelf)
    _signal(shelf)
    _segments(shelf)
    _heads(shelf)
    _bits(shelf)
    every_codec.add(shelf, "pca")
    return shelf.vectors


def _zeros(n_frames: int = 8, n_channels: int = 3) -> tuple[Plan, Any]:
    plan = Plan((part_of(n_frames, n_channels, 1),), empty=(0,))
    return plan, motion_of(plan)


def _headers(shelf: Broken) -> None:
    plan, motion = _zeros()
    for name, header in (
        ("decimals-16", b"\x10"),
        ("decimals-254", b"\xfe"),
        ("header-none", b""),
        ("header-and-byte", b"\x02\x00"),
    ):
        purpose = f"The header {header.hex(' ') or 'of no bytes'}, over nothing but zeros."
        data = file_with(plan, motion, CLIP=says(header))
        shelf.add(name, HEADING, purpose, data)


def _segments(shelf: Broken) -> None:
    plan = Plan((part_of(5, 3, 1), part_of(5, 3, 1, 1)))
    motion = motion_of(plan)
    for name, purpose, edit in (
        ("segment-lead", "A lead, which no segment has.", headed(1, lead=1)),
        ("segment-tail", "A tail, which no segment has.", headed(0, tail=1)),
        ("segment-not-fresh", "A segment that needs the one before.", headed(1, flags=0)),
    ):
        shelf.add(name, f"{HEADING}; DATA", purpose, file_with(plan, motion, segments=edit))


def _heads(shelf: Broken) -> None:
    good = part_of(6, 3, 2)
    cases: tuple[tuple[str, str, Part], ...] = (
        ("mean-scale-63", "A first scale of means of 63.", replace(good, mean_scale=63)),
        ("shift-41", "A basis with 41 binary digits.", replace(good, shifts=(6, 41))),
        ("form-63", "A first scale of coefficients of 63.", replace(good, forms=(9, 63))),
        ("form-255", "The same with predictor 3.", replace(good, forms=(9, 255))),
        ("count-varint", "2 components, said in two bytes.", replace(good, said=b"\x82\x00")),
        ("count-huge", "2^40 components.", replace(good, said=b"\x80\x80\x80\x80\x80\x20")),
    )
    for name, purpose, part in cases:
        shelf.add(name, HEADING, purpose, _with(part, 6, 3))
    purpose = "4 components of 3 channels."
    shelf.add("count-channels", HEADING, purpose, _with(part_of(6, 3, 4), 6, 3))
    purpose = "3 components in 1 frame of 5 channels."
    shelf.add("count-frames", HEADING, purpose, _with(part_of(1, 5, 3), 1, 5))
    plan = Plan((good,), SCALED)
    for size in range(6):
        purpose = f"A stream that ends behind {size + 1} bytes of its head."

        def cut(data: bytes, size: int = size) -> bytes:
            return data[: size + 1]

        data = file_with(plan, motion_of(plan), segments=stream(0, cut))
        shelf.add(f"head-cut-{size + 1}", HEADING, purpose, data)


def _with(part: Part, n_frames: int, n_channels: int) -> bytes:
    """A file of one segment, in place of zeros; the hash is of what a lax reader decodes."""
    plan, motion = _zeros(n_frames, n_channels)
    data = stream_of(part, plan.decimals)
    edits = {"segments": stream(0, lambda _: data), "CEND": rehash(_lax(part, n_frames))}
    return file_with(plan, motion, **edits)


def _lax(part: Part, n_frames: int) -> np.ndarray:
    """The values of 2 decimals, whatever the head may not say."""
    values = np.tile(np.array(part.means) / 100, (n_frames, 1))
    for i, row in enumerate(part.basis):
        column = np.array([frame[i] for frame in part.coefficients]) / 100
        values = values + column[:, None] * np.ldexp(np.array(row, np.float64), -part.shifts[i])
    return values


def _bits(shelf: Broken) -> None:
    plan = Plan((part_of(9, 3, 2),))
    motion = motion_of(plan)
    for name, purpose, edit in (
        ("byte-behind", "A byte 255 behind the bits.", plus(b"\xff")),
        ("byte-0-behind", "A byte 0 behind the bits.", plus(b"\0")),
        ("byte-missing", "Bits without their last byte.", lambda data: data[:-1]),
    ):
        data = file_with(plan, motion, segments=stream(0, edit))
        shelf.add(name, f"{HEADING}; Entropy coding", purpose, data)
    beyond = MAX_INDEX + 1
    one = {"shifts": (3,), "forms": (4,), "n_frames": 2, "faulty": True}
    for name, purpose, part in (
        ("mean-beyond", "A mean of 2^40 + 1.", Part((beyond,), ((1,),), ((1,), (2,)), **one)),
        ("basis-beyond", "An entry of -2^40 - 1.", Part((1,), ((-beyond,),), ((1,), (2,)), **one)),
        (
            "first-beyond",
            "A first coefficient of 2^40 + 1.",
            Part((1,), ((1,),), ((beyond,),), **{**one, "n_frames": 1}),
        ),
        (
            "coefficient-beyond",
            "A coefficient of -2^40 - 1, which is -2^40 and -1 more.",
            Part((1,), ((1,),), ((-MAX_INDEX,), (-beyond,)), **one),
        ),
    ):
        shelf.add(name, SPEC, purpose, _with(part, part.n_frames, 1))


def _signal(shelf: Broken) -> None:
    plan = pca_clips.Plan((part_of(8, 4, 1),), empty=(0,))
    motion = pca_clips.motion_of(plan)
    spec = f"{pca_clips.HEADING}; CLIP"
    twice = put(payloads.Clip, "signals.0.samples_per_frame", b"\2")
    grouped = put(payloads.Clip, "signals.0.groups", b"\3\2\2\2")
    resolved = put(payloads.Clip, "signals.0.n_resolutions", b"\2")
    cases: tuple[tuple[str, str, dict[str, Any]], ...] = (
        ("samples", "Two rows a frame.", {"CLIP": twice, "CEND": rehash(np.zeros((16, 4)))}),
        ("groups", "Two groups.", {"CLIP": grouped, "segments": _more}),
        ("resolutions", "Two resolutions.", {"CLIP": resolved, "segments": _more}),
        (
            "integers",
            "All grids are INTEGER, but the codec decodes no ordinals.",
            {"CLIP": all_integers(4), "CEND": rehash(np.zeros((8, 4), np.int64))},
        ),
    )
    for name, purpose, edits in cases:
        row = {"row": two_rows} if name == "samples" else {}
        shelf.add(name, spec, purpose, pca_clips.file_with(plan, motion, **edits, **row))


def _more(made: Any) -> Any:
    """An empty stream more."""
    return [(header, [*streams, b""]) for header, streams in made]
