"""Features of clips in blocks of frames, cached in memory or a folder; their mean and deviation."""

from __future__ import annotations

import hashlib
import os
import tempfile
import zlib
from collections import OrderedDict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path
from threading import Lock
from typing import NamedTuple
from urllib.parse import quote, unquote

import numpy as np

from mcz.errors import AccessError, OptionError, reason_of
from mcz.exchange.datasets.fields import Arrays
from mcz.exchange.datasets.open_files import Member, OpenFiles, Recipe, timeline_of_member
from mcz.files.reading.file import File
from mcz.model.types import Floats, Ints, Reals

UNITS = {"": 1, "B": 1, "KB": 10**3, "MB": 10**6, "GB": 10**9, "TB": 10**12}
UNITS |= {f"{letter}IB": 2 ** (10 * (n + 1)) for n, letter in enumerate("KMGT")}


def to_size(text: int | str) -> int:
    """A number of bytes, or a text such as "64 MB" or "2 GiB"; raises OptionError.

    >>> to_size("64 MB"), to_size("1.5GiB"), to_size(4096)
    (64000000, 1610612736, 4096)
    """
    words = str(text).strip()
    number = words.rstrip("ABDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz ")
    unit = words[len(number) :].strip().upper()
    with suppress(ArithmeticError, KeyError):
        size = Decimal(number) * UNITS[unit]
        if 0 <= size < 2**62:
            return int(size)
    raise OptionError(
        f"cache is {text!r}; it must be a number of bytes, or a string such as '64 MB'"
    )


def size_of(arrays: Arrays) -> int:
    return sum(array.nbytes for array in arrays.values())


class MemoryCache:
    """Blocks by key, those that were used last: at most ``most_bytes``."""

    def __init__(self, most_bytes: int) -> None:
        self.most_bytes = most_bytes
        self._held: OrderedDict[str, Arrays] = OrderedDict()
        self._size = 0
        self._lock = Lock()

    def get(self, key: str) -> Arrays | None:
        with self._lock:
            arrays = self._held.get(key)
            if arrays is not None:
                self._held.move_to_end(key)
            return arrays

    def put(self, key: str, arrays: Arrays) -> None:
        size = size_of(arrays)
        if size > self.most_bytes:
            return
        with self._lock:
            if key in self._held:
                return
            self._held[key] = arrays
            self._size += size
            while self._size > self.most_bytes:
                self._size -= size_of(self._held.popitem(last=False)[1])


class FolderCache:
    """Blocks as files of a folder, at most ``most_bytes`` of them; none is ever evicted.

    Processes may share it: a file gets its name when it is complete, and a damaged one is written
    again. Raises AccessError if the folder cannot be used.
    """

    SUFFIX = ".features"

    def __init__(self, folder: Path, most_bytes: int) -> None:
        self.folder, self.most_bytes = folder, most_bytes
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._size = sum(path.stat().st_size for path in folder.glob(f"*{self.SUFFIX}"))
        except OSError as error:
            raise AccessError(reason_of(error), path=folder) from None

    def get(self, key: str) -> Arrays | None:
        try:
            data = self._path(key).read_bytes()
        except OSError:
            return None
        if len(data) < 4 or zlib.crc32(data[:-4]).to_bytes(4, "little") != data[-4:]:
            return None
        return _arrays_from_bytes(data[:-4])

    def put(self, key: str, arrays: Arrays) -> None:
        data = _arrays_to_bytes(arrays)
        if self._size + len(data) + 4 > self.most_bytes:
            return
        try:
            handle, name = tempfile.mkstemp(dir=self.folder)
            with os.fdopen(handle, "wb") as file:
                file.write(data + zlib.crc32(data).to_bytes(4, "little"))
            os.replace(name, self._path(key))
        except OSError as error:
            raise AccessError(reason_of(error), path=self.folder) from None
        self._size += len(data) + 4

    def _path(self, key: str) -> Path:
        return self.folder / f"{key}{self.SUFFIX}"


def _arrays_to_bytes(arrays: Arrays) -> bytes:
    """Arrays as bytes: for each a line with name, type and shape, then its values."""
    parts = []
    for name, array in arrays.items():
        shape = ",".join(map(str, array.shape))
        parts.append(f"{quote(name)} {array.dtype.str} {shape}\n".encode("ascii") + array.tobytes())
    return b"".join(parts)


def _arrays_from_bytes(data: bytes) -> Arrays:
    arrays, at = {}, 0
    while at < len(data):
        end = data.index(b"\n", at)
        name, dtype, shape = data[at:end].decode("ascii").split(" ")
        dims = tuple(map(int, shape.split(",")))
        count = int(np.prod(dims))
        array = np.frombuffer(data, dtype, count, end + 1).reshape(dims)
        arrays[unquote(name)] = array
        at = end + 1 + array.nbytes
    return arrays


Cache = MemoryCache | FolderCache


BLOCK = 128  # frames whose features are computed and kept together
RUNS_SHARE = 4  # a quarter of the cache is for frames as they were decoded
VERSION = 2  # of the features: counted up if a cached one would be wrong


@dataclass(frozen=True, slots=True)
class DatasetSettings:
    """Settings of windows and caches."""

    recipe: Recipe
    window: int | None
    stride: int
    cache_bytes: int
    folder: Path | None

    @property
    def decoded_bytes(self) -> int:
        """Share of the cache for decoded frames."""
        return self.cache_bytes // RUNS_SHARE

    @property
    def feature_bytes(self) -> int:
        """Share of the cache for features in memory."""
        return self.cache_bytes - self.decoded_bytes


