"""The codecs of a clip over their whole range: points, interpolations, deltas, speeds.

docs/reference/measures.md, "Bjontegaard deltas", is normative.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcz.bench.cases import Case, Variant, load
from mcz.bench.measure import N_POINTS, Record
from mcz.bench.tables import ResultTable, setting
from mcz.bench.tasks import Runner, Task
from mcz.codecs import codec_by_name
from mcz.model.types import JsonObject

Values = NDArray[np.float64]
RatePoints = Iterable[tuple[float, float]]  # (size in bytes, quality in dB)

FEWEST = 4  # points of a curve


def pareto_front(curve: RatePoints) -> tuple[Values, Values]:
    """Sizes and qualities of the points that no smaller point matches, both ascending.

    >>> pareto_front([(20, 3.0), (10, 2.0), (30, 2.5)])
    (array([10., 20.]), array([2., 3.]))
    """
    front: list[tuple[float, float]] = []
    for size, quality in sorted(curve, key=lambda point: (point[0], -point[1])):
        if not front or quality > front[-1][1]:
            front.append((float(size), float(quality)))
    return np.array([p[0] for p in front]), np.array([p[1] for p in front])


def bd_rate(reference: RatePoints, other: RatePoints) -> float | None:
    """Percent of bytes that ``other`` needs more at equal quality; None without a common range."""
    a, b = pareto_front(reference), pareto_front(other)
    mean = _mean_difference((a[1], np.log10(a[0])), (b[1], np.log10(b[0])))
    return None if mean is None else float((10.0**mean - 1) * 100)


def bd_sqnr(reference: RatePoints, other: RatePoints) -> float | None:
    """Gain of ``other`` in dB at equal size; None if the ranges do not overlap."""
    a, b = pareto_front(reference), pareto_front(other)
    return _mean_difference((np.log10(a[0]), a[1]), (np.log10(b[0]), b[1]))


def _mean_difference(a: tuple[Values, Values], b: tuple[Values, Values]) -> float | None:
    """The mean over their common x of the y of ``b`` minus that of ``a``."""
    if min(len(a[0]), len(b[0])) < FEWEST:
        return None
    low, high = max(a[0][0], b[0][0]), min(a[0][-1], b[0][-1])
    if not low < high:
        return None
    return float((_integral(*b, low, high) - _integral(*a, low, high)) / (high - low))


def _integral(x: Values, y: Values, low: float, high: float) -> float:
    """Integrate the PCHIP through (x, y), x ascending, from ``low`` to ``high``."""
    h = np.diff(x)
    secants = np.diff(y) / h
    slopes = pchip_slopes(h, secants)
    # A piece is y + d t + c t^2 + b t^3, t the distance from its first point.
    c = (3 * secants - 2 * slopes[:-1] - slopes[1:]) / h
    b = (slopes[:-1] + slopes[1:] - 2 * secants) / h**2

    def primitive(t: Values) -> Values:
        return np.asarray(t * (y[:-1] + t * (slopes[:-1] / 2 + t * (c / 3 + t * b / 4))))

    start, stop = np.clip(low - x[:-1], 0, h), np.clip(high - x[:-1], 0, h)
    return float(np.sum(primitive(stop) - primitive(start)))


def pchip_slopes(h: Values, secants: Values) -> Values:
    """Slopes at the points of a PCHIP from the pieces' widths and secants, at least two pieces."""
    before, after = secants[:-1], secants[1:]
    w1, w2 = 2 * h[1:] + h[:-1], h[1:] + 2 * h[:-1]
    rising = before * after > 0
    safe = np.where(rising, before, 1.0), np.where(rising, after, 1.0)
    inner = np.where(rising, (w1 + w2) / (w1 / safe[0] + w2 / safe[1]), 0.0)
    first = _end_slope(h[0], h[1], secants[0], secants[1])
    last = _end_slope(h[-1], h[-2], secants[-1], secants[-2])
    return np.concatenate([[first], inner, [last]])


def _end_slope(h0: float, h1: float, s0: float, s1: float) -> float:
    slope = ((2 * h0 + h1) * s0 - h0 * s1) / (h0 + h1)
    if slope * s0 <= 0:
        return 0.0
    if s0 * s1 < 0 and abs(slope) > 3 * abs(s0):
        return 3 * s0
    return slope


