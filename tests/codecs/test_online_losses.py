"""What a live decoder of ``online`` makes of frames that are lost, damaged, doubled or misplaced.

The decoder in JavaScript has no losses. What is meant is told by the codec itself: a frame that may
be decoded is what decoding in one go makes of the frames that it rests upon, and of no others.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np
from hypothesis import HealthCheck, given, reject, settings
from hypothesis import strategies as st

from mcz.codecs import by_name
from mcz.codecs.contract import Layout, Request, Span, model_finder
from mcz.codecs.online.units import INTRA, LTR, STR, Unit, build_units, parse_units
from mcz.errors import FormatError, MotionError, OptionError
from mcz.motion import Motion
from mcz.writing.signal_source import MemorySource
from tests.codecs.lossy import markers, rough

CODEC = by_name("online")

Frame = tuple[bytes, bool]  # stream, fresh


class Live:
    """A live clip, whose parameters change before some frames."""

    def __init__(
        self, motion: Motion, params: dict[str, Any], changes: dict[int, dict[str, Any]]
    ) -> None:
        signal = motion.signals[0]
        layout = replace(MemorySource(motion, 0, CODEC, 2**26).layout, n_frames=0)
        assert CODEC.live is not None
        live = CODEC.live(layout, CODEC.options(params))
        self.frames: list[Frame] = []
        for f, row in enumerate(signal.values):
            if f in changes:
                options = CODEC.options(changes[f])
                live.change({name: options[name] for name in changes[f]})
            self.frames.append(live.push(row, None if signal.mask is None else signal.mask[f]))
        self.header = live.header
        self.layout: Layout = replace(layout, find_model=model_finder(live.models))

    def came(self, frames: Sequence[Frame | None]) -> list[bytes | None]:
        """What the codec makes of frames, of which some did not come."""
        assert CODEC.follow is not None
        follower = CODEC.follow(self.header, self.layout)
        rows: list[bytes | None] = []
        for frame in frames:
            rows.append(None)
            if frame is None:
                follower.skip(1)
                continue
            with suppress(FormatError):
                rows[-1] = follower.push(*frame).astype("<f8").tobytes()
        return rows

    def meant(self, frames: Sequence[Frame | None]) -> list[bytes | None]:
        """What SPEC.md says of them: the units that each rests upon, decoded as a clip."""
        rows: list[bytes | None] = []
        before: list[Unit] | None = None  # what the frame before rests upon, if it is known
        last: list[Unit] = []  # the same of the last LTR
        last_at = None
        for at, frame in enumerate(frames):
            chain = None if frame is None else rests_upon(frame, before, last, at, last_at)
            row = None if chain is None else self.in_one_go(chain)[-1]
            rows.append(row)
            before = chain if row is not None else None
            if before is not None and before[-1].kind != STR:
                last, last_at = before, at
        return rows

    def in_one_go(self, units: Sequence[Unit]) -> list[bytes | None]:
        """The rows of a clip of these units, a frame each; all None where it is refused."""
        n = len(units)
        spans = [Span(i, 1, fresh=unit.kind == INTRA) for i, unit in enumerate(units)]
        layout, request = replace(self.layout, n_frames=n), Request(0, n, (0,))
        streams = [build_units([unit]) for unit in units]
        try:
            values = CODEC.decode(
                self.header, layout, spans, request, lambda segment, _, __: streams[segment]
            )
        except FormatError:
            return [None] * n
        return [row.astype("<f8").tobytes() for row in values]

    def check(self, frames: Sequence[Frame | None]) -> int:
        """How many of the frames are decoded: those that may be, and no others."""
        rows = self.came(frames)
        assert rows == self.meant(frames)
        return sum(row is not None for row in rows)


def rests_upon(
    frame: Frame, before: list[Unit] | None, last: list[Unit], at: int, last_at: int | None
) -> list[Unit] | None:
    """The units of a clip that ends with this frame; None where it must not be decoded."""
    stream, fresh = frame
    try:
        (unit,) = parse_units(CODEC.name, stream, 1)
    except FormatError:
        return None
    if fresh != (unit.kind == INTRA):
        return None
    if unit.kind == INTRA:
        return [unit]
    if unit.kind == STR:
        return None if before is None else [*before, unit]
    if last_at is None or unit.distance != at - last_at:
        return None
    return [*last, replace(unit, distance=1)]  # the one before, in that clip


# Losses


def only_lost(frames: Sequence[Frame], chance: random.Random, share: float) -> list[Frame | None]:
    """Some did not come. (What then may be decoded is no question of the reader.)"""
    return [None if chance.random() < share else frame for frame in frames]


def with_losses(frames: Sequence[Frame], chance: random.Random, share: float) -> list[Frame | None]:
    """Some did not come, some came damaged, some with a wrong flag or in the wrong place."""
    out: list[Frame | None] = []
    for f, (stream, fresh) in enumerate(frames):
        what = chance.random() / share
        if what < 0.6:
            out.append(None)
        elif what < 0.8:
            out.append((damaged(stream, chance), fresh))
        elif what < 0.85:
            out.append((stream, not fresh))
        elif what < 1:
            out.append(frames[chance.randrange(max(0, f - 20), f + 1)])
        else:
            out.append((stream, fresh))
    return out


def damaged(data: bytes, chance: random.Random) -> bytes:
    new = bytearray(data or b"\0")
    at = chance.randrange(len(new))
    match chance.randrange(7):
        case 0:
            del new[at:]
        case 1:
            new += bytes([chance.choice((0, 255))])
        case 2:
            new[0] = chance.randrange(256)
        case 3:
            new[at] = chance.randrange(256)
        case _:
            new[at] ^= 1 << chance.randrange(8)
    return bytes(new)


STEPS = st.sampled_from([1e-5, 0.01, 0.3, 1.0, 20.0, 1e4])
COMMON = {
    "preset": st.sampled_from(["mod", "rc", "rca"]),
    "gof": st.integers(1, 50),
    "intra_period": st.integers(0, 4),
    "coder": st.sampled_from(["golomb", "mixed"]),
}
PARAMS = st.one_of(
    st.fixed_dictionaries(
        {"step": STEPS},
        optional=COMMON | {"ltr_step": st.sampled_from([1e-3, 0.3, 0.5, 1.0, 2.0])},
    ),
    st.fixed_dictionaries(
        {"bitrate": st.sampled_from([0.01, 1.0, 8.0, 50.0, 1e4])},
        optional=COMMON | {"rate_control": st.sampled_from(["rc", "rca", "steady"])},
    ),
)
MOTIONS = st.one_of(
    st.builds(markers, st.integers(20, 70), st.integers(1, 3)),
    st.builds(rough, st.integers(20, 70), st.integers(0, 99)),
)
CHANGES = st.dictionaries(st.integers(0, 100), STEPS.map(lambda step: {"step": step}))


@given(MOTIONS, PARAMS, CHANGES, st.sampled_from([0.02, 0.1, 0.4]), st.randoms())
@settings(
    max_examples=25, suppress_health_check=[HealthCheck.filter_too_much, HealthCheck.too_slow]
)
def test_what_comes_is_decoded_where_it_may_be(
    motion: Motion,
    params: dict[str, Any],
    changes: dict[int, Any],
    share: float,
    chance: random.Random,
) -> None:
    try:
        live = Live(motion, params, {} if "bitrate" in params else changes)
    except (OptionError, MotionError):  # parameters that do not go together, a step too fine
        reject()
    units = [parse_units(CODEC.name, stream, 1)[0] for stream, _ in live.frames]
    assert live.check(live.frames) == len(units)
    assert live.came(live.frames) == live.in_one_go(units)
    live.check(only_lost(live.frames, chance, share))
    live.check(with_losses(live.frames, chance, share))
    live.check(live.frames[chance.randrange(len(units)) :])  # a reader that joins


def test_lost_ltrs() -> None:
    """Damaged LTRs leave what was remembered of the one before, step and values."""
    refused = decoded = 0
    for seed in range(24):
        chance = random.Random(seed)
        params = {"step": chance.choice((0.01, 0.5, 8.0)), "gof": chance.choice((1, 1, 2, 5))}
        coder = {"coder": ("mixed", "golomb")[seed % 2], "intra_period": chance.choice((0, 0, 5))}
        live = Live(markers(25, 1 + seed % 3, seed), params | coder, {})
        for _ in range(10):
            losses = chance.choice((only_lost, with_losses))
            n = live.check(losses(live.frames, chance, 0.2))
            decoded, refused = decoded + n, refused + 25 - n
    assert decoded > 1000
    assert refused > 1000


def test_an_ltr_after_a_lost_one() -> None:
    """It may be predicted from the last that was decoded; not so where the lost one has come."""
    for seed in range(20):
        params = {"step": 0.5, "gof": 1, "intra_period": 0, "coder": ("mixed", "golomb")[seed % 2]}
        live = Live(markers(2, 1 + seed % 4, seed), params, {})
        first, between = live.frames
        (unit,) = parse_units(CODEC.name, between[0], 1)
        assert unit.kind == LTR and unit.distance == 1
        second = build_units([replace(unit, distance=2)]), False  # 2 behind the first
        broken = build_units([replace(unit, data=unit.data + b"\1")]), False
        assert live.check([first, None, second]) == 2
        assert live.check([first, between, second]) == 2
        assert live.check([first, (b"", False), second]) == 2
        assert live.check([first, broken, second]) == 2
        assert live.came([first, None, second])[2] == live.came([first, between])[1]
        assert live.came([first, between, second])[2] is None
        assert np.isfinite(np.frombuffer(live.came([first, broken, second])[2] or b"", "<f8")).all()
