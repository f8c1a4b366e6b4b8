"""Claims of Hou 2016, each with our findings."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from mcz.bench.cases import Variant
from mcz.bench.tables import ResultTable
from tools.papers.curves import at
from tools.papers.hou2016.tasks import (
    CLIP,
    CLIPS,
    COSINES,
    ERRORS,
    FRAME,
    MDTT,
    OWN,
    PRESET,
    RDO,
    Found,
    here,
    published_variant,
)
from tools.papers.hou2016.training import SPARSITIES
from tools.papers.verdicts import verdict

MOST_LESS = 0.7  # of the distortion: what the paper's Fig. 6 shows at most
SHORT, LONG = 3000, 9000  # frames of the paper's short clips at most, of its long ones at least
NEARLY = 0.01  # of an objective: no difference
FAST = 10_000  # frames a second, in the paper on MATLAB

Row = tuple[str, str, str, str]


def claims(found: Found) -> ResultTable:
    columns = (("the paper says", ""), ("coder", ""), ("holds", ""), ("found here", ""))
    caption = (
        f"Ratios of CR are means over D = {', '.join(f'{e:g}' for e in ERRORS)} cm, as far as both "
        f"reach it. Coder: ours, or prefix codes and thresholds of the preset {PRESET}."
    )
    table = ResultTable("Hou 2016, claim by claim", caption, columns)
    table.rows.extend(_starts(found))
    table.rows.extend(_sparse(found))
    table.rows.extend(_best_sparsity(found))
    for name, like in (("adaptive", _plain), ("prefix", published_variant)):
        table.rows.extend((row[0], name, *row[1:]) for row in _of_coder(found, like))
    table.rows.extend(_fast(found))
    return table


def _plain(variant: Variant) -> Variant:
    return variant


def _of_coder(found: Found, like: Callable[[Variant], Variant]) -> Iterator[tuple[str, str, str]]:
    if "lsdt-frame" in here():
        less = {c: _less(found, c, like(FRAME), like(COSINES)) for c in found.cases}
        yield from _frame_claims({c: pairs for c, pairs in less.items() if pairs})
    if "lsdt-clip" not in here():
        return
    if "lsdt-frame" in here():
        ratios = {c: _ratios(found, c, like(CLIP), like(FRAME)) for c in found.cases}
        known = {c: r for c, r in ratios.items() if r}
        yield _beats("clip-LSDT beats frame-LSDT", found, known, better=True)
    yield from _window_claims(found, like)
    for other, claim in ((RDO, "clip-LSDT beats PCA-RDO"), (MDTT, "clip-LSDT beats MDTT on short")):
        if other.codec in here():
            ratios = {c: _ratios(found, c, like(CLIP), like(other)) for c in found.cases}
            known = {c: r for c, r in ratios.items() if r}
            if other == RDO:
                yield _beats(claim, found, known, better=True)
                continue
            short = {c: r for c, r in known.items() if _n_frames(found, c) <= SHORT}
            yield _beats(f"{claim} clips (<= {SHORT:,} frames)", found, short, better=True)
            long = {c: r for c, r in known.items() if _n_frames(found, c) >= LONG}
            yield _beats(f"MDTT wins on long ones (>= {LONG:,} frames)", found, long, better=False)
            middle = {c: r for c, r in known.items() if c not in short and c not in long}
            if middle:
                claim = "of the clips between, clip-LSDT and MDTT are alike"
                close = [abs(_mean(r) - 1) <= 0.1 for r in middle.values()]
                yield claim, verdict(close), _ratio_text(found, middle)


def _beats(
    claim: str, found: Found, ratios: Mapping[str, list[float]], *, better: bool
) -> tuple[str, str, str]:
    held = [(_mean(r) > 1) == better for r in ratios.values()]
    return claim, verdict(held), _ratio_text(found, ratios) or "no such clip here"


def _ratio_text(found: Found, ratios: Mapping[str, list[float]]) -> str:
    parts = (
        f"{clip} ({_n_frames(found, clip):,}) {_mean(r):.2f} ({min(r):.2f} to {max(r):.2f})"
        for clip, r in sorted(ratios.items(), key=lambda pair: _n_frames(found, pair[0]))
    )
    text = ", ".join(parts)
    return f"CR / CR: {text}" if text else ""


def _n_frames(found: Found, clip: str) -> int:
    points = found.curve(clip, CLIP)
    return int(points[0]["n_frames"]) if points else 0


def _mean(ratios: Sequence[float]) -> float:
    return math.exp(sum(map(math.log, ratios)) / len(ratios))


def _ratios(found: Found, clip: str, a: Variant, b: Variant) -> list[float]:
    pairs = [(found.cr(clip, a, error), found.cr(clip, b, error)) for error in ERRORS]
    return [x / y for x, y in pairs if x and y]


def _less(found: Found, clip: str, a: Variant, b: Variant) -> list[tuple[float, float]]:
    """(CR, by what share ``a`` has less distortion than ``b``) over the CR that both reach."""
    left, right = found.curve(clip, a), found.curve(clip, b)
    if not left or not right:
        return []
    low = max(min(p["cr"] for p in points) for points in (left, right))
    high = min(max(p["cr"] for p in points) for points in (left, right))
    pairs = []
    for ratio in np.geomspace(low, high, 9) if low < high else ():
        ours, theirs = (at(points, "cr", float(ratio), "cm") for points in (left, right))
        if ours and theirs:
            pairs.append((float(ratio), 1 - ours / theirs))
    return pairs


def _frame_claims(
    less: Mapping[str, list[tuple[float, float]]],
) -> Iterator[tuple[str, str, str]]:
    always = [min(share for _, share in pairs) > 0 for pairs in less.values()]
    text = ", ".join(
        f"{clip} {min(s for _, s in pairs):.0%} to {max(s for _, s in pairs):.0%}"
        for clip, pairs in less.items()
    )
    yield (
        "frame-LSDT has less distortion than frame-DCT at equal CR",
        verdict(always),
        f"less by {text}",
    )
    tops = {clip: max(pairs, key=lambda pair: pair[1]) for clip, pairs in less.items()}
    most = [share for _, share in tops.values()]
    text = ", ".join(
        f"{clip} {share:.0%} at CR {ratio:.0f}" for clip, (ratio, share) in tops.items()
    )
    holds = "-" if not most else "yes" if max(most) >= MOST_LESS else "no"
    yield f"by up to {MOST_LESS:.0%} at high CR", holds, f"at most {text}"


def _window_claims(
    found: Found, like: Callable[[Variant], Variant]
) -> Iterator[tuple[str, str, str]]:
    rows: list[tuple[str, float, float]] = []
    for clip in found.cases:
        steps = [
            _ratios(found, clip, like(b), like(a)) for a, b in zip(CLIPS, CLIPS[1:], strict=False)
        ]
        if all(steps):
            first, second = (_mean(step) - 1 for step in steps)
            rows.append((clip, first, second))
    text = ", ".join(f"{clip} {a:+.1%}, {b:+.1%}" for clip, a, b in rows)
    yield (
        "CR of L = 60 < 120 < 240",
        verdict([a > 0 and b > 0 for _, a, b in rows]),
        f"60 to 120, 120 to 240: {text}",
    )
    yield (
        "little gain from 120 to 240",
        verdict([b < a / 2 for _, a, b in rows]),
        "less than half of that from 60 to 120",
    )


def _starts(found: Found) -> Iterator[Row]:
    kept = found.get(found.convergence())
    if not kept:
        return
    table = ResultTable.from_cache(kept["table"])
    heads = [head for head, _ in table.columns]
    ratio, share, growth = (heads.index(h) for h in ("haar / dct", "of the fall", "growth"))
    for name, grown in (("Algorithm 1 as published", False), ("ours, with growing P", True)):
        rows = [row for row in table.rows if bool(row[growth]) == grown and row[ratio] is not None]
        apart = [abs(_number(row[ratio]) - 1) for row in rows]
        if apart:
            ends = ", ".join(f"{value:.1%}" for value in apart)
            falls = ", ".join(f"{_number(row[share]):.2%}" for row in rows)
            yield (
                f"DCT and Haar starts end alike: {name}",
                "-",
                verdict([value <= NEARLY for value in apart]),
                f"x, y and z end {ends} apart, {falls} of the fall",
            )


def _number(cell: Any) -> float:
    return float(cell)


def _sparse(found: Found) -> Iterator[Row]:
    kept = found.get(found.spatial())
    if not kept:
        return
    rows = {(row[0], row[1]): row[2:] for row in ResultTable.from_cache(kept["fig_5"]).rows}
    less: dict[str, list[float]] = {}
    for clip in dict.fromkeys(clip for clip, _ in rows if clip != "mean"):
        others = zip(rows[clip, "DCT"], rows[clip, "Haar"], strict=True)
        best = [min(_number(a), _number(b)) for a, b in others]
        ours = zip(rows[clip, "LSDT"], best, strict=True)
        less[str(clip)] = [1 - _number(a) / b for a, b in ours if b]
    text = ", ".join(f"{clip} {min(s):.0%} to {max(s):.0%}" for clip, s in less.items() if s)
    held = [min(shares) > 0 for shares in less.values() if shares]
    claim = "LSDT distorts less than DCT and DWT at equal non-zeros"
    yield claim, "-", verdict(held), f"than the better of both by {text}"


def _best_sparsity(found: Found) -> Iterator[Row]:
    for codec, variant in OWN.items():
        if codec not in here():
            continue
        scores = {}
        for P in SPARSITIES:
            data = found.data_of(found.bases_of(P))
            values = [
                at(found.curve(clip, variant, data), "cm", error, "cr_without_models")
                for clip in found.papers
                for error in ERRORS
                if data
            ]
            known = [value for value in values if value]
            if known and len(known) == len(values):
                scores[P] = _mean(known)
        if scores:
            best = max(scores, key=lambda P: scores[P])
            text = ", ".join(f"P = {P} {score:.1f}" for P, score in scores.items())
            yield (
                f"P = 8 is best, {codec}",
                "adaptive",
                "yes" if best == 8 else "no",
                f"CR {text}",
            )


def _fast(found: Found) -> Iterator[Row]:
    rows = found.get(found.speeds()) or []
    both = [r for r in rows if r["label"].startswith(("lsdt-clip", "mdtt")) and not r["live"]]
    if both:
        text = ", ".join(
            f"{r['label']} {r['encode_fps']:,.0f} and {r['decode_fps']:,.0f}" for r in both
        )
        held = [min(r["encode_fps"], r["decode_fps"]) > FAST for r in both]
        claim = f"the clip methods do more than {FAST:,} frames/s"
        yield claim, "-", verdict(held), f"encode and decode: {text}"