ZFP = "zfp, tolerance"
AT_ERRORS = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0)  # cm, or length units if these are unknown
AT_MSES = (0.1, 0.25, 0.5, 1.0, 2.0)
AT_RATIOS = (20.0, 40.0, 60.0, 80.0, 120.0)


@dataclass(frozen=True, slots=True)
class Curve:
    """The points of one codec on one clip, fine to coarse, its speeds, or the reason for none."""

    label: str
    points: tuple[Record, ...] = ()
    variant: Variant | None = None  # None: a peer
    speeds: Record = field(default_factory=dict)
    error: str | None = None

    @property
    def lossless(self) -> bool:
        return self.variant is not None and codec_by_name(self.variant.codec).lossless

    def pairs(self, key: str) -> list[tuple[float, float]]:
        """(bytes, figure) of the points that have both."""
        return [(p["coded_bytes"], p[key]) for p in self.points if p.get(key)]

    def document(self) -> JsonObject:
        variant = self.variant
        return {
            "label": self.label,
            "codec": variant.codec if variant else None,
            "params": dict(variant.params) if variant else {},
            "points": list(self.points),
            "speeds": self.speeds or None,
            "error": self.error,
        }


@dataclass(frozen=True, slots=True)
class ClipResult:
    """All that was measured on one clip."""

    name: str
    case: Case
    source_bytes: int
    n_frames: int
    n_channels: int
    unit_cm: float | None
    curves: tuple[Curve, ...]
    peers: tuple[Record, ...]

    @property
    def error_key(self) -> str:
        return "mean_position_error" + ("_cm" if self.unit_cm else "")

    @property
    def unit(self) -> str:
        return "cm" if self.unit_cm else "length units"

    @property
    def lossy(self) -> list[Curve]:
        return [c for c in self.curves if c.points and not c.lossless]

    @property
    def plotted_curves(self) -> list[Curve]:
        """Lossy codecs, and zfp with bounds if it ran."""
        bounded = tuple(p for p in self.peers if p["peer"] == ZFP)
        return [*self.lossy, *([Curve(ZFP, bounded)] if bounded else [])]

    def deltas(self) -> list[JsonObject]:
        """Bjontegaard deltas of every codec against every other."""
        entries = []
        for a in self.lossy:
            for b in self.lossy:
                if a is not b:
                    pair = a.pairs("sqnr_db"), b.pairs("sqnr_db")
                    row = {"reference": a.label, "other": b.label, "bd_rate_pct": bd_rate(*pair)}
                    entries.append(row | {"bd_sqnr_db": bd_sqnr(*pair)})
        return entries

    def document(self) -> JsonObject:
        return {
            "name": self.name,
            "path": self.case.path,
            "source_bytes": self.source_bytes,
            "n_frames": self.n_frames,
            "n_channels": self.n_channels,
            "unit_cm": self.unit_cm,
            "codecs": [curve.document() for curve in self.curves],
            "peers": list(self.peers),
            "deltas": self.deltas(),
        }


