"""Khan 2014's Table 4 and Khan 2017's figures, with ours beside them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from mcz.bench.cases import Case, Variant, has_preset, preset_of
from mcz.bench.tables import ResultTable
from mcz.bench.tasks import Task
from mcz.codecs import CODECS
from tools.papers.khan2014.printed import BYTES_2014, DWT_2014, KHAN_2014, KHAN_2017, QBC_2014

NAMES = tuple(KHAN_2014)
ORDER = ("qbc", "dwt", "awt", "pca")  # the papers' order, best first
METRICS = "MSE over the channels (degrees and length units squared, whole turns taken off)"

Results = Mapping[Task, Any]


def here() -> list[str]:
    """The paper's codecs that this package has, with the preset that follows it."""
    known = {codec.name: codec for codec in CODECS.values()}
    return [n for n in ORDER if n in known and has_preset(known[n], "khan2014")]


def missing_codecs() -> list[str]:
    return [name for name in ORDER if name not in here()]


def tasks(cases: Mapping[str, Case]) -> Iterator[Task]:
    for clip, case in cases.items():
        for codec in here():
            yield from _Row(clip, case, codec).tasks
        for threshold in DWT_2014.get(clip, {}) if "dwt" in here() else ():
            yield _threshold(case, threshold)
        yield from (_at_common(case, clip, variant) for variant in _variants())


class _Row:
    """The tasks of one clip and codec."""

    def __init__(self, clip: str, case: Case, codec: str) -> None:
        self.clip, self.codec = clip, codec
        name, value, self.mse, self.cr = KHAN_2014[clip][codec]
        self.parameter = f"{name}={value}"
        given = ((name, value),)
        plain, preset = Variant(codec), preset_of(codec, "khan2014")
        self.preset = Task("point", case, preset, given)
        self.same = Task("point", case, plain, given)
        self.close = Task("at", case, preset, ("mse", self.mse, float(value)))
        self.ours = Task("at", case, plain, ("mse", self.mse, float(value)))
        mse_2017 = KHAN_2017.get(clip, {}).get(codec, (self.mse, 0.0))[0]
        self.later = Task("at", case, plain, ("mse", mse_2017, float(value)))
        self.tasks = [self.preset, self.close, self.same, self.ours, self.later]


def _threshold(case: Case, threshold: int) -> Task:
    return Task("point", case, preset_of("dwt", "khan2014"), (("t_w", threshold),))


def _variants() -> list[Variant]:
    return [v for n in here() for v in (Variant(n), preset_of(n, "khan2014"))]


def _common_mse(clip: str) -> float:
    return float(KHAN_2014[clip]["qbc"][2])


def _at_common(case: Case, clip: str, variant: Variant) -> Task:
    value = KHAN_2014[clip][variant.codec][1]
    return Task("at", case, variant, ("mse", _common_mse(clip), float(value)))


def tables(cases: Mapping[str, Case], results: Results) -> Iterator[ResultTable]:
    if not cases or not here():
        return
    yield _table_4(cases, results)
    yield _later(cases, results)
    yield from _order(cases, results)
    if "dwt" in here():
        yield _thresholds(cases, results)
    if "qbc" in here():
        yield _published_qbc(cases, results)


def _remark(cases: Mapping[str, Case]) -> str:
    """Remark on the sizes behind the ratios."""
    remarks = []
    for clip, case in cases.items():
        held, paper = Path(case.path).stat().st_size, BYTES_2014[clip]
        text = f"{clip}: {paper:,} bytes in the paper"
        if held != paper:
            lines = Path(case.path).read_bytes().count(b"\n")
            same = "; CRLF instead of LF makes up the difference" if held + lines == paper else ""
            text += f", {held:,} in the file at hand{same}"
        remarks.append(text)
    return "CR: bytes of the .amc as the paper has it / payload and overhead. " + ". ".join(remarks)


def _ratio(clip: str, found: Mapping[str, Any]) -> float | None:
    """CR with the paper's size of the source."""
    size = found.get("coded_bytes")
    return BYTES_2014[clip] / size if size else None


def _times(ours: float | None, paper: float | None) -> float | None:
    return ours / paper if ours and paper else None


