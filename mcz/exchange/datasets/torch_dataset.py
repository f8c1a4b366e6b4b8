"""``torch.utils.data.Dataset`` over a ``Dataset``; imports PyTorch."""

from __future__ import annotations

from typing import Protocol

import torch
from torch.utils import data

from mcz.exchange.datasets.samplers import WindowBatchSampler, WindowSampler
from mcz.model.types import JsonObject, Reals


class Windows(Protocol):
    """Protocol of the parts of a ``Dataset`` that are used here."""

    @property
    def whole_clips(self) -> bool: ...
    def __len__(self) -> int: ...
    def __getitem__(self, index: object) -> dict[str, Reals]: ...
    def sampler(self, seed: int) -> WindowSampler: ...
    def batch_sampler(self, size: int, seed: int, workers: int = 1) -> WindowBatchSampler: ...


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
        batch: JsonObject = {n: torch.from_numpy(a) for n, a in self.dataset[indices].items()}
        return [{name: array[row] for name, array in batch.items()} for row in range(len(indices))]

    def sampler(self, seed: int) -> WindowSampler:
        """Indices in a new order each epoch, for a DataLoader of at most one worker."""
        return self.dataset.sampler(seed)

    def batch_sampler(self, size: int, seed: int, workers: int = 1) -> WindowBatchSampler:
        """Batches of ``size`` indices, for ``DataLoader(batch_sampler=..., num_workers=workers)``.

        A DataLoader gives its workers a batch each in turn. Here each gets batches of parts of the
        data set of its own, so that hardly any two decode the same.
        """
        return self.dataset.batch_sampler(size, seed, workers)
