"""Make ``mcz/codecs/known_answers.json``: one small segment of every codec, and its values.

Run it where a codec's bitstream changes: ``python -m tools.known_answers``.
"""

from __future__ import annotations

import json
from dataclasses import asdict, replace

import numpy as np

from mcz.codecs import CODECS
from mcz.codecs.contract import Codec
from mcz.codecs.known_answers import N_FRAMES, TABLE, KnownAnswer, answer_layout, digest
from mcz.files.writing.signal_source import MemorySource
from mcz.model.motion import Motion, Signal

OPTIONS = {"segment_frames": N_FRAMES, "group": N_FRAMES}  # where a codec has them


def motion_of(codec: Codec) -> Motion:
    """A motion without a sine, the same on every machine: parabolas with a little noise."""
    layout = answer_layout(codec.grouping)
    assert layout.skeleton is not None
    frame = np.arange(N_FRAMES)[:, None]
    channel = np.arange(layout.n_channels)[None]
    ordinals = (frame - channel) ** 2 * (3000 - 400 * channel) + (frame * 7919 * channel) % 97 * 10
    values = layout.grids[0].values(ordinals)
    return Motion(layout.skeleton, (Signal(values, layout.grids),), layout.frame_rate, name="known")


def answer_of(codec: Codec) -> KnownAnswer:
    """The answer, coded and decoded here."""
    given = {name: value for name, value in OPTIONS.items() if codec.has(name)}
    options = codec.options(given)
    source = MemorySource(motion_of(codec), 0, codec, 2**26, options)
    source.layout = answer_layout(codec.grouping)
    encoded = codec.encode(source, options)
    (segment,) = encoded.segments
    models = (*encoded.models, *encoded.known_models)
    header, streams = encoded.header.hex(), tuple(stream.hex() for stream in segment.streams)
    coded = tuple((model.kind, model.data.hex()) for model in models)
    version = codec.version if encoded.version is None else encoded.version
    answer = KnownAnswer(version, codec.grouping, header, streams, "", coded)
    return replace(answer, sha256=digest(codec, answer))


def table() -> str:
    """The text of the file."""
    answers = {codec.name: asdict(answer_of(codec)) for codec in CODECS.values()}
    return json.dumps(answers, indent=1) + "\n"


if __name__ == "__main__":
    TABLE.write_text(table(), "utf-8")
