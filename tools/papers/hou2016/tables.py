"""Hou 2016's figures as tables, with ours beside them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from mcz.bench.tables import ResultTable
from tools.papers.curves import at
from tools.papers.hou2016.claims import claims
from tools.papers.hou2016.tasks import (
    CLIP,
    ERRORS,
    EVERY,
    OWN,
    PRESET,
    RDO,
    REFERENCE,
    SPEED_CM,
    STEPS_CM,
    Found,
    in_channels,
    same_subject,
    variants,
)
from tools.papers.hou2016.training import SPARSITIES, TRAINING_CLIPS

CR = "96 bits a point and frame / payload, overhead and models of the clip in the file"
D = "D: mean distance of points in cm, as read back"
BETWEEN = "Between measured points, straight in logarithms; - where a codec does not reach it"
HEADS = tuple((f"{error:g} cm", ".1f") for error in ERRORS)


def tables(found: Found) -> Iterator[ResultTable]:
    yield claims(found)
    yield _rates(found, preset=False)
    yield _rates(found, preset=True)
    if kept := found.get(found.convergence()):
        yield ResultTable.from_cache(kept["table"])
    if kept := found.get(found.spatial()):
        yield ResultTable.from_cache(kept["fig_5"])
        yield ResultTable.from_cache(kept["by_sparsity"])
    yield from (_sparsities(found), _held_out_table(found), _domains(found), _speeds(found))
    yield _ways_back(found)


def _rates(found: Found, *, preset: bool) -> ResultTable:
    coder = f"preset {PRESET}: prefix codes" if preset else "our coder"
    about = "mrdwt, for reference, codes channels" if not preset else "bases as by default"
    caption = (
        f"CR: {CR}. {D}. {BETWEEN}. Bases: cosines (the frame-DCT that the paper compares with), "
        f"others the well-known ones where these are best; {about}."
    )
    columns = (("clip", ""), ("frames", ",d"), ("codec", ""), *HEADS)
    table = ResultTable(f"Hou 2016, Fig. 6 and 7: CR at equal D, {coder}", caption, columns)
    for clip in found.cases:
        for variant in variants(preset=preset):
            points = found.curve(clip, variant)
            if points:
                n_frames = points[0]["n_frames"]
                rates = (found.cr(clip, variant, error) for error in ERRORS)
                table.rows.append((clip, n_frames, variant.label, *rates))
    return table


def _sparsities(found: Found) -> ResultTable:
    caption = (
        f"CR at D of, bases trained on {len(found.training)} clips (every frame of {EVERY}, at "
        f"most {found.iterations} iterations) and not counted, as in the paper. {D}. {BETWEEN}."
    )
    columns = (("clip", ""), ("codec", ""), ("P", "d"), *HEADS)
    table = ResultTable("Hou 2016, Fig. 4: P", caption, columns)
    for variant in OWN.values():
        for clip in found.papers:
            for P in SPARSITIES:
                data = found.data_of(found.bases_of(P))
                points = found.curve(clip, variant, data) if data else []
                if points:
                    rates = (at(points, "cm", error, "cr_without_models") for error in ERRORS)
                    table.rows.append((clip, variant.label, P, *rates))
    return table


def _held_out_table(found: Found) -> ResultTable:
    errors = (0.2, 0.5, 1.0)
    caption = (
        "Payload and overhead in bytes at D of, with the bases of this package, whose training saw "
        "nothing of the subject, and with bases trained on the subject's other clips by the same "
        "recipe. The latter have to be in the file, once for all of its clips: bytes of bases. "
        f"{D}. {BETWEEN}."
    )
    columns = (
        *(("clip", ""), ("codec", ""), ("clips of the subject", ""), ("bytes of bases", ",d")),
        *(
            column
            for error in errors
            for column in (
                (f"{error:g} cm: ours", ",d"),
                ("the subject's", ",d"),
                ("ours / its", ".3f"),
            )
        ),
    )
    table = ResultTable("Bases on a subject that they never saw", caption, columns)
    for clip in found.cases:
        if any(same_subject(clip, name) for name in TRAINING_CLIPS):
            continue  # 86: its bases have seen it
        data = found.data_of(found.own_bases(clip))
        for variant in OWN.values():
            own = found.curve(clip, variant, data) if data else []
            ours = found.curve(clip, variant)
            if not own or not ours:
                continue
            cells: list[float | None] = []
            for error in errors:
                pair = [_bytes_at(points, error) for points in (ours, own)]
                cells += [*pair, pair[0] / pair[1] if pair[0] and pair[1] else None]
            names = ", ".join(case.name for case in found.own[clip])
            table.rows.append((clip, variant.label, names, own[0]["model_bytes"], *cells))
    return table


def _bytes_at(points: Sequence[dict[str, Any]], error: float) -> float | None:
    without = [p | {"bytes": p["coded_bytes"] - p["model_bytes"]} for p in points]
    return at(without, "cm", error, "bytes")


def _domains(found: Found) -> ResultTable:
    caption = (
        f"CR: {CR}. {D}; of channels through kinematics. {BETWEEN}. channels: the codec is given "
        "the channels of the clip, and decodes to channels; from places these are not to be had "
        "without inverse kinematics."
    )
    columns = (("clip", ""), ("codec", ""), ("domain", ""), *HEADS)
    table = ResultTable("Channels against positions at equal position error", caption, columns)
    for clip in found.cases:
        pairs = [(v, d) for v in (CLIP, RDO) for d in ("positions", "channels")]
        for variant, domain in [*pairs, (REFERENCE, "channels")]:
            given = variant
            if domain == "channels" and variant != REFERENCE:
                given = in_channels(variant)
            if found.curve(clip, given):
                rates = (found.cr(clip, given, error) for error in ERRORS)
                table.rows.append((clip, variant.label, domain, *rates))
    return table


def _speeds(found: Found) -> ResultTable:
    caption = (
        f"Clip {found.one.name}, each codec at its setting for D = {SPEED_CM} cm. Frames a second "
        "of CPU time, warm, one core, the fastest of several runs, the codec alone, values to "
        "streams and back, all frames at once; live: each frame pushed by itself. / mrdwt: as a "
        "ratio to mrdwt in the same run. Places are computed before."
    )
    columns = (
        *(("codec", ""), ("mode", ""), ("setting", ".3g"), ("encode f/s", ",d")),
        *(("decode f/s", ",d"), ("encode / mrdwt", ".3f"), ("decode / mrdwt", ".3f")),
    )
    table = ResultTable("Hou 2016: speed", caption, columns)
    rows = found.get(found.speeds()) or []
    base = next((row for row in rows if row["label"] == REFERENCE.label), None)
    for row in rows:
        mode = "live" if row["live"] else "batch"
        rates = (row["encode_fps"], row["decode_fps"])
        ratios = (row[k] / base[k] if base else None for k in ("encode_fps", "decode_fps"))
        table.rows.append((row["label"], mode, row["setting"], *rates, *ratios))
    return table


def _ways_back(found: Found) -> ResultTable:
    caption = (
        f"Clip {found.one.name}: places of points, as they are or coded by lsdt-clip at a step, "
        "fitted by inverse kinematics. places: mean distance of what is fitted; points, virtual "
        "markers: of the solved motion from the source; angles: mean difference of rotation "
        "channels, of two equal spellings the nearer; turns: mean angle between the joints' "
        "orientations in the world."
    )
    columns = (
        *(("places", ""), ("virtual markers", ""), ("bytes", ",d"), ("places cm", ".4f")),
        *(("points mean cm", ".4f"), ("points max cm", ".3f"), ("virtual markers cm", ".4f")),
        *(("angles deg", ".4f"), ("turns deg", ".4f")),
    )
    table = ResultTable("Back to channels by inverse kinematics", caption, columns)
    for step in STEPS_CM:
        for marked in (False, True):
            row = found.get(found.way_back(step, virtual_markers=marked))
            if row:
                what = "exact" if step is None else f"coded, step {step:g} cm"
                keys = ("coded_bytes", "seen_cm", "cm", "max_cm", "markers_cm")
                cells = (row[key] for key in (*keys, "channel_deg", "turn_deg"))
                table.rows.append((what, "with" if marked else "without", *cells))
    return table
