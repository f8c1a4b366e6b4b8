"""Clips of ``posewave``, to order: any skeleton, header and steps of rows.

Streams are those of the encoder of one segment: binary64 + - * / alone, so that the bytes do not
depend on a machine's arithmetic. Values are those of the decoder.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcz.codecs import raw
from mcz.codecs.contract import Codec, Encoded, Layout, Request, Segment, SignalSource, Span
from mcz.codecs.posewave import posewave
from mcz.codecs.posewave.contacts import ContactTracker, Piece
from mcz.codecs.posewave.exact_channels import build_exact, groups_of
from mcz.codecs.posewave.header import Header, PosewaveHeader, parse_posewave_header
from mcz.codecs.posewave.segment import SegmentChain, Weights, encode_segment
from mcz.model.motion import Joint, Skeleton
from mcz.model.numbers import Grid
from tools.records import build_record
from tools.vectors.build.motions import channels

Floats = NDArray[np.float64]

PLAIN_FIELDS: dict[str, Any] = {
    "levels": 2,
    "borrowing": 1,
    "start": 0,
    "flags": 0,
    "step": 0.03125,
    "radius": 3.0,
    "shell": 8,
    "rotation": 136,
    "position": 145,
    "first": 2,
    "constant": 8,
    "plain": [],
    "weights": [],
    "orders": [],
    "exact": [],
}


@dataclass(frozen=True, slots=True)
class Plan:
    """``source`` (n_frames, n_channels) is what is encoded; ``ends`` of segments but the last.

    ``fields`` are those of the header that are not the plain ones; ``cut``: finest resolutions that
    are not stored; ``price`` of a bit in squared steps; ``streams``: those of a segment in the
    place of its own; ``on``: segments that go on where the one before ended; ``exact`` joints have
    groups of their own, and values on ``grids``, all BINARY64 where there are none. ``pieces`` of
    contacts are to keep their places to ``tolerance``.
    """

    skeleton: Skeleton
    source: Floats
    fields: dict[str, Any] = field(default_factory=dict)
    ends: tuple[int, ...] = ()
    cut: int = 0
    price: float = 0.0625
    refinement: Sequence[int] | None = None
    streams: dict[int, tuple[bytes, ...]] = field(default_factory=dict)
    on: Collection[int] = ()
    pieces: tuple[Piece, ...] = ()
    tolerance: float = 0.01
    exact: Collection[int] = ()
    grids: tuple[Grid, ...] = ()

    @property
    def groups(self) -> tuple[tuple[tuple[int, ...], ...], tuple[int, ...]]:
        """All groups, and the numbers of the exact ones."""
        if self.exact:
            return groups_of(self.skeleton, self.exact)
        return ((tuple(range(self.skeleton.n_channels)),) if self.skeleton.n_channels else ()), ()

    @property
    def lossy(self) -> tuple[int, ...]:
        """The numbers of the other groups."""
        groups, exact = self.groups
        return tuple(number for number in range(len(groups)) if number not in exact)

    @property
    def n_frames(self) -> int:
        return len(self.source)

    @property
    def levels(self) -> int:
        return int((PLAIN_FIELDS | self.fields)["levels"])

    @property
    def n_resolutions(self) -> int:
        return self.levels + 1 - self.cut


def header_of(plan: Plan, **changes: Any) -> bytes:
    fields = PLAIN_FIELDS | {"exact": plan.groups[1]} | plan.fields | changes
    fields["borrowing"] = min(fields["borrowing"], fields["levels"])
    return build_record(PosewaveHeader, {"contacts": []} | fields, "posewave header")


def layout_of(plan: Plan) -> Layout:
    groups, grids = plan.groups[0], plan.grids
    return Layout(
        plan.n_frames, groups, grids=grids, skeleton=plan.skeleton, n_resolutions=plan.n_resolutions
    )


def parse_plan(plan: Plan) -> Header:
    return parse_posewave_header(header_of(plan), layout_of(plan))


def segments_of(plan: Plan) -> list[Segment]:
    chain, tracker = (
        SegmentChain(parse_plan(plan), plan.skeleton),
        ContactTracker(plan.tolerance, plan.pieces),
    )
    edges = [0, *plan.ends, plan.n_frames] if plan.n_frames else []
    return [
        Segment(
            start, stop - start, _streams(plan, chain, tracker, index, (start, stop)), fresh=fresh
        )
        for index, (start, stop) in enumerate(zip(edges, edges[1:], strict=False))
        for fresh in (index not in plan.on,)
    ]


def _streams(
    plan: Plan, chain: SegmentChain, tracker: ContactTracker, index: int, frames: tuple[int, int]
) -> tuple[bytes, ...]:
    if index in plan.streams:
        return plan.streams[index]
    if not plan.skeleton.n_channels:
        return ()
    own, (start, stop) = plan.refinement, frames
    tracker.first = start
    octaves = None if own is None else np.array(own[start:stop], np.int64)
    source, weights = plan.source[start:stop], Weights(plan.price, plan.price)
    if plan.on:
        octave = 0 if octaves is None else int(octaves[0])
        return chain.encode(source, plan.price, octave, fresh=index not in plan.on)[:1]
    if not plan.lossy:
        return (b"",) * plan.n_resolutions
    streams, _ = encode_segment(chain.header, plan.skeleton, source, weights, octaves, tracker)
    return streams[: plan.n_resolutions]


def with_exact(plan: Plan, source: SignalSource) -> Iterator[Segment]:
    """The segments of ``plan``, with the streams of all groups; ``source`` has what is exact."""
    groups, exact = plan.groups
    for segment in segments_of(plan):
        last = segment.first + segment.n_frames
        own = zip(exact, build_exact(source, exact, segment.first, last), strict=True)
        streams = {(0, group): stream for group, stream in own}
        if plan.lossy:
            streams |= {(r, plan.lossy[0]): s for r, s in enumerate(segment.streams)}
        places = product(range(plan.n_resolutions), range(len(groups)))
        yield replace(segment, streams=tuple(streams.get(place, b"") for place in places))


def codec_of(plan: Plan) -> Codec:
    """Codec posewave with this content, whatever the values of the motion."""

    def encode(source: Any, params: Any) -> Encoded:
        made = with_exact(plan, source) if plan.exact else iter(segments_of(plan))
        version = parse_plan(plan).version
        return Encoded(header_of(plan), made, plan.n_resolutions, version=version)

    return replace(
        posewave.CODEC,
        encode=encode,
        parameters=raw.CODEC.parameters,
        dial=None,
        promise=None,
        partition=lambda skeleton, options: plan.groups if plan.exact else None,
    )


def values_of(plan: Plan, resolution: int = 0) -> Floats:
    made, layout = segments_of(plan), layout_of(plan)
    request = Request(0, plan.n_frames, plan.lossy, resolution)
    values = plan.source.copy()
    values[:, [c for g in plan.lossy for c in layout.groups[g]]] = posewave.CODEC.decode(
        header_of(plan),
        layout,
        [Span(s.first, s.n_frames, fresh=s.fresh) for s in made],
        request,
        lambda segment, stream, group: (
            made[segment].streams[stream] if group in plan.lossy[:1] else b""
        ),
    )
    return values


# Skeletons and how they move


def acclaim() -> Skeleton:
    """Fixed axes in degrees, with orientations and tails."""
    return Skeleton(
        (
            Joint("root", channels=channels("tx ty tz rx ry rz")),
            Joint(
                "hip",
                0,
                (1.5, -2.0, 0.25),
                ((0.5, -6.0, 1.0),),
                axis=(0.0, 0.0, 20.0),
                channels=channels("rx ry rz"),
            ),
            Joint(
                "knee",
                1,
                (0.5, -6.0, 1.0),
                ((0.25, -5.5, 0.5),),
                axis=(10.0, 20.0, 30.0),
                axis_order="ZXY",
                channels=channels("rx"),
            ),
            Joint(
                "spine",
                0,
                (0.0, 2.0, 0.0),
                ((0.0, 4.5, 0.0), (0.5, 5.0, 0.0)),
                axis=(0.0, -15.0, 0.0),
                channels=channels("rx rz"),
            ),
        ),
        name="acclaim",
        unit_cm=5.644444444444444,
        angle_unit="deg",
        up_axis="y",
    )


def biovision(unit: str = "deg") -> Skeleton:
    """Intrinsic rotations, offsets of the parent's axes."""
    return Skeleton(
        (
            Joint("hips", channels=channels("tx ty tz rz rx ry")),
            Joint("chest", 0, (0.0, 5.0, 0.5), channels=channels("rz rx ry")),
            Joint("arm", 1, (4.0, 1.0, 0.0), channels=channels("rz rx ry")),
            Joint("hand", 2, (6.0, 0.0, 0.0), ((2.0, 0.0, 0.0),), channels=channels("rz rx ry")),
            Joint("leg", 0, (1.5, -7.0, 0.0), ((0.0, -8.0, 0.0),), channels=channels("rz rx ry")),
        ),
        name="biovision",
        angle_unit=unit,
        up_axis="y",
        intrinsic=True,
    )


def chain(kinds: Sequence[str], intrinsic: bool = True, **more: Any) -> Skeleton:
    """Joints of these channels, each below the one before."""
    joints = tuple(
        Joint(
            f"link {j}",
            j - 1,
            (0.0, 1.0 + j % 3, 0.5) if j else (0.0, 0.0, 0.0),
            channels=channels(own),
        )
        for j, own in enumerate(kinds)
    )
    return Skeleton(joints, **({"angle_unit": "deg", "intrinsic": intrinsic} | more))
