"""A plain decoder of codec 2, mrdwt, written from SPEC.md alone and in its order.

Python integers and floats only, one value at a time: slow, small, and independent of the package,
whose fast decoder the tests compare with this one bit for bit.
"""

from __future__ import annotations

import hashlib
import json
import math
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

ANNEX = Path(__file__).parents[1] / "conformance" / "annex"
START_SHA256 = "045535af7b86d95dc8eaaa9b6e9a45a16cedd5cdbe76577f320c009f335acffd"


def refuse(what: str) -> ValueError:
    return ValueError(what)


# Conventions


class Bytes:
    """Fields read from bytes, front to back; refuses where they end too early."""

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.at = 0

    def take(self, n: int) -> bytes:
        if self.at + n > len(self.data):
            raise refuse(f"{n} bytes at {self.at} of {len(self.data)}")
        self.at += n
        return self.data[self.at - n : self.at]

    def u8(self) -> int:
        return self.take(1)[0]

    def binary64(self) -> float:
        return float(struct.unpack("<d", self.take(8))[0])

    def varint(self) -> int:
        value = shift = 0
        while True:
            byte = self.u8()
            value += (byte & 127) << shift
            if value > 2**53 - 1 or (byte == 0 and shift > 0):
                raise refuse(f"a varint that ends at {self.at}")
            if byte < 128:
                return value
            shift += 7

    def zigzag(self) -> int:
        value = self.varint()
        return -(value + 1) // 2 if value % 2 else value // 2

    def rest(self) -> bytes:
        return self.take(len(self.data) - self.at)


def bits(v: int) -> int:
    return v.bit_length()


def clamp(v: int, a: int, b: int) -> int:
    return max(a, min(v, b))


# Entropy coding: the range coder