class Blocks:
    """The features of clips, from open files or from the cache; threads may share it."""

    def __init__(
        self, settings: DatasetSettings, members: Sequence[Member], files: Mapping[str, File]
    ) -> None:
        self._recipe = settings.recipe
        targets = {member.target for member in members}
        self.sources = OpenFiles(files, settings.decoded_bytes, len(targets))
        self._keys: dict[Member, str] = {}
        self.cache: Cache = (
            MemoryCache(settings.feature_bytes)
            if settings.folder is None
            else FolderCache(settings.folder, settings.cache_bytes)
        )

    def parts(self, member: Member, start: int, stop: int) -> dict[str, list[Reals]]:
        """The arrays of frames of a clip as read-only parts of blocks."""
        parts: dict[str, list[Reals]] = {field.name: [] for field in self._recipe.fields}
        size = self.block_size(member)
        first = start // size
        for number in range(first, max(first + 1, -(-stop // size))):
            at = number * size
            for name, array in self._block(member, number).items():
                parts[name].append(array[max(start - at, 0) : stop - at])
        return parts

    def all_of(self, member: Member) -> Iterator[Arrays]:
        """The blocks of a clip, in order."""
        for number in range(-(-member.n_frames // self.block_size(member))):
            yield self._block(member, number)

    def block_size(self, member: Member) -> int:
        """Frames of a block: all of a clip if a field cannot be computed for fewer."""
        return max(1, member.n_frames) if self._recipe.is_whole else BLOCK

    def _block(self, member: Member, number: int) -> Arrays:
        key = f"{self.key(member)}-{number}"
        block = self.cache.get(key)
        if block is None:
            size = self.block_size(member)
            start = number * size
            stop = min(start + size, member.n_frames)
            block = self.sources.features(self._recipe, member, start, stop)
            self.cache.put(key, block)
        return block

    def key(self, member: Member) -> str:
        """Cache key of a clip's features: in a folder, independent of the file's name."""
        key = self._keys.get(member)
        if key is None:
            recipe = self._recipe
            names = [field.name for field in recipe.fields]
            facts = [names, recipe.rate, member.source_rate, recipe.joints, recipe.units]
            facts += [member.first, member.n_source, recipe.dtype.str, BLOCK, VERSION]
            text = repr(facts).encode()
            if isinstance(self.cache, FolderCache):
                clip = self.sources.clip(member)
                text += b"".join(clip.value_hashes) + clip.skeleton_id
                if not member.is_even:
                    text += np.diff(timeline_of_member(clip, member).regular_times).tobytes()
            else:
                text += repr((member.target, member.clip)).encode()
            key = self._keys[member] = hashlib.sha256(text).hexdigest()[:32]
        return key


class FieldStatistics(NamedTuple):
    """Mean and standard deviation of a field over all frames, float64 of the shape of a frame.

    Both are NaN for values that are NaN in all frames.
    """

    mean: Floats
    std: Floats

    def normalize(self, array: Reals) -> Reals:
        """``array`` less the mean, divided by the deviation; by 1 if that is 0."""
        std = np.where(self.std > 0, self.std, 1.0)
        return ((array - self.mean) / std).astype(array.dtype)


class _Moments(NamedTuple):
    """Number of known values, their mean, and the sum of the squares of their differences from it.

    They are joined as by T. F. Chan, G. H. Golub and R. J. LeVeque 1979, "Updating Formulae and a
    Pairwise Algorithm for Computing Sample Variances".
    """

    counts: Ints
    means: Floats
    squares: Floats

    def __add__(self, other: object) -> _Moments:
        assert isinstance(other, _Moments)
        counts = self.counts + other.counts
        share = other.counts / np.maximum(counts, 1)
        difference = other.means - self.means
        return _Moments(
            counts,
            self.means + difference * share,
            self.squares + other.squares + difference**2 * self.counts * share,
        )

    @property
    def statistics(self) -> FieldStatistics:
        counts = np.where(self.counts, self.counts, np.nan).astype(np.float64)
        return FieldStatistics(self.means * counts / counts, np.sqrt(self.squares / counts))


def _moments_of(array: Reals) -> _Moments:
    known = ~np.isnan(array)
    values = np.where(known, array, 0.0).astype(np.float64)
    counts = known.sum(axis=0)
    means = values.sum(axis=0) / np.maximum(counts, 1)
    return _Moments(counts, means, (np.where(known, values - means, 0.0) ** 2).sum(axis=0))


def statistics_of(blocks: Blocks, members: Iterable[Member]) -> dict[str, FieldStatistics]:
    """The statistics of each field over all frames of the clips, from the cache if it has them."""
    members = list(members)
    text = "statistics " + " ".join(map(blocks.key, members))
    key = hashlib.sha256(text.encode()).hexdigest()[:32]
    cached = blocks.cache.get(key)
    if cached is None:
        cached = _statistics_arrays(_compute(blocks, members))
        blocks.cache.put(key, cached)
    arrays = {name: np.asarray(array, np.float64) for name, array in cached.items()}
    names = [name.removesuffix(" mean") for name in arrays if name.endswith(" mean")]
    return {name: FieldStatistics(arrays[f"{name} mean"], arrays[f"{name} std"]) for name in names}


def _compute(blocks: Blocks, members: Iterable[Member]) -> dict[str, FieldStatistics]:
    moments: dict[str, _Moments] = {}
    for member in members:
        for block in blocks.all_of(member):
            for name, array in block.items():
                new = _moments_of(array)
                moments[name] = moments[name] + new if name in moments else new
    return {name: each.statistics for name, each in moments.items()}


def _statistics_arrays(statistics: Mapping[str, FieldStatistics]) -> dict[str, Floats]:
    pairs = statistics.items()
    means = {f"{name} mean": each.mean for name, each in pairs}
    return means | {f"{name} std": each.std for name, each in pairs}
