"""Measurements of a clip, a codec and a setting; settings with evenly spaced sizes."""

from __future__ import annotations

import math
import time
import tracemalloc
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import mcz
from mcz.bench.cases import Case, Variant, load
from mcz.codecs import codec_by_name
from mcz.codecs.contract import Encoded, Request, Segment, Span, model_finder
from mcz.codecs.parameters import Dial
from mcz.container.limits import BASE
from mcz.errors import MczError, MotionError, OptionError
from mcz.files.reading.sizes import clip_ratios, clip_sizes
from mcz.files.writing.clip_writer import write_trial
from mcz.files.writing.planning import prepare
from mcz.files.writing.signal_source import MemorySource
from mcz.kinematics.metrics.figures import NO_CONTACTS
from mcz.kinematics.points import SHELL_CM
from mcz.model.motion import Motion
from mcz.model.types import JsonObject, Params

Record = JsonObject

LEAST_SECONDS = 0.25  # runs are repeated for this much CPU time; the fastest counts
MOST_RUNS = 50
OMITTED = {"frames", "channels", "point_set", "points", "max_position_error_point"}
OMITTED |= {"shell_radius_cm", "shell_max_joint", *NO_CONTACTS}


def coded_part(motion: Motion, codec: str) -> Motion:
    """All of the clip for a lossless codec, only the motion for a lossy one."""
    return motion if codec_by_name(codec).lossless else replace(motion, signals=motion.signals[:1])


def write_file(motion: Motion, codec: str, params: Params) -> bytes:
    """An MCZ file of one clip, without its quality record, which is not part of the codec."""
    chosen = codec_by_name(codec)
    return write_trial(prepare(motion, chosen, params), chosen, params, BASE).data


def coded_bytes(case: Case, variant: Variant, params: Params) -> int:
    """Bytes of payload, overhead and models, as docs/reference/measures.md defines them."""
    motion = coded_part(load(case).motion, variant.codec)
    data = write_file(motion, variant.codec, variant.options(params))
    with mcz.open(data, max_decoded=2**53) as file:
        sizes = clip_sizes(file.container, file.only_clip())
    return sizes.payload + sizes.overhead + sizes.models


def measure(case: Case, variant: Variant, params: Params, *, markers: bool = True) -> Record:
    """Sizes and errors of a clip at one setting, from the public reader."""
    whole = load(case).motion
    motion = coded_part(whole, variant.codec)
    data = write_file(motion, variant.codec, variant.options(params))
    with mcz.open(data, max_decoded=2**53) as file:
        clip = file.only_clip()
        sizes, ratios = clip_sizes(file.container, clip), clip_ratios(file, clip)
        radius = SHELL_CM if markers else None
        figures = mcz.compare(motion, clip.motion(), virtual_markers=markers, shell_cm=radius)
    coded = sizes.payload + sizes.overhead + sizes.models
    if not codec_by_name(variant.codec).lossless:
        ratios = _ratios(motion, len(load(case).data), coded)
    ratios.pop("cr_file", None)
    if len(motion.signals) < len(whole.signals):
        ratios["cr_source"] = None  # the source also holds signals that are not coded here
    entries = {k: v for k, v in figures.entries().items() if k not in OMITTED}
    return {
        "params": dict(params),
        "coded_bytes": coded,
        "payload_bytes": sizes.payload,
        **ratios,
        **{k: v for k, v in entries.items() if not k.startswith("signal.")},
    }


def _ratios(motion: Motion, source_bytes: int, coded: int) -> dict[str, float | None]:
    """Compression ratios, whose numerators do not depend on the codec."""
    per_joint = 40 * motion.n_frames * motion.skeleton.n_joints
    numerators = (source_bytes, 4 * motion.signals[0].values.size, per_joint)
    names = ("cr_source", "cr_float32", "cr_40B")
    return {name: n / coded if n else None for name, n in zip(names, numerators, strict=True)}


