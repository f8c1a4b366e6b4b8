"""Arrays of a file: headers of NPY, and columns of numbers with their number grids.

The grid of a column is a writer's choice: each restores all bits.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from math import prod

import numpy as np
from numpy.typing import NDArray

from mcz.errors import SourceError
from mcz.model.motion import Channel, Signal
from mcz.model.numbers import Grid, GridKind
from mcz.model.types import Items, Values
from mcz.sources.arrays.archive import Archive, ArchiveMember, read_archive
from mcz.sources.arrays.layout import TYPES

MAGIC = b"\x93NUMPY"
VERSIONS = ((1, 0), (2, 0), (3, 0))
MAX_HEAD = 10_000  # bytes, NumPy's limit for an untrusted file
MAX_AXES = 64  # NumPy's limit
_NUMBER = re.compile(rb"\d+")
_PLAIN = re.compile(rb"0|[1-9]\d{0,17}")
_BLANKS = rb"[ \t\r\n]*"
_VALUES = {
    b"descr": rb"""(?:'([<>|=]?)([A-Za-z])(\d*)'|"([<>|=]?)([A-Za-z])(\d*)")""",
    b"fortran_order": rb"(True|False)",
    b"shape": rb"\( ((?:\d+ , )*(?:\d+ , \d+ )?)\)",
}
_ITEM = rb"""(?:'%s'|"%s") : %s """
_ITEMS = {
    key: re.compile((_ITEM % (key, key, value)).replace(b" ", _BLANKS))
    for key, value in _VALUES.items()
}
_OPEN, _COMMA = re.compile(rb"[ \t]*\{" + _BLANKS), re.compile(b"," + _BLANKS)
_CLOSE = re.compile(rb"\}" + _BLANKS)


@dataclass(frozen=True, slots=True)
class NpyHead:
    """The header of an array, or only its ``fault``.

    The numbers begin at ``start``; ``code`` is their type as NumPy has it, without byte order, such
    as "f8"; "O" for pickled objects. ``rows_at`` is the place of the length of the first axis,
    ``end`` that of the end of the text, without blanks. If not ``is_printed``, that length is a
    binary integer, and so is the count of all numbers at ``items_at``.
    """

    start: int = 0
    shape: tuple[int, ...] = ()
    code: str = ""
    big_endian: bool = False
    is_fortran: bool = False
    rows_at: tuple[int, int] = (0, 0)
    end: int = 0
    fault: str = ""
    is_printed: bool = True
    items_at: tuple[int, int] = (0, 0)

    @property
    def is_number(self) -> bool:
        """True if a grid may store such numbers."""
        return self.code in TYPES

    @property
    def size(self) -> int:
        """Bytes of the numbers; their type must be ``is_number``."""
        return prod(self.shape) * int(self.code[1:])


def read_head(data: bytes, at: int, stop: int) -> NpyHead:
    """Read the header of the NPY file in data[at:stop]; see ``NpyHead.fault``."""
    if data[at : at + 6] != MAGIC or stop < at + 10:
        return NpyHead(fault=f"offset {at}: no NPY file, which begins with \\x93NUMPY")
    version = data[at + 6], data[at + 7]
    size_bytes = 2 if version == (1, 0) else 4
    if version not in VERSIONS:
        return NpyHead(
            fault=f"offset {at + 6}: version {version[0]}.{version[1]} of NPY is not known"
        )
    text_at = at + 8 + size_bytes
    size = int.from_bytes(data[at + 8 : text_at], "little")
    if size > MAX_HEAD or text_at + size > stop:
        return NpyHead(fault=f"offset {at + 8}: a head of {size} bytes is too long")
    return _parse_header(data[text_at : text_at + size], text_at, stop)


def _parse_header(text: bytes, at: int, stop: int) -> NpyHead:
    """Parse the text of a header at offset ``at``."""
    items = _parse_items(text)
    if items is None:
        return NpyHead(
            fault=f"offset {at}: the head is no plain dictionary of descr, fortran_order and shape"
        )
    descr, order, shape = items[b"descr"], items[b"fortran_order"], items[b"shape"]
    numbers = _NUMBER.findall(shape[1])
    if len(numbers) > MAX_AXES or not all(map(_PLAIN.fullmatch, numbers)):
        return NpyHead(
            fault=f"offset {at + shape.start(1)}: the shape {shape[1][:60]!r} is no plain one"
        )
    lengths = tuple(map(int, numbers))
    byte_order, code = _type_of(descr)
    first = re.match(rb"\d+", shape[1])
    rows_at = (0, 0)
    if first is not None:
        rows_at = at + shape.start(1), at + shape.start(1) + first.end()
    end = at + len(text.rstrip(b"\n").rstrip(b" "))
    head = NpyHead(
        at + len(text), lengths, code, byte_order == b">", order[1] == b"True", rows_at, end
    )
    if head.is_number and head.size != stop - head.start:
        return NpyHead(
            fault=f"offset {head.start}: {stop - head.start} bytes of numbers, but shape {lengths} "
            f"of {code} has {head.size}"
        )
    return head


def _parse_items(text: bytes) -> dict[bytes, re.Match[bytes]] | None:
    """Parse a header, a Python dictionary, into its three values; None if it is not plain.

    NumPy evaluates the text: a repeated or further key, a comment or an escape might have a
    meaning.
    """
    at, items = 0, dict[bytes, re.Match[bytes]]()
    last = _OPEN.match(text)
    while last is not None:
        at = last.end()
        matches = {key: item for key, value in _ITEMS.items() if (item := value.match(text, at))}
        if not matches:
            break
        [(key, item)] = matches.items()
        if key in items:
            return None
        items[key], at = item, item.end()
        last = _COMMA.match(text, at)
    end = _CLOSE.fullmatch(text, at)
    return items if end is not None and len(items) == len(_ITEMS) else None


def _type_of(descr: re.Match[bytes]) -> tuple[bytes, str]:
    """The byte order of a type and its code without one."""
    order, kind, size = descr.groups()[:3] if descr[2] else descr.groups()[3:]
    return order, (kind + size).decode()


def has_rows(data: bytes) -> bool:
    """Return True if ``data`` begins with the header of numbers with at least two axes."""
    begin = 10 if data[6:7] == b"\1" else 12
    size = int.from_bytes(data[8:begin], "little")
    items = _parse_items(data[begin : begin + min(size, MAX_HEAD)])
    if items is None:
        return False
    return _type_of(items[b"descr"])[1] in TYPES and len(_NUMBER.findall(items[b"shape"][1])) > 1


def refuse_faulty_head(head: NpyHead) -> None:
    """Raise SourceError if a head has a fault."""
    if head.fault:
        raise SourceError(head.fault)


DIRECTORY_END = b"PK\5\6"


def is_motion(data: bytes) -> bool:
    """Return True if an NPY or NPZ that begins with ``data`` may have a row of numbers per frame.

    True in doubt: the reader then states the fault.
    """
    heads = [match.start() for match in re.finditer(re.escape(MAGIC), data)]
    is_whole = not data.startswith(b"PK") or DIRECTORY_END in data
    return not heads or not is_whole or any(has_rows(data[at:]) for at in heads)


BINARY32, BINARY64, INTEGER = (
    Grid(kind) for kind in (GridKind.BINARY32, GridKind.BINARY64, GridKind.INTEGER)
)
NANS = {2: 0x7E00, 4: 0x7FC00000, 8: 0x7FF8000000000000}  # bits of the usual NaN, by bytes
MOST_DECIMALS = 9  # of a grid for binary64
MOST_PREFERRED = 6  # most decimals of a grid preferred to BINARY32
LARGEST = 2.0**51  # bound of the magnitudes of decimals
SAMPLE = 64  # rows tried before a whole column


@dataclass(frozen=True, slots=True)
class ArrayColumns:
    """Columns of one array, (rows, columns), binary64 or int64, and the grid of each.

    ``ordinals``: None unless there are NaNs with unusual bits, which values cannot hold.
    """

    values: Values
    grids: tuple[Grid, ...]
    ordinals: NDArray[np.int64] | None = None


def words_of(data: bytes, head: NpyHead) -> Items:
    """The numbers of an array as they are stored, a row for each index of its first axis."""
    order = ">" if head.big_endian else "<"
    n_words = head.size // int(head.code[1:])
    words = np.frombuffer(data, order + head.code, n_words, head.start)
    shaped = words.reshape(head.shape, order="F" if head.is_fortran else "C")
    return shaped.reshape(head.shape[0] if head.shape else 1, -1)


def file_columns(head: NpyHead) -> NDArray[np.int64]:
    """The column of each number of a row, in the order in which the file has them."""
    inner = head.shape[1:]
    columns = np.arange(int(np.prod(inner, dtype=np.int64))).reshape(inner)
    return columns.ravel(order="F" if head.is_fortran else "C")


def misfit_reason(words: Items) -> str:
    """Reason why no grid stores such numbers bit for bit, or ""."""
    kind, size = words.dtype.kind, words.dtype.itemsize
    if kind == "b":
        return "a bool that is neither 0 nor 1" if (words.view("u1") > 1).any() else ""
    if kind in "iu":
        if size < 8 or not words.size:
            return ""
        most = 2**53
        is_too_large = int(words.max()) > most or int(words.min()) < -most
        return "an integer beyond 2^53" if is_too_large else ""
    if size == 2:
        bits = _bits(words)
        if (np.isnan(words) & (bits != NANS[2])).any():
            return "a NaN of 16 bits with a payload"
    return ""


def columns_of(words: Items) -> ArrayColumns:
    """The columns of numbers (rows, columns), which grids store bit for bit."""
    if words.dtype.kind != "f":
        return ArrayColumns(words.astype(np.int64), (INTEGER,) * words.shape[1])
    with np.errstate(invalid="ignore"):  # signaling NaNs
        values = np.require(words, np.float64, ("C", "A"))  # members lie at any offset
    grids = (BINARY32,) * words.shape[1] if words.dtype.itemsize < 8 else _grids_of(values)
    nan = np.isnan(values)
    if not nan.any() or words.dtype.itemsize == 2:
        return ArrayColumns(values, grids)
    bits = _bits(words)
    if (bits[nan] == NANS[words.dtype.itemsize]).all():
        return ArrayColumns(values, grids)
    grid = BINARY32 if words.dtype.itemsize == 4 else BINARY64
    values = np.where(nan, np.nan, values)  # the usual NaN in place of all others
    return ArrayColumns(values, (grid,) * len(grids), grid.ordinals_of_bits(bits))


def _bits(words: Items) -> Items:
    """The bits of floats, in this machine's order."""
    plain = np.ascontiguousarray(words, words.dtype.newbyteorder("<"))
    return plain.view(f"<u{words.dtype.itemsize}")


