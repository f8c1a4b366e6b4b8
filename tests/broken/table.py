"""All breaks, from the tables by part of the format."""

from __future__ import annotations

from tests.broken import (
    Break,
    clips,
    codecs,
    container,
    curves,
    filtered,
    frames,
    grids,
    lists,
    lossless,
    online,
    points,
    segments,
    shared,
    sources,
    wavelets,
    windows,
)

_TABLES = (
    container,
    shared,
    clips,
    segments,
    codecs,
    lossless,
    wavelets,
    curves,
    lists,
    points,
    windows,
    frames,
    online,
    filtered,
    grids,
    sources,
)

BREAKS: dict[str, Break] = {}
for _table in _TABLES:
    for _break in _table.BREAKS:
        assert _break.name not in BREAKS, _break.name
        BREAKS[_break.name] = _break
