"""Orders of windows for a DataLoader: a new one each epoch, reproducible by seed."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from mcz.model.arguments import integer

SEED, EPOCH = integer("seed", 0, 2**128 - 1), integer("epoch", 0, 2**63 - 1)
SIZE = integer("size", 1, 2**63 - 1)
Item = TypeVar("Item")


class Ordered(Protocol):
    """The orders of a ``Dataset``."""

    def __len__(self) -> int: ...
    def order(self, seed: int, epoch: int = 0) -> NDArray[np.int64]: ...
    def pools(self, seed: int, epoch: int = 0) -> list[NDArray[np.int64]]: ...


class EpochSampler(Generic[Item]):
    """Another order each time that it is iterated, epochs 0, 1, 2, ..., reproducible by seed."""

    def __init__(self, dataset: Ordered, seed: int) -> None:
        self.dataset, self.seed = dataset, SEED(seed)
        self.set_epoch(0)

    def set_epoch(self, epoch: int) -> None:
        """Make ``epoch`` the next one, of a run that is continued or one of several processes."""
        self.epoch = EPOCH(epoch)

    def __iter__(self) -> Iterator[Item]:
        items = self.items(self.epoch)
        self.epoch += 1
        return iter(items)

    def items(self, epoch: int) -> Sequence[Item]:
        """The items of an epoch, in their order."""
        raise NotImplementedError


class WindowSampler(EpochSampler[int]):
    """Indices of windows, in the ``order`` that is quick to read."""

    def __len__(self) -> int:
        return len(self.dataset)

    def items(self, epoch: int) -> list[int]:
        return list(map(int, self.dataset.order(self.seed, epoch)))


class WindowBatchSampler(EpochSampler[list[int]]):
    """Batches of indices of windows, for each worker in turn; the last batch may be smaller."""

    def __init__(self, dataset: Ordered, size: int, seed: int, workers: int = 1) -> None:
        super().__init__(dataset, seed)
        self.size = SIZE(size)
        self.workers = integer("workers", 1, 2**16)(workers)

    def __len__(self) -> int:
        return math.ceil(len(self.dataset) / self.size)

    def items(self, epoch: int) -> list[list[int]]:
        pools = self.dataset.pools(self.seed, epoch)
        if len(pools) < self.workers:
            pools = np.array_split(self.dataset.order(self.seed, epoch), self.workers)
        shares = [pools[worker :: self.workers] for worker in range(self.workers)]
        lengths = [sum(map(len, share)) for share in shares]
        numbers = np.concatenate([pool for share in shares for pool in share]).tolist()
        batches = [numbers[at : at + self.size] for at in range(0, len(numbers), self.size)]
        # One batch may be of two workers' windows: the number of batches is that of any epoch.
        ends = [round(end / self.size) for end in itertools.accumulate(lengths)]
        ends[-1] = len(batches)
        runs = [batches[start:stop] for start, stop in itertools.pairwise([0, *ends])]
        turns = itertools.zip_longest(*runs)
        return [batch for turn in turns for batch in turn if batch]
