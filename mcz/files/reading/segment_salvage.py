"""Decode the intact segments of a damaged signal. SPEC.md, "Salvage", is normative."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from mcz.codecs.contract import Span
from mcz.errors import FormatError, UnsupportedError

LOST_BEFORE = "what is before them is lost, and they need it"
Run = tuple[int, int]  # segments first <= i < last
Complain = Callable[[int, int, object], None]


def salvage(
    spans: Sequence[Span],
    segments: range,
    frames: tuple[int, int],
    rescue: Callable[[int, int], None],
    complain: Complain,
) -> None:
    """Let ``rescue`` decode all frames a <= f < b of ``segments`` that can be decoded.

    ``rescue`` raises FormatError for a range that cannot be; it is halved until the bad segments
    are known. ``complain`` gets lost frames and the reason. The cost is one decoding, and a few
    more for each bad segment.
    """
    lead = max((span.lead for span in spans), default=0)
    for run in _runs(spans, segments, complain):
        todo = [run]
        while todo:
            first, last = todo.pop()
            a, b = max(frames[0], spans[first].first), min(frames[1], spans[last - 1].stop)
            try:
                rescue(a, b)
            except UnsupportedError:
                raise
            except FormatError as error:
                if last - first > 1:
                    middle = (first + last) // 2
                    todo += [(middle, last), (first, middle)]
                    continue
                # Frames that the segment after affects may be lost with it; others are not.
                complain(a, b, error)
                _rescue_start(rescue, a, max(a, spans[first].stop - lead), b, complain)
                todo = _without_bad_segment(spans, todo, first, complain)


def _rescue_start(
    rescue: Callable[[int, int], None], start: int, stop: int, tried: int, complain: Complain
) -> None:
    if stop >= tried:
        return
    try:
        rescue(start, stop)
    except FormatError as error:
        complain(start, stop, error)


def _without_bad_segment(
    spans: Sequence[Span], todo: list[Run], bad: int, complain: Complain
) -> list[Run]:
    last = max((run[1] for run in todo), default=0)
    after = bad + 1
    while after < last and not spans[after].fresh:
        after += 1
    if after > bad + 1:
        complain(spans[bad + 1].first, spans[after - 1].stop, LOST_BEFORE)
    return [(max(first, after), stop) for first, stop in todo if stop > after]


def _runs(spans: Sequence[Span], segments: range, complain: Complain) -> list[Run]:
    """Runs of neighbors among ``segments``, each from a fresh one on."""
    start = segments.start
    while start > 0 and start < len(spans) and not spans[start].fresh:
        start -= 1
    runs: list[Run] = []
    usable, lost = False, None
    for index in range(start, segments.stop):
        joined = index > start and spans[index - 1].stop == spans[index].first
        usable = spans[index].fresh or (joined and usable)
        if index < segments.start:
            continue
        if not usable:
            lost = spans[index].first if lost is None else lost
            continue
        if lost is not None:
            complain(lost, spans[index - 1].stop, LOST_BEFORE)
            lost = None
        if runs and runs[-1][1] == index and joined:
            runs[-1] = (runs[-1][0], index + 1)
        else:
            runs.append((index, index + 1))
    if lost is not None:
        complain(lost, spans[segments.stop - 1].stop, LOST_BEFORE)
    return runs
