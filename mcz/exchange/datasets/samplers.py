"""Orders of windows for a DataLoader: a new one each epoch, reproducible by seed."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from mcz.errors import OptionError
from mcz.exchange.datasets.open_files import Member
from mcz.files.reading.clip import Clip
from mcz.model.checks import integer

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
        """Make ``epoch`` the next one, to continue a run or in one of several processes."""
        self.epoch = EPOCH(epoch)

    def __iter__(self) -> Iterator[Item]:
        # A generator: a DataLoader with workers makes two iterators an epoch, and uses one.
        epoch = self.epoch
        self.epoch += 1
        yield from self.items(epoch)

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


def label_of(member: Member, clip: Clip, by: str, pattern: str | None) -> str:
    """The subject of a clip; raises OptionError if it has none."""
    if pattern is not None:
        try:
            match = re.search(pattern, member.clip)
        except re.error as error:
            raise OptionError(f"pattern {pattern!r}: {error}") from None
        if match is None or not match.groups() or match[1] is None:
            raise OptionError(
                f"pattern {pattern!r} captures no group in its name",
                path=member.target,
                clip=member.clip,
            )
        return match[1]
    if by == "clip":
        return member.label
    if by not in clip.metadata:
        raise OptionError(
            f"its metadata have no {by!r}; extract it from clip names, such as "
            "pattern=r'^(\\d+)_', or use by='clip'",
            path=member.target,
            clip=member.clip,
        )
    return clip.metadata[by]


def split_members(
    labels: Sequence[str], weights: Sequence[int], parts: Mapping[str, float], seed: int
) -> dict[str, list[int]]:
    """The numbers of the items of each part; raises OptionError. See ``Dataset.split``."""
    shares = list(parts.values())
    positive = all(isinstance(s, (int, float)) and 0 < s <= 1 for s in shares)
    if not shares or not positive or not math.isclose(sum(shares), 1):
        raise OptionError(f"parts is {dict(parts)}; the shares must be above 0 and add up to 1")
    totals: dict[str, int] = {}
    for label, weight in zip(labels, weights, strict=True):
        totals[label] = totals.get(label, 0) + weight
    if len(totals) < len(parts):
        raise OptionError(
            f"{len(totals)} subjects (or other groups) cannot fill {len(parts)} parts"
        )
    names, whole = list(parts), sum(weights)
    shuffled = sorted(totals)
    np.random.default_rng(SEED(seed)).shuffle(shuffled)
    filled = dict.fromkeys(names, 0)
    home: dict[str, str] = {}
    for number, label in enumerate(shuffled):
        empty = [name for name in names if name not in home.values()]
        last_chance = len(shuffled) - number <= len(empty)
        among = empty if last_chance else names
        # Where most is missing, so that the shares are met as closely as the subjects allow.
        part = max(among, key=lambda name: parts[name] * whole - filled[name])
        home[label] = part
        filled[part] += totals[label]
    return {name: [n for n, label in enumerate(labels) if home[label] == name] for name in names}
