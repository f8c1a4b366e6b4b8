"""Make ``mcz/codecs/known_answer_table.py``: one small segment of every codec, and its values.

Run it where a codec's bitstream changes: ``python -m tools.known_answers``.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from mcz.codecs import CODECS
from mcz.codecs.contract import Codec
from mcz.codecs.known_answer_table import KnownAnswer
from mcz.codecs.known_answers import N_FRAMES, answer_layout, digest
from mcz.files.writing.signal_source import MemorySource
from mcz.model.motion import Motion, Signal

HOME = Path(__file__).parent.parent / "mcz/codecs/known_answer_table.py"
OPTIONS = {"segment_frames": N_FRAMES, "group": N_FRAMES}  # where a codec has them
WIDTH = 96


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
    models = (*encoded.models, *encoded.known)
    header, streams = encoded.header.hex(), tuple(stream.hex() for stream in segment.streams)
    held = tuple((model.kind, model.data.hex()) for model in models)
    version = codec.version if encoded.version is None else encoded.version
    answer = KnownAnswer(version, codec.grouping, header, streams, "", held)
    return replace(answer, sha256=digest(codec, answer))


def _hex(text: str, indent: int) -> str:
    if len(text) <= WIDTH - indent - 3:
        return f'"{text}"'
    pad = " " * (indent + 4)
    lines = "\n".join(f'{pad}"{line}"' for line in textwrap.wrap(text, WIDTH - indent - 8))
    return f"(\n{lines}\n{' ' * indent})"


def _lines(codec: Codec) -> Iterator[str]:
    answer = answer_of(codec)
    yield f'    "{codec.name}": KnownAnswer('
    yield f'        {answer.version}, "{answer.grouping}",'
    yield f"        {_hex(answer.header, 8)},"
    yield "        ("
    yield from (f"            {_hex(stream, 12)}," for stream in answer.streams)
    yield "        ),"
    yield f'        "{answer.sha256}",'
    if answer.models:
        yield "        ("
        for kind, data in answer.models:
            yield f"            ({kind}, {_hex(data, 12)}),"
        yield "        ),"
    yield "    ),"


def table() -> str:
    """The text of the module."""
    head = HOME.read_text("utf-8").partition("ANSWERS = {\n")
    lines = [line for codec in CODECS.values() for line in _lines(codec)]
    return "".join([head[0], head[1], *(f"{line}\n" for line in lines), "}\n"])


if __name__ == "__main__":
    HOME.write_text(table(), "utf-8")
