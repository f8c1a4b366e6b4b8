"""Which bytes of a clip are whose: stored bytes by signal, group of channels and resolution."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from mcz.container.segments import StreamTable
from mcz.reading.clip import Clip
from mcz.reading.layout import group_names


@dataclass(frozen=True, slots=True)
class Share:
    """Bytes of a group's streams of one sort in all segments; with all others the whole payload.

    ``name`` are the joints of the group, or its channels, the first of many. ``resolution`` counts
    as stored, from 0, the coarsest; None of what is no codec's: exceptions, masks, frame notes
    (whose group is None).
    """

    signal: str
    group: int | None
    name: str
    resolution: int | None
    n_bytes: int


def byte_shares(clip: Clip) -> list[Share]:
    """What each group of each signal takes, by resolution, and beside that; no part is empty.

    Reads the stream tables alone. The sum is the payload of ``mcz info``.
    """
    shares = []
    for signal in clip.signals:
        names = [text for _, text in group_names(clip, signal)]
        totals: dict[tuple[int | None, int | None], int] = {}
        for row in signal.rows:
            table = clip.container.table(row, signal.counts)
            for key, index in _streams(table):
                if index is not None:
                    totals[key] = totals.get(key, 0) + table.lengths[index]
        shares += [
            Share(signal.name, group, "" if group is None else names[group], resolution, total)
            for (group, resolution), total in totals.items()
            if total
        ]
    return shares


def by_group(shares: Iterable[Share]) -> dict[str, dict[int | None, int]]:
    """The bytes by the joints of a group, then by resolution, in the order of ``shares``.

    The names begin with that of the signal where several have bytes.
    """
    shares = list(shares)
    several = len({share.signal for share in shares}) > 1
    groups: dict[str, dict[int | None, int]] = {}
    for share in shares:
        of = share.name or "frame notes"
        own = groups.setdefault(f"{share.signal}: {of}" if several else of, {})
        own[share.resolution] = own.get(share.resolution, 0) + share.n_bytes
    return groups


def _streams(table: StreamTable) -> Iterator[tuple[tuple[int | None, int | None], int | None]]:
    """Group and resolution of every stream of a segment, and its index."""
    yield (None, None), table.frame_notes()
    for group in range(table.counts.n_groups):
        yield (group, None), table.group_notes(group)
        yield (group, None), table.mask(group)
        for resolution in range(table.counts.n_resolutions):
            yield (group, resolution), table.codec(resolution, group)
