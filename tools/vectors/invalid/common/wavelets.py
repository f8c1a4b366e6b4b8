"""Faults of clips of codecs 5 and 6.

A decoder may read these codecs by other code than their kin, so each kind of fault is there once.
"""

from __future__ import annotations

import math
import struct
from dataclasses import replace
from typing import Any

import numpy as np

from mcz.codecs import by_name, raw
from mcz.codecs.parameters import SCALED
from mcz.container import payloads
from mcz.schema import varint
from tools.vectors.build import wavelet_clips
from tools.vectors.build.edits import Edit, all_integers, headed, plus, put, says, stream, two_rows
from tools.vectors.build.files import Broken, file_of, rehash

BEYOND = 2**40 + 1


def add(shelf: Broken, name: str) -> None:
    codec = by_name(name)
    spec = f"Codec {codec.id}: {name}"
    plan = wavelet_clips.Plan(16, wavelet_clips.DB2, ends=(8,))
    scaled = replace(plan, decimals=SCALED)
    silent_ = [wavelet_clips.zeros(plan)]

    def add(case: str, purpose: str, plan: wavelet_clips.Plan, made: Any, **edits: Any) -> None:
        motion = wavelet_clips.motion_of(plan, made)
        encode = wavelet_clips.codec_of(plan, made).encode
        own = replace(codec, encode=encode, parameters=raw.CODEC.parameters, dial=None)
        data = file_of(motion, codec=own, grouping=edits.pop("grouping", "channel"), **edits)
        shelf.add(case, spec, purpose, data)

    said: tuple[tuple[str, str, wavelet_clips.Plan, dict[str, bytes]], ...] = (
        ("wavelet-11", "A wavelet beyond the registry.", plan, {"wavelet": b"\x0b"}),
        ("levels-17", "17 levels.", plan, {"levels": b"\x11"}),
        ("decimals-16", "16 decimals.", plan, {"decimals": b"\x10"}),
        ("least-0", "A least detail of 0.", plan, {"least": b"\0"}),
        ("frames-fewer", "Fewer coded frames than are stored.", plan, {"coded_frames": b"\x0f"}),
        ("unit-NaN", "A unit of nan.", scaled, {"unit": struct.pack("<d", math.nan)}),
        ("header-and-byte", "A byte behind the header.", plan, {"least": b"\1\0"}),
        ("header-none", "A header of no bytes.", plan, dict.fromkeys(_FIELDS, b"")),
    )
    for case, purpose, made, parts in said:
        add(case, purpose, made, silent_, CLIP=says(wavelet_clips.header(made, **parts)))
    samples = put(payloads.Clip, "signals.0.samples_per_frame", b"\2")
    edits = {"CLIP": samples, "CEND": rehash(np.zeros((32, 1))), "row": two_rows}
    add("samples", "Two rows a frame.", plan, silent_, **edits)
    edits = {"CLIP": all_integers(1), "CEND": rehash(np.zeros((16, 1), np.int64))}
    purpose = "All grids are INTEGER, but the codec decodes no ordinals."
    add("integers", purpose, plan, silent_, **edits)
    for case, purpose, edit in (
        ("segment-lead-less", "A lead of a frame less than the filters reach.", headed(1, lead=5)),
        ("segment-tail", "A tail, which no segment has.", headed(0, tail=1)),
        ("segment-not-fresh", "A segment that needs the one before.", headed(1, flags=0)),
    ):
        add(case, purpose, plan, silent_, segments=edit)
    made = wavelet_clips.waves(plan)
    bits: tuple[tuple[str, str, int, Edit], ...] = (
        ("byte-0-behind", "A byte 0 behind the bits of an approximation.", 0, plus(b"\0")),
        ("byte-missing", "An approximation without its last byte.", 0, lambda data: data[:-1]),
        ("detail-byte-behind", "A byte 255 behind the bits of a detail.", 2, plus(b"\xff")),
    )
    for case, purpose, place, edit in bits:
        add(case, purpose, plan, made, segments=stream(place, edit))
    flat = wavelet_clips.Plan(4, wavelet_clips.HAAR, 0, decimals=0)
    first = b"\x3f" + varint(2 * BEYOND)
    zeros = [wavelet_clips.zeros(flat)]
    purpose = f"A first coefficient of {BEYOND}."
    edits = {"segments": stream(0, lambda _: first), "CEND": rehash(np.full((4, 1), float(BEYOND)))}
    add("first-beyond", purpose, flat, zeros, **edits)


_FIELDS = ("wavelet", "lo", "hi", "levels", "coded_frames", "decimals", "unit", "least")
