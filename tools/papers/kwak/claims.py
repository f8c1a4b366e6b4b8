"""Claims of Kwak and Bajic, each with our findings."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from mcz.bench.tables import ResultTable
from tools.papers.kwak.clips import Clip
from tools.papers.kwak.measure import NAME
from tools.papers.kwak.printed import (
    DEVIATIONS,
    FIL_SAVES,
    MOST_OFF,
    RCA_SAVES,
    VIRTUAL_COST,
    usual_deviation,
)
from tools.papers.kwak.tasks import (
    CHAINED,
    FIL,
    MOD,
    OURS,
    PRINTED,
    PUBLISHED,
    RC,
    RCA,
    STEADY,
    WITH_MARKERS,
    Found,
    Method,
    speeds_task,
)
from tools.papers.kwak.versus import bd, virtual_ratios
from tools.papers.verdicts import verdict

FAST, FAST_LIVE = 20_000, 5_000  # frames a second

Row = tuple[str, str, str, str]
Judged = list[tuple[Clip, bool, str]]


def claims(found: Found) -> ResultTable:
    columns = (("the paper says", ""), ("of", ""), ("holds", ""), ("found here", ""))
    caption = (
        "Each clip by itself, at 3 to 7 kbps. Percent of bits are BD rates, dB BD SQNR; where two "
        "curves share no SQNR there is no BD rate. Deviations are held against the paper's of the "
        "same clip, or where it has none against the mean of its clips."
    )
    table = ResultTable("Kwak and Bajic, claim by claim", caption, columns)
    table.rows.extend(_orders(found))
    table.rows.extend(_savings(found))
    table.rows.extend(_rates(found))
    table.rows.extend(_deviations(found))
    table.rows.extend(_virtual(found))
    table.rows.extend(_fast(found))
    return table


def _row(claim: str, of: str, judged: Judged) -> Row:
    text = ", ".join(f"{clip.name} {text}" for clip, _, text in judged)
    return claim, of, verdict([held for _, held, _ in judged]), text or "no such clip here"


def _kinds(found: Found) -> Iterator[tuple[str, list[Clip]]]:
    for markers, of in ((True, "markers"), (False, "skeletons")):
        yield of, [clip for clip in found.clips if clip.is_markers == markers]


def _orders(found: Found) -> Iterator[Row]:
    for of, clips in _kinds(found):
        for lower, higher in pairwise(PUBLISHED):
            yield _order(found, of, clips, lower, higher)
        judged: Judged = []
        for clip in clips:
            gains = [_gain(found, clip, a, b) for a, b in pairwise(PUBLISHED)]
            steps = [gain for gain in gains if gain is not None]
            if len(steps) == len(gains):
                text = " ".join(f"{step:+.1f}" for step in steps)
                judged.append((clip, min(steps) > 0, f"{text} dB"))
        yield _row(" < ".join(method.label for method in PUBLISHED), of, judged)
        for lower, higher in ((RC, PRINTED), (RC, STEADY), (MOD, FIL), (MOD, OURS)):
            yield _order(found, of, clips, lower, higher)


def _order(found: Found, of: str, clips: Sequence[Clip], lower: Method, higher: Method) -> Row:
    judged: Judged = []
    for clip in clips:
        gain = _gain(found, clip, lower, higher)
        if gain is not None:
            judged.append((clip, gain > 0, f"{gain:+.2f} dB"))
    ours = "" if {lower, higher} <= set(PUBLISHED) else "ours: "
    return _row(f"{ours}{lower.label} < {higher.label}", of, judged)


def _gain(found: Found, clip: Clip, lower: Method, higher: Method) -> float | None:
    return bd(found, clip, lower, higher)[0]


def _savings(found: Found) -> Iterator[Row]:
    for of, clips in _kinds(found):
        for lower, higher, (least, most) in (
            (RC, RCA, RCA_SAVES),
            (RC, PRINTED, RCA_SAVES),
            (RCA, FIL, FIL_SAVES),
        ):
            judged: Judged = []
            for clip in clips:
                rate = bd(found, clip, lower, higher)[1]
                if rate is not None:
                    judged.append((clip, -rate >= least, f"{-rate:.1f} %"))
            claim = f"{higher.label} saves {least:.0f} to {most:.0f} % of {lower.label}'s bits"
            yield _row(f"{claim} or more", of, judged)


def _rates(found: Found) -> Iterator[Row]:
    for of, clips in _kinds(found):
        for method in (RC, RCA, STEADY, OURS, CHAINED):
            judged: Judged = []
            for clip in clips:
                points = found.rates(clip, method)
                off = [100 * abs(p["kbps"] / p["target"] - 1) for p in points]
                if off:
                    judged.append((clip, max(off) <= MOST_OFF, f"{max(off):.2f} %"))
            yield _row(f"rates of {method.label} within {MOST_OFF:g} %", of, judged)


def _deviations(found: Found) -> Iterator[Row]:
    for of, clips in _kinds(found):
        for method, column in ((RC, 1), (RCA, 2)):
            judged: Judged = []
            for clip in clips:
                values = [p["deviation"] for p in found.rates(clip, method)]
                if not values or None in values:
                    continue
                mean = float(np.mean(values))
                printed = DEVIATIONS.get((clip.is_markers, clip.stem))
                limit = printed[column] if printed else usual_deviation(clip.is_markers, column)
                judged.append((clip, mean <= limit, f"{mean:.1f} ({limit:.1f})"))
            claim = f"{method.label} deviates by as few bytes a group"
            yield _row(claim, of, judged)


def _virtual(found: Found) -> Iterator[Row]:
    low, high = VIRTUAL_COST
    for method in (m for own in WITH_MARKERS for m in (own, own.behind_filter())):
        judged: Judged = []
        for clip in found.skeletons:
            ratios = [r for r in virtual_ratios(found, clip, method, (3.0, 5.0, 7.0)) if r]
            if ratios:
                held = low <= min(ratios) and max(ratios) <= high
                judged.append((clip, held, f"{min(ratios):.2f} to {max(ratios):.2f}"))
        claim = f"virtual markers raise the size by {low - 1:.0%} to {high - 1:.0%}"
        yield _row(claim, method.label, judged)


def _fast(found: Found) -> Iterator[Row]:
    """Requirements on our speed; the paper's own 71 and 91 frames a second are no measure."""
    rows = found.get(speeds_task(found.fastest)) if found.fastest else None
    for live, least in ((False, FAST), (True, FAST_LIVE)):
        own = [r for r in rows or [] if r["live"] == live and r["label"].startswith(NAME)]
        if own:
            held = [min(r["encode_fps"], r["decode_fps"]) >= least for r in own]
            rates = ", ".join(
                f"{r['label']} {r['encode_fps']:,.0f} and {r['decode_fps']:,.0f}" for r in own
            )
            how = "frame by frame" if live else "in one run"
            claim = f"ours: {least:,} frames/s and more each way, {how}"
            yield claim, "skeletons", verdict(held), f"encode and decode: {rates}"
