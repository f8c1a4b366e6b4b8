"""Rows of posewave, decoded step by step: the lines of SPEC.md, "A traced row".

The decoder is SPEC.md's pseudo-code of "Rows in the metric", for one block, without a prior and
without exponents.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from tools.spec_traces.coder import RangeDecoder, clamp, probabilities_of, squash, stretch

ANNEX = Path(__file__).parents[2] / "conformance" / "annex"
CLASSES = 1, 3, 2  # of the channels
LEVELS = (0, 2), (4, 1), (5, 3)  # kind and rows of each: 6 frames
STREAMS = tuple(map(bytes.fromhex, ("35 ee 80 82", "1a 64", "13 49 bc 2b 2d")))
DOUBLES = (  # 2 q of each level, row and channel
    ((8, -4, 2), (14, -6, 5)),
    ((4, -2, 2),),
    ((-2, 4, 3), (2, -6, -3), (2, -2, -1)),
)
SHOWN = 2, 1  # level and row

FLAG, SIGN, EXTRA, ESCAPE, SHARED = (0, 0), (208, 6), 416, 428, 676 + 492
AFTER_EVEN, AFTER_ODD = (0, 5, 1, 6, 2, 4, 3, 7), (2, 7, 3, 4, 0, 6, 1, 5)
LOGS = [
    next(e for e in range(60, -1, -1) if 4**6 * 2**e <= (4 + k) ** 6) for k in range(1024)
]  # floor(6 log2(1 + k / 4))


def log(v: float) -> int:
    return LOGS[min(int(16.0 * v), 1023)]


def trust(n: int) -> int:
    return 65536 * (10 * n + 4) // (10 * n + 16)


def fold(terms: Sequence[float]) -> float:
    padded = [*terms, *[0.0] * (-len(terms) % 32)]
    x = padded[:32]
    for at in range(32, len(padded), 32):
        x = [a + b for a, b in zip(x, padded[at : at + 32], strict=True)]
    for half in (16, 8, 4):
        x = [x[c] + x[c + half] for c in range(half)]
    return x[0] + x[1] + (x[2] + x[3])


@dataclass
class Row:
    """Magnitudes, values and the mean magnitude of a row."""

    n: int
    magnitudes: list[float] = field(default_factory=list)
    values: list[float] = field(default_factory=list)
    mean: float = 0.0

    def __post_init__(self) -> None:
        self.magnitudes, self.values = [0.0] * self.n, [0.0] * self.n


class Model:
    """The state that "State of rows" lists."""

    def __init__(self, classes: Sequence[int], *, dependent: bool = True) -> None:
        self.dependent = dependent
        start = json.loads((ANNEX / "posewave_start.json").read_text("utf-8"))
        table, n = start["sets"][0], len(classes)

        def counts_of(name: str) -> list[int]:
            return [start["counts"][int(digit, 16)] for digit in "".join(table[name])]

        def divided(name: str) -> list[float]:
            return [integer / 1024 for integer in table[name]]

        p, counts = probabilities_of(table["probabilities"]), counts_of("counts")
        small = probabilities_of(table["small_probabilities"])
        self.coder = RangeDecoder(b"", small, counts_of("small_counts"), table["small_weights"])
        own = [1280 * 12 + 432 * one for one in classes]
        self.p = p[: 1280 * 12] + [v for at in own for v in p[at : at + 432]]
        self.counts = counts[: 1280 * 12] + [v for at in own for v in counts[at : at + 432]]
        weights = [1024 * (b - 128) for b in bytes.fromhex("".join(table["weights"]))]
        sets = [weights[at : at + 60] for at in range(0, len(weights), 60)]
        self.weights = [list(one) for one in sets[:64]] + [list(sets[64 + one]) for one in classes]
        self.second = [probabilities_of(table["second"]) for _ in range(16)]
        self.tap, self.tap_energy = divided("taps"), [500.0] * 60
        self.level_size = divided("level_sizes")
        sizes, usual = divided("own_sizes"), divided("usual")
        self.own_size = [sizes[16 * one : 16 * one + 16] for one in classes]
        self.usual = [usual[one] for one in classes]
        self.lower = [[0.0] * n for _ in range(n)]
        self.variances, self.seen, self.lines = [2.0] * n, 0.0, list[str]()


class RowDecoder:
    """Decodes the rows of a level; keeps lines of what it does."""

    def __init__(self, model: Model, kind: int, n_rows: int, levels: Sequence[list[Row]]) -> None:
        """``levels`` are those of coarser details, the coarsest first."""
        self.model, self.kind, self.n = model, kind, len(model.usual)
        self.rows = [Row(self.n) for _ in range(n_rows)]
        self.levels, self.doubles = levels, [[0] * self.n for _ in range(n_rows)]

    def near(self, m: int) -> dict[str, Row]:
        """The rows around row m."""
        none = [Row(self.n)]
        above = self.levels[-1] if self.levels else none
        higher = self.levels[-2] if len(self.levels) > 1 else none
        up = min(m // 2, len(above) - 1)
        return {
            **{f"before{k}": self.rows[m - k] if m >= k else none[0] for k in (1, 2, 3)},
            "parent": above[up],
            "next": above[min(up + 1, len(above) - 1)],
            "last": above[max(up - 1, 0)],
            "grand": higher[min(up // 2, len(higher) - 1)],
        }

    def decode(self, m: int) -> None:
        model, near, kind = self.model, self.near(m), self.kind
        before1, before2, parent, after = (
            near[name] for name in ("before1", "before2", "parent", "next")
        )
        flags = (before1.mean > 0, before2.mean > 0, parent.mean > 0, after.mean > 0)
        around = sum(2**k * flag for k, flag in enumerate(flags))
        g = min(log(8.0 * before1.mean) // 4, 7)
        h = min(log(8.0 * parent.mean) // 4, 7)
        contexts = [FLAG[0] + c for c in (16 * kind + around, 96 + 8 * kind + g, 144 + 8 * g + h)]
        live, one, middle = model.coder.mixed(FLAG[1] + kind, contexts)
        model.lines.append(f"FLAG    {contexts}  one {one}  middle {middle:08X}  bit {live}")
        if not live:
            return
        series = [near[name].values for name in ("before1", "before2", "parent", "next", "last")]
        taps = slice(10 * kind + 5 * (m % 2), 10 * kind + 5 * (m % 2) + 5)
        time = [0.0] * self.n
        for c in range(self.n):
            for tap, values in zip(model.tap[taps], series, strict=True):
                time[c] = time[c] + tap * values[c]
        channels = Channels(self, near, time)
        for c in range(self.n):
            self.doubles[m][c] = channels.decode(c)
        channels.learn(self.rows[m], series, taps)


class Channels:
    """The channels of a live row."""

    def __init__(self, rows: RowDecoder, near: dict[str, Row], time: list[float]) -> None:
        self.model, self.kind, self.n = rows.model, rows.kind, rows.n
        self.near, self.time = near, time
        self.across, self.state = [0.0] * self.n, 0
        self.values, self.magnitudes = [0.0] * self.n, list[float]()
        self.features, self.sizes = list[list[float]](), list[tuple[float, float, float]]()

    def features_of(self, c: int) -> list[float]:
        near, model, here = self.near, self.model, self.magnitudes
        total, usual = 0.0, 0.0
        for k in range(c):
            total, usual = total + here[k], usual + model.usual[k]
        before, parent = near["before1"].mean, near["parent"].mean
        names = ("before1", "before2", "before3", "grand", "parent", "next", "last")
        return [
            *(near[name].magnitudes[c] for name in names),
            *(here[c - k] if c >= k else 0.0 for k in (1, 2, 3, 4)),
            total / c if c > 3 else before,
            *(before, parent, model.usual[c]),
            model.usual[c] * (total + before + 0.1) / (usual + before + 0.1),
        ]

    def decode(self, c: int) -> int:
        """Twice the value of channel ``c``."""
        model, near, kind, features = self.model, self.near, self.kind, self.features_of(c)
        size1 = size_of(model.level_size[16 * kind : 16 * kind + 16], features)
        size2 = size_of(model.own_size[c], features)
        mean = min(max(self.across[c] + self.time[c], -(2.0**31)), 2.0**31)
        fixed = math.floor(mean * 4096)
        mean, two, both, odd = fixed / 4096, size2, 0.5 * (size1 + size2), self.state % 2
        if odd:
            fixed += clamp(fixed, -2048, 2048)
            two, both = two + min(two, 0.5), both + min(both, 0.5)
        rounded = (fixed + 2048) >> 12
        fraction = fixed - 4096 * rounded
        log_two, log_size = log(two), log(both)
        log_mean, distance = min(log(abs(fixed) / 4096) // 4, 3), min(abs(fraction) // 256, 7)
        before, parent = near["before1"], near["parent"]
        sums = (
            features[11],
            before.mean + parent.mean,
            parent.magnitudes[c] + near["next"].magnitudes[c],
            0.5 * (before.magnitudes[c] + near["before2"].magnitudes[c] + parent.magnitudes[c]),
        )
        at = [
            ((min(log_two // 3, 11) * 4 + log_mean) * 4 + distance // 2) * 2,
            384 + (16 * kind + min(log_size // 3, 15)) * 4 + log_mean,
            768
            + 64 * min(log(sums[0]) // 4, 7)
            + 8 * min(log(sums[1]) // 4, 7)
            + min(log(sums[2]) // 5, 7),
            1280 + 36 * c + 6 * kind + min(log(sums[3]) // 5, 5),
        ]
        scale = min(3 * log_size // 8, 15)
        one = 8 * (4 * min(log_mean, 1) + distance // 2) + scale // 2
        opposite = int((fraction < 0) != (fixed < 0))
        down = int(fraction >= 0)
        signs = (
            8 * min(log_size // 4, 11) + distance,
            96 + 8 * (2 * log_mean + opposite) + distance,
            160 + 4 * (2 * kind + opposite) + distance // 2,
        )
        model.lines.append(
            f"channel {c}: mean {mean:.17g}, state {self.state}, size1 {size1:.17g},"
            f" size2 {size2:.17g}"
        )
        at, far = self.first_decision(at, (one, 64 + c), scale, signs)
        error = 0 if far is None else self.error_size(at, (one, 64 + c), scale)
        error = -error if far is not None and far != 1 - down else error
        k = rounded + error
        double = 2 * k - (k > 0) + (k < 0) if odd else 2 * k
        if model.dependent:
            self.state = (AFTER_ODD if k % 2 else AFTER_EVEN)[self.state]
        value = double / 2
        miss = value - mean
        found = min(abs(miss), 4096.0)
        magnitude = min(0.5 * abs(miss) + 0.5 * abs(value), 4096.0)
        self.values[c] = value
        self.magnitudes.append(0.0 if k == 0 and rounded == 0 else magnitude)
        self.features.append(features)
        self.sizes.append((found, size1, size2))
        for d in range(c + 1, self.n):
            self.across[d] += model.lower[d][c] * miss
        model.lines.append(f"  rounded {rounded}, error {error}: k {k}, q {value:g}")
        return double

    def first_decision(
        self, at: list[int], sets: tuple[int, int], scale: int, signs: Sequence[int]
    ) -> tuple[list[int], int | None]:
        """The contexts of the next decisions, and ``far``, None without an error."""
        if not self.decide(0, at, sets, scale):
            return at, None
        contexts = [SIGN[0] + c for c in signs]
        far, one, middle = self.model.coder.mixed(SIGN[1] + self.kind, contexts)
        self.model.lines.append(f"  SIGN  {contexts}  one {one}  middle {middle:08X}  bit {far}")
        return [at[0] + far, *at[1:]], far

    def error_size(self, at: list[int], sets: tuple[int, int], scale: int) -> int:
        coder, b = self.model.coder, 1
        while b < 12 and self.decide(b, at, sets, scale):
            b += 1
        if b < 5:
            return b
        if b < 12:
            k = (b - 3) // 2
            low = (4 if b % 2 else 6) * 2 ** (k - 1) + 1
            top = coder.adaptive(EXTRA + b)
            return low + top * 2 ** (k - 1) + coder.number(k - 1)
        k = 1
        while k < 32 and coder.adaptive(ESCAPE + 32 * self.kind + k):
            k += 1
        return 48 + 2 ** (k - 1) + coder.number(k - 1)

    def decide(self, slot: int, at: list[int], sets: tuple[int, int], scale: int) -> int:
        model, coder = self.model, self.model.coder
        w, v = (model.weights[one] for one in sets)
        w_at = slice(5 * slot, 5 * slot + 5)
        z, z_at = model.second[scale], 33 * slot
        contexts = [12 * place + slot for place in at]
        x = [(stretch(model.p[c]) * trust(model.counts[c])) >> 16 for c in contexts] + [77]
        both = [a + b for a, b in zip(w[w_at], v[w_at], strict=True)]
        dot = both[4] * 77 + sum(both[k] * x[k] for k in range(4))
        y = clamp(dot >> 16, -2047, 2047) + 2048
        chance, (i, r) = squash(y - 2048), divmod(y, 128)
        later = (z[z_at + i] * (128 - r) + z[z_at + i + 1] * r) // 128
        one = clamp((chance + later + 1) // 2, 16, 65520)
        state = f"{coder.low:08X} {coder.high:08X} {coder.code:08X}"
        bit, middle = coder.decode(one)
        names = " ".join(f"{place:4}" for place in at)
        before = " ".join(f"{model.p[c]:5}" for c in contexts)
        model.lines.append(
            f" {slot:2}  {names}  {before}  {sets[0]:2} {scale:2} {chance:6} {later:5}"
            f"  {state}  {middle:08X} {bit:2}"
        )
        e, target = 65536 * bit - chance, 65535 * bit
        for own in (w, v):
            for k in range(5):
                moved = own[5 * slot + k] + ((x[k] * e + 32768) >> 16)
                own[5 * slot + k] = clamp(moved, -(2**24), 2**24)
        for c in contexts:
            model.p[c] += ((target - model.p[c]) * (65536 // (model.counts[c] + 2))) >> 16
            model.counts[c] = min(model.counts[c] + 1, 250)
        z[z_at + i] += ((target - z[z_at + i]) * (128 - r)) >> 14
        z[z_at + i + 1] += ((target - z[z_at + i + 1]) * r) >> 14
        return bit

    def learn(self, row: Row, series: Sequence[list[float]], taps: slice) -> None:
        """After the last channel."""
        model, n, kind = self.model, self.n, self.kind
        total = 0.0
        for magnitude in self.magnitudes:
            total = total + magnitude
        row.values, row.magnitudes, row.mean = self.values, self.magnitudes, total / n
        shares = list[float]()
        for c, (found, size1, size2) in enumerate(self.sizes):
            energy = 2.0
            for feature in self.features[c]:
                energy = energy + feature * feature
            shares.append((found - size1) * (0.992 / max(n, 62)) * (1.0 / energy))
            own = (found - size2) * 0.032 * (1.0 / energy)
            for k, feature in enumerate(self.features[c]):
                model.own_size[c][k] += own * feature
        for k in range(16):
            terms = [shares[c] * self.features[c][k] for c in range(n)]
            model.level_size[16 * kind + k] += fold(terms)
        for c in range(n):
            model.usual[c] += (self.magnitudes[c] - model.usual[c]) * 0.06
        moved = 0.0
        for value in self.values:
            moved = moved + abs(value)
        share = 1.0 / (1.25 * moved / n + 1.0)
        fair = share * share
        self.update(fair)
        gains = [fair / (usual + 0.3) for usual in model.usual]
        t = [(self.values[c] - self.time[c]) * gains[c] for c in range(n)]
        for k, values in enumerate(series):
            place = taps.start + k
            square = fold([values[c] * values[c] * gains[c] for c in range(n)])
            model.tap_energy[place] = energy = model.tap_energy[place] * 0.98 + square
            turn = 0.012 * fold([values[c] * t[c] for c in range(n)])
            moved = model.tap[place] + turn / (energy * (1.0 - 0.98) + 5.0)
            model.tap[place] = min(max(moved, -2.0), 2.0)
        model.seen = model.seen * 0.996 + 1.0
        self.describe(row, taps)

    def update(self, share: float) -> None:
        model, n = self.model, self.n
        rest = [self.values[c] - self.time[c] for c in range(n)]
        for a in range(n):
            miss, before = rest[a], model.variances[a] * 0.996 + 0.1
            after = before + share * miss * miss
            gain, share = share * miss / after, share * (before / after)
            model.variances[a] = after
            for b in range(a + 1, n):
                rest[b] = rest[b] - miss * model.lower[b][a]
                model.lower[b][a] = model.lower[b][a] + gain * rest[b]

    def describe(self, row: Row, taps: slice) -> None:
        model, kind = self.model, self.kind
        figures = {
            "P": [row.mean],
            "A": row.magnitudes,
            "usual": model.usual,
            "tap": model.tap[taps],
            "D": model.variances,
            "L": [model.lower[1][0]],
            "levelSize, 0 to 3": model.level_size[16 * kind : 16 * kind + 4],
            "ownSize of channel 0, 0 to 3": model.own_size[0][:4],
        }
        for name, values in figures.items():
            texts = [f"{value:.17g}" for value in values]
            for at in range(0, len(texts), 4):
                model.lines.append(f"{name if at == 0 else '':4} {' '.join(texts[at : at + 4])}")


def size_of(weights: Sequence[float], features: Sequence[float]) -> float:
    p = [w * feature for w, feature in zip(weights, features, strict=True)]
    size = 0.015
    for k in (*range(7), 12, 13, 14):
        size = size + p[k]
    size = (size + p[7]) + p[8]
    size = size + (p[9] + p[10])
    size = size + (p[11] + p[15])
    return min(max(size, 0.008), 4096.0)


def decode_level(
    model: Model, kind: int, n_rows: int, levels: Sequence[list[Row]]
) -> tuple[RowDecoder, list[list[str]]]:
    """Decode the rows of a level, and give the lines of each."""
    if kind and model.seen > 40.0:
        model.variances = [d * (40.0 / model.seen) for d in model.variances]
        model.seen = 40.0
    decoder, lines = RowDecoder(model, kind, n_rows, levels), []
    for m in range(n_rows):
        model.lines = []
        decoder.decode(m)
        lines.append(model.lines)
    return decoder, lines


def levels() -> Iterator[tuple[list[list[int]], list[list[str]]]]:
    """Each level: 2 q of its rows, and the lines of each row."""
    model, details = Model(CLASSES), list[list[Row]]()
    for (kind, n_rows), stream in zip(LEVELS, STREAMS, strict=True):
        model.coder.start(stream)
        decoder, lines = decode_level(model, kind, n_rows, details)
        if kind:
            details.append(decoder.rows)
        yield decoder.doubles, lines


def trace() -> str:
    level, row = SHOWN
    lines = [lines for _, lines in levels()][level][row]
    return "\n".join(lines) + "\n"
