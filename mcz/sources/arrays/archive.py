"""The structure of a ZIP archive: its members, and the fields that follow from them.

Deflated members are inflated, up to a limit. A ZIP states most things twice: if the two disagree
about the place of a member, it is refused.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from mcz.errors import MczError, SourceError
from mcz.model.schema import inflate
from mcz.sources.arrays.layout import SIZES, PieceKind

LOCAL, CENTRAL, END = b"PK\3\4", b"PK\1\2", b"PK\5\6"
END64, LOCATOR64, DESCRIPTOR = b"PK\6\6", b"PK\6\7", b"PK\7\x08"
STORED, DEFLATED = 0, 8  # methods
ENCRYPTED, DESCRIBED = 1, 8  # flags of a member
FULL32 = 0xFFFFFFFF  # the number is in the ZIP64 field
ZIP64 = 1  # id of that extra field
MAX_MEMBERS = 2**16
LEAST_LIMIT, MOST_RATIO = 2**26, 16  # contents may always have, or have for each byte of the file


@dataclass(frozen=True, slots=True)
class ArchiveField:
    """A number at offset ``at`` that follows from the bytes from ``start`` to ``stop``."""

    at: int
    kind: PieceKind
    start: int
    stop: int


@dataclass(frozen=True, slots=True)
class ArchiveMember:
    """A member: ``at`` is the offset of its local header, ``start`` and ``stop`` those of its
    bytes; ``entry`` is that of its entry in the central directory.

    ``contents`` are the offsets in ``Archive.data`` of its ``size`` bytes as they were before they
    were packed; None if they are not known, for the reason ``fault``.
    """

    name: str
    method: int
    flags: int
    at: int
    start: int
    stop: int
    entry: int
    size: int
    contents: tuple[int, int] | None = None
    fault: str = ""

    @property
    def is_encrypted(self) -> bool:
        return bool(self.flags & ENCRYPTED)

    @property
    def is_stored(self) -> bool:
        return self.method == STORED and not self.is_encrypted

    @property
    def is_deflated(self) -> bool:
        return self.method == DEFLATED and not self.is_encrypted


@dataclass(frozen=True, slots=True)
class Archive:
    """The members of a ZIP in the order of their bytes, and its fields that are true.

    ``data`` is the file and, from ``size`` on, the contents of its deflated members. ``wrong``:
    members whose CRC-32 is another.
    """

    data: bytes
    size: int
    members: tuple[ArchiveMember, ...] = ()
    fields: tuple[ArchiveField, ...] = ()
    wrong: tuple[str, ...] = ()


def _number(data: bytes, at: int, size: int) -> int:
    return int.from_bytes(data[at : at + size], "little")


def read_archive(data: bytes) -> Archive:
    """The structure of a ZIP; raises SourceError, with the offset at fault."""
    tail, end, start, n_members = _ends(data)
    entries, at = [], start
    for _ in range(n_members):
        member, at = _entry(data, at, end)
        entries.append(member)
    _check_names(entries)
    members = tuple(sorted(entries, key=lambda member: member.at))
    for one, other in pairwise(members):
        if one.stop > other.at:
            raise SourceError(f"members {one.name!r} and {other.name!r} overlap", offset=other.at)
    if members and members[-1].stop > start:
        raise SourceError(f"member {members[-1].name!r} overlaps the directory", offset=start)
    whole, members = _with_contents(data, members)
    parts = (*_of_members(data, members), *_of_directory(data, start, end, tail))
    fields = sorted(parts, key=lambda field: field.at)
    sums = {
        (f.start, f.stop): zlib.crc32(memoryview(whole)[f.start : f.stop])
        for f in fields
        if f.kind == PieceKind.CRC
    }
    true, wrong, written_to = [], set(), 0
    for field in fields:
        width = SIZES[field.kind]
        is_sum = field.kind == PieceKind.CRC
        number = sums[field.start, field.stop] if is_sum else field.stop - field.start
        if field.at >= written_to and _number(data, field.at, width) == number:
            true.append(field)
            written_to = field.at + width
        elif is_sum and field.at >= start:
            span = field.start, field.stop
            wrong |= {member.name for member in members if member.contents == span}
    return Archive(whole, len(data), members, tuple(true), tuple(sorted(wrong)))


def _with_contents(
    data: bytes, members: Sequence[ArchiveMember]
) -> tuple[bytes, tuple[ArchiveMember, ...]]:
    """The file followed by the contents of deflated members, and the members with their place."""
    left = max(LEAST_LIMIT, MOST_RATIO * len(data))
    parts, placed, end = [data], [], len(data)
    for member in members:
        if member.is_stored:
            member = replace(member, contents=(member.start, member.stop))
        elif member.is_deflated and member.size > left:
            member = replace(member, fault=f"of {member.size} bytes when inflated: too many")
        elif member.is_deflated:
            try:
                part = inflate(data[member.start : member.stop], member.size, member.name)
            except MczError as error:
                member = replace(member, fault=f"damaged: {error}")
            else:
                parts.append(part)
                member = replace(member, contents=(end, end + len(part)))
                end += len(part)
                left -= len(part)
        placed.append(member)
    return b"".join(parts), tuple(placed)


def _ends(data: bytes) -> tuple[int, int, int, int]:
    """Find the end record: its offset, the end and the start of the directory, its entries."""
    low = max(0, len(data) - 22 - 0xFFFF)
    end = data.rfind(END, low)
    while end >= 0 and end + 22 + _number(data, end + 20, 2) != len(data):
        end = data.rfind(END, low, end)
    if end < 0:
        raise SourceError(
            "no end of a ZIP directory: not a ZIP file, or truncated", offset=len(data)
        )
    n_members, size, start = (_number(data, end + k, n) for k, n in ((10, 2), (12, 4), (16, 4)))
    stop = end
    locator = end - 20
    if locator >= 0 and data[locator : locator + 4] == LOCATOR64:
        stop = _number(data, locator + 8, 8)
        if data[stop : stop + 4] != END64 or stop + 56 > locator:
            raise SourceError(f"no ZIP64 end of the directory at {stop}", offset=locator + 8)
        n_members, size, start = (_number(data, stop + k, 8) for k in (32, 40, 48))
    if start + size != stop:
        raise SourceError(
            f"a directory of {size} bytes from {start} on cannot end at {stop}", offset=end
        )
    if n_members > min(MAX_MEMBERS, size // 46):
        raise SourceError(f"{n_members} members do not fit a directory of {size} bytes", offset=end)
    return end, stop, start, n_members


def _entry(data: bytes, at: int, end: int) -> tuple[ArchiveMember, int]:
    """The member whose entry of the directory is at ``at``, and where the next entry is."""
    if at + 46 > end or data[at : at + 4] != CENTRAL:
        raise SourceError("the directory has an invalid entry", offset=at)
    sizes = [_number(data, at + k, 2) for k in (28, 30, 32)]
    next_entry = at + 46 + sum(sizes)
    if next_entry > end:
        raise SourceError("an entry of the directory extends past its end", offset=at)
    raw = data[at + 46 : at + 46 + sizes[0]]
    name = raw.decode("utf-8" if _number(data, at + 8, 2) & 0x800 else "cp437", "replace")
    size, packed, local = (value for value, _, _ in _wide_fields(data, at, sizes))
    method, flags = _number(data, at + 10, 2), _number(data, at + 8, 2)
    if local + 30 > len(data) or data[local : local + 4] != LOCAL:
        raise SourceError(f"member {name!r} has no local header at {local}", offset=at)
    start = local + 30 + _number(data, local + 26, 2) + _number(data, local + 28, 2)
    if start + packed > len(data):
        raise SourceError(f"member {name!r} of {packed} bytes extends past the end", offset=local)
    member = ArchiveMember(name, method, flags, local, start, start + packed, at, size)
    if member.is_stored and size != packed:
        raise SourceError(
            f"member {name!r} is stored uncompressed, but its sizes differ: {packed} and "
            f"{size} bytes",
            offset=at,
        )
    _check_local(data, member, raw)
    return member, next_entry


def _check_names(members: list[ArchiveMember]) -> None:
    """Raise SourceError for names that NumPy or zipfile take as equal."""
    seen = set()
    for member in members:
        name = member.name.partition("\0")[0].removesuffix(".npy")
        if name in seen:
            raise SourceError(f"two members have the name {name!r}", offset=member.entry)
        seen.add(name)


def _check_local(data: bytes, member: ArchiveMember, raw: bytes) -> None:
    """Raise SourceError if the local header differs from the directory."""
    at = member.at
    if data[at + 30 : at + 30 + _number(data, at + 26, 2)] != raw:
        raise SourceError(f"member {member.name!r} has another name in its local header", offset=at)
    if _number(data, at + 8, 2) != member.method:
        raise SourceError(
            f"member {member.name!r} has different compression methods in directory and local "
            "header",
            offset=at + 8,
        )
    packed, where, _ = _local_sizes(data, member)[1]
    is_open = packed == FULL32 or _number(data, at + 6, 2) & DESCRIBED  # said elsewhere
    if packed != member.stop - member.start and not is_open:
        raise SourceError(
            f"member {member.name!r} has {member.stop - member.start} bytes, but its local "
            f"header states {packed}",
            offset=where,
        )


def _wide_fields(data: bytes, at: int, sizes: list[int]) -> list[tuple[int, int, int]]:
    """Value, offset and bytes of the two sizes and the place of an entry, size first."""
    plain = [(at + 24, 4), (at + 20, 4), (at + 42, 4)]
    return _zip64_numbers(data, plain, at + 46 + sizes[0], sizes[1])


def _local_sizes(data: bytes, member: ArchiveMember) -> list[tuple[int, int, int]]:
    """Value, offset and bytes of the two sizes of a local header, size first."""
    at = member.at
    extra = at + 30 + _number(data, at + 26, 2)
    return _zip64_numbers(data, [(at + 22, 4), (at + 18, 4)], extra, member.start - extra)


def _zip64_numbers(
    data: bytes, plain: list[tuple[int, int]], extra: int, size: int
) -> list[tuple[int, int, int]]:
    """Numbers of 4 bytes, or the 8 bytes of the extra field that replace them."""
    at, stop = _zip64(data, extra, extra + size)
    numbers = []
    for where, width in plain:
        if _number(data, where, 4) == FULL32 and at + 8 <= stop:
            where, width, at = at, 8, at + 8
        numbers.append((_number(data, where, width), where, width))
    return numbers


def _zip64(data: bytes, at: int, stop: int) -> tuple[int, int]:
    """Find the start and end of the ZIP64 field; (0, 0) if there is none."""
    while at + 4 <= stop:
        end = at + 4 + _number(data, at + 2, 2)
        if _number(data, at, 2) == ZIP64:
            return at + 4, min(end, stop)
        at = end
    return 0, 0


def _of_members(data: bytes, members: tuple[ArchiveMember, ...]) -> Iterator[ArchiveField]:
    """The numbers of headers, entries and descriptors that may follow from the members."""
    for member in members:
        span = member.start, member.stop
        sizes = [_number(data, member.entry + k, 2) for k in (28, 30, 32)]
        entry_fields = _wide_fields(data, member.entry, sizes)
        place = entry_fields.pop()
        for pair in (_local_sizes(data, member), entry_fields):
            for (_, at, width), of in zip(pair, (member.contents, span), strict=True):
                if of is not None:
                    yield ArchiveField(at, _of_width(width), *of)
        if member.contents is not None:
            yield ArchiveField(member.at + 14, PieceKind.CRC, *member.contents)
            yield ArchiveField(member.entry + 16, PieceKind.CRC, *member.contents)
        yield ArchiveField(place[1], _of_width(place[2]), 0, member.at)
        if member.flags & DESCRIBED and member.contents is not None:
            yield from _descriptor(data, member, member.contents)


def _of_directory(data: bytes, start: int, end: int, tail: int) -> Iterator[ArchiveField]:
    """The numbers at the end, at ``tail``, that may follow from a directory."""
    yield ArchiveField(tail + 12, PieceKind.SIZE4, start, end)
    yield ArchiveField(tail + 16, PieceKind.SIZE4, 0, start)
    if data[end : end + 4] == END64:
        yield ArchiveField(end + 40, PieceKind.SIZE8, start, end)
        yield ArchiveField(end + 48, PieceKind.SIZE8, 0, start)
        yield ArchiveField(tail - 12, PieceKind.SIZE8, 0, end)


def _descriptor(
    data: bytes, member: ArchiveMember, contents: tuple[int, int]
) -> Iterator[ArchiveField]:
    """The fields of what may follow the bytes of a member."""
    at = member.stop + (4 if data[member.stop : member.stop + 4] == DESCRIPTOR else 0)
    packed = member.stop - member.start
    wide = _number(data, at + 4, 8) == packed and _number(data, at + 12, 8) == member.size
    width = 8 if wide else 4
    yield ArchiveField(at, PieceKind.CRC, *contents)
    yield ArchiveField(at + 4, _of_width(width), member.start, member.stop)
    yield ArchiveField(at + 4 + width, _of_width(width), *contents)


def _of_width(width: int) -> PieceKind:
    return PieceKind.SIZE8 if width == 8 else PieceKind.SIZE4