def _grids_of(values: NDArray[np.float64]) -> tuple[Grid, ...]:
    """The grid of each column of binary64: FIXED if all numbers are short, else binary."""
    n_rows, n_columns = values.shape
    sample = values[np.linspace(0, n_rows - 1, min(SAMPLE, n_rows)).astype(np.int64)]
    places = np.array([_decimals(sample[:, c]) for c in range(n_columns)], np.int64)
    with np.errstate(over="ignore", invalid="ignore"):
        narrow = (sample.astype(np.float32) == sample).all(axis=0)
    grids = []
    for column in range(n_columns):
        digits = int(places[column])
        grid = BINARY64
        if digits >= 0 or narrow[column]:
            whole = values[:, column]
            digits = _decimals(whole, max(digits, 0)) if digits >= 0 else -1
            with np.errstate(over="ignore"):
                is_narrow = bool((whole.astype(np.float32) == whole).all())
            if 0 <= digits <= (MOST_PREFERRED if is_narrow else MOST_DECIMALS):
                grid = Grid(GridKind.FIXED, digits)
            elif is_narrow:
                grid = BINARY32
        grids.append(grid)
    return tuple(grids)


def _decimals(values: NDArray[np.float64], least: int = 0) -> int:
    """The fewest decimals, ``least`` or more, that hold all values; -1 if none do."""
    if not np.isfinite(values).all():
        return -1
    largest = float(np.abs(values).max(initial=0.0))
    for digits in range(least, MOST_DECIMALS + 1):
        power = 10.0**digits
        if largest * power >= LARGEST:
            return -1
        if (np.rint(values * power) / power == values).all():
            return digits
    return -1


