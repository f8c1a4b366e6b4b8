"""Quaternions among plain scalars: four columns of unit norm, which splines would shrink."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mcz.errors import OptionError
from mcz.model.motion import Channel, Skeleton
from mcz.model.text_format import shown

Floats = NDArray[np.float64]
Quaternion = tuple[int, ...]  # four columns

UNIT = 2e-3  # how far a norm may be from 1: of numbers with three decimals
SIZE = 4
_NAMED = re.compile(r"(?i)quat|(^|[^a-z])q(_?[wxyz0-3])?($|[^a-z0-9])")
HINT = "; components=True interpolates each column by itself"


def scalar_quaternions(
    skeleton: Skeleton | None, own: Sequence[Channel] | None, values: Floats
) -> list[Quaternion]:
    """The columns of quaternions: four plain scalars side by side whose norm is 1 in all rows.

    Raises OptionError where these overlap and names do not tell which are meant, and where columns
    that are named like a quaternion are none.
    """
    names = _plain_names(skeleton, own)
    places = [at for at in range(len(names) - SIZE + 1) if None not in names[at : at + SIZE]]
    units = {at: _is_unit(values[:, at : at + SIZE]) for at in places}
    starts = [at for at in places if units[at]]
    named = {at for at in places if all(map(_is_named, names[at : at + SIZE]))}
    for at in sorted(named):
        inside = any(other in starts for other in range(at - SIZE + 1, at + SIZE))
        if units[at] is False and not inside:
            raise OptionError(
                f"{_describe_columns(names, at)} are named like a quaternion, of another norm{HINT}"
            )
    apart: list[int] = []
    for at in starts:
        rivals = [other for other in starts if other != at and abs(other - at) < SIZE]
        if not rivals or (at in named and named.isdisjoint(rivals)):
            apart.append(at)
        elif named.isdisjoint([at, *rivals]):
            raise OptionError(
                f"{_describe_columns(names, at)} may be a quaternion, or those beside them{HINT}"
            )
    return [tuple(range(at, at + SIZE)) for at in apart]


def _plain_names(skeleton: Skeleton | None, own: Sequence[Channel] | None) -> list[str | None]:
    """The names of columns that are plain scalars, None for others."""
    if own is not None:
        return [channel.label for channel in own]
    joints = () if skeleton is None else skeleton.joints
    return [
        None if channel.kind else f"{joint.name} {channel.label}"
        for joint in joints
        for channel in joint.channels
    ]


def _is_unit(four: Floats) -> bool | None:
    """Tell whether norms are 1 in all rows; None where none is known, or all rows are the same."""
    norms = np.sqrt((four * four).sum(axis=1))
    known = norms[~np.isnan(norms)]
    if not len(known) or (four == four[:1]).all():
        return None
    return bool((np.abs(known - 1) <= UNIT).all())


def _is_named(name: str | None) -> bool:
    return name is not None and _NAMED.search(name) is not None


def _describe_columns(names: Sequence[str | None], at: int) -> str:
    return f"columns {at + 1} to {at + SIZE} ({shown(str(names[at]))}, ...)"


def slerp_quaternions(first: Floats, last: Floats, share: Floats) -> Floats:
    """The quaternions (n, 4) a ``share``, (n,), of the shortest way from the first to the last."""
    with np.errstate(invalid="ignore", divide="ignore"):
        cosine = (first * last).sum(axis=1, keepdims=True)
        last = np.where(cosine < 0, -last, last)
        angle = np.arccos(np.clip(np.abs(cosine), 0.0, 1.0))
        to, near = share[:, None], angle < 1e-6
        start = np.where(near, 1 - to, np.sin((1 - to) * angle))
        mixed = start * first + np.where(near, to, np.sin(to * angle)) * last
        return np.asarray(mixed / np.sqrt((mixed * mixed).sum(axis=1, keepdims=True)))
