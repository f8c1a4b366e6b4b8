"""``Dataset``: windows of many clips by number, shuffled, in batches, in parts."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import ceil
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcz.errors import OptionError, OutOfRangeError
from mcz.exchange.datasets.caches import Arrays, Cache, FolderCache, MemoryCache
from mcz.exchange.datasets.fields import FIELDS, Subject, names_of
from mcz.exchange.datasets.samplers import EPOCH, SEED, SIZE, WindowBatchSampler, WindowSampler
from mcz.exchange.datasets.sources import BLOCK, Member, Recipe, Sources, timeline_of_member
from mcz.files.reading.file import File
from mcz.kinematics.poses.conversions import continuous_signs
from mcz.model.indexing import row_numbers
from mcz.model.text_format import counted
from mcz.model.types import JsonObject, Reals

RUNS_SHARE = 4  # a quarter of the cache is for frames as they were decoded
RUN_BLOCKS = 6  # of windows that stay together until a pool is shuffled
VERSION = 2  # of what features are: counted up where a kept one would be wrong


@dataclass(frozen=True, slots=True)
class Window:
    """The origin of a window of a data set: frames start <= f < stop, at its rate.

    ``time`` is that of its first frame in seconds, on the clock of the clip; None while unknown.
    """

    target: str
    clip: str
    start: int
    stop: int
    time: float | None = None


@dataclass(frozen=True, slots=True)
class Settings:
    """Settings of windows and caches."""

    recipe: Recipe
    window: int | None
    stride: int
    cache_bytes: int
    folder: Path | None


class Dataset:
    """Windows of clips: ``data[i]`` is a dict of arrays, one of each field, (window, ...).

    Made by ``mcz.dataset``. ``len(data)`` windows, in the order of the clips and of their frames;
    without a window whole clips. ``data[3:9]`` and ``data[[5, 1]]`` are batches: arrays
    (n, window, ...). The arrays are the caller's own.

    It can be pickled, and each process that a worker is opens the files anew: fork and spawn are
    both safe. Threads may share it. Reading raises as ``mcz.open`` and ``Clip.read`` do.
    """

    def __init__(
        self,
        settings: Settings,
        members: Sequence[Member],
        given: Mapping[str, File],
        skipped: Sequence[Member] = (),
    ) -> None:
        self._settings, self._given = settings, dict(given)
        self.members, self.skipped = tuple(members), tuple(skipped)
        counts = [self._count(member) for member in self.members]
        self._ends = np.cumsum(counts, dtype=np.int64)
        self._prepare()

    def _prepare(self) -> None:
        """Create the parts that are not pickled: open files and caches of them."""
        targets = {member.target for member in self.members}
        self._sources = Sources(self._given, self._settings.cache_bytes // RUNS_SHARE, len(targets))
        self._keys: dict[Member, str] = {}
        folder, most = self._settings.folder, self._settings.cache_bytes
        kept = most - most // RUNS_SHARE
        self._cache: Cache = MemoryCache(kept) if folder is None else FolderCache(folder, most)

    def adopt(self, files: Mapping[str, File]) -> None:
        """Read from these files, by target, which are open, and close them with the rest."""
        self._sources.adopt(files)

    def close(self) -> None:
        """Close the files that the data set has opened; they are opened anew when needed."""
        self._sources.close()

    def __getstate__(self) -> JsonObject:
        made = ("_sources", "_cache", "_keys")
        return {k: v for k, v in self.__dict__.items() if k not in made}

    def __setstate__(self, state: JsonObject) -> None:
        self.__dict__.update(state)
        self._prepare()

    def _count(self, member: Member) -> int:
        window = self._settings.window
        if window is None:
            return 1
        return max(0, (member.n_frames - window) // self._settings.stride + 1)

    def __repr__(self) -> str:
        window = self._settings.window
        what = "whole clips" if window is None else f"windows of {counted(window, 'frame')}"
        clips = counted(len({member.label for member in self.members}), "clip")
        short = f", {len(self.skipped)} too short" if self.skipped else ""
        return f"<Dataset: {len(self)} {what} of {clips}{short}: {', '.join(self.fields)}>"

    def __len__(self) -> int:
        return int(self._ends[-1]) if len(self._ends) else 0

    @property
    def fields(self) -> tuple[str, ...]:
        return tuple(field.name for field in self._settings.recipe.fields)

    @property
    def whole_clips(self) -> bool:
        """True if an item is a whole clip, not a window."""
        return self._settings.window is None

    @property
    def rate(self) -> Fraction | None:
        """Frames a second, None where the clips do not say it."""
        first = self.members[0].source_rate if self.members else None
        return self._settings.recipe.rate or first

    @property
    def n_frames(self) -> int:
        """Frames of all clips, at the rate of the data set."""
        return sum(member.n_frames for member in self.members)

    @property
    def names(self) -> dict[str, tuple[str, ...]]:
        """Names of each field along the axis after the frames, () for none."""
        subject = self._first_subject()
        return {field.name: names_of(field, subject) for field in self._settings.recipe.fields}

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shape of a frame of each field."""
        subject = self._first_subject()
        return {field.name: field.shape(subject) for field in self._settings.recipe.fields}

    def _first_subject(self) -> Subject:
        if not self.members:
            raise OptionError("a data set of no clips")
        member = self.members[0]
        return self._settings.recipe.subject(self._sources.clip(member), member)

    def window(self, index: int) -> Window:
        """Clip and frames of window ``index``; raises OutOfRangeError, which is an IndexError."""
        number = row_numbers(index, len(self), "window")
        if not isinstance(number, int):
            raise OutOfRangeError(f"{index!r} is not the number of a window")
        member, start, stop = self._place(number)
        first = ceil(member.first / self._settings.recipe.step(member))
        time = self._sources.time(self._settings.recipe, member, start)
        return Window(member.target, member.clip, first + start, first + stop, time)

    def _place(self, number: int) -> tuple[Member, int, int]:
        which = int(np.searchsorted(self._ends, number, side="right"))
        member = self.members[which]
        if self._settings.window is None:
            return member, 0, member.n_frames
        before = int(self._ends[which - 1]) if which else 0
        start = (number - before) * self._settings.stride
        return member, start, start + self._settings.window

    def __getitem__(self, index: object) -> dict[str, Reals]:
        """One window, or a batch of those that ``index`` chooses, as NumPy indexes an axis.

        A slice, a list, an array of integers or a mask gives arrays (n, window, ...); an array of
        two dimensions gives (n, m, window, ...). Raises OutOfRangeError, which is an IndexError.
        """
        if isinstance(index, str):
            raise OutOfRangeError(f"windows come before fields: data[:8][{index!r}]")
        if isinstance(index, tuple) and len(index) < 2:
            index = index[0] if index else ...
        if isinstance(index, tuple):
            raise OutOfRangeError(f"a data set has one axis, its windows, and no index {index!r}")
        chosen = row_numbers(index, len(self), "window")
        if isinstance(chosen, int):
            return self._arrays(*self._place(chosen))
        numbers = np.asarray(chosen, np.int64)
        batch = self._batch(numbers.ravel().tolist())
        return {name: a.reshape(*numbers.shape, *a.shape[1:]) for name, a in batch.items()}

    def __iter__(self) -> Iterator[dict[str, Reals]]:
        return (self[index] for index in range(len(self)))

    def _batch(self, numbers: Sequence[int]) -> dict[str, Reals]:
        if self._settings.window is None:
            raise OptionError("whole clips differ in length and make no batch; give a window=")
        shape = len(numbers), self._settings.window
        shapes = self.shapes if not numbers else None
        out: dict[str, Reals] = {}
        for row, number in enumerate(numbers):
            for name, parts in self._parts(*self._place(number)).items():
                if name not in out:
                    out[name] = np.empty((*shape, *parts[0].shape[1:]), parts[0].dtype)
                np.concatenate(parts, out=out[name][row])
                self._finish(name, out[name][row])
        if shapes is not None:
            dtype = self._settings.recipe.dtype
            return {name: np.empty((*shape, *rest), dtype) for name, rest in shapes.items()}
        return out

    def _arrays(self, member: Member, start: int, stop: int) -> dict[str, Reals]:
        parts = self._parts(member, start, stop)
        arrays = {name: np.concatenate(each) for name, each in parts.items()}
        for name, array in arrays.items():
            self._finish(name, array)
        return arrays

    def _finish(self, name: str, array: Reals) -> None:
        """Give quaternions the signs that keep them together, whichever blocks they are from."""
        if FIELDS[name].signed:
            array[:] = continuous_signs(np.asarray(array, np.float64))

    def _parts(self, member: Member, start: int, stop: int) -> dict[str, list[Reals]]:
        """The arrays of frames of a clip as parts of blocks, which nobody may change."""
        parts: dict[str, list[Reals]] = {name: [] for name in self.fields}
        first = start // BLOCK
        for number in range(first, max(first + 1, -(-stop // BLOCK))):
            at = number * BLOCK
            for name, array in self._block(member, number).items():
                parts[name].append(array[max(start - at, 0) : stop - at])
        return parts

    def _block(self, member: Member, number: int) -> Arrays:
        key = f"{self._key(member)}-{number}"
        found = self._cache.get(key)
        if found is None:
            start = number * BLOCK
            stop = min(start + BLOCK, member.n_frames)
            found = self._sources.features(self._settings.recipe, member, start, stop)
            self._cache.put(key, found)
        return found

    def _key(self, member: Member) -> str:
        """Cache key of a clip's features: in a folder, independent of the file's name."""
        key = self._keys.get(member)
        if key is None:
            recipe = self._settings.recipe
            told = [self.fields, recipe.rate, member.source_rate, recipe.joints, recipe.unit]
            told += [member.first, member.n_source]
            text = repr([*told, recipe.dtype.str, BLOCK, VERSION]).encode()
            if isinstance(self._cache, FolderCache):
                clip = self._sources.clip(member)
                text += clip.value_hashes[0] + clip.skeleton_id
                if not member.is_even:
                    text += np.diff(timeline_of_member(clip, member).even).tobytes()
            else:
                text += repr((member.target, member.clip)).encode()
            key = self._keys[member] = hashlib.sha256(text).hexdigest()[:32]
        return key

    def order(self, seed: int, epoch: int = 0) -> NDArray[np.int64]:
        """All windows in an order that follows from ``seed`` and ``epoch`` and is quick to read.

        Neighbouring windows are kept in runs, the runs are shuffled, then the windows of as many
        runs as the cache holds. A data set that fits in the cache is shuffled as a whole.
        """
        pools = self.pools(seed, epoch)
        return np.concatenate(pools) if pools else np.empty(0, np.int64)

    def pools(self, seed: int, epoch: int = 0) -> list[NDArray[np.int64]]:
        """The ``order`` of an epoch in the parts that are shuffled each for itself."""
        random = np.random.default_rng([SEED(seed), EPOCH(epoch)])
        runs = self._runs()
        random.shuffle(runs)
        pools: list[list[NDArray[np.int64]]] = [[]]
        held, most = 0, self._pool_frames()
        for run, n_frames in runs:
            if held + n_frames > most and pools[-1]:
                pools.append([])
                held = 0
            pools[-1].append(run)
            held += n_frames
        return [random.permutation(np.concatenate(pool)) for pool in pools if pool]

    def _runs(self) -> list[tuple[NDArray[np.int64], int]]:
        """Windows in runs of some blocks of a clip, each with the frames that it needs."""
        runs = []
        for which, member in enumerate(self.members):
            before = int(self._ends[which - 1]) if which else 0
            numbers = np.arange(before, int(self._ends[which]))
            each = max(1, RUN_BLOCKS * BLOCK // self._settings.stride)
            for at in range(0, len(numbers), each):
                part = numbers[at : at + each]
                if self._settings.window is None:
                    n_frames = member.n_frames
                else:
                    n_frames = (len(part) - 1) * self._settings.stride + self._settings.window
                runs.append((part, n_frames + BLOCK))
        return runs

    def _pool_frames(self) -> int:
        """Frames that the cache holds, as features and as they were decoded."""
        if self._settings.folder is not None or not self.members:
            return 2**62
        size = self._settings.recipe.dtype.itemsize
        values = sum(int(np.prod(shape)) for shape in self.shapes.values())
        decoded = self._settings.cache_bytes // RUNS_SHARE
        kept = (self._settings.cache_bytes - decoded) // (size * max(1, values))
        if self.n_frames <= kept:
            return 2**62
        n_channels = self._first_subject().skeleton.n_channels
        # Segments reach beyond the ends of a run: two thirds of what is decoded is of use.
        return min(kept, int(decoded // (8 * max(1, n_channels))) * 2 // 3)

    def shuffled(self, seed: int, epoch: int = 0) -> Iterator[dict[str, Reals]]:
        """The windows in the ``order`` of an epoch."""
        return (self[int(index)] for index in self.order(seed, epoch))

    def batches(
        self, size: int, *, seed: int | None = None, epoch: int = 0, drop_last: bool = False
    ) -> Iterator[dict[str, Reals]]:
        """Batches of ``size`` windows, in the ``order`` of an epoch or, seed None, as they come.

        The last one is smaller where they do not come out even, unless ``drop_last``.
        """
        size = SIZE(size)
        numbers = np.arange(len(self)) if seed is None else self.order(seed, epoch)
        stop = len(self) - len(self) % size if drop_last else len(self)
        return (self[numbers[at : at + size]] for at in range(0, stop, size))

    def sampler(self, seed: int) -> WindowSampler:
        """Numbers of windows in the ``order`` of epoch 0, 1, 2, ... each time it is iterated.

        ``set_epoch`` chooses the next epoch.
        """
        return WindowSampler(self, seed)

    def batch_sampler(self, size: int, seed: int, workers: int = 1) -> WindowBatchSampler:
        """Batches of ``size`` numbers of windows, for workers that take one each in turn.

        Each worker gets windows of clips of its own. A new order each time, as of ``sampler``.
        """
        return WindowBatchSampler(self, size, seed, workers)

    def part(self, members: Sequence[Member]) -> Dataset:
        """The same of some of its ``members`` alone; files and cache are shared."""
        made = Dataset(self._settings, members, self._given)
        made._sources, made._cache = self._sources, self._cache
        return made

    def split(
        self,
        parts: Mapping[str, float],
        *,
        by: str = "subject",
        pattern: str | None = None,
        seed: int = 0,
    ) -> dict[str, Dataset]:
        """Parts of which no two share a subject: ``split({"train": 0.8, "test": 0.2})``.

        ``parts``: names and shares, which add up to 1; by their number of windows parts come as
        near to these as whole subjects allow, each at least one. ``by``: a key of the clips'
        metadata, or "clip", of which each stands for itself; ``pattern``: a regular expression
        whose first group, found in the name of a clip, is its subject instead. The same ``seed``
        splits the same clips in the same way. Raises OptionError where a clip has none, and where
        there are fewer subjects than parts.
        """
        from mcz.exchange.datasets.samplers import split

        groups = split(self._labels(by, pattern), list(map(self._count, self.members)), parts, seed)
        return {
            name: self.part([self.members[number] for number in numbers])
            for name, numbers in groups.items()
        }

    def _labels(self, by: str, pattern: str | None) -> list[str]:
        from mcz.exchange.datasets.samplers import label_of

        clips = (self._sources.clip(member) for member in self.members)
        return [label_of(m, clip, by, pattern) for m, clip in zip(self.members, clips, strict=True)]

    def torch(self) -> Any:
        """As a ``torch.utils.data.Dataset``, an item a dict of tensors, (window, ...).

        Raises OptionError where PyTorch is not installed (``mcz[torch]``).
        """
        try:
            from mcz.exchange.datasets.torch_dataset import TorchDataset
        except ImportError as error:
            raise OptionError(
                f"PyTorch is not installed (pip install 'mcz[torch]'): {error}"
            ) from None
        return TorchDataset(self)
