"""Streams of raw deflate, RFC 1951, to order: blocks, codes and symbols that no packer chooses."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

END = 256
ORDER = (16, 17, 18, 0, 8, 7, 9, 6, 10, 5, 11, 4, 12, 3, 13, 2, 14, 1, 15)
FIXED_LENGTHS = [8] * 144 + [9] * 112 + [7] * 24 + [8] * 8
FIXED_DISTANCES = [5] * 32
Code = dict[int, tuple[int, int]]  # symbol: code, bits


def code_of(lengths: Sequence[int]) -> Code:
    """The codes of these lengths, 0 for none, whether or not they are complete."""
    code, found = 0, {}
    for size in range(1, 16):
        for symbol, length in enumerate(lengths):
            if length == size:
                found[symbol] = (code, size)
                code += 1
        code *= 2
    return found


class Bits:
    """Bits from the lowest of the first byte on; methods can be chained."""

    def __init__(self) -> None:
        self.bits: list[int] = []

    def add(self, value: int, size: int) -> Bits:
        """A number, its lowest bit first."""
        self.bits += [value >> k & 1 for k in range(size)]
        return self

    def code(self, code: Code, *symbols: int) -> Bits:
        """Symbols of a code, the highest bit of each first."""
        for symbol in symbols:
            value, size = code[symbol]
            self.bits += [value >> k & 1 for k in range(size - 1, -1, -1)]
        return self

    def block(self, kind: int, last: bool = True) -> Bits:
        return self.add(int(last), 1).add(kind, 2)

    def stored(self, data: bytes, last: bool = True, check: int | None = None) -> Bits:
        """A block of kind 0; ``check``: in place of the complement of the length."""
        self.block(0, last)
        self.bits += [0] * (-len(self.bits) % 8)
        self.add(len(data), 16).add(0xFFFF ^ len(data) if check is None else check, 16)
        for byte in data:
            self.add(byte, 8)
        return self

    def fixed(self, *symbols: int | tuple[int, int, int, int], last: bool = True) -> Bits:
        """A block of kind 1, without its end; a match is ``match(...)``."""
        self.block(1, last)
        lengths, distances = code_of(FIXED_LENGTHS), code_of(FIXED_DISTANCES)
        return self.symbols(lengths, distances, symbols)

    def symbols(
        self, lengths: Code, distances: Code, symbols: Iterable[int | tuple[int, int, int, int]]
    ) -> Bits:
        """Literals, and matches as (length symbol, its extra, distance symbol, its extra)."""
        for symbol in symbols:
            if isinstance(symbol, int):
                self.code(lengths, symbol)
                continue
            length, more, distance, further = symbol
            self.code(lengths, length).add(more, extra_of_length(length))
            self.code(distances, distance).add(further, max(0, distance // 2 - 1))
        return self

    def dynamic(
        self,
        n_lengths: int,
        n_distances: int,
        own: Sequence[int],
        said: Iterable[int | tuple[int, int]],
        last: bool = True,
    ) -> Bits:
        """The head of a block of kind 2: the lengths of the code of lengths, then its symbols,
        16 to 18 as (symbol, extra)."""
        self.block(2, last)
        listed = [own[symbol] for symbol in ORDER]
        n_own = max(4, 19 - next((k for k, size in enumerate(reversed(listed)) if size), 19))
        self.add(n_lengths - 257, 5).add(n_distances - 1, 5).add(n_own - 4, 4)
        for size in listed[:n_own]:
            self.add(size, 3)
        code = code_of(own)
        for item in said:
            symbol, more = item if isinstance(item, tuple) else (item, 0)
            self.code(code, symbol).add(more, {16: 2, 17: 3, 18: 7}.get(symbol, 0))
        return self

    def data(self, behind: int = 0) -> bytes:
        """The bytes; bits ``behind`` the last one in its byte are 0 or 1."""
        bits = self.bits + [behind] * (-len(self.bits) % 8)
        return bytes(
            sum(bit << k for k, bit in enumerate(bits[at : at + 8]))
            for at in range(0, len(bits), 8)
        )


def extra_of_length(symbol: int) -> int:
    """Bits behind a length symbol."""
    return 0 if symbol < 265 or symbol >= 285 else (symbol - 261) // 4


def own_lengths(**sizes: int) -> list[int]:
    """Lengths of the code of lengths by symbol, named as ``s0`` to ``s18``."""
    return [sizes.get(f"s{symbol}", 0) for symbol in range(19)]
