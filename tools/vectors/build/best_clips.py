"""Streams of ``best``, to order: heads and links that its encoder would never choose.

Nothing here is fitted or estimated, so the bytes do not depend on a machine's arithmetic.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mcz.codecs.contract import Codec, Encoded, Segment
from mcz.codecs.lossless import best, best_streams
from mcz.codecs.lossless.best_streams import AS_CODEC_1, ECHOED, LINKED, Link
from mcz.codecs.lossless.echoes import Echo, build_echoes
from mcz.coding.start import start_states
from mcz.motion import Motion
from mcz.numbers import Grid
from tools.vectors.build import lossless_clips
from tools.vectors.build.files import Whole, file_of
from tools.vectors.build.lossless_clips import UNEXAMINED, USUAL, Head, Ints

HEADING = "Codec 2: best"
Links = Sequence[Link]


def codec_of(
    heads: Sequence[Head] = (),
    links: Links = (),
    methods: Sequence[int] = (LINKED,),
    echoes: Sequence[Echo] = (),
) -> Codec:
    """Codec best with these heads, channel by channel, and links, coded channel by coded channel.

    A channel without a head is ``USUAL``, one without a link has one of ``usual``. ``methods`` are
    those of the groups, the last of all further ones. A parameter ``segment_frames`` of 0 makes
    segments as long as the grids allow.
    """

    def encode(source: Any, params: Any) -> Encoded:
        layout = source.layout
        every = [*heads, *[USUAL] * (layout.n_channels - len(heads))]
        made: list[Segment] = []
        fixed, start = params["segment_frames"] or layout.n_frames, 0
        ends = sorted({*source.breaks, layout.n_frames})
        while start < layout.n_frames:
            stop = min(start + fixed, *(end for end in ends if end > start))
            ordinals = source.ordinals(start, stop)
            streams = tuple(
                build_stream(
                    ordinals[:, list(group)],
                    [layout.grids[channel] for channel in group],
                    [every[channel] for channel in group],
                    links,
                    method=methods[min(number, len(methods) - 1)],
                    echoes=echoes,
                )
                for number, group in enumerate(layout.groups)
            )
            made.append(Segment(start, stop - start, streams))
            start = stop
        return Encoded(b"", iter(made))

    return replace(best.CODEC, encode=encode)


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


class Streams(Whole):
    """A Shelf of files of one clip that best codes."""

    def code(
        self,
        name: str,
        purpose: str,
        motion: Motion,
        heads: Sequence[Head] = (),
        links: Links = (),
        spec: str = HEADING,
        **rest: Any,
    ) -> None:
        parts, methods = rest.pop("parts", ()), rest.pop("methods", (LINKED,))
        codec = codec_of(heads, links, methods, rest.pop("echoes", ()))
        rest = {"grouping": "all", **rest}
        data = file_of(motion, codec=codec, **rest)
        self.hold(name, spec, purpose, data, motion, parts=parts)
