"""``Dataset``: windows of many clips by number, shuffled, in batches, in parts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import ceil
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcz.errors import OptionError, OutOfRangeError
from mcz.exchange.datasets.feature_blocks import (
    BLOCK,
    Blocks,
    DatasetSettings,
    FieldStatistics,
    statistics_of,
)
from mcz.exchange.datasets.fields import Subject, names_of
from mcz.exchange.datasets.open_files import Member
from mcz.exchange.datasets.samplers import EPOCH, SEED, SIZE, WindowBatchSampler, WindowSampler
from mcz.files.reading.file import File
from mcz.kinematics.poses.conversions import continuous_signs
from mcz.model.checks import row_numbers
from mcz.model.text_format import count_text
from mcz.model.types import JsonObject, Reals

RUN_BLOCKS = 12  # of windows that stay together until a pool is shuffled


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


class Dataset:
    """Windows of clips: ``data[i]`` is a dict of arrays, one of each field, (window, ...).

    Made by ``mcz.dataset``. ``len(data)`` windows, in the order of the clips and of their frames;
    without a window whole clips. ``data[3:9]`` and ``data[[5, 1]]`` are batches: arrays
    (n, window, ...). The arrays are the caller's own.

    It can be pickled, and each worker process opens the files itself: fork and spawn are both safe.
    Threads may share it. Reading raises as ``mcz.open`` and ``Clip.read`` do.
    """

    def __init__(
        self,
        settings: DatasetSettings,
        members: Sequence[Member],
        files: Mapping[str, File],
        skipped: Sequence[Member] = (),
        blocks: Blocks | None = None,
    ) -> None:
        self._settings, self._given = settings, dict(files)
        self.members, self.skipped = tuple(members), tuple(skipped)
        counts = [self._count(member) for member in self.members]
        self._ends = np.cumsum(counts, dtype=np.int64)
        self._scales: dict[str, FieldStatistics] | None = None  # of windows that are normalized
        self._blocks = blocks or Blocks(settings, self.members, self._given)

    def adopt(self, files: Mapping[str, File]) -> None:
        """Read from these files, by target, which are open, and close them with the rest."""
        self._blocks.sources.adopt(files)

    def close(self) -> None:
        """Close the files that the data set has opened; they are reopened when needed."""
        self._blocks.sources.close()

    def __getstate__(self) -> JsonObject:
        return {name: value for name, value in self.__dict__.items() if name != "_blocks"}

    def __setstate__(self, state: JsonObject) -> None:
        self.__dict__.update(state)
        self._blocks = Blocks(self._settings, self.members, self._given)

    def _count(self, member: Member) -> int:
        window = self._settings.window
        if window is None:
            return 1
        return max(0, (member.n_frames - window) // self._settings.stride + 1)

    def __repr__(self) -> str:
        window = self._settings.window
        noun = "whole clips" if window is None else f"windows of {count_text(window, 'frame')}"
        clips = count_text(len({member.label for member in self.members}), "clip")
        short = f", {len(self.skipped)} too short" if self.skipped else ""
        return f"<Dataset: {len(self)} {noun} of {clips}{short}: {', '.join(self.fields)}>"

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
        """Frames a second, None if the clips do not state it."""
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
            raise OptionError("a data set needs at least one clip")
        member = self.members[0]
        return self._settings.recipe.subject(self._blocks.sources.clip(member), member)

    def window(self, index: int) -> Window:
        """Clip and frames of window ``index``; raises OutOfRangeError, which is an IndexError."""
        number = row_numbers(index, len(self), "window")
        if not isinstance(number, int):
            raise OutOfRangeError(f"{index!r} is not a valid window number")
        member, start, stop = self._place(number)
        first = ceil(member.first / self._settings.recipe.step(member))
        time = self._blocks.sources.time(self._settings.recipe, member, start)
        return Window(member.target, member.clip, first + start, first + stop, time)

    def _place(self, number: int) -> tuple[Member, int, int]:
        index = int(np.searchsorted(self._ends, number, side="right"))
        member = self.members[index]
        if self._settings.window is None:
            return member, 0, member.n_frames
        before = int(self._ends[index - 1]) if index else 0
        start = (number - before) * self._settings.stride
        return member, start, start + self._settings.window

    def __getitem__(self, index: object) -> dict[str, Reals]:
        """One window, or a batch of those that ``index`` chooses, as NumPy indexes an axis.

        A slice, a list, an array of integers or a mask gives arrays (n, window, ...); an array of
        two dimensions gives (n, m, window, ...). Raises OutOfRangeError, which is an IndexError.
        """
        if isinstance(index, str):
            raise OutOfRangeError(f"select windows before fields: data[:8][{index!r}]")
        if isinstance(index, tuple) and len(index) < 2:
            index = index[0] if index else ...
        if isinstance(index, tuple):
            raise OutOfRangeError(f"a data set has one axis, its windows; {index!r} has more")
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
            raise OptionError(
                "whole clips differ in length, so they cannot be batched; set window="
            )
        shape = len(numbers), self._settings.window
        if not numbers:
            dtype = self._settings.recipe.dtype
            return {name: np.empty((*shape, *rest), dtype) for name, rest in self.shapes.items()}
        out: dict[str, Reals] = {}
        for row, number in enumerate(numbers):
            for name, parts in self._blocks.parts(*self._place(number)).items():
                if name not in out:
                    out[name] = np.empty((*shape, *parts[0].shape[1:]), parts[0].dtype)
                np.concatenate(parts, out=out[name][row])
        for name in self._signed:
            for window in out[name]:
                window[:] = continuous_signs(np.asarray(window, np.float64))
        return self._normalize(out)

    def _arrays(self, member: Member, start: int, stop: int) -> dict[str, Reals]:
        parts = self._blocks.parts(member, start, stop)
        arrays = {name: np.concatenate(each) for name, each in parts.items()}
        for name in self._signed:
            arrays[name][:] = continuous_signs(np.asarray(arrays[name], np.float64))
        return self._normalize(arrays)

    @property
    def _signed(self) -> list[str]:
        """Quaternions: a window gives them the signs that keep them together."""
        return [field.name for field in self._settings.recipe.fields if field.signed]

    def _normalize(self, arrays: dict[str, Reals]) -> dict[str, Reals]:
        if self._scales is None:
            return arrays
        return {name: self._scales[name].normalize(array) for name, array in arrays.items()}

    def statistics(self) -> dict[str, FieldStatistics]:
        """Mean and standard deviation of each field over all frames of the clips, once each.

        Unknown values (NaN) do not count. Computed in one pass, which decodes every clip, and kept
        with the features in the cache; in a ``folder``, for later runs as well.
        """
        return statistics_of(self._blocks, self.members)

    def normalized(self, statistics: Mapping[str, FieldStatistics] | None = None) -> Dataset:
        """A copy whose fields have their mean subtracted and are divided by their deviation.

        ``statistics``: those of another data set, such as the training part; by default its own.
        Raises OptionError if they lack a field.
        """
        scales = dict(self.statistics() if statistics is None else statistics)
        missing = [name for name in self.fields if name not in scales]
        if missing:
            raise OptionError(f"the statistics lack {', '.join(missing)}")
        normalized = self.part(self.members)
        normalized.skipped, normalized._scales = self.skipped, scales
        return normalized

    def order(self, seed: int, epoch: int = 0) -> NDArray[np.int64]:
        """All windows in an order that follows from ``seed`` and ``epoch`` and is quick to read.

        Neighboring windows are kept in runs, the runs are shuffled, then the windows of as many
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
        for index, member in enumerate(self.members):
            before = int(self._ends[index - 1]) if index else 0
            numbers = np.arange(before, int(self._ends[index]))
            each = max(1, RUN_BLOCKS * BLOCK // self._settings.stride)
            if self._settings.recipe.is_whole:
                each = max(1, len(numbers))
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
        decoded = self._settings.decoded_bytes
        cached_frames = self._settings.feature_bytes // (size * max(1, values))
        if self.n_frames <= cached_frames:
            return 2**62
        n_channels = self._first_subject().skeleton.n_channels
        # Segments reach beyond the ends of a run: two thirds of what is decoded is of use.
        return min(cached_frames, int(decoded // (8 * max(1, n_channels))) * 2 // 3)

    def shuffled(self, seed: int, epoch: int = 0) -> Iterator[dict[str, Reals]]:
        """The windows in the ``order`` of an epoch."""
        return (self[int(index)] for index in self.order(seed, epoch))

    def batches(
        self, size: int, *, seed: int | None = None, epoch: int = 0, drop_last: bool = False
    ) -> Iterator[dict[str, Reals]]:
        """Batches of ``size`` windows, in the ``order`` of an epoch or, seed None, as they come.

        The last one is smaller if they do not come out even, unless ``drop_last``.
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

        Each worker gets windows of clips of its own. A new order each time, as in ``sampler``.
        """
        return WindowBatchSampler(self, size, seed, workers)

    def part(self, members: Sequence[Member]) -> Dataset:
        """A data set of some of its ``members``; it shares files and cache."""
        part = Dataset(self._settings, members, self._given, blocks=self._blocks)
        part._scales = self._scales
        return part

    def split(
        self,
        parts: Mapping[str, float],
        *,
        by: str = "subject",
        pattern: str | None = None,
        seed: int = 0,
    ) -> dict[str, Dataset]:
        """Split into parts with distinct subjects: ``split({"train": 0.8, "test": 0.2})``.

        ``parts``: names and shares, which add up to 1; by their number of windows parts come as
        near to these as whole subjects allow, each at least one. ``by``: a key of the clips'
        metadata, or "clip": each is a subject; ``pattern``: a regular expression whose first group,
        found in the name of a clip, is its subject instead. The same ``seed`` splits the same clips
        in the same way. Raises OptionError if a clip has none, and if there are fewer subjects than
        parts.
        """
        from mcz.exchange.datasets.samplers import split_members

        groups = split_members(
            self._labels(by, pattern), list(map(self._count, self.members)), parts, seed
        )
        return {
            name: self.part([self.members[number] for number in numbers])
            for name, numbers in groups.items()
        }

    def _labels(self, by: str, pattern: str | None) -> list[str]:
        from mcz.exchange.datasets.samplers import label_of

        clips = (self._blocks.sources.clip(member) for member in self.members)
        return [label_of(m, clip, by, pattern) for m, clip in zip(self.members, clips, strict=True)]

    def torch(self) -> Any:
        """A ``torch.utils.data.Dataset`` whose items are dicts of tensors, (window, ...).

        Raises OptionError if PyTorch is not installed (``mcz[torch]``).
        """
        try:
            from mcz.exchange.datasets.torch_dataset import TorchDataset
        except ImportError as error:
            raise OptionError(
                f"PyTorch is not installed (pip install 'mcz[torch]'): {error}"
            ) from None
        return TorchDataset(self)
