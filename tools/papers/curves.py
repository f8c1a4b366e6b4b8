"""Position error against size along the dial of a codec, whatever domain the codec has.

Sizes and ratios are those of Hou 2016: 96 bits a point and frame, and the mean distance of points
in centimeters. A walk along the dial covers the errors of ``LOW`` to ``HIGH``.
"""

from __future__ import annotations

import base64
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import mcz
from mcz.bench.cases import Case, LoadedCase, Variant, load
from mcz.bench.measure import (
    LEAST_SECONDS,
    MOST_RUNS,
    Record,
    codec_calls,
    coded_part,
    cpu_seconds,
    dial_of,
    write_file,
)
from mcz.codecs import codec_by_name
from mcz.codecs.contract import Codec, model_finder
from mcz.codecs.training import Recipe, train
from mcz.container.limits import BASE
from mcz.errors import MczError, MotionError
from mcz.files.reading.sizes import clip_sizes
from mcz.files.writing.planning import prepare
from mcz.files.writing.signal_source import MemorySource

LOW, HIGH = 0.09, 2.3  # cm
RATIO = 1.7  # from one error to the next
SLOPE = 0.8  # of the error against the setting, in logarithms, before it is known
SLOPES = (0.25, 2.0)  # what a step trusts
MOST_STEP = 16.0  # of a setting
MOST_POINTS = 10  # each way
POINT_BYTES = 12  # a point and frame: three numbers of 32 bits
START_CM = 0.5  # a step in places to begin with

Clips = tuple[tuple[str, str | None, str], ...]  # path, unit, digest


def references(cases: Sequence[Case]) -> Clips:
    """Clips as a task names them beside its own, with what their figures depend on."""
    return tuple((case.path, case.unit, _digest(case)) for case in cases)


@cache
def _digest(case: Case) -> str:
    return load(case).digest


def reference_cases(clips: Sequence[Sequence[Any]]) -> list[Case]:
    return [Case(path, unit) for path, unit, _ in clips]


def bases(clips: Clips, recipe: Sequence[tuple[str, Any]]) -> Record:
    """Bases that are learned from the clips: their data as text, and what is said of them."""
    trained = train((load(case).motion for case in reference_cases(clips)), Recipe(**dict(recipe)))
    document = trained.document()
    return {"data": base64.b64encode(trained.data).decode(), "document": document}


def point_of(loaded: LoadedCase, variant: Variant, params: Mapping[str, Any]) -> Record:
    """Bytes and mean distance in cm at one setting, by the public reader.

    Raises MotionError where the length unit is unknown.
    """
    motion = coded_part(loaded.motion, variant.codec)
    data = write_file(motion, variant.codec, variant.options(params))
    with mcz.open(data, max_decoded=2**53) as file:
        clip = file.only_clip()
        sizes = clip_sizes(file.container, clip)
        decoded = mcz.compare(motion, clip.motion(), virtual_markers=False, shell_cm=None)
    if decoded.mean_position_error_cm is None:
        raise MotionError(f"{motion.name}: {'; '.join(decoded.notes) or 'no figure in cm'}")
    coded, n_points = sizes.payload + sizes.overhead, decoded.points or 0
    plain = POINT_BYTES * n_points * motion.n_frames
    return {
        "setting": next(iter(params.values())),
        "cm": decoded.mean_position_error_cm,
        "coded_bytes": coded + sizes.models,
        "model_bytes": sizes.models,
        "cr": plain / (coded + sizes.models),
        "cr_without_models": plain / coded,
        "n_frames": motion.n_frames,
    }


def curve(case: Case, variant: Variant, data: str = "") -> list[Record]:
    """Points from the finest to the coarsest setting that ``LOW`` and ``HIGH`` need.

    ``data`` are bases that the codec is given in a file. Raises MotionError, OptionError.
    """
    loaded = load(case)
    dial, settings = dial_of(variant)
    with TemporaryDirectory() as folder:
        if data:
            path = Path(folder) / "bases"
            path.write_bytes(base64.b64decode(data))
            variant = replace(variant, params=(*variant.params, ("basis", str(path))))

        def measure(setting: float) -> Record:
            return point_of(loaded, variant, {dial.parameter: settings.to_parameter(setting)})

        return walk(measure, settings.snap(_start(loaded, variant)), settings.snap)


def _start(loaded: LoadedCase, variant: Variant) -> float:
    codec = codec_by_name(variant.codec)
    in_places = codec.positions and variant.options().get("domain") != "channels"
    return START_CM / (loaded.motion.skeleton.unit_cm or 1.0) if in_places else 1.0