def cpu_seconds(work: Callable[[], object]) -> float:
    """CPU time of the fastest of several runs, after a first one that compiles."""
    work()
    spent, best = 0.0, float("inf")
    for _ in range(MOST_RUNS):
        start = time.process_time()
        work()
        took = time.process_time() - start
        best, spent = min(best, took), spent + took
        if spent >= LEAST_SECONDS:
            break
    return max(best, 1e-9)


def peak_bytes(work: Callable[[], object]) -> int:
    """The most memory that Python and numpy held during a call, above what they held before."""
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def speeds(case: Case, variant: Variant, params: Params) -> Record:
    """Frames a second, warm: the codec alone, writing and reading a file, parsing text.

    Peak memory is the codec's own, without the values themselves.
    """
    loaded = load(case)
    motion = coded_part(loaded.motion, variant.codec)
    to_parameter = variant.options(params)
    encode, decode = codec_calls(motion, variant.codec, to_parameter)

    def read() -> object:
        with mcz.open(data, max_decoded=2**53) as file:
            return file.only_clip().read()

    data = write_file(motion, variant.codec, to_parameter)
    seconds = {
        "parse": cpu_seconds(lambda: mcz.read(case.path, unit=case.unit)),
        "encode": cpu_seconds(encode),
        "decode": cpu_seconds(decode),
        "write": cpu_seconds(lambda: write_file(motion, variant.codec, to_parameter)),
        "read": cpu_seconds(read),
    }
    fps = {f"{name}_fps": motion.n_frames / took for name, took in seconds.items()}
    ratios = {
        f"{name}_to_parse": seconds["parse"] / took
        for name, took in seconds.items()
        if name != "parse"
    }
    memory = {"encode_peak_bytes": peak_bytes(encode), "decode_peak_bytes": peak_bytes(decode)}
    return {"params": dict(params), **fps, **ratios, **memory}


def codec_calls(
    motion: Motion, name: str, params: Params
) -> tuple[Callable[[], object], Callable[[], object]]:
    """Functions that encode and decode the stored values by the codec alone."""
    codec = codec_by_name(name)
    options = codec.options(params)
    stored_motion = prepare(motion, codec, params).motion

    def encode() -> tuple[Encoded, list[Segment]]:
        source = MemorySource(stored_motion, 0, codec, BASE.segment_bytes, options)
        encoded = codec.encode(source, options)
        return encoded, list(encoded.segments)

    encoded, segments = encode()
    find_model = model_finder((*encoded.models, *encoded.known_models))

    def decode() -> None:
        layout = MemorySource(stored_motion, 0, codec, BASE.segment_bytes, options).layout
        layout = replace(layout, n_resolutions=encoded.n_resolutions, find_model=find_model)
        spans = [Span(s.first, s.n_frames, s.lead, s.tail, s.fresh) for s in segments]
        n = len(layout.groups)
        exact = codec.exact(encoded.header, layout) if codec.exact else ()
        for groups in filter(None, (set(range(n)) - set(exact), exact)):
            request = Request(0, layout.n_frames, tuple(sorted(groups)))
            codec.decode(
                encoded.header,
                layout,
                spans,
                request,
                lambda s, r, g: segments[s].streams[r * n + g],
            )

    return encode, decode


FINEST, COARSEST = 6, 150  # cr_float32 at the ends of a ladder, within the range of the codec
N_POINTS = 10
GROWTH = 4.0  # from one setting to the next in the search for the ends
# smallest relative change of size, and steps below it until the dial counts as ended
FLAT, MOST_FLAT = 0.004, 6
CLEAR = 0.1  # a step that shows the direction of sizes
MOST_TRIALS = 24

Known = dict[float, float]  # setting -> figure


class DialRange:
    """The range of a dial: whole numbers only for a parameter of integers."""

    def __init__(self, dial: Dial) -> None:
        self.low, self.high, self.whole = dial.low, dial.high, dial.is_integer

    def snap(self, setting: float) -> float:
        rounded = round(setting) if self.whole else float(f"{setting:.6g}")
        return float(min(max(rounded, self.low), self.high))

    def to_parameter(self, setting: float) -> float | int:
        return int(setting) if self.whole else setting


