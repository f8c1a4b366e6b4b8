"""Codec lossless, ``fast``: predicted ordinals in static distributions, made to be read.

SPEC.md, "Codec 1: fast", is normative.

Exactness: lossless and bit-exact; integers only, in 64 bits. A stream holds one group of one
segment and needs no other, but for channels that are copies of another group's.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.contract import Codec, Fetch, Layout, Request, Span, refuse_extras
from mcz.codecs.lossless.segments import (
    MAX_ROWS,
    check_copy,
    encode_groups,
    recode_groups,
    segment_frames,
)
from mcz.codecs.segments import Sizing
from mcz.coding.quick.streams import (
    Channels,
    build_streams,
    channels_of,
    parse_streams,
    renumbered,
)
from mcz.errors import FormatError
from mcz.numbers import Grid

Ints = NDArray[np.int64]

SIZING = Sizing(43_000, 50_000, value_bytes=2, most_rows=MAX_ROWS, spare=1)


def decode(
    header: bytes, layout: Layout, spans: Sequence[Span], request: Request, fetch: Fetch
) -> Ints:
    """Return the ordinals, int64 (rows, channels of the groups); raise FormatError on bad bytes."""
    refuse_extras("fast", header, layout)
    per_frame = layout.samples_per_frame
    n_channels = sum(len(layout.groups[group]) for group in request.groups)
    channels = _channels(layout.grids, tuple(layout.groups[group] for group in request.groups))
    out = np.empty(((request.stop - request.start) * per_frame, n_channels), np.int64)
    for index, span in enumerate(spans):
        start, stop = max(span.first, request.start), min(span.stop, request.stop)
        if start >= stop:
            continue
        target = out[(start - request.start) * per_frame : (stop - request.start) * per_frame]
        n_rows = span.n_frames * per_frame
        rows = target if len(target) == n_rows else np.empty((n_rows, n_channels), np.int64)
        _read_segment(layout, request.groups, channels, partial(fetch, index, 0), rows)
        if rows is not target:
            first = (start - span.first) * per_frame
            target[:] = rows[first : first + len(target)]
    return out


def _read_segment(
    layout: Layout,
    groups: tuple[int, ...],
    channels: Channels,
    stream: partial[bytes],
    rows: Ints,
) -> None:
    """Fill ``rows``, those of one segment, with the channels of the groups."""
    copies = parse_streams(
        [stream(group) for group in groups],
        [len(layout.groups[group]) for group in groups],
        channels,
        rows,
    )
    if not copies:
        return
    first, columns = 0, {}
    for group in groups:
        columns[group] = first
        first += len(layout.groups[group])
    apart: dict[int, tuple[Ints, dict[int, tuple[int, int]]]] = {}  # groups not asked for
    for column, (group, channel) in copies.items():
        check_copy("fast", layout, group, channel)
        source, known, at = rows, copies, columns.get(group, 0) + channel
        if group not in columns:
            if group not in apart:
                other = np.empty((len(rows), len(layout.groups[group])), np.int64)
                own = _channels(layout.grids, (layout.groups[group],))
                apart[group] = other, parse_streams([stream(group)], [len(own.grids)], own, other)
            source, known = apart[group]
        if at in known:  # FAST-02, LOSS-11
            raise FormatError(f"fast: a copy of a copy, channel {channel} of group {group}")
        rows[:, column] = source[:, at]


@lru_cache(maxsize=64)
def _channels(grids: tuple[Grid, ...], groups: tuple[tuple[int, ...], ...]) -> Channels:
    return channels_of(grids[c] for group in groups for c in group)


def regroup(stream: bytes, layout: Layout, group: int, numbers: Mapping[int, int]) -> bytes:
    """``stream`` of ``group`` with its copies referring to the groups' new ``numbers``."""
    channels = _channels(layout.grids, (layout.groups[group],))

    def number_of(other: int, channel: int) -> int:
        check_copy("fast", layout, other, channel)
        return numbers[other]

    return renumbered(stream, channels, number_of)


CODEC = Codec(
    id=1,
    name="fast",
    version=0,
    domain="ordinals",
    lossless=True,
    hash_optional=True,
    encode=partial(encode_groups, build_streams, SIZING),
    decode=decode,
    regroup=regroup,
    recode=partial(recode_groups, build_streams),
    parameters=(segment_frames("43,000"),),
)
