"""Streams of ``best``, to order: heads and links that its encoder would never choose.

Nothing here is fitted or estimated, so the bytes do not depend on a machine's arithmetic.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from mcz.codecs.lossless import best_streams
from mcz.codecs.lossless.best_streams import AS_CODEC_1, ECHOED, LINKED, Link
from mcz.codecs.lossless.echoes import Echo, build_echoes
from mcz.coding.start import start_states
from mcz.numbers import Grid
from tools.vectors.build import lossless_clips
from tools.vectors.build.lossless_clips import UNEXAMINED, Head, Ints

Links = Sequence[Link]


def usual(channel: int) -> Link:
    """A link of that coded channel: it looks at up to 8 before it."""
    return Link(4, 9, tuple(range(max(0, channel - 8), channel)))


def build_stream(
    ordinals: Any,
    grids: Sequence[Grid],
    heads: Sequence[Head],
    links: Links = (),
    *,
    method: int = LINKED,
    echoes: Sequence[Echo] = (),
    faulty: bool = False,
) -> bytes:
    """The stream of a group; of method 0 where no channel is coded, of method 2 with ``echoes``.

    ``faulty``: an ordinal has no code, and the bits end with the fault.
    """
    data, plans, coded = lossless_clips.heads_of(ordinals, grids, heads)
    if method == AS_CODEC_1 or not plans:
        return bytes((AS_CODEC_1,)) + lossless_clips.build_stream(ordinals, grids, heads)
    every = [*links, *map(usual, range(len(links), len(plans)))][: len(plans)]
    code = _code_to_the_fault if faulty else best_streams.code
    linked = b"".join(link.head() for link in every)
    if echoes:
        bits = best_streams.code(coded, plans, every, echoes)
        return bytes((ECHOED,)) + data + build_echoes(echoes) + linked + bits
    return bytes((LINKED,)) + data + linked + code(coded, plans, every)


def _code_to_the_fault(coded: Ints, plans: Sequence[Ints], links: Links) -> bytes:
    """The bits up to what cannot be coded."""
    _, coding = best_streams.loops()
    data, state = np.zeros(UNEXAMINED, np.uint8), start_states("best")[0].copy()
    coding.start(state, data, 1)
    rows = np.ascontiguousarray(coded).copy()
    assert best_streams.run(state, data, rows, plans, links, ()) >= 0
    return data[: coding.finish(state, data)].tobytes()
