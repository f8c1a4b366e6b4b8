"""Metadata of clips in chunks of their own: META.

SPEC.md, "META", is normative.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from sys import intern

from mcz.container import payloads
from mcz.container.chunks import Chunk
from mcz.container.dictionary_deflate import decoded, smallest
from mcz.container.directory import ClipRow
from mcz.container.limits import BASE, MIB, Profile, check, metadata_limit
from mcz.container.metadata_keys import INTERPRETED
from mcz.errors import FormatError
from mcz.model.schema import build, parse, parse_all, parse_until

MOST_KEPT = 16 * MIB  # bytes, about: 40,000 clips of three keys
PAIR = 100  # bytes that Python takes for a pair, beside its letters


@dataclass(frozen=True, slots=True)
class Record:
    """A META record of the clip ``name``, or with "" of the whole file.

    ``removed`` are keys that are not there any more, ``entries`` what is there from now on.
    """

    name: str
    entries: Mapping[str, str] = field(default_factory=dict)
    removed: tuple[str, ...] = ()


Placed = dict[str, list[tuple[int, Record]]]  # by name, each with where its META begins


class Remembered:
    """Cache of the metadata in CLIPs, up to ``MOST_KEPT``."""

    def __init__(self) -> None:
        self._pairs: dict[str, dict[str, str]] = {}
        self._size = 0

    def of(self, row: ClipRow, payload: Callable[[Chunk], bytes]) -> Mapping[str, str]:
        """Return the metadata in the CLIP of ``row``, whose payload is read unless cached."""
        found = self._pairs.get(row.name)
        if found is None:
            clip = parse_until(payloads.Clip, payload(row.clip), row.clip.label, "source")
            found = {intern(pair.key): pair.value for pair in clip.metadata}
            self._size += PAIR + sum(PAIR + len(key) + len(found[key]) for key in found)
            if self._size <= MOST_KEPT:
                self._pairs[row.name] = found
        return found


def applied(pairs: Mapping[str, str], records: Iterable[Record]) -> dict[str, str]:
    """``pairs`` as they are after the records, in order."""
    found = dict(pairs)
    for record in records:
        for key in record.removed:
            found.pop(key, None)
        found |= record.entries
    return found


def as_one(name: str, records: Iterable[Record]) -> Record:
    """A record of ``name`` that says what ``records`` say together."""
    entries: dict[str, str] = {}
    removed: dict[str, None] = {}
    for record in records:
        for key in record.removed:
            entries.pop(key, None)
            removed[key] = None
        entries |= record.entries
    return Record(name, entries, tuple(key for key in removed if key not in entries))


def build_metas(
    records: Sequence[Record], *, short: bool = False, profile: Profile = BASE
) -> Iterator[bytes]:
    """The payloads of the META chunks that hold ``records``, each of about 1 MiB at most."""
    content = bytearray()
    for record in records:
        content += record_bytes(record)
        if len(content) >= min(MIB, profile.coded_bytes):
            yield _payload(bytes(content), short, profile)
            content.clear()
    if content:
        yield _payload(bytes(content), short, profile)


def _payload(content: bytes, short: bool, profile: Profile) -> bytes:
    flags, data = smallest(content, short=short, plain=profile.is_plain)
    return build(payloads.Meta(flags=flags, size=len(content), data=data), "META")


def record_bytes(record: Record) -> bytes:
    """A record as META has it."""
    entries = payloads.metadata_records(record.entries)
    stored = payloads.MetaRecord(clip=record.name, removed=list(record.removed), entries=entries)
    return build(stored, "META")


def parse_meta(payload: bytes, chunk: Chunk, file_bytes: int) -> list[Record]:
    """The records in ``payload``, that of the META ``chunk`` of a file of ``file_bytes``.

    Raises FormatError, and LimitError where they would be longer than an index may be.
    """
    where = f"chunk {chunk.label}"
    fields = parse(payloads.Meta, payload, where)
    check(f"{where}: bytes of the records", fields.size, metadata_limit(file_bytes))
    content = decoded(fields.data, fields.flags, fields.size, where)
    records = []
    for stored in parse_all(payloads.MetaRecord, content, where):
        _check_keys(stored.removed, where)
        _check_keys([pair.key for pair in stored.entries], where)
        pairs = payloads.metadata_pairs(stored.entries)
        records.append(Record(stored.clip, pairs, tuple(stored.removed)))
    return records


def records_in(
    chunks: Iterable[Chunk],
    payload_of: Callable[[Chunk], bytes],
    file_bytes: int,
    *,
    lenient: bool,
) -> Placed:
    """Collect the META records of each name, and their offsets, in file order.

    ``lenient``: of one that is damaged nothing is taken, and nothing raised.
    """
    found: Placed = {}
    for chunk in chunks:
        try:
            records = parse_meta(payload_of(chunk), chunk, file_bytes)
        except FormatError:
            if not lenient:
                raise
            continue
        for record in records:
            found.setdefault(record.name, []).append((chunk.offset, record))
    return found


def _check_keys(keys: Sequence[str], where: str) -> None:
    for key in keys:
        if key in INTERPRETED:  # META-03
            raise FormatError(f"{key!r} is not to be said behind a clip", where=where)
    if len(keys) != len(set(keys)):  # META-04
        raise FormatError(f"a key occurs twice in one record: {sorted(keys)}", where=where)