def dial_of(variant: Variant) -> tuple[Dial, DialRange]:
    """The dial of a variant's codec, and its settings; OptionError if it has none."""
    codec = codec_by_name(variant.codec)
    if codec.dial is None:
        raise OptionError(f"codec {variant.codec} has no parameter that varies its rate")
    return codec.dial, DialRange(codec.dial)


def sweep(case: Case, variant: Variant, n_points: int = N_POINTS) -> list[Record]:
    """Points of about evenly spaced sizes from fine to coarse; one point without a dial."""
    if codec_by_name(variant.codec).dial is None:
        return [measure(case, variant, {})]
    dial, settings = dial_of(variant)
    signal = load(case).motion.signals[0]
    plain = 4.0 * max(1, signal.values.size)

    def size(setting: float) -> float:
        return coded_bytes(case, variant, {dial.parameter: settings.to_parameter(setting)})

    points = ladder(size, settings, (plain / FINEST, plain / COARSEST), n_points)
    return [measure(case, variant, {dial.parameter: settings.to_parameter(s)}) for s in points]


def ladder(
    size: Callable[[float], float], settings: DialRange, window: tuple[float, float], n_points: int
) -> list[float]:
    """About ``n_points`` settings whose sizes are evenly spaced in logarithms, fine to coarse.

    Sizes lie in ``window``, the greatest first, within the range of the dial. The direction of the
    dial is measured.
    """
    big, small = window
    known = _explore(size, settings, big, small)
    for _ in range(MOST_TRIALS):
        gap, middle = _widest_step(known, settings, big, small)
        if gap <= math.log(big / small) / n_points or middle is None:
            break
        try:
            known[middle] = size(middle)
        except MotionError:  # too fine for this clip
            break
    high, low = min(big, max(known.values())), max(small, min(known.values()))
    if high <= low:
        return sorted(known)[:1]
    steps = [(high / low) ** (i / max(1, n_points - 1)) for i in range(n_points)]
    order = sorted({settings.snap(_setting_at(known, low * step)) for step in steps})
    return order if _is_falling(known) else order[::-1]


def _explore(
    size: Callable[[float], float], settings: DialRange, big: float, small: float
) -> Known:
    """Sizes from a setting in the middle outwards, until they are beyond ``small`` and ``big``."""
    start = settings.snap(1.0)
    known = {start: size(start)}
    for factor in (GROWTH, 1 / GROWTH):
        setting, flat = start, 0
        for _ in range(MOST_TRIALS):
            before, moved = known[setting], settings.snap(setting * factor)
            if moved in known or flat == MOST_FLAT:
                break
            try:
                known[moved] = size(moved)
            except MczError:  # beyond the range of the codec
                break
            change = math.log(known[moved] / before)
            flat = flat + 1 if abs(change) < FLAT else 0
            is_beyond = known[moved] > big if change > 0 else known[moved] < small
            setting = moved
            if is_beyond and abs(change) > CLEAR:  # less may be a whim of the encoder
                break
    return known


def _is_falling(known: Known) -> bool:
    order = sorted(known)
    return known[order[0]] >= known[order[-1]]


def _widest_step(
    known: Known, settings: DialRange, big: float, small: float
) -> tuple[float, float | None]:
    """The widest step of sizes between neighboring settings, in logarithms, and its middle."""
    best: tuple[float, float | None] = (0.0, None)
    for a, b in pairwise(sorted(known)):
        middle = settings.snap(math.sqrt(a * b))
        if middle in known:
            continue
        logs = [math.log(min(max(known[s], small), big)) for s in (a, b)]
        if (step := abs(logs[0] - logs[1])) > best[0]:
            best = step, middle
    return best


def _setting_at(known: Known, figure: float) -> float:
    for a, b in pairwise(sorted(known)):
        left, right = known[a], known[b]
        if min(left, right) <= figure <= max(left, right):
            if left == right:
                return a
            share = math.log(figure / left) / math.log(right / left)
            return math.exp(math.log(a) + share * math.log(b / a))
    return min(known, key=lambda s: abs(known[s] - figure))
