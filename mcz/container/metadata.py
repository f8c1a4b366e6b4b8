"""Metadata of clips in chunks of their own, META, and the keys of SPEC.md's registry.

SPEC.md, "META", is normative. Values are checked when they are set, never when they are read.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import date, datetime

from mcz.container import payloads
from mcz.container.chunks import Chunk
from mcz.container.encodings import decode_data, encode_smallest
from mcz.container.limits import BASE, MIB, Profile, check, metadata_limit
from mcz.errors import FormatError, OptionError
from mcz.model.schema import build, parse, parse_all
from mcz.model.text_format import nearest_names


@dataclass(frozen=True, slots=True)
class Record:
    """A META record of the clip ``name``, or with "" of the whole file.

    ``removed`` are keys to delete, ``entries`` keys and values to set.
    """

    name: str
    entries: Mapping[str, str] = field(default_factory=dict)
    removed: tuple[str, ...] = ()


Placed = dict[str, list[tuple[int, Record]]]  # by name, each with the offset of its META


def apply_records(pairs: Mapping[str, str], records: Iterable[Record]) -> dict[str, str]:
    """Apply the records to ``pairs``, in order."""
    updated = dict(pairs)
    for record in records:
        for key in record.removed:
            updated.pop(key, None)
        updated |= record.entries
    return updated


def merge_records(name: str, records: Iterable[Record]) -> Record:
    """A record of ``name`` equivalent to ``records`` in order."""
    entries: dict[str, str] = {}
    removed: dict[str, None] = {}
    for record in records:
        for key in record.removed:
            entries.pop(key, None)
            removed[key] = None
        entries |= record.entries
    return Record(name, entries, tuple(key for key in removed if key not in entries))


def build_metas(
    records: Sequence[Record],
    *,
    short: bool = False,
    profile: Profile = BASE,
    file_bytes: int = 0,
) -> Iterator[bytes]:
    """The payloads of META chunks with ``records``, each of about 1 MiB at most.

    ``file_bytes``: the bytes of the file before them.
    """
    content = bytearray()
    for record in records:
        content += record_bytes(record)
        if len(content) >= min(MIB, profile.coded_bytes):
            yield _payload(bytes(content), short, profile, file_bytes)
            content.clear()
    if content:
        yield _payload(bytes(content), short, profile, file_bytes)


def _payload(content: bytes, short: bool, profile: Profile, file_bytes: int) -> bytes:
    flags, data = encode_smallest(content, short=short, plain=profile.is_plain)
    # a long value that deflates well would inflate to more than readers of a small file accept
    if len(content) > metadata_limit(file_bytes + len(data)):
        flags, data = payloads.STORED, content
    return build(payloads.Meta(flags=flags, size=len(content), data=data), "META")


def record_bytes(record: Record) -> bytes:
    entries = payloads.metadata_records(record.entries)
    stored = payloads.MetaRecord(clip=record.name, removed=list(record.removed), entries=entries)
    return build(stored, "META")


def parse_meta(payload: bytes, chunk: Chunk, file_bytes: int) -> list[Record]:
    """Parse ``payload``, that of the META ``chunk`` in a file of ``file_bytes``.

    Raises FormatError, and LimitError if they would be longer than an index may be.
    """
    where = f"chunk {chunk.label}"
    fields = parse(payloads.Meta, payload, where)
    check(f"{where}: bytes of the records", fields.size, metadata_limit(file_bytes))
    content = decode_data(fields.data, fields.flags, fields.size, where)
    records = []
    for stored in parse_all(payloads.MetaRecord, content, where):
        _check_keys(stored.removed, where)
        _check_keys([pair.key for pair in stored.entries], where)
        pairs = payloads.metadata_pairs(stored.entries)
        records.append(Record(stored.clip, pairs, tuple(stored.removed)))
    return records


def read_records(
    chunks: Iterable[Chunk], payload_of: Callable[[Chunk], bytes], file_bytes: int, *, lenient: bool
) -> Placed:
    """Collect the META records of each name, and their offsets, in file order.

    ``lenient``: a damaged META is skipped, and no error raised.
    """
    placed: Placed = {}
    for chunk in chunks:
        try:
            records = parse_meta(payload_of(chunk), chunk, file_bytes)
        except FormatError:
            if not lenient:
                raise
            continue
        for record in records:
            placed.setdefault(record.name, []).append((chunk.offset, record))
    return placed


def _check_keys(keys: Sequence[str], where: str) -> None:
    for key in keys:
        if key in INTERPRETED:  # META-03
            raise FormatError(f"{key!r} must not follow a clip", where=where)
    if len(keys) != len(set(keys)):  # META-04
        raise FormatError(f"a key occurs twice in the record: {sorted(keys)}", where=where)


PRIVATE = "x-"
SPDX = re.compile(r"\(*[A-Za-z0-9.+:-]+\)*( (AND|OR|WITH) \(*[A-Za-z0-9.+:-]+\)*)*")
DOI = re.compile(r"10\.[0-9]{4,9}/\S+")
FRACTION = re.compile(r"(\.[0-9]{1,6})[0-9]{0,3}")  # of a second; datetime reads six digits


def _is_date(value: str) -> bool:
    """A year, a month or a day: 2014, 2014-05, 2014-05-21."""
    if not re.fullmatch(r"[0-9]{4}(-[0-9]{2}){0,2}", value):
        return False
    return _parses(date.fromisoformat, value + "-01" * (2 - value.count("-")))


def _is_time(value: str) -> bool:
    """Return whether a text is a date and time by ISO 8601, perhaps with its offset from UTC."""
    if not re.match(r"[0-9]{4}-[0-9]{2}-[0-9]{2}T[0-9]{2}:[0-9]{2}", value):
        return False
    return _parses(datetime.fromisoformat, FRACTION.sub(r"\1", value))


def _parses(parse: Callable[[str], object], value: str) -> bool:
    try:
        parse(value)
    except ValueError:
        return False
    return True


TYPES: dict[str, Callable[[str], bool]] = {
    "text": lambda value: True,
    "date": _is_date,
    "time": _is_time,
    "SPDX": lambda value: SPDX.fullmatch(value) is not None,
    "DOI": lambda value: DOI.fullmatch(value) is not None,
}
EXAMPLES = {
    "date": "2014, 2014-05 or 2014-05-21",
    "time": "2014-05-21T14:30:00+02:00",
    "SPDX": "CC-BY-4.0",
    "DOI": "10.1000/182",
}

# The first three describe values and source of a clip, and must not follow it (META-03).
KEYS = {
    "name-encoding": "text",
    "skeleton-note": "text",
    "source-note": "text",
    "subject": "text",
    "scene": "text",
    "rights": "text",
    "credit": "text",
    "title": "text",
    "session": "text",
    "date": "date",
    "time": "time",
    "place": "text",
    "lab": "text",
    "system": "text",
    "marker-set": "text",
    "protocol": "text",
    "description": "text",
    "keywords": "text",
    "rights-holder": "text",
    "licence": "SPDX",
    "consent": "text",
    "contact": "text",
    "doi": "DOI",
    "published": "date",
    "mtime": "time",
}
SPELLINGS = {"license": "licence"}  # of keys that users may type
INTERPRETED = tuple(KEYS)[:3]
SETTABLE = tuple(KEYS)[3:]  # keys that users set


def check_pair(key: str, value: str | None) -> None:
    """Raise OptionError for a key that cannot be set, or a value that it cannot have.

    ``value`` None: it is removed.
    """
    if key in INTERPRETED:
        raise OptionError(
            f"{key!r} is determined by the clip's values or source, and cannot be set or removed"
        )
    if key not in KEYS and not (key.startswith(PRIVATE) and len(key) > len(PRIVATE)):
        near = nearest_names(key, SETTABLE)
        hint = f"did you mean {near}?" if near else f"registered are {', '.join(SETTABLE)}"
        raise OptionError(
            f"metadata key {key!r} is not registered; {hint}; private keys begin with {PRIVATE!r}"
        )
    kind = KEYS.get(key, "text")
    if value is not None and not TYPES[kind](value):
        raise OptionError(f"{key} is {value!r}, not a {kind} such as {EXAMPLES[kind]}")
