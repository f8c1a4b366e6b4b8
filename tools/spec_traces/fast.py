"""A stream of fast, decoded step by step: the lines of SPEC.md, "A traced stream of fast".

The decoder is SPEC.md's pseudo-code for form 0.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

ORDINALS = ((3, 20), (40, 58), (76, 97), (113, 133), (148, 170), (180, -200), (214, 235))
STREAM = bytes.fromhex(
    "88 00 01 02 14 24 28 0e 00 00 90 03 0f 00 0d 00 11 3c 54 79 51 07 00 e6 6b 00 8d 02 09"
)


class Bits:
    """Bits of a part, the lowest of a byte first."""

    def __init__(self, part: bytes) -> None:
        self.number, self.at = int.from_bytes(part, "little"), 0

    def take(self, n: int) -> int:
        self.at += n
        return self.number >> (self.at - n) & ((1 << n) - 1)


def wrap(x: int) -> int:
    return (x + 2**31) % 2**32 - 2**31


@dataclass
class Code:
    """One code and what it was read with."""

    k: int
    q: int
    u: int
    e: int
    bits: int
    scale: int


def read_code(bits: Bits, scale: int) -> Code:
    start, k = bits.at, (scale >> 4).bit_length()
    q = 0
    while not bits.take(1):
        q += 1
    j = max(0, q - 7)
    h = q if j == 0 else 6 + 2**j
    u = h * 2**k + bits.take(k + j)
    e = u // 2 if u % 2 == 0 else -1 - u // 2
    return Code(k, q, u, e, bits.at - start, scale + ((16 * min(abs(e), 2**26) - scale) >> 2))


@dataclass
class Channel:
    """A coded channel of form 0: its head and its state."""

    drop: int
    taps: tuple[int, int, int, int]
    last: int
    scale: int
    weight: int = 0
    differences: list[int] = field(default_factory=lambda: [0, 0, 0, 0])

    def decode(self, bits: Bits, parent_e: int) -> tuple[Code, int, int]:
        """The code, p and x of a row, whose lead is ``last`` then."""
        code = read_code(bits, self.scale)
        products = (t * d for t, d in zip(self.taps, self.differences, strict=True))
        p = wrap(16 + sum(products)) >> 5
        x = wrap(128 + self.weight * parent_e) >> 8
        c = wrap(self.last + p + x + code.e)
        self.differences = [wrap(c - self.last), *self.differences[:3]]
        self.last, self.scale = c, code.scale
        return code, p, x


def scale_of(q: int) -> int:
    return ((4 + q % 4) * 2 ** (q // 4)) // 4


def channels() -> tuple[Channel, Channel, bytes]:
    """The two channels of the stream, and the bytes after their heads."""
    one = Channel(STREAM[2], (64, -32, 0, 0), STREAM[3] // 2, scale_of(STREAM[4]))
    weight = (STREAM[10] & 127) + 128 * STREAM[11]
    two = Channel(0, (32, 0, 0, 0), STREAM[6] // 2, scale_of(STREAM[7]), weight // 2)
    return one, two, STREAM[12:]


def rows() -> Iterator[tuple[list[tuple[int, int]], list[str]]]:
    """Each row: ordinals and the line of each channel."""
    one, two, rest = channels()
    residuals, tails = Bits(rest[1 : 1 + rest[0]]), Bits(rest[1 + rest[0] :])
    for r in range(len(ORDINALS)):
        lines, ordinals, parent_e = [], [], 0
        for c, channel in enumerate((one, two)):
            read = f"{r:3}  {c:7}"
            if r > 0:
                scale = channel.scale
                code, p, x = channel.decode(residuals, parent_e)
                parent_e = code.e
                read += f"  {scale:5} {code.k:2} {code.q:2} {code.bits:4} {code.u:5} {code.e:5}"
                read += f" {p:5} {x:4}"
            else:
                read += " " * 37
            tail = tails.take(channel.drop)
            ordinals.append(channel.last * 2**channel.drop + tail)
            lines.append(f"{read} {channel.last:5} {tail:4} {ordinals[-1]:7}")
        yield ordinals, lines


def trace() -> str:
    head = "row  channel      F  k  q bits     u     e     p    x     c tail ordinal"
    return "\n".join([head, *(line for _, lines in rows() for line in lines)]) + "\n"
