"""Layout of protected blocks, and of the packets behind them.

A RECV protects the bytes before it, from ``start`` on, and the ``t_size`` bytes behind it; together
they are the *stream*, cut into blocks.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import ceil, isqrt

from mcz.container.chunks import FRAMING, HEADER
from mcz.container.recovery.code import LANE, MOST_POINTS, runs_of
from mcz.errors import FormatError, LimitError, OptionError

HASH = 8  # bytes of the hash of a block
SECTION = 128  # bytes of a section of the table, where it has so many
HEAD = 69  # bytes of a packet beside its body: 61 before it, 8 behind
LEAST_BLOCK, MOST_BLOCKS = 256, 1 << 15
LEAST_RECOVERY = 4  # blocks, so that a small file can take some bad places


@dataclass(frozen=True, slots=True)
class Shape:
    """Sizes of what is protected and of the code; all else follows from them.

    The stream is bytes ``start`` to ``start + a_size`` of the file, which the RECV begins at, and
    the ``t_size`` bytes behind the RECV.
    """

    start: int
    a_size: int
    t_size: int
    block_size: int
    n_recovery: int

    def __post_init__(self) -> None:
        sound = self.block_size % LANE == 0 < self.block_size and self.n_recovery > 0
        if not sound or not self.size:
            raise FormatError(f"recovery data: {self}")
        if runs_of(self.n_recovery) + self.n_blocks > MOST_POINTS:
            raise LimitError(f"recovery data: {self.n_blocks} and {self.n_recovery} blocks")

    @property
    def size(self) -> int:
        """Bytes of the stream."""
        return self.a_size + self.t_size

    @property
    def n_blocks(self) -> int:
        return -(-self.size // self.block_size)

    @property
    def section_size(self) -> int:
        return min(SECTION, HASH * self.n_blocks)

    @property
    def n_sections(self) -> int:
        """Sections of the table of hashes."""
        return -(-HASH * self.n_blocks // self.section_size)

    @property
    def n_parities(self) -> int:
        """Sections computed from these."""
        return max(self.n_recovery, self.n_sections)

    @property
    def chunk_offset(self) -> int:
        return self.start + self.a_size

    @property
    def chunk_size(self) -> int:
        return FRAMING + self.payload_size

    @property
    def payload_size(self) -> int:
        sections = (self.n_sections + self.n_parities) * (HEAD + self.section_size)
        return sections + self.n_recovery * (HEAD + self.block_size)

    @property
    def stop(self) -> int:
        """End of the protected file."""
        return self.chunk_offset + self.chunk_size + self.t_size

    @property
    def burst(self) -> int:
        """Bytes in a row that may be bad wherever they lie, if nothing else is."""
        return (self.n_recovery - 1) * self.block_size + 1

    def packets(self) -> Iterator[tuple[int, int, int]]:
        """Kind, index and offset in the file of each packet: half of the sections at either end."""
        at = self.chunk_offset + HEADER.size
        n = self.n_sections + self.n_parities
        order = [(0, index) for index in range(n - n // 2)]
        order += [(1, index) for index in range(self.n_recovery)]
        order += [(0, index) for index in range(n - n // 2, n)]
        for kind, index in order:
            yield kind, index, at
            at += HEAD + (self.block_size if kind else self.section_size)

    def pieces(self, block: int) -> list[tuple[int, int]]:
        """Offset in the file and size of the pieces of a data block, padding left out."""
        first = block * self.block_size
        stop = min(first + self.block_size, self.size)
        behind = self.chunk_size + self.start
        found = []
        if first < self.a_size:
            found.append((self.start + first, min(stop, self.a_size) - first))
        if stop > self.a_size:
            own = max(first, self.a_size)
            found.append((behind + own, stop - own))
        return found

    def block(self, number: int, read: Callable[[int, int], bytes]) -> bytes:
        """A data block and its padding; ``read`` gives bytes of the file by offset and size."""
        data = b"".join(read(offset, size) for offset, size in self.pieces(number))
        return data.ljust(self.block_size, b"\0")


def check_redundancy(redundancy: float) -> None:
    """Raise OptionError for what is no share."""
    if not 0 < redundancy <= 1:
        raise OptionError(f"redundancy is {redundancy:g}, not above 0 and at most 1")


def shape_for(start: int, a_size: int, t_size: int, redundancy: float) -> Shape:
    """The shape for a stream of these sizes; raises OptionError for a redundancy that cannot be."""
    check_redundancy(redundancy)
    size = a_size + t_size
    block = max(LEAST_BLOCK, isqrt(4 * size), -(-size // MOST_BLOCKS))
    block = -(-block // LANE) * LANE
    n_blocks = -(-size // block)
    wanted = max(LEAST_RECOVERY, ceil(redundancy * n_blocks))
    return Shape(start, a_size, t_size, block, wanted)