def signal_of(
    parts: list[ArrayColumns],
    name: str = "motion",
    per_frame: int = 1,
    channels: tuple[Channel, ...] | None = None,
    role: str = "",
) -> Signal:
    """One signal with the columns of all parts side by side; NaN is invalid."""
    grids = tuple(grid for part in parts for grid in part.grids)
    if all(grid.kind == GridKind.INTEGER for grid in grids):
        values = np.hstack([part.values for part in parts])
        return Signal(values, grids, name, per_frame, channels=channels, role=role)
    floats = [part.values.astype(np.float64, copy=False) for part in parts]
    values = floats[0] if len(parts) == 1 else np.hstack(floats)
    nan = np.isnan(values)
    ordinals = None
    if any(part.ordinals is not None for part in parts):
        ordinals = np.hstack([_ordinals(part) for part in parts])
    mask = ~nan if nan.any() else None
    return Signal(
        values, grids, name, per_frame, mask, channels=channels, ordinals=ordinals, role=role
    )


def _ordinals(part: ArrayColumns) -> NDArray[np.int64]:
    if part.ordinals is not None:
        return part.ordinals
    if part.values.dtype == np.int64:
        return part.values.astype(np.int64, copy=False)
    return Signal(part.values, part.grids).to_ordinals()[0]


