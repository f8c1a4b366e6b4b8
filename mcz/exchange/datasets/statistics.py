"""Mean and standard deviation of every field of a data set, in one pass over its frames."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from mcz.exchange.datasets.blocks import Blocks
from mcz.exchange.datasets.sources import Member
from mcz.model.types import Floats, Ints, Reals


class FieldStatistics(NamedTuple):
    """Mean and standard deviation of a field over all frames, float64 of the shape of a frame.

    Of values that are NaN in all frames both are NaN.
    """

    mean: Floats
    std: Floats

    def normalize(self, array: Reals) -> Reals:
        """``array`` less the mean, divided by the deviation; by 1 where that is 0."""
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
