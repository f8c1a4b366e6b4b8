"""Exact channels of ``posewave``: groups of ordinals besides the rows, each a signal of fast.

SPEC.md, "Exact channels", is normative.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from functools import cache
from itertools import groupby

import numpy as np

from mcz.codecs.coding.fast.decoder import MOST_ROWS, MOST_VALUES, Shape, read_alone
from mcz.codecs.coding.fast.encoder import StreamBuilder
from mcz.codecs.contract import Layout, Request, SignalSource, Span
from mcz.codecs.posewave.header import (
    NAME,
    START_TABLES,
    VECTORS,
    PosewaveHeader,
    build_header,
)
from mcz.codecs.segments import gather
from mcz.errors import FormatError, OptionError
from mcz.kinematics.joint_names import find_joints
from mcz.model.motion import Skeleton
from mcz.model.schema import parse
from mcz.model.types import Ints, Params

Groups = tuple[tuple[int, ...], ...]
Stream = Callable[[int, int, int], bytes]  # (segment, resolution, group)

OPTION = "lossless"


def joint_words(text: object) -> tuple[str, ...]:
    """Names of joints or groups of joints; raises OptionError.

    >>> joint_words("lfoot, hands")
    ('lfoot', 'hands')
    """
    words = text.split(",") if isinstance(text, str) else text
    if not isinstance(words, list | tuple) or not all(isinstance(word, str) for word in words):
        raise OptionError(f"{OPTION} is {text!r}; it must be names of joints")
    names = tuple(word.strip() for word in words)
    if not all(names):
        raise OptionError(f"{OPTION} is {text!r}: a name is missing")
    return names


def partition(skeleton: Skeleton, options: Params) -> tuple[Groups, tuple[int, ...]] | None:
    """The groups of a clip and the numbers of the exact ones; None without exact joints."""
    words = options.get(OPTION)
    if words is None:
        return None
    joints = {joint for word in words for joint in find_joints(skeleton, word, OPTION)}
    groups, exact = groups_of(skeleton, joints)
    if not exact:
        raise OptionError(f"{OPTION}: {', '.join(words)} have no channels")
    return groups, exact


def groups_of(skeleton: Skeleton, joints: Collection[int]) -> tuple[Groups, tuple[int, ...]]:
    """Groups: each of these joints, and the channels of other joints between them.

    Also returns the numbers of the groups of these joints.
    """
    owners = [joint for joint in range(skeleton.n_joints) for _ in skeleton.columns(joint)]
    keys = [owner if owner in joints else -1 for owner in owners]
    runs = [(key, list(run)) for key, run in groupby(range(len(keys)), key=keys.__getitem__)]
    exact = tuple(number for number, (key, _) in enumerate(runs) if key >= 0)
    return tuple(tuple(run) for _, run in runs), exact


def cut_header(
    header: bytes, layout: Layout, first: int, stop: int, groups: tuple[int, ...]
) -> bytes:
    """The header of a cut: exact groups can be cut, rows, which all lossy joints share, cannot.

    Raises OptionError for other groups.
    """
    fields = parse(PosewaveHeader, header, f"{NAME} header")
    if len(groups) == len(layout.groups):
        return header
    if not set(groups) <= set(fields.exact):
        raise OptionError(
            f"{NAME}: joints can be cut out or left out only if they are coded exactly; the "
            "others are coded together"
        )
    left = {"plain": [], "orders": [], "exact": list(range(len(groups)))}
    start = fields.start % START_TABLES  # without a prior
    flags = fields.flags & ~VECTORS
    return build_header(**vars(fields) | left | {"start": start, "flags": flags})


def most_frames(layout: Layout, groups: Sequence[int]) -> int:
    """Most frames of a segment that can keep these groups exact."""
    widest = max((len(layout.groups[group]) for group in groups), default=1)
    return min(MOST_ROWS, MOST_VALUES // widest)


def build_exact(source: SignalSource, groups: Sequence[int], first: int, stop: int) -> list[bytes]:
    """The stream of each of these groups in the segment first <= f < stop."""
    if not groups:
        return []
    layout, grids = source.layout, source.grids(first)
    ordinals = source.ordinals(first, stop)
    streams: list[bytes] = []
    for group in groups:
        channels = list(layout.groups[group])
        builder = StreamBuilder([layout.grids[c] for c in channels], [range(len(channels))])
        own = np.ascontiguousarray(ordinals[:, channels])
        streams += builder.build(own, tuple(grids[c] for c in channels))
    return streams


def decode_exact(
    layout: Layout, spans: Sequence[Span], request: Request, stream: Stream, where: str
) -> Ints:
    """Decode the ordinals of exact groups, at any resolution."""

    @cache
    def shape(group: int) -> Shape:
        channels = layout.groups[group]
        return Shape([layout.grids[channel] for channel in channels], [range(len(channels))])

    def rows(index: int, group: int) -> Ints:
        for resolution in range(1, layout.n_resolutions - request.resolution):
            if stream(index, resolution, group):  # PWAVE-35
                raise FormatError(f"exact group {group} must not have details", where=where)
        data = stream(index, 0, group)
        return read_alone(shape(group), data, spans[index].n_frames)  # PWAVE-36

    return gather(layout, spans, request, rows)
