"""Features of clips in blocks of frames, computed when they are needed and kept in a cache."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mcz.exchange.datasets.caches import Arrays, Cache, FolderCache, MemoryCache
from mcz.exchange.datasets.sources import Member, Recipe, Sources, timeline_of_member
from mcz.files.reading.file import File
from mcz.model.types import Reals

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