def walk(
    measure: Callable[[float], Record], start: float, snap: Callable[[float], float]
) -> list[Record]:
    """Points of errors about ``RATIO`` apart, from a setting outwards; greater is coarser."""
    found = {start: measure(start)}
    for up in (False, True):
        setting, slope = start, SLOPE
        for _ in range(MOST_POINTS):
            error = max(found[setting]["cm"], 1e-9)
            wanted = max(error * RATIO, LOW) if up else min(error / RATIO, HIGH)
            if error >= HIGH if up else error <= LOW:
                break
            factor = min(MOST_STEP, max(wanted / error, error / wanted) ** (1 / slope))
            moved = snap(setting * factor if up else setting / factor)
            if moved in found:
                break
            try:
                found[moved] = measure(moved)
            except MczError:  # the codec goes no further
                break
            moved_by = abs(math.log(moved / setting))
            gained = abs(math.log(max(found[moved]["cm"], 1e-9) / error))
            slope = min(max(gained / moved_by, SLOPES[0]), SLOPES[1])
            setting = moved
    return [found[setting] for setting in sorted(found)]


def at(points: Sequence[Record], x: str, value: float, y: str) -> float | None:
    """The figure ``y`` where ``x`` is ``value``, on straight lines in logarithms; or None.

    Between points that no other matches in both error and size.
    """
    kept = [p for p in points if not any(_beats(other, p) for other in points)]
    pairs = sorted((p[x], p[y]) for p in kept if p[x] and p[y])
    if len(pairs) < 2 or not pairs[0][0] <= value <= pairs[-1][0]:
        return None
    xs, ys = np.log(np.array(pairs)).T
    return float(math.exp(np.interp(math.log(value), xs, ys)))


def _beats(a: Record, b: Record) -> bool:
    no_worse = a["cm"] <= b["cm"] and a["cr"] >= b["cr"]
    return bool(no_worse and (a["cm"] < b["cm"] or a["cr"] > b["cr"]))


def speeds_beside(case: Case, settings: Sequence[tuple[Variant, float]]) -> list[Record]:
    """Frames a second of CPU time of several codecs in one run, each at its setting.

    Of a codec that works frame by frame that way, too, as a row of its own.
    """
    motion = replace(load(case).motion, signals=load(case).motion.signals[:1])
    rows = []
    for variant, setting in settings:
        dial, given = dial_of(variant)
        params = variant.options({dial.parameter: given.to_parameter(setting)})
        encode, decode = codec_calls(motion, variant.codec, params)
        row = {"label": variant.label, "setting": setting, "live": False}
        seconds = {"encode": cpu_seconds(encode), "decode": cpu_seconds(decode)}
        rows.append(row | {f"{k}_fps": motion.n_frames / v for k, v in seconds.items()})
        codec = codec_by_name(variant.codec)
        if codec.live is not None and params.get("preset") is None:
            options = codec.options(params)
            seconds = live_seconds(prepare(motion, codec, params).motion, codec, options)
            live = row | {"live": True}
            rows.append(live | {f"{k}_fps": motion.n_frames / v for k, v in seconds.items()})
    return rows


def live_seconds(motion: Any, codec: Codec, options: Mapping[str, Any]) -> dict[str, float]:
    """CPU time of all frames, each pushed by itself: the fastest of several runs."""
    assert codec.live is not None and codec.follow is not None
    layout = MemorySource(motion, 0, codec, BASE.segment_bytes).layout
    values = np.ascontiguousarray(motion.signals[0].values)
    best = {"encode": math.inf, "decode": math.inf}
    spent = 0.0
    for run in range(MOST_RUNS):
        encoder = codec.live(replace(layout, n_frames=0), options)
        start = time.process_time()
        pushed = [encoder.push(row) for row in values]
        encoded = time.process_time()
        known = replace(layout, n_frames=0, find_model=model_finder(encoder.models))
        decoder = codec.follow(encoder.header, known)
        middle = time.process_time()
        for stream, fresh in pushed:
            decoder.push(stream, fresh)
        stop = time.process_time()
        if run:  # the first compiles
            best["encode"] = min(best["encode"], encoded - start)
            best["decode"] = min(best["decode"], stop - middle)
            spent += stop - start
        if spent >= LEAST_SECONDS:
            break
    return {name: max(seconds, 1e-9) for name, seconds in best.items()}