def _table_4(cases: Mapping[str, Case], results: Results) -> ResultTable:
    columns = (
        *(("clip", ""), ("codec", ""), ("parameter", "")),
        *(("paper MSE", ".3f"), ("paper CR", ".2f")),
        *(("preset MSE", ".4f"), ("preset CR", ".2f"), ("times", ".2f")),
        *(("preset at the paper's MSE: CR", ".2f"), ("times", ".2f"), ("mean cm", ".3f")),
        *(("default, same parameter: MSE", ".4f"), ("CR", ".2f")),
        *(("default at the paper's MSE: CR", ".2f"), ("times", ".2f"), ("mean cm", ".3f")),
    )
    caption = (
        f"{_remark(cases)}. {METRICS}. Preset: khan2014 at the paper's parameter. At the "
        "paper's MSE: between two measured settings, straight in logarithms. mean cm: "
        "mean_position_error_cm of that."
    )
    table = ResultTable("Khan 2014, Table 4", caption, columns)
    for clip, case in cases.items():
        for codec in here():
            row = _Row(clip, case, codec)
            preset, same, ours = results[row.preset], results[row.same], results[row.ours]
            close = results[row.close]
            ratio, near, best = (_ratio(clip, found) for found in (preset, close, ours))
            table.rows.append(
                (
                    *(clip, codec, row.parameter, row.mse, row.cr),
                    *(preset.get("mse"), ratio, _times(ratio, row.cr)),
                    *(near, _times(near, row.cr), close.get("mean_position_error_cm")),
                    *(same.get("mse"), _ratio(clip, same)),
                    *(best, _times(best, row.cr), ours.get("mean_position_error_cm")),
                )
            )
    return table


def _later(cases: Mapping[str, Case], results: Results) -> ResultTable:
    columns = (
        *(("clip", ""), ("codec", ""), ("paper MSE", ".4f"), ("paper CR", ".2f")),
        *(("default at this MSE: CR", ".2f"), ("times", ".2f")),
    )
    caption = f"{_remark(cases)}. {METRICS}. For 10_03 and 05_01 the paper says: at an MSE below 1."
    table = ResultTable("Khan 2017, text and Table III", caption, columns)
    for clip, case in cases.items():
        for codec, (mse, cr) in KHAN_2017.get(clip, {}).items():
            if codec in here():
                ratio = _ratio(clip, results[_Row(clip, case, codec).later])
                table.rows.append((clip, codec, mse, cr, ratio, _times(ratio, cr)))
    return table


def _order(cases: Mapping[str, Case], results: Results) -> Iterator[ResultTable]:
    columns = (
        *(("clip", ""), ("MSE", ".3f"), ("default, best first: CR", "")),
        *(("preset khan2014, best first: CR", ""), ("QBC > DWT > AWT > PCA", "")),
    )
    caption = f"{_remark(cases)}. {METRICS}, that of the paper's QBC for every codec."
    table = ResultTable("Order of the codecs at equal MSE", caption, columns)
    for clip, case in cases.items():
        texts, holds = [], []
        for published in (False, True):
            found = {}
            for variant in _variants():
                if variant.is_published == published:
                    ratio = _ratio(clip, results[_at_common(case, clip, variant)])
                    if ratio is not None:
                        found[variant.codec] = ratio
            order = sorted(found, key=lambda name: -found[name])
            texts.append(", ".join(f"{name} {found[name]:.1f}" for name in order))
            holds.append("yes" if order == [n for n in ORDER if n in found] else "no")
        verdict = f"default {holds[0]}, preset {holds[1]}"
        table.rows.append((clip, _common_mse(clip), *texts, verdict))
    yield table


def _thresholds(cases: Mapping[str, Case], results: Results) -> ResultTable:
    columns = (
        *(("clip", ""), ("t_w", "d"), ("published MSE", ".4f"), ("preset MSE", ".4f")),
        *(("difference", ".4f"), ("preset CR", ".2f")),
    )
    caption = f"{_remark(cases)}. {METRICS}. Published: by the author's program."
    table = ResultTable("Khan 2014's DWT by threshold", caption, columns)
    for clip, case in cases.items():
        for threshold, mse in DWT_2014.get(clip, {}).items():
            found = results[_threshold(case, threshold)]
            ours = found.get("mse")
            off = None if ours is None else ours - mse
            table.rows.append((clip, threshold, mse, ours, off, _ratio(clip, found)))
    return table


def _published_qbc(cases: Mapping[str, Case], results: Results) -> ResultTable:
    columns = (("clip", ""), ("d2_lmt", "d"), ("published MSE", ".4f"), ("preset MSE", ".4f"))
    caption = f"{METRICS}. Published: by the author's program."
    table = ResultTable("Khan 2014's QBC", caption, columns)
    for clip, case in cases.items():
        if clip in QBC_2014:
            limit, mse = QBC_2014[clip]
            found = results[_Row(clip, case, "qbc").preset]
            table.rows.append((clip, limit, mse, found.get("mse")))
    return table
