"""Arrays, texts and numbers of a pickle by their keys, without running it.

SPEC.md, "The bytes of arrays", defines its template; ``pickle_machine`` reads opcodes.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence, Set
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import accumulate

import numpy as np

from mcz.errors import SourceError
from mcz.model.motion import Source
from mcz.model.types import JsonObject
from mcz.sources.arrays.archive import Archive, ArchiveField, read_archive
from mcz.sources.arrays.columns import MAGIC, MAX_TEXT, Array, NpyHead, array_of, read_head
from mcz.sources.arrays.columns import is_motion as is_array_motion
from mcz.sources.arrays.interpretation import LONGEST_TEXT
from mcz.sources.arrays.layout import (
    INTEGERS,
    LOCAL,
    SIZES,
    TYPES,
    Piece,
    PieceKind,
    list_pieces,
    parse_arrays,
)
from mcz.sources.arrays.layout import list_arrays as list_plain
from mcz.sources.arrays.pickle_machine import Machine
from mcz.sources.arrays.pickle_values import (
    Dict,
    Number,
    PickledArray,
    Raw,
    integer_of,
    size_of,
)

COMPRESSED = {
    b"x": "zlib",
    b"\x1f\x8b": "gzip",
    b"BZ": "bz2",
    b"\xfd7zXZ": "xz",
    b"\x5d\0": "lzma",
    b"\x04\x22\x4d\x18": "lz4",
}
MAX_DEPTH, MAX_NAME = 32, 512  # of a place in a pickle: keys, characters
MAX_ARRAYS, MAX_FACTS = 2**15, 256  # of a file, of a clip
SEPARATOR = "/"


OLD_TORCH = (
    "a file of torch before 1.6, which is not a ZIP; if you trust it, rewrite it in Python: "
    "torch.save(torch.load(path), path)"
)
NO_TORCH = "not a file of torch.save, which is a ZIP with data.pkl, not compressed"
NESTS = (Dict, list, tuple, PickledArray)


@dataclass(frozen=True, slots=True)
class Pickle:
    """``arrays`` have the numbers and texts, too; ``clip`` is the key of a single clip.

    ``clips`` are several: by their names, the index of each array by its name within the clip.
    """

    arrays: list[Array]
    archive: Archive
    clip: str = ""
    notes: tuple[str, ...] = ()
    clips: Mapping[str, Mapping[str, int]] = field(default_factory=dict)


def read_pickle(data: bytes, at: int = 0) -> Pickle:
    """The arrays of the pickle from offset ``at`` on; raises SourceError with the offset."""
    for magic, name in COMPRESSED.items():
        if data.startswith(magic, at):
            raise SourceError(
                f"compressed by {name}; if you trust the file, write it uncompressed in "
                "Python: joblib.dump(joblib.load(path), path)",
                offset=at,
            )
    pickle = _read_machine(machine := Machine(data, at))
    rest = len(data) - machine.at
    return replace(pickle, notes=(f"{rest} bytes follow the pickle",)) if rest else pickle


def read_tensors(data: bytes) -> Pickle:
    """The arrays in a file of torch.save, a ZIP; raises SourceError with the offset."""
    if not data.startswith(LOCAL):
        raise SourceError(OLD_TORCH if data.startswith(b"\x80") else NO_TORCH, offset=0)
    archive = read_archive(data)
    members = {m.name.partition("/")[2]: m for m in archive.members if m.is_stored}
    pickle = members.get("data.pkl")
    if pickle is None:
        raise SourceError(NO_TORCH, offset=0)
    order = members.get("byteorder")
    is_big = order is not None and data[order.start : order.stop] == b"big"
    storages = {
        name.removeprefix("data/"): Raw(m.start, m.stop, 0)
        for name, m in members.items()
        if name.startswith("data/")
    }
    machine = Machine(data, pickle.start, storages, ">" if is_big else "<")
    own = _read_machine(machine)
    if machine.at > pickle.stop:
        raise SourceError("the pickle extends past its end", offset=pickle.stop)
    fields = sorted((*archive.fields, *own.archive.fields), key=lambda field: field.at)
    return replace(own, archive=replace(archive, fields=tuple(fields)))


def _read_machine(machine: Machine) -> Pickle:
    """The arrays of a pickle, which is run to its end."""
    data = machine.data
    root, clip = _single_clip(machine, machine.run())
    for shared in filter(lambda tensors: len(tensors) > 1, machine.tensors.values()):
        for tensor in shared:
            tensor.content = None
    reader = _Collector(machine, _clips(machine, root))
    arrays, fields = reader.read(root)
    fields += [
        ArchiveField(field, PieceKind.SIZE8, start, stop) for field, start, stop in machine.frames
    ]
    fields.sort(key=lambda field: field.at)
    archive = Archive(data, len(data), fields=tuple(fields))
    return Pickle(arrays, archive, clip, clips=reader.members)


def _children(machine: Machine, node: object) -> list[tuple[str, object]]:
    """The values of a dictionary by their keys; what a list or an array of objects nests."""
    if isinstance(node, Dict):
        named = (
            (machine.text_of(key), _unwrap_poselib(machine, value)) for key, value in node.pairs
        )
        return [*{key: value for key, value in named if key}.items()]
    items = node.content if isinstance(node, PickledArray) else node
    if not isinstance(items, list | tuple):
        return []
    return [(str(n), value) for n, value in enumerate(items) if isinstance(value, NESTS)]


def _unwrap_poselib(machine: Machine, value: object) -> object:
    """The array in a dictionary of poselib; any other value unchanged."""
    if isinstance(value, Dict) and len(value.pairs) == 2:
        parts = {machine.text_of(key): part for key, part in value.pairs}
        if parts.keys() == {"arr", "context"} and isinstance(parts["arr"], PickledArray):
            return parts["arr"]
    return value


def _single_clip(machine: Machine, root: object) -> tuple[object, str]:
    """The dictionary of the motion within others that hold nothing else, and its key."""
    clip = ""
    for _ in range(MAX_DEPTH):
        children = _children(machine, root)
        if len(children) != 1 or not isinstance(children[0][1], Dict):
            break
        clip = children[0][0] if isinstance(root, Dict) else clip
        root = children[0][1]
    return root, clip


def _clips(machine: Machine, root: object) -> set[int]:
    """The identities of several clips: dictionaries that have arrays of the same keys."""
    clips: set[int] = set()
    keys: Counter[str] = Counter()
    seen: set[int] = set()
    waiting = [(0, root)]
    while waiting:
        depth, node = waiting.pop()
        if depth > MAX_DEPTH or id(node) in seen or not isinstance(node, NESTS):
            continue
        seen.add(id(node))
        below = _children(machine, node)
        arrays = [k for k, v in below if isinstance(v, PickledArray) and len(v.shape) > 1]
        if isinstance(node, Dict) and arrays:
            clips.add(id(node))
            keys.update(arrays)
        else:
            waiting += [(depth + 1, value) for _, value in below]
    return clips if max(keys.values(), default=0) > 1 else set()


class _Collector:
    """Collects the arrays below a value, each once, with its bytes.

    ``members`` are those of each dictionary among ``clips``.
    """

    def __init__(self, machine: Machine, clips: Set[int]) -> None:
        self.machine = machine
        self.clips = clips
        self.members: dict[str, dict[str, int]] = {}
        self.clip: str | None = None  # that arrays are added to
        self.data = machine.data
        self.arrays: list[Array] = []
        self.fields: list[ArchiveField] = []
        self.n_facts = 0
        self.used: set[int] = set()  # offsets that an array has
        self.names: set[str] = set()

    def read(self, root: object) -> tuple[list[Array], list[ArchiveField]]:
        """The arrays in order, and the lengths of their bytes."""
        seen: set[int] = set()
        waiting: list[tuple[str, str, int, object, str | None]] = [("", "", 0, root, None)]
        while waiting:
            prefix, key, depth, node, self.clip = waiting.pop()
            name = prefix + key
            if len(name) > MAX_NAME or depth > MAX_DEPTH or id(node) in seen:
                continue
            if not isinstance(node, NESTS):
                self._add_fact(name, node)
                continue
            seen.add(id(node))
            if isinstance(node, PickledArray) and not isinstance(node.content, list):
                self._add_array(name or "array", node)
            elif not self._add_words(name, node):
                below = _children(self.machine, node)[::-1]
                prefix = name + SEPARATOR if name else ""
                if id(node) in self.clips:
                    self.clip, self.n_facts = name, 0
                waiting += [(prefix, key, depth + 1, value, self.clip) for key, value in below]
        return self.arrays, self.fields

    def _add(self, array: Array) -> None:
        if array.name in self.names:
            return
        if len(self.arrays) >= MAX_ARRAYS:
            raise SourceError(f"more than {MAX_ARRAYS} arrays")
        self.names.add(array.name)
        if self.clip is not None:
            key = array.name.removeprefix(self.clip + SEPARATOR)
            self.members.setdefault(self.clip, {})[key] = len(self.arrays)
        self.arrays.append(array)

    def _add_array(self, name: str, node: PickledArray) -> None:
        head, fault = self._head(node)
        raw = node.content
        if fault or not isinstance(raw, Raw):
            self._add(Array(name, head, kept=fault, is_loud=bool(head.shape)))
            return
        self._add(array_of(name, self.data, head, raw.stop))
        if raw.count_size:
            kind = {1: PieceKind.SIZE1, 4: PieceKind.SIZE4, 8: PieceKind.SIZE8}[raw.count_size]
            self.fields.append(ArchiveField(raw.start - raw.count_size, kind, raw.start, raw.stop))

    def _head(self, node: PickledArray) -> tuple[NpyHead, str]:
        """The head of an array, and the reason why its bytes are not read, if any."""
        dtype, raw, shape = node.dtype, node.content, node.lengths
        if dtype is None or size_of(shape, 1) is None:
            return NpyHead(), "an array without type or shape"
        code, order = dtype.code, dtype.order
        if not isinstance(raw, Raw):
            return NpyHead(shape=shape), node.fault
        if code in TYPES and code[1:] != "1" and order not in ("<", ">"):
            return NpyHead(shape=shape), "of a byte order that is not stated"
        rows = node.shape[0] if shape else None
        places = {raw.start} | ({rows.at} if isinstance(rows, Number) else set())
        if (shape and not isinstance(rows, Number)) or places & self.used:
            return NpyHead(shape=shape), "an array that shares its bytes or its shape with another"
        if code in TYPES and size_of(shape, int(code[1:])) != raw.stop - raw.start:
            raise SourceError(
                f"{raw.stop - raw.start} bytes of numbers, but shape {shape} of {code} needs "
                f"{size_of(shape, int(code[1:]))}",
                offset=raw.start,
            )
        self.used |= places
        rows_at = (rows.at, rows.at + rows.size) if isinstance(rows, Number) else (0, 0)
        is_big = order == ">"
        items = node.items
        items_at = (items.at, items.at + items.size) if items is not None else (0, 0)
        head = NpyHead(raw.start, shape, code, is_big, node.is_fortran, rows_at)
        return replace(head, is_printed=False, items_at=items_at), ""

    def _add_words(self, name: str, node: object) -> bool:
        """Add a list of texts, such as joint names; return False for anything else."""
        if not name or not isinstance(node, list | tuple) or not node:
            return False
        texts = [self.machine.text_of(value) for value in node]
        words = [text for text in texts if text]
        if len(words) != len(texts) or self.n_facts >= MAX_FACTS:
            return False
        if max(map(len, words)) > min(LONGEST_TEXT, MAX_TEXT // 4 // len(words)):
            return False
        self.n_facts += 1
        self._add(_array_of_texts(name, words, (len(words),)))
        return True

    def _add_fact(self, name: str, value: object) -> None:
        """Add a single text or number."""
        if not name or self.n_facts >= MAX_FACTS:
            return
        text = self.machine.text_of(value)
        number = integer_of(value) if not isinstance(value, float) else value
        is_number = isinstance(value, Number | float) or (type(value) is int)
        if text and len(text) <= LONGEST_TEXT:
            self._add(_array_of_texts(name, [text], ()))
        elif is_number and abs(number) <= 2**53:
            self._add(Array(name, NpyHead(), kept="a single number", words=np.array([[number]])))
        else:
            return
        self.n_facts += 1


def _array_of_texts(name: str, words: Sequence[str], shape: tuple[int, ...]) -> Array:
    """The array of texts that NumPy would make; its bytes are no part of the file."""
    longest = max(map(len, words))
    encoded = [word.ljust(longest, "\0").encode("utf-32-le", "surrogatepass") for word in words]
    return Array(
        name, NpyHead(code=f"U{longest}", shape=shape), kept="text", text=b"".join(encoded)
    )


def npy_objects(data: bytes) -> Pickle | None:
    """The pickle in an NPY file of objects; None for other files."""
    head = read_head(data, 0, len(data)) if data.startswith(MAGIC) else NpyHead()
    return read_pickle(data, head.start) if head.code == "O" else None


def list_arrays(source: Source, signals: Sequence[str]) -> list[JsonObject]:
    """The arrays of a pickle or an NPY, see ``layout.list_arrays``; raises FormatError.

    Names are those in the pickle of no rows that the template makes.
    """
    pieces = parse_arrays(source.template, source.detail)
    if source.format == "npy" and all(piece.kind != PieceKind.ROWS for piece in pieces):
        return list_plain(source, signals)
    sizes = [
        piece.size if piece.kind in INTEGERS else SIZES.get(piece.kind, len(piece.text))
        for piece in pieces
    ]
    starts = [0, *accumulate(sizes)]
    data = b"".join(_empty(piece, starts, size) for piece, size in zip(pieces, sizes, strict=True))
    try:
        if source.format == "torch":
            pickle = read_tensors(data)
        else:
            pickle = (npy_objects(data) if source.format == "npy" else None) or read_pickle(data)
        names = {a.head.start: a.name for a in pickle.arrays if a.head.start}
    except SourceError:
        names = {}  # a template that no pickle made
    listed = []
    for at, piece in zip(starts, pieces, strict=False):
        if piece.kind == PieceKind.DATA:
            listed.append(list_pieces(names.get(at, ""), [piece], signals))
    placed = {array["name"] for array in listed}
    unplaced = [name for name in names.values() if name not in placed]
    return listed + [list_pieces(name, [], signals) for name in unplaced]


def _empty(piece: Piece, starts: Sequence[int], size: int) -> bytes:
    """The bytes of a piece of a file without rows."""
    if piece.kind in SIZES:
        last = len(starts) - 1
        number = starts[min(piece.stop, last)] - starts[min(piece.start, last)]
        return max(0, number).to_bytes(8, "little")[:size]
    return piece.text or bytes(size)


def is_npy_motion(data: bytes) -> bool:
    """Return True if an NPY that begins with ``data`` may be a motion, also one of objects."""
    head = read_head(data, 0, len(data))
    return is_motion(data, head.start) if head.code == "O" else is_array_motion(data)


def is_motion(data: bytes, at: int = 0) -> bool:
    """Return True if a pickle that begins at ``at`` may have arrays of NumPy."""
    if any(data.startswith(magic, at) for magic in COMPRESSED):
        return True
    machine = Machine(data, at)
    with suppress(SourceError):
        machine.run()
    return b"numpy" in data and not machine.is_foreign


def is_tensor_motion(data: bytes) -> bool:
    """Return True if a file of torch.save that begins with ``data`` may be no model."""
    return b"_rebuild_tensor_v2" in data and b"_rebuild_parameter" not in data