class Coder:
    """The state low, high and code; ``shifted`` bytes were read beyond the first four."""

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.low, self.high = 0, 2**32 - 1
        self.code = int.from_bytes(data[:4].ljust(4, b"\0"), "big")
        self.shifted = 0

    def decode(self, one: int) -> int:
        w = self.high - self.low
        middle = self.low + (w // 65536) * one + (w % 65536) * one // 65536
        if self.code <= middle:
            bit, self.high = 1, middle
        else:
            bit, self.low = 0, middle + 1
        while self.low // 2**24 == self.high // 2**24:
            at = 4 + self.shifted
            byte = self.data[at] if at < len(self.data) else 0
            self.low = self.low * 256 % 2**32
            self.high = self.high * 256 % 2**32 + 255
            self.code = self.code * 256 % 2**32 + byte
            self.shifted += 1
        return bit

    def number(self, n: int) -> int:
        value = 0
        for _ in range(n):
            value = 2 * value + self.decode(32768)
        return value

    def finish(self) -> None:
        """Refuse data of another length than the bits take."""
        for t in range(5):
            step = 2 ** (32 - 8 * t)
            if self.high // step * step >= self.low:
                break
        if len(self.data) != self.shifted + t:
            raise refuse(f"{len(self.data)} bytes of bits that take {self.shifted + t}")


# Entropy coding: mixed bits

# fmt: off
NODES = (
    22, 36, 60, 98, 162, 267, 439, 720, 1179, 1921, 3108, 4971, 7812, 11955, 17625, 24743, 32768,
    40793, 47911, 53581, 57724, 60565, 62428, 63615, 64357, 64816, 65097, 65269, 65374, 65438,
    65476, 65500, 65514,
)
# fmt: on


def squash(x: int) -> int:
    i, v = divmod(x + 2048, 128)
    return (NODES[i] * (128 - v) + NODES[i + 1] * v + 64) // 128


def _stretch_table() -> list[int]:
    table, x = [], -2047
    for i in range(4096):
        while x < 2047 and squash(x) < 16 * i + 8:
            x += 1
        table.append(x)
    return table


STRETCH = _stretch_table()


class Model:
    """Contexts, mixers and the coder that their bits come from."""

    def __init__(self, start: dict[str, Any], coder: Coder) -> None:
        self.p = [256 * byte + 128 for byte in bytes.fromhex("".join(start["probabilities"]))]
        self.n = list(bytes.fromhex("".join(start["counts"])))
        self.weights = list(start["weights"])
        self.coder = coder

    def mixed(self, mixer: int, first: int, a: int, b: int, c: int) -> int:
        contexts = first + a, first + b, first + c
        inputs = [STRETCH[self.p[k] // 16] for k in contexts]
        weights = self.weights[3 * mixer : 3 * mixer + 3]
        dot = sum(w * x for w, x in zip(weights, inputs, strict=True)) >> 16
        one = squash(clamp(dot, -2047, 2047))
        bit = self.coder.decode(one)
        error = 65536 * bit - one
        for i, x in enumerate(inputs):
            w = weights[i] + ((x * error + 8192) >> 14)
            self.weights[3 * mixer + i] = clamp(w, -(2**24), 2**24)
        for k in contexts:
            goal = 65535 if bit else 0
            self.p[k] += (goal - self.p[k]) * (65536 // (self.n[k] + 2)) >> 16
            self.n[k] += self.n[k] < 250
        return bit


# Residuals

BELOW, LESS, MORE, SECOND, THIRD, SIDE = 0, 72, 152, 2072, 2232, 2552


def quarters(v: int) -> int:
    return min(4 * (bits(v) - 1) + (4 * v >> bits(v) - 1) % 4, 111)


class Residuals:
    """Residuals and what they depend upon; the codec sets near, other, side1 and side2."""

    near = other = side1 = side2 = 0

    def __init__(self, model: Model, first_context: int = 0, first_mixer: int = 0) -> None:
        self.model = model
        self.first_context, self.first_mixer = first_context, first_mixer

    def mixed(self, mixer: int, first: int, a: int, b: int, c: int) -> int:
        return self.model.mixed(self.first_mixer + mixer, self.first_context + first, a, b, c)

    def residual(self, f: int, g: int) -> int:
        """With minus = no, the only kind that codecs of values have."""
        kf, ks = quarters(f + 1), quarters(g + 1)
        cf, bf = (kf, 0) if kf < 28 else (28 + kf % 4, (kf - 24) // 4)
        cs, bs = (ks, 0) if ks < 28 else (28 + ks % 4, (ks - 24) // 4)
        n = self._size(cf, cs, bf, bs)
        if n > 53:
            raise refuse(f"a residual of {n} bits")
        if n == 0:
            return 0
        x, y, e = clamp(n - bf + 4, 0, 15), clamp(n - bs + 4, 0, 15), min(n, 31)
        v = 1
        if n > 1:
            v = 2 + self.mixed(14, SECOND, 4 * x + kf % 4, 64 + 4 * y + ks % 4, 128 + e)
        if n > 2:
            b = v % 2
            fast, slow = 8 * x + 2 * (kf % 4) + b, 128 + 8 * y + 2 * (ks % 4) + b
            v = 2 * v + self.mixed(15, THIRD, fast, slow, 256 + 2 * e + b)
        if n > 3:
            v = v * 2 ** (n - 3) + self.model.coder.number(n - 3)
        beside = 3 + 3 * self.side1 + self.side2
        return -v if self.mixed(16, SIDE, self.side1, beside, 12 + self.other) else v

    def _size(self, cf: int, cs: int, bf: int, bs: int) -> int:
        """The bits of the absolute value."""
        q = clamp(self.near + 3, 0, 7)
        base = max(0, min(bf, bs) - 2)
        if base > 0 and self.mixed(0, BELOW, cf, 32 + cs, 64 + q):
            n = base - 1
            while n > 0 and self.mixed(1, LESS, min(base - n, 15), 16 + cf, 48 + cs):
                n -= 1
            return n
        n = base
        while True:
            x, y = clamp(n - bf + 4, 0, 23), clamp(n - bs + 4, 0, 23)
            beside = 1536 + 48 * q + 2 * x + (bf > bs)
            if not self.mixed(2 + min(x, 11), MORE, 24 * cf + x, 768 + 24 * cs + y, beside):
                return n
            n += 1
            if n > 60:
                raise refuse(f"a residual of {n} bits")


# Wavelets


class Wavelet(NamedTuple):
    """Synthesis filters of approximations and details."""

    lo: Sequence[float]
    hi: Sequence[float]


def registered(number: int) -> Wavelet:
    for known in json.loads((ANNEX / "wavelets.json").read_text()).values():
        if known["id"] == number:
            return Wavelet(known["lo"], known["hi"])
    raise refuse(f"wavelet {number}")


def lengths_of(n: int, taps: int, levels: int) -> list[int]:
    """n_0 to n_N."""
    lengths = [n]
    for _ in range(levels):
        lengths.append((lengths[-1] + taps - 1) // 2)
    return lengths


def ends_of(stop: int, taps: int, levels: int) -> list[int]:
    """e_0 to e_N: the coefficients 0 to e_l - 1 of level l make frames 0 to stop - 1."""
    ends = [stop]
    for _ in range(levels):
        ends.append((ends[-1] + taps - 3) // 2 + 1)
    return ends


def synthesis(
    wavelet: Wavelet, a: Sequence[float], d: Sequence[float] | None, stop: int
) -> list[float]:
    """Coefficients 0 to ``stop`` - 1 of one level less; no details: they are left out."""
    taps = len(wavelet.lo)
    values = []
    for n in range(stop):
        x = 0.0
        for k in range(n // 2, (n + taps - 2) // 2 + 1):
            x = x + wavelet.lo[n + taps - 2 - 2 * k] * a[k]
        if d is not None:
            for k in range(n // 2, (n + taps - 2) // 2 + 1):
                x = x + wavelet.hi[n + taps - 2 - 2 * k] * d[k]
        values.append(x)
    return values


# Codec 2: mrdwt


class Header(NamedTuple):
    wavelet: Wavelet
    levels: int
    coded_frames: int
    decimals: int
    unit: float
    least: int

    @property
    def taps(self) -> int:
        return len(self.wavelet.lo)

    @property
    def scaled(self) -> bool:
        return self.decimals == 255


def parse_header(data: bytes) -> Header:
    fields = Bytes(data)
    number = fields.u8()
    if number:
        wavelet = registered(number)
    else:
        wavelet = Wavelet(_filter(fields), _filter(fields))
    if len(wavelet.lo) != len(wavelet.hi):
        raise refuse(f"{len(wavelet.lo)} taps beside {len(wavelet.hi)}")
    levels, coded_frames, decimals = fields.u8(), fields.varint(), fields.u8()
    if levels > 16 or 15 < decimals < 255:
        raise refuse(f"{levels} levels, {decimals} decimals")
    unit = fields.binary64() if decimals == 255 else 1.0
    least = fields.varint()
    if not 2.0**-100 <= unit <= 2.0**100 or not 1 <= least <= 2**39:
        raise refuse(f"unit {unit}, least {least}")
    if fields.rest():
        raise refuse("bytes after the header")
    return Header(wavelet, levels, coded_frames, decimals, unit, least)


def _filter(fields: Bytes) -> list[float]:
    n = fields.varint()
    if n % 2 or not 2 <= n <= 64:
        raise refuse(f"{n} taps")
    taps = [fields.binary64() for _ in range(n)]
    if not all(-16 <= tap <= 16 for tap in taps):
        raise refuse(f"taps {taps}")
    return taps


def check_segments(header: Header, n_frames: int, segments: Sequence[Any]) -> None:
    due, last = 0, len(segments) - 1
    for i, (first, size, _) in enumerate(segments):
        end = first + size
        whole = end % 2**header.levels == 0 or (i == last and end == header.coded_frames)
        if first != due or size < 1 or not whole:
            raise refuse(f"a segment of frames {first} to {end} where {due} is due")
        due = end
    if due != n_frames or due > header.coded_frames:
        raise refuse(f"segments end at {due} of {n_frames}, {header.coded_frames} were coded")


# The stream of an approximation


def side(x: int) -> int:
    return 0 if x == 0 else 1 if x > 0 else 2


def starts_of(name: str, sha256: str) -> list[dict[str, Any]]:
    """The sets of an annex."""
    text = (ANNEX / name).read_bytes()
    if hashlib.sha256(text).hexdigest() != sha256:
        raise refuse(f"another {name}")
    sets: list[dict[str, Any]] = json.loads(text)["sets"]
    return sets


# The approximation's, d_N's, d_(N-1)'s, d_(N-2)'s, all finer ones'.
STARTS = starts_of("wavelet_start.json", START_SHA256)


def approximation(data: bytes, c: int, header: Header) -> tuple[list[int], int | None]:
    """Its ``c`` coefficients, and the field ``step``, None where there is none."""
    if not data:
        return [0] * c, None
    fields = Bytes(data)
    form = fields.u8()
    step = fields.u8() if header.scaled else None
    first = fields.zigzag()
    if abs(first) > 2**40:
        raise refuse(f"first coefficient {first}")
    if form % 64 == 63:
        if form != 63 or fields.rest():
            raise refuse(f"an approximation of equals, form {form}")
        return [first] * c, step
    coder = Coder(fields.rest())
    v = _approximation_bits(Residuals(Model(STARTS[0], coder)), form, first, c)
    coder.finish()
    return v, step


def _approximation_bits(model: Residuals, form: int, first: int, c: int) -> list[int]:
    v = [first]
    h = form % 64
    scale = (2 + h % 2) * 2 ** (h // 2) // 2
    fast = slow = 16 * scale
    for i in range(1, c):
        d = v[i - 1] - v[i - 2] if i > 1 else 0
        e = v[i - 2] - v[i - 3] if i > 2 else 0
        p = v[i - 1] + (0, d >> 1, d, (3 * d - 2 * e) >> 2)[form // 64]
        model.other = side(d) if i > 1 else 3
        r = model.residual(fast, slow)
        v.append(p + r)
        if abs(v[i]) > 2**40:
            raise refuse(f"coefficient {v[i]}")
        size = 16 * abs(r)
        model.near = (model.near + bits(size) - bits(slow)) >> 1
        fast += (size - fast) >> 1
        slow += (size - slow) >> 5
        model.side2, model.side1 = model.side1, side(r)
    return v


# The stream of a detail


class Coarser(NamedTuple):
    """Activities A and sides S of the next coarser band."""

    activities: list[int]
    sides: list[int]

    def activity(self, k: int) -> int:
        return self.activities[k] if 0 <= k < len(self.activities) else 0

    def around(self, k: int) -> int:
        before = self.activity(k - 1) if k < len(self.activities) else 0
        return 8 * self.activity(k) + 4 * (before + self.activity(k + 1))

    def side(self, k: int) -> int:
        return self.sides[k] if k < len(self.sides) else 3


def beside_approximation(w: Sequence[int]) -> Coarser:
    inner = range(1, len(w) - 1)
    curved = {k: abs(w[k + 1] - 2 * w[k] + w[k - 1]) for k in inner}
    return Coarser([curved.get(k, 0) for k in range(len(w))], [3] * len(w))


def beside_detail(w: Sequence[int], least: int) -> Coarser:
    return Coarser([max(0, abs(x) - least + 1) for x in w], [side(x) for x in w])


def detail(data: bytes, c: int, place: int, coarser: Coarser, header: Header) -> list[int]:
    """The ``c`` coefficients of the band at ``place``, 1 for d_N."""
    if not data:
        return [0] * c
    coder = Coder(data)
    model = Residuals(Model(STARTS[min(place, 4)], coder))
    v = []
    run = last = before = 0
    for i in range(c):
        k = (i + (header.taps - 2) // 2) // 2
        model.near = min(bits(run), 7) - 3
        model.other = coarser.side(k)
        r = model.residual(11 * last + 5 * before, coarser.around(k))
        if abs(r) > 2**40 - header.least:
            raise refuse(f"residual {r}")
        v.append(0 if r == 0 else r + header.least - 1 if r > 0 else r - header.least + 1)
        run = run + 1 if r == 0 else 0
        before, last = last, abs(r)
        model.side2, model.side1 = model.side1, side(r)
    coder.finish()
    return v


# Coefficients


def values_of_band(v: Sequence[int], is_detail: bool, s: int | None, header: Header) -> list[float]:
    if not header.scaled:
        return [float(x) / float(10**header.decimals) for x in v]
    if s is None:
        return [0.0] * len(v)
    step = header.unit * ((4 + s % 4) * 2.0 ** (s // 4 - 34))
    if not is_detail:
        return [x * step for x in v]
    return [(x - 0.0625) * step if x > 0 else (x + 0.0625) * step if x < 0 else 0.0 for x in v]


def bands_of_segment(
    header: Header, first: int, end: int, streams: Sequence[bytes]
) -> list[list[float]]:
    """The bands of one channel in one segment: a_N, d_N, d_(N-1) ..., those of ``streams``."""
    lengths = lengths_of(header.coded_frames, header.taps, header.levels)
    bands: list[list[float]] = []
    coarser, s = Coarser([], []), None
    for place, data in enumerate(streams):
        level = header.levels - max(0, place - 1)
        stop = lengths[level] if end == header.coded_frames else end // 2**level
        c = stop - first // 2**level
        if place == 0:
            v, s = approximation(data, c, header)
            coarser = beside_approximation(v)
        else:
            if data and header.scaled and s is None:
                raise refuse("details beside an empty approximation")
            v = detail(data, c, place, coarser, header)
            coarser = beside_detail(v, header.least)
        bands.append(values_of_band(v, place > 0, s, header))
    return bands


def channel_of(header: Header, stop: int, bands: Sequence[Sequence[float]]) -> list[float]:
    """Values 0 to ``stop`` - 1 of one channel from its bands, those of all segments joined."""
    if not stop:
        return []
    ends = ends_of(stop, header.taps, header.levels)
    a: Sequence[float] = bands[0]
    if len(a) < ends[header.levels]:
        raise refuse(f"{len(a)} approximations where {ends[header.levels]} are needed")
    for level in range(header.levels, 0, -1):
        place = header.levels - level + 1
        d = bands[place] if place < len(bands) else None
        a = synthesis(header.wavelet, a, d, ends[level - 1])
    values = list(a[:stop])
    if not all(map(math.isfinite, values)):
        raise refuse("a value that is not finite")
    return values


def decode(
    header: bytes,
    layout_n_channels: int,
    n_frames: int,
    n_resolutions: int,
    segments: Sequence[tuple[int, int, Sequence[bytes]]],
    resolution: int = 0,
    stop: int | None = None,
) -> list[list[float]]:
    """Rows 0 to ``stop`` - 1 of a signal without the ``resolution`` finest stored details.

    ``segments`` are (first frame, frames, the codec's streams as DATA has them) and hold
    ``n_frames``; without ``stop`` these are all wanted. Raises ValueError where a reader must
    refuse.
    """
    stop = n_frames if stop is None else stop
    fields = parse_header(header)
    if not 1 <= n_resolutions <= fields.levels + 1 or not 0 <= resolution < n_resolutions:
        raise refuse(f"resolution {resolution} of {n_resolutions}, {fields.levels} levels")
    check_segments(fields, n_frames, segments)
    if any(len(streams) != layout_n_channels * n_resolutions for _, _, streams in segments):
        raise refuse(f"not {n_resolutions} streams a channel")
    wanted = layout_n_channels * (n_resolutions - resolution)  # the finest come last
    columns = []
    for channel in range(layout_n_channels):
        bands: list[list[float]] = [[] for _ in range(n_resolutions - resolution)]
        for first, size, streams in segments:
            own = streams[channel:wanted:layout_n_channels]
            parts = bands_of_segment(fields, first, first + size, own)
            for band, part in zip(bands, parts, strict=True):
                band += part
        columns.append(channel_of(fields, stop, bands))
    return [[column[n] for column in columns] for n in range(stop)]
