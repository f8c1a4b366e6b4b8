"""Rates and errors of the online codec as Kwak and Bajic measure them, at one setting or many.

Rates are kilobits of payload a second: the bytes of units. Framing is what else is in the streams:
the head of every unit, and its size. Errors are those of what decodes, with and without the post
filter.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

import mcz
from mcz.bench.cases import LoadedCase, Variant, load
from mcz.bench.measure import Record, codec_calls, cpu_seconds, dial_of, write_file
from mcz.codecs import codec_by_name
from mcz.codecs.contract import Encoded, Layout, Request, Segment, Span, model_finder
from mcz.codecs.online.units import Unit, parse_units
from mcz.codecs.space_choices import live_sample
from mcz.container.limits import BASE
from mcz.files.reading.sizes import clip_sizes
from mcz.files.writing.planning import prepare
from mcz.files.writing.signal_source import MemorySource
from mcz.model.motion import Motion
from tools.papers.curves import POINT_BYTES, live_seconds, point_of, walk
from tools.papers.kwak.clips import Clip, motion_in_positions, source_of

Floats = NDArray[np.float64]
Params = tuple[tuple[str, Any], ...]

NAME = "online"
CLOSE = 0.002  # of a rate that a step is searched for
MOST_TRIES = 16
STEP_CM = 2.0  # to begin with
OCTAVES = 2.0  # of a step where one side of a rate is not known yet


@dataclass(frozen=True, slots=True)
class Coded:
    """Result of coding a motion of markers: values, units, bytes of streams."""

    values: Floats
    units: list[Unit]
    stream_bytes: int
    encoded: Encoded
    layout: Layout  # with the models


def code(motion: Motion, options: Mapping[str, Any]) -> Coded:
    """Encode and decode a motion of markers by the codec alone; raises MotionError, OptionError."""
    codec = codec_by_name(NAME)
    source = MemorySource(motion, 0, codec, BASE.segment_bytes)
    encoded = codec.encode(source, codec.options(options))
    segments: list[Segment] = list(encoded.segments)
    layout = replace(
        source.layout, find_model=model_finder((*encoded.models, *encoded.known_models))
    )
    spans = [Span(s.first, s.n_frames, 0, 0, s.fresh) for s in segments]
    request = Request(0, motion.n_frames, (0,))

    def fetch(segment: int, resolution: int, group: int) -> bytes:
        return segments[segment].streams[0]

    values = codec.decode(encoded.header, layout, spans, request, fetch)
    units = [u for s in segments for u in parse_units(NAME, s.streams[0], s.n_frames)]
    size = sum(len(s.streams[0]) for s in segments)
    return Coded(np.asarray(values, np.float64), units, size, encoded, layout)


def errors(motion: Motion, values: Floats) -> tuple[float, float]:
    """SQNR in dB, eq. 24, and mean error in cm, eq. 25, of places that are valid."""
    signal = motion.signals[0]
    known = np.ones(signal.values.shape, np.bool_) if signal.mask is None else signal.mask
    source = np.where(known, signal.values, 0.0)
    apart = np.where(known, np.nan_to_num(values) - source, 0.0)
    noise = float((apart**2).sum())
    sqnr = 10 * math.log10(float((source**2).sum()) / noise) if noise else math.inf
    points = known.reshape(len(known), -1, 3).all(axis=2)
    distances = np.sqrt((apart.reshape(len(apart), -1, 3) ** 2).sum(axis=2))[points]
    return sqnr, float(distances.mean()) * (motion.skeleton.unit_cm or 1.0)


def post_filter_values(motion: Motion, values: Floats) -> Floats:
    """Values after the reader's post filter."""
    signal = motion.signals[0]
    decoded = replace(motion, signals=(replace(signal, values=values),))
    return np.asarray(mcz.post_filter(decoded).values, np.float64)


def rate_point(motion: Motion, options: Mapping[str, Any]) -> Record:
    """Rate, deviation and errors at one setting; raises MotionError, OptionError."""
    found = code(motion, options)
    sizes = group_bytes(found.units, int(codec_by_name(NAME).options(options)["gof"]))
    per_second = float(motion.frame_rate or 1) / motion.n_frames * 8 / 1000
    payload = sum(len(unit.data) for unit in found.units)
    sqnr, cm = errors(motion, found.values)
    sqnr_filtered, cm_filtered = errors(motion, post_filter_values(motion, found.values))
    return {
        "setting": options.get("bitrate", options.get("step")),
        "kbps": payload * per_second,
        "framed_kbps": found.stream_bytes * per_second,
        "model_kbps": sum(len(model.data) for model in found.encoded.models) * per_second,
        "deviation": float(np.std(sizes)) if sizes else None,
        "groups": sizes,
        "sqnr": sqnr,
        "cm": cm,
        "sqnr_filtered": sqnr_filtered,
        "cm_filtered": cm_filtered,
    }


@lru_cache(maxsize=64)
def live_basis(clip: Clip) -> str:
    """The basis that an encoder has who works live: a well-known one, or cosines.

    One who has the whole clip may learn another from it, which no online codec can.
    """
    source = MemorySource(motion_in_positions(clip), 0, codec_by_name(NAME), BASE.segment_bytes)
    return live_sample(NAME, source.layout, "auto")[1]


def group_bytes(units: Sequence[Unit], gof: int) -> list[int]:
    """Payload bytes of every whole group of frames."""
    sizes: list[list[int]] = []
    for unit in units:
        if unit.kind:
            sizes.append([0, 0])
        sizes[-1][0] += len(unit.data)
        sizes[-1][1] += unit.n_frames
    return [size for size, n_frames in sizes if n_frames == gof]


