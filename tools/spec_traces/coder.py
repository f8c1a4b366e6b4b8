"""The range coder, contexts and mixers of SPEC.md, "Entropy coding"."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

NODES = [22, 36, 60, 98, 162, 267, 439, 720, 1179, 1921, 3108, 4971, 7812, 11955, 17625, 24743]
NODES = [*NODES, 32768, *(65536 - node for node in reversed(NODES))]


def clamp(v: int, a: int, b: int) -> int:
    return min(max(v, a), b)


def squash(x: int) -> int:
    i, v = divmod(x + 2048, 128)
    return (NODES[i] * (128 - v) + NODES[i + 1] * v + 64) // 128


SQUASHED = [(x, squash(x)) for x in range(-2047, 2048)]


@cache
def stretch(p: int) -> int:
    return next((x for x, one in SQUASHED if one >= 16 * (p // 16) + 8), 2047)


def probabilities_of(lines: Sequence[str]) -> list[int]:
    """Probabilities of an annex, two hexadecimal digits each."""
    return [256 * byte + 128 for byte in bytes.fromhex("".join(lines))]


@dataclass
class RangeDecoder:
    """Bits of ``data``; ``p`` and ``n`` are of the contexts, three ``weights`` of each mixer."""

    data: bytes
    p: list[int]
    n: list[int]
    weights: list[int]

    def __post_init__(self) -> None:
        self.start(self.data)

    def start(self, data: bytes) -> None:
        self.data, self.low, self.high, self.code, self.at = data, 0, 2**32 - 1, 0, 0
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

    def mixed(self, mixer: int, contexts: Sequence[int]) -> tuple[int, int, int]:
        """The bit, ``one`` and ``middle``."""
        x = [stretch(self.p[c]) for c in contexts]
        w = self.weights[3 * mixer : 3 * mixer + 3]
        one = squash(clamp(sum(a * b for a, b in zip(w, x, strict=True)) >> 16, -2047, 2047))
        bit, middle = self.decode(one)
        error = 65536 * bit - one
        for i in range(3):
            moved = w[i] + ((x[i] * error + 8192) >> 14)
            self.weights[3 * mixer + i] = clamp(moved, -(2**24), 2**24)
        for c in contexts:
            self.learn(c, bit)
        return bit, one, middle

    def adaptive(self, c: int) -> int:
        bit, _ = self.decode(clamp(self.p[c], 32, 65504))
        self.learn(c, bit)
        return bit

    def learn(self, c: int, bit: int) -> None:
        self.p[c] += ((65535 * bit - self.p[c]) * (65536 // (self.n[c] + 2))) >> 16
        self.n[c] = min(self.n[c] + 1, 250)
