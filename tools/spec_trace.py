"""A stream of lossless, decoded step by step: the lines of SPEC.md, "A traced stream".

``tools/spec_tables.py`` puts them into SPEC.md. The decoder here is SPEC.md's pseudo-code for plain
integers, word for word; it shares nothing with that of the package.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

ORDINALS = (3, 2, 2, 2, 4, 7, 8, 8)  # of one channel
STREAM = bytes.fromhex("04 00 36 22 A1 61")
N_ROWS = 5  # are shown: the first ten bits, and those around the first byte that is shifted out
START = Path(__file__).parents[1] / "conformance" / "annex" / "lossless_start.json"

NODES = [22, 36, 60, 98, 162, 267, 439, 720, 1179, 1921, 3108, 4971, 7812, 11955, 17625, 24743]
NODES = [*NODES, 32768, *(65536 - node for node in reversed(NODES))]
BELOW, LESS, MORE, SECOND, THIRD, SIDE = 0, 72, 152, 2072, 2232, 2552
NAMES = {BELOW: "BELOW", LESS: "LESS", MORE: "MORE", SECOND: "SECOND", THIRD: "THIRD", SIDE: "SIDE"}
MIXERS = {BELOW: 0, LESS: 1, MORE: 2, SECOND: 14, THIRD: 15, SIDE: 16}
FIRST_CONTEXT, FIRST_MIXER = 808, 6  # of residuals


def clamp(v: int, a: int, b: int) -> int:
    return min(max(v, a), b)


def squash(x: int) -> int:
    i, v = divmod(x + 2048, 128)
    return (NODES[i] * (128 - v) + NODES[i + 1] * v + 64) // 128


SQUASHED = [(x, squash(x)) for x in range(-2047, 2048)]


def stretch(p: int) -> int:
    return next((x for x, one in SQUASHED if one >= 16 * (p // 16) + 8), 2047)


def quarters(v: int) -> int:
    n = v.bit_length()
    return min(4 * (n - 1) + (4 * v // 2 ** (n - 1)) % 4, 111)


@dataclass
class Decoder:
    """The range coder, its models and mixers, and a line for each bit that it has decoded."""

    data: bytes
    low: int = 0
    high: int = 2**32 - 1
    code: int = 0
    at: int = 0
    lines: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        table = json.loads(START.read_text("utf-8"))
        self.p = [256 * byte + 128 for byte in bytes.fromhex("".join(table["probabilities"]))]
        self.n = list(bytes.fromhex("".join(table["counts"])))
        self.weights = table["weights"]
        for _ in range(4):
            self.code = self.code * 256 + self.byte()

    def byte(self) -> int:
        self.at += 1
        return self.data[self.at - 1] if self.at <= len(self.data) else 0

    def decode(self, one: int) -> tuple[int, int]:
        """The bit, and ``middle``."""
        w = self.high - self.low
        middle = self.low + w // 65536 * one + w % 65536 * one // 65536
        bit = int(self.code <= middle)
        if bit:
            self.high = middle
        else:
            self.low = middle + 1
        while self.low >> 24 == self.high >> 24:
            self.low = self.low * 256 % 2**32
            self.high = self.high * 256 % 2**32 + 255
            self.code = self.code * 256 % 2**32 + self.byte()
        return bit, middle

    def number(self, n: int) -> int:
        value = 0
        for _ in range(n):
            value = 2 * value + self.decode(32768)[0]
        return value

    def mixed(self, kind: int, places: tuple[int, int, int], more: int = 0) -> int:
        """A bit of ``kind`` from its contexts at these places; of MORE, ``more`` mixers on."""
        contexts = [FIRST_CONTEXT + kind + place for place in places]
        mixer = FIRST_MIXER + MIXERS[kind] + more
        before = " ".join(f"{self.p[c]:5}" for c in contexts)
        x = [stretch(self.p[c]) for c in contexts]
        w = self.weights[3 * mixer : 3 * mixer + 3]
        one = squash(clamp(sum(a * b for a, b in zip(w, x, strict=True)) >> 16, -2047, 2047))
        state = f"{self.low:08X} {self.high:08X} {self.code:08X}"
        bit, middle = self.decode(one)
        error = 65536 * bit - one
        for i in range(3):
            moved = w[i] + ((x[i] * error + 8192) >> 14)
            self.weights[3 * mixer + i] = clamp(moved, -(2**24), 2**24)
        for c in contexts:
            self.p[c] += ((65535 * bit - self.p[c]) * (65536 // (self.n[c] + 2))) >> 16
            self.n[c] = min(self.n[c] + 1, 250)
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
        if base > 0 and self.mixed(BELOW, (cf, 32 + cs, 64 + q)):
            n = base - 1
            while n > 0 and self.mixed(LESS, (min(base - n, 15), 16 + cf, 48 + cs)):
                n -= 1
        else:
            n = base
            while True:
                x, y = clamp(n - bf + 4, 0, 23), clamp(n - bs + 4, 0, 23)
                third = 1536 + 48 * q + 2 * x + int(bf > bs)
                if not self.mixed(MORE, (24 * cf + x, 768 + 24 * cs + y, third), min(x, 11)):
                    break
                n += 1
        if n == 0:
            return 0
        x, y, e = clamp(n - bf + 4, 0, 15), clamp(n - bs + 4, 0, 15), min(n, 31)
        v = 1
        if n > 1:
            v = 2 + self.mixed(SECOND, (4 * x + kf % 4, 64 + 4 * y + ks % 4, 128 + e))
        if n > 2:
            b = v % 2
            places = 8 * x + 2 * (kf % 4) + b, 128 + 8 * y + 2 * (ks % 4) + b, 256 + 2 * e + b
            v = 2 * v + self.mixed(THIRD, places)
        if n > 3:
            v = v * 2 ** (n - 3) + self.number(n - 3)
        side = self.mixed(SIDE, (side1, 3 + 3 * side1 + side2, 12 + other))
        return -v if side == 1 else v


@dataclass(frozen=True)
class Row:
    """One decoded row: the lines of its bits, the scales before them, and what comes of it."""

    lines: tuple[str, ...]
    fast: int
    slow: int
    predicted: int
    residual: int
    ordinal: int


def rows() -> Iterator[Row]:
    """The rows of the stream: one channel, form 0 with no taps, and nothing dropped."""
    kind, q = STREAM[:2]
    assert kind == 1 << 2  # coded, from_last, no taps, no form
    decoder = Decoder(STREAM[2:])
    last = side1 = side2 = 0
    fast = slow = 16 * ((4 + q % 4) * 2 ** (q // 4) // 4)
    for _ in ORDINALS:
        begun, scales = len(decoder.lines), (fast, slow)
        predicted = last + (16 >> 5)
        residual = decoder.residual(0, side1, side2, 3, fast, slow)  # the first channel of a row
        last = predicted + residual
        size = 16 * abs(residual)
        fast += (size - fast) >> 1
        slow += (size - slow) >> 5
        side1, side2 = int(residual > 0) + 2 * int(residual < 0), side1
        yield Row(tuple(decoder.lines[begun:]), *scales, predicted, residual, last)


def traced() -> str:
    """The bits of the first rows, and behind those of each row what comes of them."""
    head = "bit  name    contexts        p of these         mixer  one    low      high     code"
    out = [f"{head}      middle    bit"]
    for number, row in zip(range(N_ROWS), rows(), strict=False):
        out.append(f"row {number}: fast {row.fast}, slow {row.slow}, predicted {row.predicted}")
        out += row.lines
        out.append(f"     residual {row.residual}: ordinal {row.ordinal}")
    return "\n".join(out) + "\n"
