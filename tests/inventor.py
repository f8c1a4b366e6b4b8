"""Streams and models that no encoder writes: legal, and made of random decisions."""

from __future__ import annotations

import random

from mcz.codecs.base import Model
from tests import plain_lsdt, plain_wavelets


class Inventor:
    """Stands for the range coder: makes its bits up, and the data that would give them."""

    def __init__(self, chance: random.Random) -> None:
        self.chance = chance
        self.decisions: list[tuple[int, int]] = []

    def decode(self, one: int) -> int:
        bit = int(self.chance.random() * 65536 < one)
        self.decisions.append((one, bit))
        return bit

    def number(self, n: int) -> int:
        value = 0
        for _ in range(n):
            value = 2 * value + self.decode(32768)
        return value

    def finish(self) -> None:
        """The data are what the bits take."""

    def data(self) -> bytes:
        low, high, out = 0, 2**32 - 1, bytearray()
        for one, bit in self.decisions:
            w = high - low
            middle = low + (w // 65536) * one + (w % 65536) * one // 65536
            low, high = (low, middle) if bit else (middle + 1, high)
            while low // 2**24 == high // 2**24:
                out.append(low // 2**24)
                low, high = low * 256 % 2**32, high * 256 % 2**32 + 255
        for t in range(5):
            step = 2 ** (32 - 8 * t)
            if high // step * step >= low:
                break
        return bytes(out) + (high // step * step).to_bytes(5, "big")[1 : 1 + t]


class Bounded(plain_wavelets.Residuals):
    """Residuals from ``low`` to ``high``: others are made up anew."""

    def __init__(self, kind: plain_wavelets.Residuals, low: int, high: int) -> None:
        super().__init__(kind.model, kind.first_context, kind.first_mixer)
        self.low, self.high = low, high

    def residual(self, f: int, g: int) -> int:
        model = self.model
        while True:
            before = model.p[:], model.n[:], model.weights[:]
            n = len(model.coder.decisions)
            try:
                r = super().residual(f, g)
            except ValueError:
                r = self.high + 1
            if self.low <= r <= self.high:
                return r
            model.p, model.n, model.weights = before
            del model.coder.decisions[n:]


def number(n: int) -> bytes:
    """A varint."""
    out = bytearray()
    while n > 127:
        out.append(n % 128 + 128)
        n //= 128
    return bytes([*out, n])


def invented_model(chance: random.Random, sizes: list[tuple[int, int]]) -> Model:
    """Bases of so many points and vectors."""
    head = number(len(sizes))
    coder = Inventor(chance)
    residuals = plain_wavelets.Residuals(
        plain_wavelets.Model(plain_lsdt.plain_pca.START, coder), 2568, 17
    )
    bounded = Bounded(residuals, -(2**40), 2**40)
    for n_points, n_vectors in sizes:
        shifts = [chance.choice((0, 1, 7, 7, 7, 12, 40)) for _ in range(n_vectors)]
        head += number(n_points) + number(n_vectors) + bytes(shifts)
        for shift in shifts:
            plain_lsdt.table(bounded, n_points, 2**shift >> (n_points.bit_length() >> 1))
    return Model(1, head + coder.data())


def invented_code(chance: random.Random, classes: list[int]) -> list[int]:
    """Lengths of a whole code of these classes and some more."""
    leaves = [0]
    while len(leaves) < len(classes) or chance.random() < 0.8:
        at = chance.randrange(len(leaves))
        if leaves[at] < 15 and len(leaves) < 90:
            leaves[at : at + 1] = [leaves[at] + 1] * 2
    others = [c for c in range(90) if c not in classes]
    own = [*classes, *chance.sample(others, len(leaves) - len(classes))]
    lengths = [0] * (max(own) + 1)
    for c, length in zip(own, chance.sample(leaves, len(leaves)), strict=True):
        lengths[c] = length
    return lengths


class Written:
    """Bits as they are written: integers by the codes of these lengths."""

    def __init__(self) -> None:
        self.text = ""

    def plain(self, value: int, n: int) -> None:
        self.text += f"{value:0{n}b}" if n else ""

    def integer(self, value: int, lengths: list[int]) -> None:
        n = value.bit_length() - 2
        c = value if value < 16 else 16 + 2 * (n - 3) + (value >> n) - 2
        codes: dict[int, int] = {}
        code = 0
        for length in range(1, 16):
            for each, own in enumerate(lengths):
                if own == length:
                    codes[each], code = code, code + 1
            code *= 2
        self.plain(codes[c], lengths[c])
        if c >= 16:
            self.plain(value % 2**n, n)

    def sparse(self, chance: random.Random, n: int, gaps: list[int], values: list[int]) -> None:
        kept = [k for k in range(n) if chance.random() < 0.3]
        self.plain(len(kept), n.bit_length())
        at = 0
        for k in kept:
            self.integer(k - at, gaps)
            self.integer(chance.choice((0, 1, 5, 16, 24, 31, 2**40 - 1)), values)
            self.plain(chance.randrange(2), 1)
            at = k + 1

    def data(self) -> bytes:
        padded = self.text + "0" * (-len(self.text) % 8)
        return bytes(int(padded[i : i + 8], 2) for i in range(0, len(padded), 8))
