"""``torch.utils.data.Dataset`` over a ``Dataset``; imports PyTorch."""

from __future__ import annotations

import itertools
from typing import Any, Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from torch.utils import data


class Windows(Protocol):
    """What a ``Dataset`` has that is needed here."""

    @property
    def whole_clips(self) -> bool: ...
    def __len__(self) -> int: ...
    def __getitem__(self, index: Any) -> dict[str, NDArray[Any]]: ...
    def order(self, seed: int) -> NDArray[np.int64]: ...
    def pools(self, seed: int) -> list[NDArray[np.int64]]: ...


class TorchDataset(data.Dataset[dict[str, torch.Tensor]]):
    """A map-style data set; a DataLoader's workers open the files each for itself.

    ``sampler`` and ``batch_sampler`` give indices in the ``order`` that is quick to read, in place
    of a DataLoader's ``shuffle=True``.
    """

    def __init__(self, dataset: Windows) -> None:
        self.dataset = dataset

    def __len__(self) -> int:
        return len(self.dataset)

    def __getitem__(self, index: int) -> dict[str, torch.Tensor]:
        return {name: torch.from_numpy(array) for name, array in self.dataset[index].items()}

    def __getitems__(self, indices: list[int]) -> list[dict[str, torch.Tensor]]:
        """A DataLoader's batch, made at once."""
        if self.dataset.whole_clips:
            return [self[index] for index in indices]
        batch: dict[str, Any] = {n: torch.from_numpy(a) for n, a in self.dataset[indices].items()}
        return [{name: array[row] for name, array in batch.items()} for row in range(len(indices))]

    def sampler(self, seed: int) -> list[int]:
        """All indices, for a DataLoader of at most one worker."""
        return [int(index) for index in self.dataset.order(seed)]

    def batch_sampler(self, size: int, seed: int, workers: int = 1) -> list[list[int]]:
        """Batches of ``size`` indices, for ``DataLoader(batch_sampler=..., num_workers=workers)``.

        A DataLoader gives its workers a batch each in turn. Here each gets batches of parts of the
        data set of its own, so that no two decode the same.
        """
        pools = self.dataset.pools(seed)
        if len(pools) < workers:
            pools = np.array_split(self.dataset.order(seed), workers)
        batches: list[list[list[int]]] = []
        for worker in range(workers):
            own = np.concatenate(pools[worker::workers]).tolist()
            batches.append([own[at : at + size] for at in range(0, len(own), size)])
        turns = itertools.zip_longest(*batches)
        return [batch for turn in turns for batch in turn if batch]