def rates(clip: Clip, params: Params, targets: Sequence[float]) -> list[Record]:
    """A point for every rate in kbps: asked for, or where none is controlled searched for."""
    motion = motion_in_positions(clip)
    given = dict(params)
    if is_controlled(given):
        points = [rate_point(motion, given | {"bitrate": target}) for target in targets]
    else:
        start = STEP_CM / (motion.skeleton.unit_cm or 1.0)
        points = search_rates(lambda s: rate_point(motion, given | {"step": s}), start, targets)
    return [p | {"target": target} for p, target in zip(points, targets, strict=True)]


def is_controlled(params: Mapping[str, Any]) -> bool:
    mode = params.get("rate_control", params.get("preset", "default"))
    return mode not in ("mod", "default")


def search_rates(
    measure: Callable[[float], Record], start: float, targets: Sequence[float]
) -> list[Record]:
    """For every rate in kbps what is measured at the setting that comes nearest; more is less."""
    seen = {math.log2(start): measure(start)}
    for target in targets:
        for number in range(MOST_TRIES):
            if min(_off(point, target) for point in seen.values()) <= math.log(1 + CLOSE):
                break
            x = _between(seen, target, halve=number % 3 == 2)
            if x in seen:
                break
            seen[x] = measure(2.0**x)
    return [min(seen.values(), key=lambda p: _off(p, target)) for target in targets]


def _off(point: Record, target: float) -> float:
    return abs(math.log(max(point["kbps"], 1e-9) / target))


def _between(seen: Mapping[float, Record], target: float, *, halve: bool) -> float:
    """Next setting to try, as log2."""
    above = [x for x, point in seen.items() if point["kbps"] >= target]
    below = [x for x, point in seen.items() if point["kbps"] < target]
    if not below:
        return max(above) + OCTAVES
    if not above:
        return min(below) - OCTAVES
    a, b = max(above), min(below)
    if halve or a >= b:
        return (a + b) / 2
    high, low = seen[a]["kbps"], max(seen[b]["kbps"], 1e-9)
    part = math.log(high / target) / math.log(high / low) if high > low else 0.5
    return a + min(max(part, 0.05), 0.95) * (b - a)


# Whole files


def file_points(
    clip: Clip, variant: Variant, with_filter: bool = False, wanted: Sequence[float] = ()
) -> list[Record]:
    """Mean error in cm against bytes of a file: at ``wanted`` rates, or along the codec's dial."""
    motion = source_of(clip)
    given = variant.options()
    if wanted:
        points = [_file_point(motion, given | {"bitrate": rate}, with_filter) for rate in wanted]
        return sorted(points, key=lambda p: -p["coded_bytes"])
    dial, settings = dial_of(variant)
    loaded = LoadedCase(motion, b"", load(clip.case).digest)

    def measure(setting: float) -> Record:
        return point_of(loaded, variant, {dial.parameter: settings.to_parameter(setting)})

    in_places = codec_by_name(variant.codec).positions
    start = STEP_CM / (motion.skeleton.unit_cm or 1.0) / 4 if in_places else 1.0
    return walk(measure, settings.snap(start), settings.snap)


def _file_point(motion: Motion, options: Mapping[str, Any], with_filter: bool) -> Record:
    data = write_file(motion, NAME, options)
    with mcz.open(data, max_decoded=2**53) as file:
        clip = file.only_clip()
        sizes, decoded = clip_sizes(file.container, clip), clip.motion()
    decoded = mcz.post_filter(decoded) if with_filter else decoded
    comparison = mcz.compare(motion, decoded, virtual_markers=False, shell_cm=None)
    coded = sizes.payload + sizes.overhead + sizes.models
    plain = POINT_BYTES * (comparison.points or 0) * motion.n_frames
    cm, ratio = comparison.mean_position_error_cm, plain / coded
    return {"cm": cm, "coded_bytes": coded, "setting": options["bitrate"], "cr": ratio}


# Speed


def speeds(clip: Clip, variants: Sequence[tuple[Variant, Params]]) -> list[Record]:
    """Frames a second of CPU time in one run, by the codec alone; a live row beside each."""
    motion = source_of(clip)
    rows = []
    for variant, more in variants:
        params = variant.options(dict(more))
        codec = codec_by_name(variant.codec)
        encode, decode = codec_calls(motion, variant.codec, params)
        seconds = {"encode": cpu_seconds(encode), "decode": cpu_seconds(decode)}
        row = {"label": variant.label, "settings": dict(more), "live": False}
        rows.append(row | _per_second(motion, seconds))
        if codec.live is not None:
            options = codec.options(params)
            seconds = live_seconds(prepare(motion, codec, params).motion, codec, options)
            rows.append(row | {"live": True} | _per_second(motion, seconds))
    rows.append(_filter_speed(motion_in_positions(clip)))
    return rows


def _per_second(motion: Motion, seconds: Mapping[str, float]) -> Record:
    return {f"{name}_fps": motion.n_frames / took for name, took in seconds.items()}


def _filter_speed(motion: Motion) -> Record:
    values = np.asarray(motion.values, np.float64)
    seconds = cpu_seconds(lambda: post_filter_values(motion, values))
    row = {"label": "post filter", "settings": {}, "live": False, "encode_fps": None}
    return row | {"decode_fps": motion.n_frames / seconds}
