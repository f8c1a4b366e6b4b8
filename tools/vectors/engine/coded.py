"""Clips whose coded content a row writes out: the codec, its header, models and segments.

The clip is that of the row's base, as zeros; ``values`` are the hashes of what it means.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mcz.codecs import codec_by_name, raw
from mcz.codecs.contract import Encoded, Model, Segment, SignalSource
from mcz.container import payloads
from mcz.container.limits import BASE, LARGE
from mcz.container.model_records import parse_skeleton
from mcz.container.segments import SegmentHeader
from mcz.files.writing.clip_writer import ClipCopy, Decoded, write_plan
from mcz.files.writing.planning import Prepared, SignalPlan, plan_clip
from mcz.model.motion import Motion, Signal, Skeleton
from mcz.model.schema import parse
from mcz.model.types import Params
from tools.vectors.build.edits import both, put
from tools.vectors.build.files import Crafter, finish_file
from tools.vectors.engine.notation import read_bytes

CLIP_KEYS = {"skeleton", "codec", "header", "models", "segments", "values"}
CLIP_KEYS |= {"version", "resolutions", "grouping", "clip", "appended"}
STREAM = re.compile(r"\(([^()]*)\)(?:\*(\d+))?")
SEGMENT = re.compile(r"(\d+)\+(\d+)((?: \w+=\d+)*): ?(.*)", re.DOTALL)


class _Told(ClipCopy):
    """Nothing is decoded: the row tells the hashes."""

    def __init__(self, hashes: Sequence[bytes]) -> None:
        super().__init__(BASE)
        self.hashes = hashes

    def segment(self, header: SegmentHeader, streams: Sequence[bytes]) -> None:
        """Segments are the row's."""

    def decoded(self, motion: Motion, coded: Sequence[SignalPlan]) -> list[Decoded]:
        signals = zip(motion.signals, self.hashes, strict=True)
        return [Decoded(signal.values, sha256) for signal, sha256 in signals]


def coded_file(
    clips: Sequence[tuple[Motion, Mapping[str, Any]]],
    constants: Mapping[str, str],
    *,
    index: bool = True,
    archive: bool = False,
    **options: Any,
) -> bytes:
    """The file of clips, each with what its row says; ``options`` are those of a Crafter."""
    crafter = Crafter(profile=LARGE if archive else BASE, **options)
    for motion, fields in clips:
        if fields.get("appended"):
            finish_file(crafter, index=index)
        _write(crafter, motion, fields, constants)
    return finish_file(crafter, index=index)


def _write(
    crafter: Crafter, motion: Motion, fields: Mapping[str, Any], constants: Mapping[str, str]
) -> None:
    if "skeleton" in fields:
        skeleton = _skeleton(_bytes(fields["skeleton"], constants))
        signal = Signal(np.zeros((motion.n_frames, skeleton.n_channels)))
        motion = replace(motion, skeleton=skeleton, signals=(signal, *motion.signals[1:]))
    made = [segment_of(text, constants) for text in fields["segments"]]
    encoded = Encoded(
        _bytes(fields.get("header", ""), constants),
        iter(()),
        fields.get("resolutions", 1),
        tuple(_model(text, constants) for text in fields.get("models", ())),
        version=fields.get("version"),
    )

    def encode(source: SignalSource, _: Params) -> Encoded:
        n_streams = len(source.layout.groups) * encoded.n_resolutions
        whole = Segment(0, max(1, source.layout.n_frames), (b"",) * n_streams)
        return replace(encoded, segments=iter((whole,)))

    codec = replace(
        codec_by_name(fields["codec"]),
        encode=encode,
        parameters=raw.CODEC.parameters,
        dial=None,
        grouping=fields.get("grouping", "all"),
    )
    crafter.edits["segments"] = lambda _: made
    changes = [
        put(payloads.Clip, path, _bytes(text, constants))
        for path, text in fields.get("clip", {}).items()
    ]
    crafter.edits["CLIP"] = both(*changes)
    plan = plan_clip(Prepared(motion), codec, {}, crafter.profile)
    hashes = [bytes.fromhex(word) for word in fields["values"].split()]
    write_plan(crafter, plan, quality=False, copy=_Told(hashes))


def _skeleton(payload: bytes) -> Skeleton:
    return parse_skeleton(parse(payloads.Skel, payload, "SKEL"), LARGE, "SKEL")


def segment_of(text: str, constants: Mapping[str, str]) -> tuple[SegmentHeader, list[bytes]]:
    """A segment such as ``0+16 lead=3: (01 ff) ()``: its first frame, its frames, its streams."""
    match = SEGMENT.fullmatch(text.strip())
    if match is None:
        raise ValueError(f"{text!r} is no segment")
    first, n_frames, more, streams = match.groups()
    fields = {key: int(value) for key, value in (word.split("=") for word in more.split())}
    header = SegmentHeader(fields.pop("signal", 0), int(first), int(n_frames), **fields)
    parts = []
    for stream, times in STREAM.findall(streams):
        parts += [_bytes(stream, constants)] * int(times or 1)
    return header, parts


def _model(text: str, constants: Mapping[str, str]) -> Model:
    kind, _, data = text.partition(":")
    return Model(int(kind), _bytes(data, constants))


def _bytes(text: str, constants: Mapping[str, str]) -> bytes:
    return read_bytes(text, {}.__getitem__, constants)