LARGE = 1024  # bytes of an array that gets a note if its numbers are not read
MAX_TEXT = 2**16  # bytes of an array that are examined as text


@dataclass(frozen=True, slots=True)
class Array:
    """An array, whose numbers are read unless ``kept`` gives a reason to store only its bytes.

    ``stop`` is the end of its bytes, 0 if they are not examined. ``words`` are its numbers, (rows,
    columns), None if it has none; then ``text`` is its text. ``is_loud``: a kept array gets a note.
    """

    name: str
    head: NpyHead
    stop: int = 0
    kept: str = ""
    words: Items | None = None
    text: bytes = b""
    is_loud: bool = False

    @property
    def numbers(self) -> Items:
        """The numbers of an array that is not kept."""
        assert self.words is not None
        return self.words

    @property
    def n_rows(self) -> int:
        return self.head.shape[0]

    @property
    def is_large(self) -> bool:
        return self.stop - self.head.start > LARGE


def npy_array(data: bytes) -> Array:
    """The array of an NPY file; raises SourceError if it has no numbers with rows."""
    head = read_head(data, 0, len(data))
    refuse_faulty_head(head)
    array = array_of("array", data, head, len(data))
    if array.kept:
        raise SourceError(f"the array is {array.kept}, which is no motion", offset=head.start)
    return array


def npz_arrays(data: bytes) -> tuple[list[Array], Archive]:
    """The arrays of an NPZ file in the order of their bytes, one for each member."""
    archive = read_archive(data)
    return [_member(archive.data, member) for member in archive.members], archive


def _member(data: bytes, member: ArchiveMember) -> Array:
    """The array in a member; ``data`` is that of its archive."""
    name = member.name.removesuffix(".npy")
    if member.contents is None:
        reason = (
            f"deflated, {member.fault}" if member.fault else f"packed by method {member.method}"
        )
        reason = "encrypted" if member.is_encrypted else reason
        return Array(name, NpyHead(), kept=reason, is_loud=True)
    start, stop = member.contents
    head = read_head(data, start, stop)
    if head.fault:
        fault = head.fault
        if member.is_deflated:  # offsets count from the beginning of the contents
            fault = f"inflated, {read_head(data[start:stop], 0, stop - start).fault}"
        return Array(name, NpyHead(), kept=f"no array ({fault})", is_loud=name != member.name)
    return array_of(name, data, head, stop)


def array_of(name: str, data: bytes, head: NpyHead, stop: int) -> Array:
    """The array of a head, whose bytes end at ``stop``."""
    if head.code == "O":
        return Array(name, head, stop, "pickled, and not unpickled", is_loud=True)
    if not head.is_number:
        text = data[head.start : min(stop, head.start + MAX_TEXT)]
        return Array(name, head, stop, f"of type {head.code}", text=text)
    if not head.size:
        return Array(name, head, stop, f"of shape {head.shape}")
    if not head.shape:
        return Array(name, head, stop, "a single number", words_of(data, head))
    words = words_of(data, head)
    fault = misfit_reason(words)
    return Array(name, head, stop, fault, words, is_loud=bool(fault))
