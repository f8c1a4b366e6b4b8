"""Features of clips in cached blocks of frames; their mean and standard deviation."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from mcz.exchange.datasets.caches import Arrays, Cache, FolderCache, MemoryCache
from mcz.exchange.datasets.sources import Member, Recipe, Sources, timeline_of_member
from mcz.files.reading.file import File
from mcz.model.types import Floats, Ints, Reals

BLOCK = 128  # frames whose features are computed and kept together
RUNS_SHARE = 4  # a quarter of the cache is for frames as they were decoded
VERSION = 2  # of the features: counted up where a kept one would be wrong


@dataclass(frozen=True, slots=True)
class Settings:
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
        self, settings: Settings, members: Sequence[Member], given: Mapping[str, File]
    ) -> None:
        self._recipe = settings.recipe
        targets = {member.target for member in members}
        self.sources = Sources(given, settings.decoded_bytes, len(targets))
        self._keys: dict[Member, str] = {}
        self.cache: Cache = (
            MemoryCache(settings.feature_bytes)
            if settings.folder is None
            else FolderCache(settings.folder, settings.cache_bytes)
        )

    def parts(self, member: Member, start: int, stop: int) -> dict[str, list[Reals]]:
        """The arrays of frames of a clip as parts of blocks, which nobody may change."""
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
        """Frames of a block: all of a clip where a field cannot be computed for fewer."""
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

    Of values that are NaN in all frames both are NaN.
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
        apart = other.means - self.means
        return _Moments(
            counts,
            self.means + apart * share,
            self.squares + other.squares + apart**2 * self.counts * share,
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
    kept = blocks.cache.get(key)
    if kept is None:
        kept = _packed(_compute(blocks, members))
        blocks.cache.put(key, kept)
    arrays = {name: np.asarray(array, np.float64) for name, array in kept.items()}
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


def _packed(statistics: Mapping[str, FieldStatistics]) -> dict[str, Floats]:
    pairs = statistics.items()
    means = {f"{name} mean": each.mean for name, each in pairs}
    return means | {f"{name} std": each.std for name, each in pairs}
