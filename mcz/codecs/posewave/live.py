"""``posewave`` frame by frame: no levels, no delay, each frame a segment.

SPEC.md, "Codec 3: posewave", "Segments that go on", is normative; README.md here says what the
encoder chooses.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mcz.codecs import contract
from mcz.codecs.contract import Layout, Model
from mcz.codecs.gaps import LiveRows
from mcz.codecs.posewave.choices import PRESETS, live_choice
from mcz.codecs.posewave.header import NAME, parse_header
from mcz.codecs.posewave.model_state import MAX_EXPONENT
from mcz.codecs.posewave.segment import decode_segment
from mcz.codecs.posewave.segment_chain import SegmentChain
from mcz.codecs.segments import skeleton_of
from mcz.errors import FormatError, LostFrameError, OptionError
from mcz.kinematics.frames import FramePositions
from mcz.model.types import Params

Floats = NDArray[np.float64]

JOINING = 480  # frames from one that starts fresh to the next, where the caller leaves it open
NEEDS_ALL = ("quality", "lossless", "contacts")


class LiveEncoder(contract.LiveEncoder):
    """Encode one frame per push, periodically a fresh segment, else a continuation.

    With a preset each frame is coded with finer and finer steps until no point of it is farther off
    than the preset promises. A frame that is refused leaves no trace.
    """

    models: tuple[Model, ...] = ()
    version: int | None

    def __init__(self, layout: Layout, options: Params) -> None:
        self.skeleton = skeleton_of(NAME, layout)
        if options["levels"]:
            raise OptionError(f"{NAME}: levels {options['levels']} needs frames that are to come")
        for name in NEEDS_ALL:
            if options[name] is not None:
                raise OptionError(f"{NAME}: {name} needs all frames, and none is known yet")
        bound = PRESETS[options["preset"]] if options["step"] is None else None
        choice = live_choice(self.skeleton, options["step"], bound)
        self.header, self._weight = choice.header, choice.weights.approximations
        fields = parse_header(self.header, layout)
        self.version = fields.version
        self._chain = SegmentChain(fields, self.skeleton)
        self._bound = math.inf if bound is None else bound / (self.skeleton.unit_cm or 1.0)
        self._places = None if bound is None else FramePositions(self.skeleton)
        self._every = options["segment_frames"] or JOINING
        self._at = 0
        self._rows = LiveRows(NAME, layout)

    def push(self, values: Floats, valid: NDArray[np.bool_] | None = None) -> tuple[bytes, bool]:
        row = self._rows.row(values, valid, self._at)
        fresh = self._at % self._every == 0
        for exponent in range(MAX_EXPONENT + 1):
            chain = self._chain.copy()
            stream, decoded = chain.encode(row, self._weight, exponent, fresh=fresh)
            if self._is_near(row[0], decoded[0]):
                break
        self._chain = chain
        self._rows.keep()
        self._at += 1
        return stream, fresh

    def _is_near(self, row: Floats, decoded: Floats) -> bool:
        if self._places is None:
            return True
        away = self._places(row) - self._places(decoded)
        return bool((np.sqrt((away * away).sum(axis=1)) <= self._bound).all())

    def change(self, options: Params) -> None:
        raise OptionError(f"{NAME}: {', '.join(options)} cannot change while frames come")


class LiveDecoder:
    """The inverse of ``LiveEncoder``."""

    def __init__(self, header: bytes, layout: Layout) -> None:
        self._fields, self._skeleton = parse_header(header, layout), skeleton_of(NAME, layout)
        self._chain = SegmentChain(self._fields, self._skeleton)
        self._broken = True  # until something fresh comes

    def push(self, stream: bytes, fresh: bool) -> Floats:
        if self._broken and not fresh:  # PWAVE-31
            raise LostFrameError(f"{NAME}: a frame needs the one before, which did not come")
        self._broken = True
        if self._fields.may_go_on:
            values: Floats = self._chain.decode(stream, 1, NAME, fresh=fresh)[0]
        elif fresh:
            values = decode_segment(self._fields, self._skeleton, [stream], 1, NAME)[0]
        else:  # PWAVE-28
            raise FormatError(f"{NAME}: a frame that does not start fresh")
        self._broken = False
        return values

    def skip(self, n_frames: int) -> None:
        self._broken = self._broken or n_frames > 0
