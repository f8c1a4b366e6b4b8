"""Tables of records, stored by columns: a count, then the values of each field.

NumPy reads a column of varints or of bytes in bulk; the record declares the type of each field.
SPEC.md, "Conventions", is normative.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import BinaryIO, Generic, TypeAlias, TypeVar, cast, overload

import construct
import numpy as np
from construct import Container

from mcz.errors import FormatError, TruncatedError
from mcz.model.schema.records import Record, RecordType
from mcz.model.schema.types import (
    MAX_COUNT,
    UVARINT,
    Checked,
    Exactly,
    Sized,
    Text,
    as_construct,
    read_varint,
    varint,
)
from mcz.model.types import Ints

R = TypeVar("R", bound=Record)
Numbers: TypeAlias = Ints
Column: TypeAlias = Numbers | list[bytes] | list[str]
Item: TypeAlias = int | bytes | str
Row: TypeAlias = tuple[Item, ...]

MOST_BYTES = 8  # of a varint
FEW_VARINTS = 8  # up to which Python is faster than NumPy


class Table(Sequence[R], Generic[R]):
    """The records of a table; ``column`` has the values of a field; records are built on access."""

    def __init__(self, record: type[R], columns: dict[str, Column], count: int) -> None:
        self.record, self.columns, self.n_rows = record, columns, count

    @classmethod
    def of(cls, record: type[R], rows: Sequence[Row]) -> Table[R]:
        """The table of rows, each with the values of the fields in their order."""
        names = [name for name, _ in cast(RecordType, as_construct(record)).rows]
        columns = zip(*rows, strict=True) if rows else [()] * len(names)
        columns_by_name = {
            name: _as_column(values) for name, values in zip(names, columns, strict=True)
        }
        return cls(record, columns_by_name, len(rows))

    def numbers(self, name: str) -> Numbers:
        """The column of a field of numbers."""
        return cast(Numbers, self.columns[name])

    def blobs(self, name: str) -> list[bytes]:
        """The column of a field of bytes."""
        return cast("list[bytes]", self.columns[name])

    def texts(self, name: str) -> list[str]:
        """The column of a field of text."""
        return cast("list[str]", self.columns[name])

    def __len__(self) -> int:
        return self.n_rows

    @overload
    def __getitem__(self, index: int) -> R: ...
    @overload
    def __getitem__(self, index: slice) -> Table[R]: ...
    def __getitem__(self, index: int | slice) -> R | Table[R]:
        if isinstance(index, slice):
            columns = {name: values[index] for name, values in self.columns.items()}
            return Table(self.record, columns, len(range(*index.indices(self.n_rows))))
        if not -self.n_rows <= index < self.n_rows:
            raise IndexError(index)
        return self.record(**{name: _item(values[index]) for name, values in self.columns.items()})

    def rows(self) -> list[Row]:
        """The values of the fields of each record."""
        return list(zip(*map(_list, self.columns.values()), strict=True))

    def __iter__(self) -> Iterator[R]:
        for values in self.rows():
            yield self.record(**dict(zip(self.columns, values, strict=True)))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Sequence) and list(self) == list(other)

    __hash__ = None  # type: ignore[assignment]


def _as_column(values: Sequence[Item]) -> Column:
    if values and isinstance(values[0], bytes | str):
        return cast(Column, list(values))
    return np.asarray(values, np.int64)


def _item(value: np.int64 | bytes | str) -> Item:
    return int(value) if isinstance(value, np.integer) else value


class Columns(construct.Subconstruct):
    """A varint count of records, then a column for each of their fields.

    A column of texts or sized bytes has the lengths of all, as varints, then the bytes of all.
    """

    def __init__(self, record: type[Record]) -> None:
        super().__init__(as_construct(record))
        self.record = record

    @property
    def rows(self) -> list[tuple[str, construct.Construct]]:
        return cast(RecordType, self.subcon).rows

    def _parse(self, stream: BinaryIO, context: Container, path: str) -> Table[Record]:
        count = UVARINT._parse(stream, context, path)
        start = stream.tell()
        rest = np.frombuffer(stream.read(), np.uint8)
        columns, at = {}, 0
        for name, kind in self.rows:
            try:
                columns[name], at = read_column(kind, rest, at, count)
            except FormatError as error:
                error.add(where=name)
                raise
        stream.seek(start + at)
        return Table(self.record, columns, count)

    def _build(
        self, obj: Sequence[Record], stream: BinaryIO, context: Container, path: str
    ) -> Sequence[Record]:
        stream.write(varint(len(obj)))
        for name, kind in self.rows:
            if isinstance(obj, Table):
                stream.write(build_column(kind, obj.columns[name]))
            else:
                stream.write(build_column(kind, [getattr(row, name) for row in obj]))
        return obj

    def _emitparse(self, code: construct.core.CodeGen) -> str:
        code.linkedparsers[id(self)] = self._parse
        return f"linkedparsers[{id(self)}](io, this, '')"


def read_column(
    kind: construct.Construct, data: np.ndarray, at: int, count: int
) -> tuple[Column, int]:
    """The ``count`` values at ``at``, and where they end; raises FormatError."""
    if isinstance(kind, Checked):
        values, at = read_column(kind.subcon, data, at, count)
        for value in set(_list(values)):
            if not kind.test(value):
                raise FormatError(f"{value!r} is not allowed")
        return values, at
    if isinstance(kind, Sized):
        sizes, at = read_varints(data, at, count)
        if float(sizes.sum(dtype=np.float64)) > len(data) - at:  # CONV-13
            raise TruncatedError(f"{count} values extend past the end")
        ends = at + np.cumsum(sizes)
        stop = int(ends[-1]) if count else at
        blob, bounds = data[:stop].tobytes(), [at, *ends.tolist()]
        pieces = [blob[a:b] for a, b in zip(bounds[:-1], bounds[1:], strict=True)]
        if not isinstance(kind, Text):
            return pieces, stop
        try:
            return [piece.decode("utf-8") for piece in pieces], stop  # CONV-05, CONV-06
        except UnicodeDecodeError as error:
            raise FormatError(f"not UTF-8: {error}") from None
    if isinstance(kind, Exactly):
        size = kind.length
        data = _piece(data, at, count * size)
        blob = data.tobytes()
        return [blob[i : i + size] for i in range(0, len(blob), size)], at + count * size
    if kind is construct.Int8ul:
        return _piece(data, at, count).astype(np.int64), at + count
    return read_varints(data, at, count)


def _list(values: Column) -> list[int] | list[bytes] | list[str]:
    return values.tolist() if isinstance(values, np.ndarray) else values


def _piece(data: np.ndarray, at: int, size: int) -> np.ndarray:
    if size > len(data) - at:  # CONV-13
        raise TruncatedError(f"{size} bytes extend past the end")
    return data[at : at + size]


def read_varints(data: np.ndarray, at: int, count: int) -> tuple[Numbers, int]:
    """The ``count`` varints at ``at``, and where they end; raises FormatError."""
    if count <= FEW_VARINTS:
        first_bytes, few, end = data[at : at + MOST_BYTES * count].tobytes(), [], 0
        for _ in range(count):
            value, end = read_varint(first_bytes, end)
            few.append(value)
        return np.array(few, np.int64), at + end
    if count > len(data) - at:  # CONV-13
        raise TruncatedError(f"{count} varints extend past the end")
    single = data[at : at + count]
    if not (single & 0x80).any():
        return single.astype(np.int64), at + count
    window = data[at : at + MOST_BYTES * count]
    ends = np.flatnonzero(window < 0x80)[:count]
    if len(ends) < count and len(window) < MOST_BYTES * count:
        raise TruncatedError(f"{count} varints extend past the end")
    sizes = np.diff(ends, prepend=-1)
    if len(ends) < count or int(sizes.max()) > MOST_BYTES:  # CONV-03, CONV-04
        raise FormatError("a varint exceeds 2^53 - 1")
    if (window[ends[sizes > 1]] == 0).any():  # CONV-02
        raise FormatError("a varint is not in its shortest form")
    starts = ends - sizes + 1
    values = (window[starts] & 0x7F).astype(np.int64)
    for index in range(1, int(sizes.max())):
        longer = np.flatnonzero(sizes > index)
        values[longer] |= (window[starts[longer] + index] & 0x7F).astype(np.int64) << (7 * index)
    if int(values.max()) > MAX_COUNT:  # CONV-01, CONV-03
        raise FormatError("a varint exceeds 2^53 - 1")
    return values, at + int(ends[-1]) + 1


def build_varints(values: Sequence[int] | Numbers) -> bytes:
    """The bytes of ``values``, 0 <= each <= 2^53 - 1; raises FormatError."""
    column = np.asarray(values, np.int64)
    if not len(column):
        return b""
    if int(column.min()) < 0 or int(column.max()) > MAX_COUNT:
        raise FormatError(f"{column.min()} to {column.max()} exceed the range 0 to 2^53 - 1")
    shifts = np.arange(0, 7 * MOST_BYTES, 7)
    parts = column[:, None] >> shifts
    is_used = parts > 0
    is_used[:, 0] = True
    out = (parts & 0x7F).astype(np.uint8)
    out[:, :-1] |= is_used[:, 1:].astype(np.uint8) << 7
    return out[is_used].tobytes()


def build_column(kind: construct.Construct, values: Column) -> bytes:
    """The bytes of a column; raises FormatError."""
    if isinstance(kind, Checked):
        for value in set(_list(values)):
            if not kind.test(value):
                raise FormatError(f"{value!r} is not allowed")
        return build_column(kind.subcon, values)
    if isinstance(kind, Sized):
        texts = [v.encode("utf-8") if isinstance(v, str) else bytes(v) for v in values]
        return build_varints([len(text) for text in texts]) + b"".join(texts)
    if isinstance(kind, Exactly):
        if any(len(value) != kind.length for value in values):
            raise FormatError(f"the values do not have {kind.length} bytes")
        return b"".join(map(bytes, values))
    if kind is construct.Int8ul:
        return np.asarray(values, np.uint8).tobytes()
    return build_varints(cast(Numbers, values))


columns = Columns  # in lower case, as other types in declarations of records
