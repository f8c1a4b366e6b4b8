"""Parts of a data set that share no subject."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence

import numpy as np

from mcz.errors import OptionError
from mcz.exchange.datasets.members import Member
from mcz.exchange.datasets.samplers import SEED
from mcz.files.reading.clip import Clip


def label_of(member: Member, clip: Clip, by: str, pattern: str | None) -> str:
    """The subject of a clip; raises OptionError where it has none."""
    if pattern is not None:
        try:
            found = re.search(pattern, member.clip)
        except re.error as error:
            raise OptionError(f"pattern {pattern!r}: {error}") from None
        if found is None or not found.groups() or found[1] is None:
            raise OptionError(
                f"pattern {pattern!r} has no group that its name matches",
                path=member.target,
                clip=member.clip,
            )
        return found[1]
    if by == "clip":
        return member.label
    if by not in clip.metadata:
        raise OptionError(
            f"its metadata say no {by!r}; give a pattern over names, such as "
            "pattern=r'^(\\d+)_', or by='clip'",
            path=member.target,
            clip=member.clip,
        )
    return clip.metadata[by]


def split(
    labels: Sequence[str], weights: Sequence[int], parts: Mapping[str, float], seed: int
) -> dict[str, list[int]]:
    """The numbers of the items of each part; raises OptionError. See ``Dataset.split``."""
    shares = list(parts.values())
    positive = all(isinstance(s, (int, float)) and 0 < s <= 1 for s in shares)
    if not shares or not positive or not math.isclose(sum(shares), 1):
        raise OptionError(f"parts {dict(parts)}: shares above 0 that add up to 1")
    totals: dict[str, int] = {}
    for label, weight in zip(labels, weights, strict=True):
        totals[label] = totals.get(label, 0) + weight
    if len(totals) < len(parts):
        raise OptionError(f"{len(totals)} subjects or the like for {len(parts)} parts")
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
