"""Kwak and Bajic's tables with ours beside them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from mcz.bench.tables import ResultTable
from tools.papers.curves import at
from tools.papers.kwak.claims import claims
from tools.papers.kwak.clips import POINTS, VIRTUAL, Clip, motion_in_positions
from tools.papers.kwak.printed import (
    BD,
    DECODE_MS,
    DEVIATIONS,
    ENCODE_MS,
    METHODS,
    RATES,
    TARGETS,
    VIRTUAL_COST,
)
from tools.papers.kwak.tasks import (
    ALL,
    CHAINED,
    CODER_KBPS,
    MOD,
    OURS,
    RC,
    RCA,
    STEADY,
    STUDY_KBPS,
    WITH_MARKERS,
    Found,
    curve_tasks,
    speeds_task,
    study_task,
)
from tools.papers.kwak.versus import bd, virtual_ratios

KBPS = "kbps: kilobits of payload a second"
CLIPS = (
    "C3D files without the frames at their ends in which no marker was seen; 41 markers: virtual "
    "ones of an AMC's skeleton, placed about as a set of that many, in mm; BVH without the pose "
    "that the conversion put first, 38 points; AMC, 31 points. An AMC says no frame rate and a BVH "
    "no unit: 120 frames/s, 2.54 / 0.45 cm"
)
ERRORS_CM = (0.5, 1.0, 2.0)


def tables(found: Found) -> Iterator[ResultTable]:
    yield claims(found)
    for markers in (True, False):
        yield _rates(found, markers)
    for markers in (True, False):
        yield _deviations(found, markers)
    yield _bd(found)
    yield from (_sizes(found), _markers(found), _coders(found))
    yield from (_periods(found), _resets(found), _packets(found), _losses(found), _speeds(found))


def _rates(found: Found, markers: bool) -> ResultTable:
    numbers = "IV and V" if markers else "VIII and IX"
    asked = "those that MOD had at about 3 to 7 kbps" if markers else "exact"
    methods = (RC, RCA, STEADY, OURS, CHAINED)
    heads = [
        column
        for method in methods
        for column in ((method.label, ".3f"), ("error %", ".2f"), ("framed", ".3f"))
    ]
    columns = (("clip", ""), ("target", ".3f"), *heads, ("paper's RC", ".2f"), ("RCA", ".2f"))
    caption = (
        f"{KBPS}; framed: with the heads of units and their sizes. Targets: {asked}. N_GOF = 30. "
        f"steady: our rate control with MOD's transform and coder; ours: with ours, every fourth "
        f"LTR intra coded, or none, and the basis that a live encoder has. {CLIPS}."
    )
    table = ResultTable(f"Kwak and Bajic, Tables {numbers}: rate control", caption, columns)
    for clip in found.clips:
        if clip.is_markers != markers:
            continue
        papers = RATES.get((markers, clip.stem), [(None, None, None)] * len(TARGETS))
        points = [found.rates(clip, method) for method in methods]
        if not all(points):
            continue
        for number, printed in enumerate(papers):
            cells: list[Any] = []
            for of in points:
                p = of[number]
                cells += [p["kbps"], 100 * abs(p["kbps"] / p["target"] - 1), p["framed_kbps"]]
            table.rows.append((clip.name, points[0][number]["target"], *cells, *printed[1:]))
    return table


def _deviations(found: Found, markers: bool) -> ResultTable:
    methods = (MOD, RC, RCA, STEADY, OURS, CHAINED)
    columns = (
        ("clip", ""),
        *((method.label, ".1f") for method in methods),
        *((f"paper's {name}", ".1f") for name in ("MOD", "RC", "RCA")),
    )
    caption = (
        "Standard deviation of the payload bytes of whole groups of 30 frames, mean of the five "
        "rates. ours: every fourth group has an intra coded LTR."
    )
    title = f"Kwak and Bajic, Table {'VI' if markers else 'X'}: bytes a group"
    table = ResultTable(title, caption, columns)
    for clip in found.clips:
        if clip.is_markers == markers:
            cells = [deviation(found, clip, method) for method in methods]
            printed = DEVIATIONS.get((markers, clip.stem), (None, None, None))
            table.rows.append((clip.name, *cells, *printed))
    return table


def deviation(found: Found, clip: Clip, method: Any) -> float | None:
    values = [p["deviation"] for p in found.rates(clip, method) if p["deviation"] is not None]
    return float(np.mean(values)) if values else None


def _bd(found: Found) -> ResultTable:
    columns = (
        *(("clip", ""), ("method", ""), ("BD SQNR dB", ".2f"), ("BD rate %", ".1f")),
        *(("paper's dB", ".2f"), ("paper's %", ".1f")),
        *((f"SQNR at {target:g} kbps", ".2f") for target in TARGETS),
        ("ME at 5 kbps, cm", ".2f"),
    )
    caption = (
        "Against MOD at the five rates; - where the curves share no SQNR. FIL: RCA behind the post "
        "filter. RCA: a and b of eq. 14 fitted to this coder; the printed ones apart. steady: our "
        "rate control with MOD's transform and coder. ours: our transform and coder too, every "
        "fourth LTR intra coded, well-known bases for 31 and 38 points, else cosines; one step: no "
        "rate control, its step searched for; basis of the clip: learned from all of it, its bytes "
        "counted in BD, so no online codec."
    )
    table = ResultTable("Kwak and Bajic, Table III: BD SQNR and BD rate", caption, columns)
    for clip in found.clips:
        for method in ALL:
            points = found.rates(clip, method)
            if not points:
                continue
            printed: tuple[float | None, float | None] = (None, None)
            if clip.is_markers and clip.stem in BD and method.label in METHODS:
                place = METHODS.index(method.label)
                printed = BD[clip.stem][0][place], BD[clip.stem][1][place]
            figures = bd(found, clip, MOD, method)
            sqnr = [p["sqnr"] for p in points]
            table.rows.append((clip.name, method.label, *figures, *printed, *sqnr, points[2]["cm"]))
    return table


def _sizes(found: Found) -> ResultTable:
    heads = tuple((f"{error:g} cm", ",d") for error in ERRORS_CM)
    columns = (("clip", ""), ("codec", ""), *heads, *((f"/ ours {h}", ".2f") for h, _ in heads))
    caption = (
        "Bytes of payload, overhead and models of a whole file at a mean error of points of, "
        "between measured ones, straight in logarithms; - where a codec does not reach it. "
        "/ ours: as a ratio to ours at a held rate."
    )
    table = ResultTable("Bytes at equal mean error", caption, columns)
    for clip in found.skeletons:
        rows = [
            (label, [at(points, "cm", cm, "coded_bytes") for cm in ERRORS_CM])
            for label, points in file_curves(found, clip)
        ]
        ours = dict(rows).get(OURS.label, [None] * len(ERRORS_CM))
        for label, cells in rows:
            ratios = [a / b if a and b else None for a, b in zip(cells, ours, strict=True)]
            table.rows.append((clip.name, label, *cells, *ratios))
    return table


def file_curves(found: Found, clip: Clip) -> Iterator[tuple[str, list[Any]]]:
    """Names and points of every codec that is drawn."""
    for label, task in curve_tasks(clip):
        if points := found.get(task):
            yield label, points


def _markers(found: Found) -> ResultTable:
    heads = (3.0, 5.0, 7.0)
    columns = (
        *(("clip", ""), ("method", ""), ("points", "d"), ("with", "d")),
        *((f"as at {kbps:g} kbps", ".2f") for kbps in heads),
    )
    low, high = VIRTUAL_COST
    caption = (
        "kbps with three virtual markers for every joint beside the points, as a ratio to kbps "
        "without, at the mean error that the points alone have at so many kbps; the paper says "
        f"{low:g} to {high:g}. Of FIL behind the filter."
    )
    table = ResultTable("What virtual markers cost", caption, columns)
    for clip in found.skeletons:
        for method in WITH_MARKERS:
            for ended in (method, method.behind_filter()):
                if ratios := virtual_ratios(found, clip, ended, heads):
                    counts = [n_points(Clip(clip.case, f)) for f in (POINTS, VIRTUAL)]
                    table.rows.append((clip.name, ended.label, *counts, *ratios))
    return table


def n_points(clip: Clip) -> int:
    return motion_in_positions(clip).skeleton.n_joints


def _coders(found: Found) -> ResultTable:
    columns = (
        *(("clip", ""), ("MOD's kbps", ".0f"), ("transform", ""), ("SQNR", ".2f")),
        *(("Rice alone", ".3f"), ("golomb", ".3f"), ("mixed", ".3f"), ("mixed / golomb", ".3f")),
    )
    caption = (
        f"{KBPS}, all of one row with the same step, that with which MOD has its rate. Rice alone: "
        "Golomb-Rice codes with parameters chosen as those of golomb, nothing behind them; golomb: "
        "their bits coded by an adaptive arithmetic coder, as published; mixed: ours. What is "
        "learned from the clip itself is not counted."
    )
    table = ResultTable("Entropy coders and transforms", caption, columns)
    for clip in found.study_clips:
        for row in found.get(study_task(clip, "coders", *CODER_KBPS)) or []:
            cells = [row[key] for key in ("rice", "golomb", "mixed")]
            ratio = row["mixed"] / row["golomb"]
            table.rows.append((clip.name, row["target"], row["place"], row["sqnr"], *cells, ratio))
    return table


def _periods(found: Found) -> ResultTable:
    columns = (
        *(("clip", ""), ("intra_period", ""), ("kbps, one step", ".3f"), ("against 0 %", ".1f")),
        *(("SQNR", ".2f"), ("SQNR, rate held", ".2f")),
    )
    caption = (
        f"{KBPS} at one step, with which intra_period 0 (the first LTR alone) has {STUDY_KBPS:g}; "
        f"SQNR, rate held: at {STUDY_KBPS:g} kbps with rate control. Our coder and transform."
    )
    table = ResultTable("What intra coded LTRs cost", caption, columns)
    for clip in found.study_clips:
        rows = found.get(study_task(clip, "periods", STUDY_KBPS)) or []
        least = next((row["kbps"] for row in rows if not row["period"]), None)
        for row in rows:
            more = 100 * (row["kbps"] / least - 1) if least else None
            cells = (row["kbps"], more, row["sqnr"], row["held_sqnr"])
            table.rows.append((clip.name, str(row["period"]), *cells))
    return table


def _resets(found: Found) -> ResultTable:
    columns = (
        *(("clip", ""), ("frames a group", ""), ("mixed", ".3f"), ("against one group %", ".1f")),
        *(("golomb", ".3f"), ("against one group %", ".1f"), ("SQNR", ".2f")),
    )
    caption = (
        f"{KBPS} at one step. Every group begins with a coder that has learned nothing and an LTR, "
        "so that this is the cost of both. ltr_step 1, intra_period 0."
    )
    table = ResultTable("What groups of frames cost", caption, columns)
    for clip in found.study_clips:
        rows = found.get(study_task(clip, "resets", STUDY_KBPS)) or []
        for row in rows:
            cells = []
            for coder in ("mixed", "golomb"):
                cells += [row[coder], 100 * (row[coder] / rows[-1][coder] - 1)]
            shown = "all" if row["gof"] == rows[-1]["gof"] else str(row["gof"])
            table.rows.append((clip.name, shown, *cells, row["sqnr"]))
    return table


def _packets(found: Found) -> ResultTable:
    columns = (
        *(("clip", ""), ("preset", ""), ("stored", ".3f"), ("with heads", ".3f")),
        *(("frame by frame", ".3f"), ("with heads", ".3f"), ("packets", ".3f")),
        ("and repeats", ".3f"),
    )
    caption = (
        "kbps of the same frames at one step: payload and streams as stored, a unit a group; "
        "payload and streams live, a unit a frame, each ended by itself; all bytes of packets in a "
        "live file; the same with skeleton and clip repeated at every intra coded LTR."
    )
    table = ResultTable("What a live stream costs", caption, columns)
    keys = ("stored", "framed", "terminated", "streams", "packets", "with_entries")
    for clip in found.study_clips:
        for row in found.get(study_task(clip, "packets", STUDY_KBPS)) or []:
            table.rows.append((clip.name, row["label"], *(row[key] for key in keys)))
    return table


def _losses(found: Found) -> ResultTable:
    columns = (
        *(("clip", ""), ("stream", ""), ("kbps", ".2f"), ("lost %", ".0f")),
        *(("concealed %", ".1f"), ("mean error cm", ".2f"), ("SQNR", ".2f")),
    )
    caption = (
        f"Frames lost at random, mean of three seeds; the first frame always comes. All at "
        f"{STUDY_KBPS:g} kbps of payload ended frame by frame. Concealed: the last frame is held, "
        "for those lost and those that need them. Gone on regardless: a decoder that takes what it "
        "shows for what was lost, in LTRs to the next group, in the plain chain from frame to "
        "frame, whose entropy coder is taken to allow it; what it shows is wrong, and it says "
        "nothing."
    )
    table = ResultTable("Lost frames", caption, columns)
    for clip in found.skeletons:
        for row in (found.get(study_task(clip, "losses", STUDY_KBPS)) or {}).get("rows", []):
            cells = (row["kbps"], 100 * row["share"], 100 * row["concealed"])
            table.rows.append((clip.name, row["label"], *cells, row["cm"], row["sqnr"]))
    return table


def _speeds(found: Found) -> ResultTable:
    columns = (
        *(("codec", ""), ("settings", ""), ("frame by frame", "")),
        *(("encode f/s", ",d"), ("decode f/s", ",d")),
        *(("encode / mrdwt", ".2f"), ("decode / mrdwt", ".2f")),
    )
    clip = found.fastest
    caption = (
        f"{clip.name if clip else 'No clip'}: frames a second of CPU time in one run, warm, by the "
        f"codec alone. The paper's, in MATLAB: {1000 / ENCODE_MS:.0f} and {1000 / DECODE_MS:.0f}."
    )
    table = ResultTable("Kwak and Bajic, Table XI: speed", caption, columns)
    rows = (found.get(speeds_task(clip)) if clip else None) or []
    base = next((row for row in rows if row["label"] == "mrdwt"), None)
    for row in rows:
        given = ", ".join(f"{key}={value:g}" for key, value in row["settings"].items())
        fps = [row["encode_fps"], row["decode_fps"]]
        ratios: list[float | None] = [None, None]
        if base:
            ratios = [
                a / b if a else None
                for a, b in zip(fps, (base["encode_fps"], base["decode_fps"]), strict=True)
            ]
        cells = (row["label"], given, "yes" if row["live"] else "no")
        table.rows.append((*cells, *fps, *ratios))
    return table
