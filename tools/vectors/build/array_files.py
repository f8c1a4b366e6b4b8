"""NPY and NPZ files, to order: byte by byte, since what NumPy writes may change."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcz.model.motion import Motion
from mcz.model.schema import varint
from mcz.sources import FORMATS
from mcz.sources.arrays.layout import Piece, PieceKind
from tools.vectors.build.source_files import set_path

SPEC = "Template of arrays; The bytes of arrays"
FULL, WIDE, ROOM = 0xFFFFFFFF, 0xFFFFFFFFFFFFFFFF, 128


def npy(
    array: NDArray[Any], code: str = "", *, is_fortran: bool = False, room: int = ROOM
) -> bytes:
    """An NPY file of version 1; ``code`` is that of its type, "<f8" and the like.

    ``room`` is what its head fills up to a multiple of.
    """
    code = code or array.dtype.str.replace("=", "<")
    shape = "({},)" if array.ndim == 1 else "({})"
    text = (
        f"{{'descr': '{code}', 'fortran_order': {is_fortran}, "
        f"'shape': {shape.format(', '.join(map(str, array.shape)))}, }}"
    )
    text += " " * (-(len(text) + 11) % room) + "\n"
    numbers = array.astype(code).tobytes(order="F" if is_fortran else "C")
    return b"\x93NUMPY\1\0" + struct.pack("<H", len(text)) + text.encode() + numbers


@dataclass(frozen=True, slots=True)
class Member:
    """A member of a ZIP: ``wide`` with sizes of 64 bits, ``described`` with what follows it.

    ``method`` and ``size`` are those of its header; ``checksum`` is another CRC-32 than its own.
    """

    name: str
    data: bytes
    wide: bool = True
    described: bool = False
    method: int = 0
    size: int | None = None
    checksum: int | None = None

    def header(self) -> tuple[bytes, bytes]:
        """The local header, and what follows the bytes."""
        n = len(self.data)
        said = (0, 0, 0) if self.described else (self.crc, n, self.full)
        extra = b""
        if self.wide:
            extra = struct.pack("<HHQQ", 1, 16, self.full, n)
            said = (said[0], FULL, FULL)
        fixed = struct.pack("<IHHHHH", 0x04034B50, 45, 8 * self.described, self.method, 0, 33)
        name = self.name.encode()
        head = fixed + struct.pack("<IIIHH", *said, len(name), len(extra)) + name + extra
        after = struct.pack("<IIII", 0x08074B50, self.crc, n, self.full) if self.described else b""
        return head, after

    def entry(self, at: int) -> bytes:
        name = self.name.encode()
        fixed = struct.pack(
            "<IHHHHHH", 0x02014B50, 0x32D, 45, 8 * self.described, self.method, 0, 33
        )
        sizes = struct.pack("<III", self.crc, len(self.data), self.full)
        return fixed + sizes + struct.pack("<HHHHHII", len(name), 0, 0, 0, 0, 0x1800000, at) + name

    @property
    def crc(self) -> int:
        return zlib.crc32(self.data) if self.checksum is None else self.checksum

    @property
    def full(self) -> int:
        return len(self.data) if self.size is None else self.size


def npz(members: Sequence[Member], *, wide: bool = False, comment: bytes = b"") -> bytes:
    """A ZIP of members; ``wide`` with a ZIP64 end of its directory."""
    out, entries = b"", b""
    for member in members:
        head, after = member.header()
        entries += member.entry(len(out))
        out += head + member.data + after
    n, at, size = len(members), len(out), len(entries)
    out += entries
    said = (n, n, size, at)
    if wide:
        end = len(out)
        out += struct.pack("<IQHHIIQQQQ", 0x06064B50, 44, 45, 45, 0, 0, *said)
        out += struct.pack("<IIQI", 0x07064B50, 0, end, 1)
        said = (0xFFFF, 0xFFFF, FULL, FULL)
    return out + struct.pack("<IHHHHIIH", 0x06054B50, 0, 0, *said, len(comment)) + comment


def plain_npz(arrays: dict[str, NDArray[Any]], **said: Any) -> bytes:
    """An NPZ as NumPy saves it."""
    return npz([Member(f"{name}.npy", npy(array)) for name, array in arrays.items()], **said)


def take_arrays(data: bytes, path: str) -> Motion:
    """The motion in an array file, which gives it back."""
    name, _, suffix = path.partition(".")
    motion = set_path(FORMATS[suffix].read(data, name), path)
    assert FORMATS[suffix].write(motion) == data, path
    return motion


def raw(piece: Piece, **fields: Any) -> bytes:
    """The bytes of a piece with other fields, also those that no schema admits."""
    piece = replace(piece, **fields)
    kind = bytes((piece.kind,))
    match piece.kind:
        case PieceKind.TEXT:
            return kind + varint(len(piece.text)) + piece.text
        case PieceKind.OWN:
            return kind
        case PieceKind.COUNT:
            after = varint(len(piece.after)) + piece.after
            return kind + varint(piece.signal) + after + varint(piece.size)
        case PieceKind.DATA:
            runs = b"".join(varint(channel) + varint(n) for channel, n in piece.runs)
            said = bytes((piece.type, piece.flags)) + varint(len(piece.runs))
            return kind + varint(piece.signal) + said + runs
    return kind + varint(piece.start) + varint(piece.stop)


def floats(*shape: int, seed: int = 1) -> NDArray[np.float64]:
    """Numbers of no short form: quotients of integers, the same on every machine."""
    count = int(np.prod(shape))
    k = (np.arange(count, dtype=np.int64) * 7919 + seed * 104729) % 20011
    return ((k - 10005) / 997.0).reshape(shape)
