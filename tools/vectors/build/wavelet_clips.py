"""Clips of ``mrdwt``, to order: coefficients, heads and headers that no encoder chooses.

Coefficients are integers that are written out or counted, so the bytes do not depend on a machine's
arithmetic; values are those of the decoder.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcz.codecs import raw
from mcz.codecs.coding import mixing
from mcz.codecs.coding.streams import start_states
from mcz.codecs.contract import Codec, Encoded, Layout, Request, Segment, Span
from mcz.codecs.parameters import SCALED
from mcz.codecs.transforms import wavelets
from mcz.codecs.transforms.wavelets import Wavelet, by_id
from mcz.codecs.wavelet import streams
from mcz.codecs.wavelet.threshold_codecs import MRDWT
from mcz.model.motion import Motion
from mcz.model.schema import varint
from tools.vectors.build.files import file_of, partial

HEADING = "Codec 16: wavelet"
HAAR, DB2, DB3, DB8, BIOR = 1, 2, 3, 8, 10  # ids
UNEXAMINED = 2**16  # bytes, more than any crafted stream has
Ints = NDArray[np.int64]
Band = Sequence[int]


@dataclass(frozen=True, slots=True)
class Head:
    """Head of the stream of an approximation; ``halves`` 63: all are equal."""

    step: int = 128
    predictor: int = 1
    halves: int = 12


@dataclass(frozen=True, slots=True)
class Wave:
    """One channel: all integers of its bands, the approximation first, then from the coarsest on.

    ``heads``: segment by segment, the last for all further ones. ``spoken``: bands whose zeros are
    written with bits, or with a head.
    """

    bands: Sequence[Band]
    heads: tuple[Head, ...] = (Head(),)
    spoken: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class Plan:
    """Header and segments of a signal. ``wavelet``: an id, or filters for the header.

    ``ends``: the segments' but the last one's; ``coded``: coded_frames, where these are more.
    """

    n_frames: int
    wavelet: int | Wavelet = BIOR
    levels: int = 2
    decimals: int = 2
    unit: float = 1.0
    least: int = 1
    ends: tuple[int, ...] = ()
    coded: int | None = None
    n_resolutions: int | None = None

    @property
    def filters(self) -> Wavelet:
        return by_id(self.wavelet) if isinstance(self.wavelet, int) else self.wavelet

    @property
    def lengths(self) -> list[int]:
        return self.filters.lengths(self.coded_frames, self.levels)

    @property
    def coded_frames(self) -> int:
        return self.n_frames if self.coded is None else self.coded

    @property
    def resolutions(self) -> int:
        return self.levels + 1 if self.n_resolutions is None else self.n_resolutions

    @property
    def coding(self) -> streams.Coding:
        shift = (self.filters.n_taps - 2) // 2
        return streams.Coding("mrdwt", self.decimals == SCALED, self.least, shift)

    def level(self, band: int) -> int:
        return self.levels + 1 - band if band else self.levels


def header(plan: Plan, **parts: bytes) -> bytes:
    """The header, field by field; ``parts`` are said in place of what the plan says."""
    inline = isinstance(plan.wavelet, Wavelet)
    fields = {
        "wavelet": b"\0" if isinstance(plan.wavelet, Wavelet) else bytes((plan.wavelet,)),
        "lo": build_taps(plan.filters.lo) if inline else b"",
        "hi": build_taps(plan.filters.hi) if inline else b"",
        "levels": bytes((plan.levels,)),
        "coded_frames": varint(plan.coded_frames),
        "decimals": bytes((plan.decimals,)),
        "unit": struct.pack("<d", plan.unit) if plan.decimals == SCALED else b"",
        "least": varint(plan.least),
    }
    return b"".join((fields | parts).values())


def build_taps(taps: Sequence[float]) -> bytes:
    return varint(len(taps)) + struct.pack(f"<{len(taps)}d", *taps)


def details(plan: Plan, count: int, seed: int) -> list[int]:
    """A third of them are not zero, their sizes from ``least`` on."""
    found = []
    for k in range(count):
        r = (k * k * 29 + 7 * k + 13 * seed) % 31
        found.append(0 if r % 3 else (plan.least + r) * (-1) ** (r // 2))
    return found


def zeros(plan: Plan, **changes: Any) -> Wave:
    """A channel of zeros; ``changes``: bands by name (a: the approximation; d1: the finest)."""
    bands: list[Band] = [[0] * plan.lengths[plan.level(band)] for band in range(plan.levels + 1)]
    for name in [name for name in changes if name[0] in "ad" and name != "spoken"]:
        place = 0 if name == "a" else plan.levels + 1 - int(name[1:])
        assert len(changes[name]) == len(bands[place]), (name, len(bands[place]))
        bands[place] = changes.pop(name)
    return Wave(bands, **changes)


# Streams


def _segments(plan: Plan, channels: Sequence[Wave]) -> list[Segment]:
    made: list[Segment] = []
    first = 0
    for stop in (*plan.ends, *([plan.n_frames] if plan.n_frames else [])):
        own = [
            slice(*wavelets.own_range(first, stop, plan.level(band), plan.lengths))
            for band in range(plan.resolutions)
        ]
        by_channel = []
        for channel in channels:
            cut = [channel.bands[band][part] for band, part in enumerate(own)]
            head = channel.heads[min(len(made), len(channel.heads) - 1)]
            by_channel.append(_streams(plan, cut, head, channel.spoken))
        found = tuple(one[band] for band in range(plan.resolutions) for one in by_channel)
        lead = min(first, plan.filters.lead(plan.levels))
        made.append(Segment(first, stop - first, found, lead))
        first = stop
    return made


def _streams(plan: Plan, bands: Sequence[Band], head: Head, spoken: Sequence[int]) -> list[bytes]:
    silent = not any(any(band) for band in (bands if plan.decimals == SCALED else bands[:1]))
    made = [b"" if silent and 0 not in spoken else approximation(plan, bands[0], head)]
    for place, band in enumerate(bands[1:], 1):
        silent = not any(band) and place not in spoken
        made.append(b"" if silent else detail(plan, bands, place))
    return made


def approximation(plan: Plan, band: Band, head: Head, *, faulty: bool = False) -> bytes:
    """The stream of an approximation; ``faulty``: its last coefficient has no code."""
    data = bytes((head.predictor << 6 | head.halves,))
    data += bytes((head.step,)) if plan.decimals == SCALED else b""
    data += varint(2 * band[0] if band[0] >= 0 else -2 * band[0] - 1)
    if head.halves == streams.CONSTANT:
        return data
    scale = streams.scale_of(head.halves)

    def loop(state: Ints, out: NDArray[np.uint8]) -> int:
        values = np.array(band, np.int64)
        fault = streams.code_approximations(state, out, values, len(band), head.predictor, scale)
        return int(fault)

    return data + _bits(0, loop, faulty=faulty)


def detail(plan: Plan, bands: Sequence[Band], place: int, *, faulty: bool = False) -> bytes:
    """The stream of the detail ``bands[place]`` beside the band before it."""
    coarser = np.array(bands[place - 1], np.int64)
    if place == 1:
        beside = streams._activity(coarser, len(coarser))
    else:
        beside = streams._magnitudes(coarser, plan.coding)
    shift = plan.coding.shift

    def loop(state: Ints, out: NDArray[np.uint8]) -> int:
        values = np.array(bands[place], np.int64)
        fault = streams.code_details(state, out, values, len(values), beside, shift, plan.least)
        return int(fault)

    return _bits(min(place, streams.N_SETS - 1), loop, faulty=faulty)


def _bits(number: int, loop: Callable[..., int], *, faulty: bool) -> bytes:
    data, state = np.zeros(UNEXAMINED, np.uint8), start_states("wavelet")[number].copy()
    mixing.start(state, data, 1)
    assert (loop(state, data) >= 0) == faulty
    return data[: mixing.finish(state, data)].tobytes()


# Files


def codec_of(plan: Plan, channels: Sequence[Wave]) -> Codec:
    """Codec mrdwt with this content, whatever the values of the motion."""

    def encode(source: Any, params: Any) -> Encoded:
        return Encoded(header(plan), iter(_segments(plan, channels)), plan.resolutions)

    parameters = raw.CODEC.parameters
    return replace(MRDWT, encode=encode, parameters=parameters, dial=None)


def values_of(plan: Plan, channels: Sequence[Wave], resolution: int = 0) -> NDArray[np.float64]:
    """The values of all frames."""
    made, n = _segments(plan, channels), len(channels)
    groups = tuple((channel,) for channel in range(n))
    layout = Layout(plan.n_frames, groups, n_resolutions=plan.resolutions)
    spans = [Span(s.first, s.n_frames, s.lead) for s in made]
    request = Request(0, plan.n_frames, tuple(range(n)), resolution)

    def fetch(segment: int, band: int, group: int) -> bytes:
        return made[segment].streams[band * n + group]

    values: NDArray[np.float64] = MRDWT.decode(header(plan), layout, spans, request, fetch)
    return values


def file_with(plan: Plan, channels: Sequence[Wave], motion: Motion, **edits: Any) -> bytes:
    grouping = edits.pop("grouping", "channel")
    return file_of(motion, codec=codec_of(plan, channels), grouping=grouping, **edits)


def request(
    plan: Plan,
    channels: Sequence[Wave],
    motion: Motion,
    resolution: int,
    frames: tuple[int, int],
    joints: Sequence[int] | None,
) -> Any:
    """Arguments and arrays of a partial read without the ``resolution`` finest details."""
    first = replace(motion.signals[0], values=values_of(plan, channels, resolution))
    coarse = replace(motion, signals=(first, *motion.signals[1:]))
    arguments, arrays = partial(coarse, frames, joints)
    return (*arguments, "--resolution", str(resolution)), arrays
