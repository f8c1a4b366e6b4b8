"""A stream of best, decoded step by step: the lines of SPEC.md, "A traced stream".

The decoder is SPEC.md's pseudo-code for form 0.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tools.spec_traces.coder import RangeDecoder, clamp, probabilities_of

ORDINALS = (  # of two channels, the second of which looks at the first
    *((0, 5), (40, 30), (75, 41), (101, 67), (120, 70), (131, 77), (140, 81), (138, 90)),
    *((120, 71), (97, 55), (70, 44), (37, 20)),
)
STREAM = bytes.fromhex(
    "01 00 00 1d 00 0a 1e 12 e0 b7 b7 e9 79 81 56 8c f7 35 1f f0 24 0a 0d 8a 8b c7"
)
BITS_OF, FIGURES_OF = 1, 11  # rows that are shown: the first so many by bits, this one by figures
START = Path(__file__).parents[2] / "conformance" / "annex" / "best_start.json"

BELOW, LESS, MORE, SECOND, THIRD, SIDE = 0, 72, 152, 2072, 2232, 2552
NAMES = {BELOW: "BELOW", LESS: "LESS", MORE: "MORE", SECOND: "SECOND", THIRD: "THIRD", SIDE: "SIDE"}
MIXERS = {BELOW: 0, LESS: 1, MORE: 2, SECOND: 14, THIRD: 15, SIDE: 16}
LIMIT = 2.0**20


def quarters(v: int) -> int:
    n = v.bit_length()
    return min(4 * (n - 1) + (4 * v // 2 ** (n - 1)) % 4, 111)


class Decoder(RangeDecoder):
    """Keeps a line for each mixed bit that it has decoded."""

    def __init__(self, data: bytes) -> None:
        table = json.loads(START.read_text("utf-8"))
        counts = list(bytes.fromhex("".join(table["counts"])))
        super().__init__(data, probabilities_of(table["probabilities"]), counts, table["weights"])
        self.lines: list[str] = []

    def mix_bit(self, kind: int, places: tuple[int, int, int], more: int = 0) -> int:
        """A bit of ``kind`` from its contexts at these places; of MORE, ``more`` mixers on."""
        contexts = [kind + place for place in places]
        mixer = MIXERS[kind] + more
        before = " ".join(f"{self.p[c]:5}" for c in contexts)
        state = f"{self.low:08X} {self.high:08X} {self.code:08X}"
        bit, one, middle = self.mixed(mixer, contexts)
        names = " ".join(f"{c:4}" for c in contexts)
        begin = f"{len(self.lines) + 1:3}  {NAMES[kind]:6}  {names}  {before}"
        self.lines.append(f"{begin}  {mixer:3}  {one:5}  {state}  {middle:08X}  {bit:3}")
        return bit

    def residual(self, near: int, side1: int, side2: int, other: int, f: int, g: int) -> int:
        kf, ks = quarters(f + 1), quarters(g + 1)
        cf, cs = (k if k < 28 else 28 + k % 4 for k in (kf, ks))
        bf, bs = (0 if k < 28 else (k - 24) // 4 for k in (kf, ks))
        q = clamp(near + 3, 0, 7)
        base = max(0, min(bf, bs) - 2)
        if base > 0 and self.mix_bit(BELOW, (cf, 32 + cs, 64 + q)):
            n = base - 1
            while n > 0 and self.mix_bit(LESS, (min(base - n, 15), 16 + cf, 48 + cs)):
                n -= 1
        else:
            n = base
            while True:
                x, y = clamp(n - bf + 4, 0, 23), clamp(n - bs + 4, 0, 23)
                third = 1536 + 48 * q + 2 * x + int(bf > bs)
                if not self.mix_bit(MORE, (24 * cf + x, 768 + 24 * cs + y, third), min(x, 11)):
                    break
                n += 1
        if n == 0:
            return 0
        x, y, e = clamp(n - bf + 4, 0, 15), clamp(n - bs + 4, 0, 15), min(n, 31)
        v = 1
        if n > 1:
            v = 2 + self.mix_bit(SECOND, (4 * x + kf % 4, 64 + 4 * y + ks % 4, 128 + e))
        if n > 2:
            b = v % 2
            places = 8 * x + 2 * (kf % 4) + b, 128 + 8 * y + 2 * (ks % 4) + b, 256 + 2 * e + b
            v = 2 * v + self.mix_bit(THIRD, places)
        if n > 3:
            v = v * 2 ** (n - 3) + self.number(n - 3)
        side = self.mix_bit(SIDE, (side1, 3 + 3 * side1 + side2, 12 + other))
        return -v if side == 1 else v


def bound(v: float) -> float:
    return v if -LIMIT < v < LIMIT else 0.0


class Regression:
    def __init__(self, n: int, keep: float, ridge: float) -> None:
        self.n, self.keep, self.ridge = n, keep, ridge
        self.w, self.t = [0.0] * n, 1.0
        self.s = [[0.0] * (n + 1) for _ in range(n)]

    def value(self, f: list[float]) -> float:
        total = 0.0
        for w, one in zip(self.w, f, strict=True):
            total = total + w * one
        return bound(total)

    def learn(self, f: list[float], target: float, guess: float, r: int) -> None:
        e = target - guess
        g = 1 / ((self.t * self.t + 0.3 * (e * e)) + 1e-9)
        y = [*(g * one for one in f), g * target]
        for i in range(self.n):
            for j in range(i, self.n + 1):
                self.s[i][j] = self.keep * self.s[i][j] + f[i] * y[j]
        self.t = self.t + (abs(e) - self.t) * (0.2 if r < 20 else 0.05)

    def solve(self) -> None:
        n, a = self.n, [list(row) for row in self.s]
        for i in range(n):
            a[i][i] = a[i][i] + (self.ridge + 1e-10 * a[i][i])
        for k in range(n):
            if not a[k][k] > self.ridge * 1e-6:
                a[k][k] = 1e300
            v = 1 / a[k][k]
            for i in range(k + 1, n):
                q = a[k][i] * v
                for j in range(i, n + 1):
                    a[i][j] = a[i][j] - q * a[k][j]
        for i in range(n - 1, -1, -1):
            x = a[i][n]
            for j in range(i + 1, n):
                x = x - a[i][j] * self.w[j]
            self.w[i] = x / a[i][i]


class Channel:
    """A coded channel of form 0, whose lead is the ordinal, without taps; ``c``: its number."""

    def __init__(self, c: int, first: int, scale: int, references: list[Channel]) -> None:
        self.c, self.first, self.last, self.references = c, first, first, references
        self.fast = self.slow = scale
        self.side1 = self.side2 = 0
        self.unit = 2.0 ** ((scale // 16).bit_length() + 2)
        self.step, self.level = [0.0] * 5, [0.0] * 2  # of this row, and of those before
        n = len(references)
        self.linear = Regression(4 + 2 * min(n, 6), 0.95, 0.01)
        self.quadratic = Regression(3 + n + n * (n + 1) // 2, 0.998, 0.001)
        self.blend = Regression(3, 0.98, 0.01)

    def next_row(self) -> None:
        self.step, self.level = [0.0, *self.step[:4]], [0.0, self.level[0]]

    def features(self) -> tuple[list[float], list[float], list[float]]:
        """Features of the three regressions."""
        o, m = self.references, self.references[:6]
        linear = [*self.step[1:5], *(one.step[0] for one in m), *(one.step[1] for one in m)]
        quadratic = [*self.step[1:4], *(one.step[0] for one in o)]
        for i, one in enumerate(o):
            for two in o[i:]:
                now, before = one.level[0] * two.level[0], one.level[1] * two.level[1]
                quadratic.append((now - before) * 64)
        p = bound((16 >> 5) / self.unit)
        return linear, quadratic, [self.linear.value(linear), self.quadratic.value(quadratic), p]

    def decode(self, decoder: Decoder, r: int, near: int, other: int) -> tuple[Step, int]:
        """The lead of row r, and near behind it."""
        before = self.fast, self.slow
        linear, quadratic, blend = self.features()
        guess = blend[2] if r < 8 else self.blend.value(blend)
        place = math.floor(self.last + guess * self.unit + 0.5)
        predicted = clamp(place, -(2**31), 2**31 - 1)
        begun = len(decoder.lines)
        e = decoder.residual(near, self.side1, self.side2, other, self.fast, self.slow)
        lead, size = predicted + e, 16 * abs(e)
        near = (near + size.bit_length() - self.slow.bit_length()) >> 1
        self.fast += (size - self.fast) >> 1
        self.slow += (size - self.slow) >> 5
        self.side1, self.side2 = int(e > 0) + 2 * int(e < 0), self.side1
        self.step[0] = min(max((lead - self.last) / self.unit, -LIMIT), LIMIT)
        self.level[0] = (lead - self.first) / (64 * self.unit)
        weights = [list(one.w) for one in (self.linear, self.quadratic, self.blend)]
        self.last = lead
        self.linear.learn(linear, self.step[0], blend[0], r)
        self.linear.solve()
        self.quadratic.learn(quadratic, self.step[0], blend[1], r)
        if (r + self.c) % 2 == 0:
            self.quadratic.solve()
        self.blend.learn(blend, self.step[0], guess, r)
        self.blend.solve()
        lines = tuple(decoder.lines[begun:])
        return Step(lines, *before, blend, guess, predicted, e, lead, weights), near


@dataclass(frozen=True)
class Step:
    """One decoded lead: the lines of its bits, scales before them, and what comes of it."""

    lines: tuple[str, ...]
    fast: int
    slow: int
    opinions: list[float]
    guess: float
    predicted: int
    e: int
    lead: int
    weights: list[list[float]]  # of the three regressions, that the prediction was made with


def varint(data: bytes, at: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        byte, at = data[at], at + 1
        value |= (byte & 127) << shift
        shift += 7
        if byte < 128:
            return value, at


def rows() -> Iterator[list[Step]]:
    """The rows of the stream but the first: method 1, two coded channels of form 0, no taps."""
    assert STREAM[0] == 1
    at, heads = 1, []
    for _ in range(2):
        assert STREAM[at] == 0  # coded, predictor 0, nothing else
        folded, at = varint(STREAM, at + 1)
        q, at = STREAM[at], at + 1
        heads.append((folded // 2 if folded % 2 == 0 else -1 - folded // 2, q))
    size, at = varint(STREAM, at)
    assert size == len(STREAM) - at  # form 0 without drop has no tails
    decoder = Decoder(STREAM[at:])
    n_references = decoder.number(4)  # of channel 1, each by no bits at all
    channels: list[Channel] = []
    for c, (first, q) in enumerate(heads):
        references = channels[:1] * n_references
        channels.append(Channel(c, first, (4 + q % 4) * 2 ** (q // 4) // 4, references))
    for r in range(1, len(ORDINALS)):
        near, other, steps = 0, 3, []
        for channel in channels:
            channel.next_row()
        for channel in channels:
            step, near = channel.decode(decoder, r, near, other)
            other = channel.side1
            steps.append(step)
        yield steps


def trace_bits() -> str:
    """The bits of the first rows, what comes of them, and the figures of a later one."""
    head = "bit  name    contexts        p of these         mixer  one    low      high     code"
    out = [f"{head}      middle    bit"]
    for r, steps in enumerate(rows(), 1):
        for c, step in enumerate(steps):
            if r <= BITS_OF:
                scales = f"fast {step.fast}, slow {step.slow}"
                out.append(f"row {r}, channel {c}: {scales}, predicted {step.predicted}")
                out += [*step.lines, f"     e {step.e}: lead {step.lead}"]
            if r == FIGURES_OF:
                out.append(f"row {r}, channel {c}: weights, values and prediction")
                for name, w in zip(("LINEAR", "QUADRATIC", "BLEND"), step.weights, strict=True):
                    texts = [f"{one:.17g}" for one in w]
                    lines = [" ".join(texts[i : i + 4]) for i in range(0, len(texts), 4)]
                    out += [f"  {name if n == 0 else '':9} {line}" for n, line in enumerate(lines)]
                opinions = " ".join(f"{one:.17g}" for one in step.opinions)
                out += [f"  features of BLEND {opinions}", f"  guess {step.guess:.17g}"]
                out.append(f"  predicted {step.predicted}, e {step.e}: lead {step.lead}")
    return "\n".join(out) + "\n"
