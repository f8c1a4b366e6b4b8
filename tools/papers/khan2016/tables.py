"""Khan 2016's Fig. 7, Fig. 8 and Table 4, with ours beside them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from mcz.bench.cases import Case, Variant, has_preset, preset_of
from mcz.bench.tables import ResultTable
from mcz.bench.tasks import Task
from mcz.codecs import CODECS
from tools.papers.khan2016.printed import FIG_7, FIG_7_ELSE, FIG_8, TABLE_4, TABLE_4_ELSE

FIG_8_CLIP = "09_01"
NAMES = ("17_10", *TABLE_4_ELSE, *(n for n in FIG_7 if n != "17_10"), FIG_8_CLIP)
CR_ELSE = 64.0  # where the paper does not have the clip: about that of 17_10
PRESETS = {"mrdwt": "khan2016", "qbc": "khan2014"}
ERRORS = (
    "eps_d: rms_coordinate_error in length units, what the paper's program prints; mean: "
    "mean_position_error; both over the joints' points"
)

Results = Mapping[Task, Any]


def here() -> list[str]:
    known = {codec.name: codec for codec in CODECS.values()}
    return [n for n, p in PRESETS.items() if n in known and has_preset(known[n], p)]


def missing_presets() -> list[str]:
    return [name for name in PRESETS if name not in here()]


def tasks(cases: Mapping[str, Case]) -> Iterator[Task]:
    for clip, case in cases.items():
        if clip == FIG_8_CLIP:
            if "mrdwt" in here():
                yield _levels(case)
            continue
        if "mrdwt" in here():
            yield from (_threshold(case, T_g) for T_g in _thresholds(clip))
            yield from (_deflated_task(case, T_g) for T_g in _thresholds(clip))
        for variant in _variants():
            yield _at_ratio(clip, case, variant)
            yield _speed_task(case, variant)


def _thresholds(clip: str) -> tuple[float, ...]:
    return tuple(FIG_7.get(clip, FIG_7_ELSE))


def _paper(clip: str, codec: str) -> tuple[Any, ...]:
    """Parameter, CR, eps_d and frames a second; None what the paper does not say."""
    if clip in TABLE_4:
        return TABLE_4[clip][codec]
    return (None,) * 5


def _variants() -> list[Variant]:
    return [v for name in here() for v in (preset_of(name, PRESETS[name]), Variant(name))]


def _threshold(case: Case, T_g: float) -> Task:
    return Task("point", case, preset_of("mrdwt", "khan2016"), (("T_g", T_g),))


def _deflated_task(case: Case, T_g: float) -> Task:
    return Task("deflated", case, preset_of("mrdwt", "khan2016"), (T_g,))


def _speed_task(case: Case, variant: Variant) -> Task:
    return Task("speeds", case, variant)


def _at_ratio(clip: str, case: Case, variant: Variant) -> Task:
    wanted = _paper(clip, variant.codec)[1] or CR_ELSE
    return Task("at", case, variant, ("cr_source", wanted, 4.0))


def _levels(case: Case) -> Task:
    params = (("threshold_rule", "flat"), ("T_g", 1))
    return Task("resolutions", case, preset_of("mrdwt", "khan2016"), ("rfoot", *params))


def tables(cases: Mapping[str, Case], results: Results) -> Iterator[ResultTable]:
    swept = {clip: case for clip, case in cases.items() if clip != FIG_8_CLIP}
    if swept and here():
        yield _table_4(swept, results)
    if "mrdwt" in here():
        for clip, case in swept.items():
            yield _figure_7(clip, case, results)
        if FIG_8_CLIP in cases:
            yield _figure_8(cases[FIG_8_CLIP], results)


def _size(case: Case) -> str:
    return f"{Path(case.path).stat().st_size:,} bytes of .amc"


def _table_4(cases: Mapping[str, Case], results: Results) -> ResultTable:
    columns = (
        *(("clip", ""), ("codec", "")),
        *(("paper CR", ".1f"), ("paper eps_d", ".3f"), ("paper f/s", "")),
        *(("at CR", ".1f"), ("eps_d", ".4f"), ("mean", ".4f"), ("mean cm", ".3f")),
        *(("MSE", ".3f"), ("encode f/s", ",d"), ("decode f/s", ",d")),
        *(("encode / parse", ".2f"), ("decode / parse", ".2f")),
    )
    caption = (
        "CR: cr_source, bytes of the .amc / payload and overhead ("
        + "; ".join(f"{clip}: {_size(case)}" for clip, case in cases.items())
        + f"). {ERRORS}. Each codec at the paper's CR, {CR_ELSE:g} where it has none, between two "
        "measured settings. The paper's eps_d of QBC is an error of channels. f/s: frames a second "
        "of CPU time, warm, encoder and decoder alone at their standard setting; / parse: as a "
        "ratio to parsing the text in the same run."
    )
    table = ResultTable("Khan 2016, Table 4: QBC and MRDWT", caption, columns)
    for clip, case in cases.items():
        for variant in _variants():
            _, cr, eps, encode, decode = _paper(clip, variant.codec)
            found = results[_at_ratio(clip, case, variant)]
            speed = results[_speed_task(case, variant)]
            rates = f"{encode:,} / {decode:,}" if encode else None
            table.rows.append(
                (
                    *(clip, variant.label, cr, eps, rates, cr or CR_ELSE),
                    *(found.get(k) for k in ("rms_coordinate_error", "mean_position_error")),
                    *(found.get("mean_position_error_cm"), found.get("mse")),
                    *(speed.get(k) for k in ("encode_fps", "decode_fps")),
                    *(speed.get(k) for k in ("encode_to_parse", "decode_to_parse")),
                )
            )
    return table


def _figure_7(clip: str, case: Case, results: Results) -> ResultTable:
    columns = (
        *(("T_g", "g"), ("paper CR", ".1f"), ("CR", ".2f"), ("times", ".2f")),
        ("CR, deflate", ".2f"),
        *(("paper eps_d", ".4f"), ("eps_d", ".5f"), ("mean", ".4f"), ("mean cm", ".3f")),
        ("virtual markers cm", ".3f"),
    )
    caption = (
        f"mrdwt, preset khan2016. CR: cr_source, {_size(case)} / payload and overhead. {ERRORS}; "
        "virtual markers: virtual_marker_mean_cm. CR, deflate: the same integers with run lengths "
        "in one deflated blob, nothing else counted."
    )
    table = ResultTable(f"Khan 2016, Fig. 7: {clip}", caption, columns)
    for T_g in _thresholds(clip):
        cr, eps = FIG_7.get(clip, {}).get(int(T_g), (None, None))
        found = results[_threshold(case, T_g)]
        ratio = found.get("cr_source")
        times = ratio / cr if ratio and cr else None
        errors = ("rms_coordinate_error", "mean_position_error", "mean_position_error_cm")
        blob = results[_deflated_task(case, T_g)].get("bytes")
        deflate = Path(case.path).stat().st_size / blob if blob else None
        table.rows.append(
            (
                *(T_g, cr, ratio, times, deflate, eps),
                *(found.get(k) for k in (*errors, "virtual_marker_mean_cm")),
            )
        )
    return table


def _figure_8(case: Case, results: Results) -> ResultTable:
    columns = (
        *(("finest levels left out", "d"), ("paper MSE", ".3f"), ("MSE", ".4f")),
        *(("bytes read for the joint", ",d"), ("bytes read for all joints", ",d")),
    )
    found = results[_levels(case)]
    caption = (
        f"{FIG_8_CLIP}, rfoot rx, mrdwt, preset khan2016 with a flat threshold of 1; MSE in "
        "degrees squared. Bytes read: after opening. "
        f"The file has {found.get('file_bytes', 0):,} bytes."
    )
    table = ResultTable("Khan 2016, Fig. 8", caption, columns)
    for row in found.get("rows", ()):
        level = row["resolution"]
        read = (row["bytes_read_joint"], row["bytes_read_all"])
        table.rows.append((level, FIG_8.get(level), row["mse"], *read))
    return table