def measure_all(
    runner: Runner,
    cases: Mapping[str, Case],
    variants: Sequence[Variant],
    *,
    speeds: bool,
    peers: tuple[str, ...],
) -> list[ClipResult]:
    """Measure sizes and errors of all clips, then speeds, with no other task running."""
    tasks = [Task("sweep", c, v, (N_POINTS,)) for c in cases.values() for v in variants]
    swept = runner.run(tasks)
    timed = {}
    for task in tasks if speeds else ():
        if isinstance(swept[task], list):
            points = swept[task]
            params = points[len(points) // 2]["params"]
            timed[task] = Task("speeds", task.case, task.variant, tuple(params.items()))
    peer_tasks = {case: Task("peers", case, arguments=peers) for case in cases.values() if peers}
    outcomes = runner.run([*timed.values(), *peer_tasks.values()])
    results = []
    for name, case in cases.items():
        curves = []
        for task in tasks:
            if task.case == case:
                speed = outcomes.get(timed[task], {}) if task in timed else {}
                curves.append(_curve(task.variant, swept[task], speed))
        others = outcomes[peer_tasks[case]] if case in peer_tasks else []
        loaded = load(case)
        motion = loaded.motion
        facts = (len(loaded.data), motion.n_frames, motion.signals[0].n_channels)
        unit = motion.skeleton.unit_cm
        rest = (tuple(curves), tuple(others) if isinstance(others, list) else ())
        results.append(ClipResult(name, case, *facts, unit, *rest))
    return results


def _curve(variant: Variant, swept: Any, speeds: Any) -> Curve:
    if not isinstance(swept, list):
        return Curve(variant.label, variant=variant, error=swept["error"])
    error = speeds.get("error")
    return Curve(variant.label, tuple(swept), variant, {} if error else speeds, error)


def tables(clip: ClipResult) -> Iterator[ResultTable]:
    yield _points(clip)
    if clip.lossy:
        yield from _at_equal(clip)
    if len(clip.lossy) > 1:
        yield from _delta_tables(clip)
    if any(curve.speeds for curve in clip.curves):
        yield _speeds(clip)
    if clip.peers:
        yield _peers(clip)


def _caption(clip: ClipResult) -> str:
    return (
        f"Clip {clip.name}: {clip.n_frames:,} frames, {clip.n_channels} channels, "
        f"{clip.source_bytes:,} bytes of source"
    )


NUMERATORS = (
    "CR: cr_source (bytes of the source file), cr_float32 (4 bytes a value), cr_40B (40 bytes a "
    "joint and frame), each / payload, overhead and models in the file, cr_source of a lossless "
    "codec / all that restores the file"
)


def _points(clip: ClipResult) -> ResultTable:
    unit = clip.unit
    columns = (
        *(("codec", ""), ("setting", ""), ("bytes", ",d"), ("cr_source", ".2f")),
        *(("cr_float32", ".2f"), ("cr_40B", ".2f"), ("MSE", ".4g")),
        *((f"mean {unit}", ".4f"), (f"max {unit}", ".3f")),
        *(("markers mean cm", ".4f"), ("markers max cm", ".3f"), ("SQNR dB", ".2f")),
    )
    caption = (
        f"{_caption(clip)}. {NUMERATORS}. MSE: channels, degrees and length units squared. mean, "
        f"max: position error of the joints' points in {unit}; markers: of three virtual markers "
        "a joint."
    )
    table = ResultTable(f"{clip.name}: points", caption, columns)
    keys = (
        *("coded_bytes", "cr_source", "cr_float32", "cr_40B", "mse"),
        *(clip.error_key, clip.error_key.replace("mean", "max")),
        *("virtual_marker_mean_cm", "virtual_marker_max_cm", "sqnr_db"),
    )
    for curve in clip.curves:
        for point in curve.points:
            row = (point.get(key) for key in keys)
            table.rows.append((curve.label, setting(point["params"]), *row))
    return table


def at_error(curve: Curve, key: str, figure: float) -> float | None:
    """Bytes at which ``key`` equals ``figure``: straight in logarithms between points."""
    sizes, errors = _pareto_points(curve, key)
    if len(sizes) < 2 or not errors[-1] <= figure <= errors[0]:
        return None
    log_size = np.interp(math.log(figure), np.log(errors[::-1]), np.log(sizes[::-1]))
    return float(math.exp(log_size))


def at_size(curve: Curve, key: str, size: float) -> float | None:
    """The figure ``key`` at a size in bytes: straight in logarithms between points."""
    sizes, errors = _pareto_points(curve, key)
    if len(sizes) < 2 or not sizes[0] <= size <= sizes[-1]:
        return None
    return float(math.exp(np.interp(math.log(size), np.log(sizes), np.log(errors))))


def _pareto_points(curve: Curve, key: str) -> tuple[Any, Any]:
    """Sizes ascending and errors descending of the points that no smaller point matches."""
    sizes, negative = pareto_front((size, -error) for size, error in curve.pairs(key))
    return sizes, -negative


BETWEEN = "interpolated between measured points, in logarithms; - where the codec does not reach it"


def _at_equal(clip: ClipResult) -> Iterator[ResultTable]:
    yield _at_error(clip, "position error", clip.error_key, AT_ERRORS, clip.unit)
    yield _at_error(clip, "MSE", "mse", AT_MSES, "")
    caption = f"{_caption(clip)}. {clip.error_key} in {clip.unit} at cr_source of, {BETWEEN}."
    heads = tuple((f"CR {value:g}", ".4f") for value in AT_RATIOS)
    table = ResultTable(
        f"{clip.name}: position error at equal size", caption, (("codec", ""), *heads)
    )
    for curve in clip.plotted_curves:
        sizes = (clip.source_bytes / ratio for ratio in AT_RATIOS)
        errors = (at_size(curve, clip.error_key, size) for size in sizes)
        table.rows.append((curve.label, *errors))
    yield table


def _at_error(
    clip: ClipResult, title: str, key: str, errors: Sequence[float], unit: str
) -> ResultTable:
    goal = f"{key} in {unit}" if unit else key
    caption = f"{_caption(clip)}. cr_source at {goal} of, {BETWEEN}."
    heads = tuple((f"{value:g} {unit}".strip(), ".1f") for value in errors)
    table = ResultTable(f"{clip.name}: CR at equal {title}", caption, (("codec", ""), *heads))
    for curve in clip.plotted_curves:
        sizes = (at_error(curve, key, value) for value in errors)
        table.rows.append((curve.label, *(clip.source_bytes / s if s else None for s in sizes)))
    return table


def _delta_tables(clip: ClipResult) -> Iterator[ResultTable]:
    deltas = {(d["reference"], d["other"]): d for d in clip.deltas()}
    labels = [curve.label for curve in clip.lossy]
    for title, key, unit in (
        ("Bjontegaard delta rate", "bd_rate_pct", "percent of bytes, below 0 is better"),
        ("Bjontegaard delta SQNR", "bd_sqnr_db", "dB, above 0 is better"),
    ):
        caption = f"{_caption(clip)}. The codec of the row against that of the column, in {unit}."
        heads = tuple((label, ".2f") for label in labels)
        table = ResultTable(f"{clip.name}: {title}", caption, (("codec", ""), *heads))
        for row in labels:
            cells = (deltas.get((column, row), {}).get(key) for column in labels)
            table.rows.append((row, *cells))
        yield table


def _speeds(clip: ClipResult) -> ResultTable:
    names = ("encode", "decode", "write", "read")
    columns = (
        *(("codec", ""), ("setting", "")),
        *((f"{name} f/s", ",d") for name in names),
        *((f"{name} / parse", ".3f") for name in names),
        *(("encode peak MB", ".1f"), ("decode peak MB", ".1f")),
    )
    caption = (
        f"{_caption(clip)}. f/s: frames a second of CPU time, warm, the fastest of several runs, "
        "nothing of ours beside it. encode, decode: the codec alone, memory to memory; write, "
        "read: a whole file in memory with all its hashes. / parse: as a ratio to parsing the "
        "source file in the same run. Peak: memory of the codec alone, beside the values."
    )
    table = ResultTable(f"{clip.name}: speed and memory", caption, columns)
    for curve in clip.curves:
        if speeds := curve.speeds:
            rates = (speeds[f"{name}_fps"] for name in names)
            ratios = (speeds[f"{name}_to_parse"] for name in names)
            peaks = (speeds[f"{name}_peak_bytes"] / 1e6 for name in ("encode", "decode"))
            table.rows.append((curve.label, setting(speeds["params"]), *rates, *ratios, *peaks))
    return table


def _peers(clip: ClipResult) -> ResultTable:
    columns = (
        *(("peer", ""), ("what is coded", ""), ("bytes", ",d"), ("cr_source", ".2f")),
        *(("cr_float32", ".2f"), ("cr_40B", ".2f"), (f"mean {clip.unit}", ".4f")),
        *(("encode f/s", ",d"), ("decode GB/s", ".3f")),
    )
    caption = (
        f"{_caption(clip)}. The same numerators / all bytes of the peer. A matrix has no skeleton, "
        "names or spelling. Rotations are unwrapped in it. GB/s: 8 bytes a value of the clip in a "
        "second of CPU time; of mcz, from opening the file to checked values."
    )
    table = ResultTable(f"{clip.name}: peers", caption, columns)
    for curve in clip.curves:
        if curve.lossless and curve.points:
            point = curve.points[0]
            ratios = (point[key] for key in ("coded_bytes", "cr_source", "cr_float32", "cr_40B"))
            table.rows.append(
                (f"mcz {curve.label}", "source file", *ratios, 0.0, *_rates(clip, curve))
            )
    for record in clip.peers:
        keys = ("peer", "coded", "coded_bytes", "cr_source", "cr_float32", "cr_40B")
        error = record.get(clip.error_key)
        rates = record.get("encode_fps"), record.get("decode_gbs")
        table.rows.append((*(record[key] for key in keys), error, *rates))
    return table


def _rates(clip: ClipResult, curve: Curve) -> tuple[float | None, float | None]:
    """Frames a second that are coded, gigabytes a second that are read."""
    read = curve.speeds.get("read_fps")
    return curve.speeds.get("encode_fps"), read and read * 8 * clip.n_channels / 1e9
