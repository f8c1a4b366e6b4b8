"""Bytes of lossy codecs at equal errors, beside ACL's, on ten clips of CMU.

Each clip is coded at ten settings. The files are decoded and measured, and bytes between two of
them are interpolated in logarithms.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

import mcz
from mcz.bench.cases import Case, Variant
from mcz.bench.measure import measure, sweep, write_file
from mcz.files.reading.sizes import clip_sizes
from tools.figures.lossless import cpu_seconds, read_values
from tools.figures.table import Table, table

ACL: Mapping[str, Any] = json.loads(Path(__file__).with_name("acl.json").read_text("utf-8"))
CLIPS = tuple(ACL["joint"])
ERRORS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0)  # cm, mean distance
STEPS = np.geomspace(0.0045, 2.6, 10)
OTHERS = ("mrdwt", "lsdt-clip", "lsdt-frame", "online", "dwt", "qbc")
SPEED_CLIP = CLIPS.index("135_02")
RATE = 120  # frames a second of these clips
SHORT = ((0.01, "0.1 mm"), (0.1, "1 mm"), (0.5, "5 mm"))
JOINT, SHELL = "mean_position_error_cm", "shell_mean_cm"
Curve = list[dict[str, float]]


def tables(data: Path, jobs: int) -> Iterator[Table]:
    """The sizes of posewave, those of README, and the speeds on one clip."""
    paths = clip_paths(data)
    with ProcessPoolExecutor(jobs) as pool:
        curves = list(pool.map(posewave_curve, paths))
        posewave = curves[SPEED_CLIP]
        sizes = {at: [size_at(curve, JOINT, at) for curve in curves] for at in ERRORS}
        rows = [_beside_acl(at, sum(own)) for at, own in sizes.items()]
        yield table(
            "lossy", ["mean distance", "ACL 2.1", "`posewave` (`lossy`)", "share of ACL"], rows
        )
        rows = [
            [f"{at:g} cm", share(sum(size_at(curve, SHELL, at) for curve in curves), "shell", at)]
            for at in ACL["errors_cm"]
        ]
        yield table("lossy-shell", ["mean shell error", "share of ACL"], rows)
        bounded = {at: list(pool.map(bounded_size, paths, [at] * len(paths))) for at, _ in SHORT}
        seconds = sum(map(seconds_of, paths))
        rows = [
            [
                name,
                f"**{sum(sizes[at]) / seconds:,.0f} bytes**",
                share(sum(sizes[at]), "joint", at) if at in ACL["errors_cm"] else "",
                f"{sum(bounded[at]) / seconds:,.0f} bytes",
            ]
            for at, name in SHORT
        ]
        head = ["error with `--codec lossy`", "size if this is the mean distance of joints"]
        yield table(
            "lossy-short",
            [*head, "share of ACL's bytes", "size if this is the greatest distance"],
            rows,
        )
    yield speeds(paths[SPEED_CLIP], posewave)


def tables_of_codecs(data: Path, jobs: int) -> Iterator[Table]:
    """Shares of ACL's bytes that the other lossy codecs take."""
    paths = clip_paths(data)
    rows = []
    with ProcessPoolExecutor(jobs) as pool:
        for codec in OTHERS:
            curves = list(pool.map(curve_of, paths, [codec] * len(paths)))
            totals = [sum(size_at(curve, JOINT, at) for curve in curves) for at in ACL["errors_cm"]]
            pairs = zip(totals, ACL["errors_cm"], strict=True)
            rows.append([f"`{codec}`", *(share(total, "joint", at) for total, at in pairs)])
    yield table("lossy-codecs", ["codec", *(f"{at:g} cm" for at in ACL["errors_cm"])], rows)


def clip_paths(data: Path) -> list[Path]:
    return [next((data / "cmu" / "amc").rglob(f"{clip}.amc")) for clip in CLIPS]


def posewave_curve(path: Path) -> Curve:
    """Bytes and errors of a clip at the ten steps."""
    return [measure(Case(str(path)), Variant("posewave"), {"step": step}) for step in STEPS]


def curve_of(path: Path, codec: str) -> Curve:
    """Bytes and errors of a clip at ten settings of the codec's dial."""
    return sweep(Case(str(path)), Variant(codec))


def bounded_size(path: Path, most: float) -> int:
    """Bytes with a bound on the greatest distance, in cm."""
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder, "bounded.mcz")
        mcz.encode(path, target, codec="posewave", params={"max_error_cm": most})
        with mcz.open(target) as file:
            sizes = clip_sizes(file.container, file.only_clip())
    return sizes.payload + sizes.overhead + sizes.models


def size_at(curve: Curve, key: str, error: float) -> float:
    """Bytes at this error; of the nearest setting, where the error is beyond the curve."""
    points = sorted((point[key], point["coded_bytes"]) for point in curve if point[key] > 0)
    errors, sizes = np.log(np.array(points)).T
    return float(np.exp(np.interp(np.log(error), errors, sizes)))


def share(total: float, metric: str, error: float) -> str:
    """Share of ACL's bytes at an error, of all clips."""
    at = ACL["errors_cm"].index(error)
    return f"{100 * total / sum(sizes[at] for sizes in ACL[metric].values()):.1f} %"


def _beside_acl(error: float, total: float) -> list[str]:
    if error not in ACL["errors_cm"]:
        return [f"{error:g} cm", "", f"{total:,.0f}", ""]
    at = ACL["errors_cm"].index(error)
    theirs = sum(sizes[at] for sizes in ACL["joint"].values())
    return [f"{error:g} cm", f"{theirs:,.0f}", f"{total:,.0f}", share(total, "joint", error)]


def seconds_of(path: Path) -> float:
    return mcz.read(path).n_frames / RATE


def speeds(path: Path, curve: Curve) -> Table:
    """Thousand frames a second of CPU time, at steps that give these mean distances."""
    motion, rows = mcz.read(path), list[list[str]]()
    errors = np.log([point[JOINT] for point in curve])
    for error in (0.01, 0.05, 0.2):
        step = float(np.exp(np.interp(np.log(error), errors, np.log(STEPS))))
        start = process_time()
        packed = write_file(motion, "posewave", {"step": step})
        encoded = process_time() - start
        decoded = cpu_seconds(partial(read_values, packed))
        rates = [motion.n_frames / seconds / 1e3 for seconds in (encoded, decoded)]
        rows.append([f"{error:g} cm", *(f"{rate:.1f}" for rate in rates)])
    head = ["`posewave`, mean distance", "encode, fixed step", "decode, from opening the file"]
    return table("lossy-speed", head, rows)
