"""Kwak and Bajic's figures with ours beside them."""

from __future__ import annotations

from collections.abc import Iterator

from tools.papers.curves import HIGH, LOW
from tools.papers.kwak.clips import Clip
from tools.papers.kwak.losses import SHOWN_FRAMES, SHOWN_SHARE
from tools.papers.kwak.printed import TARGETS
from tools.papers.kwak.tables import file_curves
from tools.papers.kwak.tasks import (
    FIL,
    MOD,
    OTHERS,
    OURS,
    PRINTED,
    PUBLISHED,
    RC,
    RCA,
    STEADY,
    STUDY_KBPS,
    Found,
    Method,
    study_task,
)
from tools.papers.panels import Line, Panels

GROUPS_AT = TARGETS.index(6.0)
RATED = (*PUBLISHED, PRINTED, STEADY, OURS, OURS.behind_filter())
GROUPED = (MOD, RC, RCA, OURS)
OTHER_LABELS = tuple(variant.label for variant in OTHERS)


def panels(found: Found) -> Iterator[Panels]:
    straight = (False, False)
    for markers, name in ((True, "markers"), (False, "skeletons")):
        clips = [clip for clip in found.clips if clip.is_markers == markers]
        figures = "8 and 9" if markers else "8 and 9, of skeletons"
        lines = tuple((clip.name, tuple(_rates(found, clip))) for clip in clips)
        title = f"Kwak and Bajic, Fig. {figures}"
        yield Panels(f"kwak_sqnr_{name}", title, ("kbps", "SQNR (dB)"), lines, straight)
        lines = tuple((clip.name, tuple(_groups(found, clip))) for clip in clips)
        title = f"Kwak and Bajic, Fig. {'10' if markers else '15'}: bytes a group at 6 kbps"
        yield Panels(f"kwak_groups_{name}", title, ("group", "bytes"), lines, straight)
    lines = tuple((clip.name, tuple(_sizes(found, clip))) for clip in found.skeletons)
    axes = ("bytes of the file", "mean error of points (cm)")
    yield Panels("kwak_sizes", "Kwak and Bajic, Fig. 12 and 13", axes, lines)
    lines = tuple((clip.name, tuple(_losses(found, clip))) for clip in found.skeletons)
    axes = ("frame", "mean error of points (cm)")
    title = f"{SHOWN_SHARE:.0%} of the frames lost, the last one held, means of {SHOWN_FRAMES}"
    yield Panels("kwak_losses", title, axes, lines, (False, True))


def _rates(found: Found, clip: Clip) -> Iterator[Line]:
    for method in RATED:
        if points := found.rates(clip, method):
            pairs = tuple((p["kbps"], p["sqnr"]) for p in points)
            yield Line(method.label, pairs, _is_published(method))


def _is_published(method: Method) -> bool:
    return method in PUBLISHED


def _groups(found: Found, clip: Clip) -> Iterator[Line]:
    for method in GROUPED:
        if points := found.rates(clip, method):
            sizes = points[GROUPS_AT]["groups"]
            pairs = tuple((float(n), float(size)) for n, size in enumerate(sizes))
            yield Line(method.label, pairs, _is_published(method), marked=False)


def _sizes(found: Found, clip: Clip) -> Iterator[Line]:
    published = [method.label for method in (MOD, RC, RCA, FIL)]
    for label, points in file_curves(found, clip):
        inside = [p for p in points if p["cm"] and LOW / 1.5 <= p["cm"] <= HIGH * 4]
        if inside:
            pairs = tuple((float(p["coded_bytes"]), p["cm"]) for p in inside)
            yield Line(label, pairs, label in published or label in OTHER_LABELS)


def _losses(found: Found, clip: Clip) -> Iterator[Line]:
    kept = found.get(study_task(clip, "losses", STUDY_KBPS)) or {}
    for label, points in kept.get("lines", []):
        pairs = tuple((float(at), max(cm, 1e-3)) for at, cm in points)
        yield Line(label, pairs, "regardless" in label, marked=False)
