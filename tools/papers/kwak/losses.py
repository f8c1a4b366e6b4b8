"""Frames that do not come: what a reader has of a live stream that loses some at random.

Frames are coded one by one, and decoded one by one by the codec's live decoder, which refuses what
needs a lost frame; the last frame is held then. Beside it stands what a decoder would have that
goes on regardless, as the paper's does behind an LTR that did not come.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcz.bench.measure import Record
from mcz.codecs import codec_by_name
from mcz.codecs.contract import Codec, Layout, model_finder
from mcz.codecs.online.units import INTRA, LTR, STR, parse_units
from mcz.container.limits import BASE
from mcz.errors import LostFrameError
from mcz.files.writing.signal_source import MemorySource
from mcz.model.motion import Motion
from tools.papers.kwak.clips import Clip, motion_in_positions
from tools.papers.kwak.measure import NAME, STEP_CM, errors, search_rates

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

SHARES = (0.0, 0.01, 0.05, 0.10)
SEEDS = (1, 2, 3)
SHOWN_SHARE, SHOWN_SEED = 0.05, 1  # of the plot
SHOWN_FRAMES = 30  # that a point of the plot is the mean of
NEVER = 2**20  # frames a group: longer than any clip


Received = tuple[Floats, Mask]


@dataclass(frozen=True, slots=True)
class Scheme:
    """Dependencies between frames. ``regardless``: decoders go on after a lost frame."""

    label: str
    codec: str
    params: Mapping[str, Any]
    regardless: bool = False


SCHEMES = (
    Scheme("default: intra_period 4", NAME, {}),
    Scheme("gof 10, intra_period 4", NAME, {"gof": 10}),
    Scheme("intra_period 1", NAME, {"intra_period": 1}),
    Scheme("intra_period 0", NAME, {"intra_period": 0}),
    Scheme("rca, LTRs chained: lost ones refused", NAME, {"preset": "rca"}),
    Scheme("rca, LTRs chained: gone on regardless", NAME, {"preset": "rca"}, True),
    Scheme("plain chain: lost ones refused", NAME, {"gof": NEVER, "rate_control": "mod"}),
    Scheme("plain chain: gone on regardless", NAME, {"gof": NEVER, "rate_control": "mod"}, True),
    Scheme("lsdt-frame, segment_frames 120", "lsdt-frame", {"segment_frames": 120}),
)


@dataclass(frozen=True, slots=True)
class Pushed:
    """A clip, coded frame by frame."""

    packets: list[tuple[bytes, bool]]
    payload: list[int]  # bytes of each frame without the head of its unit
    header: bytes
    layout: Layout


def pushed_by(codec: Codec, motion: Motion, params: Mapping[str, Any]) -> Pushed:
    """Raises MotionError, OptionError."""
    assert codec.live is not None
    layout = replace(MemorySource(motion, 0, codec, BASE.segment_bytes).layout, n_frames=0)
    encoder = codec.live(layout, codec.options(params))
    mask = motion.signals[0].mask
    rows = np.ascontiguousarray(np.nan_to_num(motion.values))
    valid = [None] * len(rows) if mask is None else [None if m.all() else m for m in mask]
    packets = [encoder.push(row, known) for row, known in zip(rows, valid, strict=True)]
    payload = [_payload(codec, stream) for stream, _ in packets]
    known_layout = replace(layout, find_model=model_finder(encoder.models))
    return Pushed(packets, payload, encoder.header, known_layout)


def _payload(codec: Codec, stream: bytes) -> int:
    if codec.name != NAME:
        return len(stream)
    return sum(len(unit.data) for unit in parse_units(NAME, stream, 1))


def receive(codec: Codec, pushed: Pushed, lost: Mask) -> Received:
    """Motion that a reader shows, holding the last frame, and the mask of decoded frames."""
    assert codec.follow is not None
    decoder = codec.follow(pushed.header, pushed.layout)
    out = np.zeros((len(lost), pushed.layout.n_channels))
    decoded = np.zeros(len(lost), np.bool_)
    for at, (stream, fresh) in enumerate(pushed.packets):
        if lost[at]:
            decoder.skip(1)
        else:
            try:
                out[at] = decoder.push(stream, fresh)
                decoded[at] = True
            except LostFrameError:
                pass
        if not decoded[at] and at:
            out[at] = out[at - 1]
    return out, decoded


def regardless(values: Floats, kinds: Sequence[int], lost: Mask, *, chain: bool) -> Received:
    """The same of a decoder that takes what it shows for what it should have.

    ``values`` are those without losses, ``kinds`` what each frame is predicted from. A group that
    has lost a frame is held to its end, for its entropy coder cannot go on; not so in a plain
    ``chain``, whose frames are taken to be coded each by itself.
    """
    out, decoded = values.copy(), ~lost
    broken, ltr = False, 0
    for at, kind in enumerate(kinds):
        broken = (broken and kind == STR) or bool(lost[at])
        decoded[at] = not (lost[at] or (broken and not chain))
        if at and not decoded[at]:
            out[at] = out[at - 1]
        elif at and kind != INTRA:
            before = ltr if kind == LTR else at - 1
            out[at] += out[before] - values[before]
        if kind != STR:
            ltr = at
    return out, decoded


def losses(clip: Clip, target: float) -> Record:
    """Every scheme at one rate of payload in kbps.

    ``rows``: what remains at every share of lost frames; ``lines``: the mean error in cm over
    frames, of the share and the seed that are drawn, in groups of them.
    """
    motion = motion_in_positions(clip)
    rows, lines = [], []
    for scheme in SCHEMES:
        run = _Run.of(motion, scheme, target)
        for share in SHARES:
            found = [run.measure(share, seed) for seed in (SEEDS if share else SEEDS[:1])]
            means = {key: float(np.mean([f[key] for f in found])) for key in found[0]}
            rows.append({"label": scheme.label, "share": share, "kbps": run.kbps, **means})
        lines.append([scheme.label, run.course()])
    return {"rows": rows, "lines": lines}


def lost_frames(n_frames: int, share: float, seed: int) -> Mask:
    """Mask of lost frames; the first always arrives, as does all that precedes it."""
    lost = np.random.default_rng(seed).random(n_frames) < share
    lost[:1] = False
    return lost


@dataclass(frozen=True, slots=True)
class _Run:
    """A scheme at its setting, with what decodes where nothing is lost."""

    motion: Motion
    scheme: Scheme
    pushed: Pushed
    whole: Floats
    kinds: list[int]

    @classmethod
    def of(cls, motion: Motion, scheme: Scheme, target: float) -> _Run:
        codec = codec_by_name(scheme.codec)
        pushed = _at_rate(codec, motion, scheme.params, target)
        whole, _ = receive(codec, pushed, np.zeros(motion.n_frames, np.bool_))
        kinds = [_kind(codec, *packet) for packet in pushed.packets]
        return cls(motion, scheme, pushed, whole, kinds)

    @property
    def kbps(self) -> float:
        return _kbps(self.motion, self.pushed)

    def receive(self, lost: Mask) -> Received:
        if self.scheme.regardless:
            chain = self.scheme.params.get("gof") == NEVER
            return regardless(self.whole, self.kinds, lost, chain=chain)
        return receive(codec_by_name(self.scheme.codec), self.pushed, lost)

    def course(self) -> list[list[float]]:
        """Frames and the mean error in cm there."""
        n_frames = self.motion.n_frames
        values, _ = self.receive(lost_frames(n_frames, SHOWN_SHARE, SHOWN_SEED))
        apart = (values - self.motion.values).reshape(n_frames, -1, 3)
        cm = np.sqrt((apart**2).sum(axis=2)).mean(axis=1) * (self.motion.skeleton.unit_cm or 1.0)
        starts = range(0, n_frames, SHOWN_FRAMES)
        return [[at, float(cm[at : at + SHOWN_FRAMES].mean())] for at in starts]

    def measure(self, share: float, seed: int) -> Record:
        lost = lost_frames(self.motion.n_frames, share, seed)
        values, decoded = self.receive(lost)
        sqnr, cm = errors(self.motion, values)
        return {"cm": cm, "sqnr": sqnr, "concealed": 1 - float(decoded.mean())}


def _kind(codec: Codec, stream: bytes, fresh: bool) -> int:
    return parse_units(NAME, stream, 1)[0].kind if codec.name == NAME else INTRA * fresh


def _kbps(motion: Motion, pushed: Pushed) -> float:
    per_second = float(motion.frame_rate or 1) / motion.n_frames * 8 / 1000
    return sum(pushed.payload) * per_second


def _at_rate(codec: Codec, motion: Motion, params: Mapping[str, Any], target: float) -> Pushed:
    """Coded with the one step, or in steps held to the rate, that make the rate of payload.

    A frame by itself fills whole bytes, which rate control does not know of: what it is asked for
    is searched for as well.
    """
    key, start, sign = "step", STEP_CM / (motion.skeleton.unit_cm or 1.0), 1.0
    if params.get("preset") in ("rc", "rca"):
        key, start, sign = "bitrate", target, -1.0

    def measure(setting: float) -> Record:
        pushed = pushed_by(codec, motion, {**params, key: setting**sign})
        return {"kbps": _kbps(motion, pushed), "pushed": pushed}

    (found,) = search_rates(measure, start**sign, [target])
    kept: Pushed = found["pushed"]
    return kept
