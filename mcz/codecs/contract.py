"""The codec contract: inputs, outputs and declarations of a codec.

SPEC.md, "Codecs", is normative. A codec is independent of the container and of source formats.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Literal, Protocol

from mcz.codecs.parameters import TARGETS, Dial, Parameter
from mcz.errors import FormatError, OptionError
from mcz.model.motion import Skeleton
from mcz.model.numbers import Grid
from mcz.model.schema import varint
from mcz.model.types import Bools, Floats, Ints, Params, Settings, Values

Domain = Literal["ordinals", "values"]
Grouping = Literal["all", "joint", "channel"]

ID_SIZE = 16  # bytes of the id of a model


@dataclass(frozen=True, slots=True)
class Segment:
    """An encoded run of frames; ``streams`` by resolution, coarsest first, then by group.

    The segment affects frames first - lead to first + n_frames + tail - 1.
    ``fresh``: it decodes without the segment before.
    """

    first: int
    n_frames: int
    streams: tuple[bytes, ...]
    lead: int = 0
    tail: int = 0
    fresh: bool = True


@dataclass(frozen=True, slots=True)
class Span:
    """Frames of a segment, known to a decoder before it fetches a stream."""

    first: int
    n_frames: int
    lead: int = 0
    tail: int = 0
    fresh: bool = True

    @property
    def stop(self) -> int:
        return self.first + self.n_frames


@dataclass(frozen=True, slots=True)
class Model:
    """A learned model (MODL): ``kind`` in the registry, ``data`` in the layout of that kind."""

    kind: int
    data: bytes


# id of a MODL -> the model, None if the file has none of that id
FindModel = Callable[[bytes], Model | None]


def model_id(model: Model) -> bytes:
    """Id by which clips refer to the MODL of a model."""
    return hashlib.sha256(b"MODL\0" + varint(model.kind) + model.data).digest()[:ID_SIZE]


def model_finder(models: Sequence[Model]) -> FindModel:
    """Return a lookup by id among ``models``."""
    return {model_id(model): model for model in models}.get


@dataclass(frozen=True, slots=True)
class Layout:
    """Facts of a signal that encoder and decoder share.

    ``n_frames`` counts stored frames. ``groups`` lists the channels of each group;
    ``samples_per_frame`` rows make a frame.
    """

    n_frames: int
    groups: tuple[tuple[int, ...], ...]
    samples_per_frame: int = 1
    skeleton: Skeleton | None = None
    frame_rate: Fraction | None = None
    grids: tuple[Grid, ...] = ()
    n_resolutions: int = 1
    segment_bytes: int = 2**53  # limit of a decoded segment, 8 per value
    find_model: FindModel | None = None  # models in the file, for a decoder
    n_channels: int = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "n_channels", sum(map(len, self.groups)))

    @property
    def most_frames(self) -> int:
        """Greatest number of frames of a segment, at least 1."""
        per_frame = 8 * self.samples_per_frame * max(1, self.n_channels)
        return max(1, self.segment_bytes // per_frame)


class SignalSource(Protocol):
    """The encoder's view of a signal, read by frames so that it need not fit in memory."""

    layout: Layout
    breaks: Sequence[int]  # frames at which a segment of an ordinals codec must begin

    def ordinals(self, start: int, stop: int) -> Ints:
        """Grid ordinals of frames start <= f < stop, (rows, n_channels)."""
        ...

    def grids(self, frame: int) -> tuple[Grid, ...]:
        """The grids in force at a frame."""
        ...

    def values(self, start: int, stop: int) -> Floats:
        """Values of these frames in source units, (rows, n_channels)."""
        ...

    def valid(self, start: int, stop: int) -> Bools | None:
        """Mask of the valid values, None if all are valid."""
        ...


@dataclass(frozen=True, slots=True)
class Request:
    """Frames start <= f < stop of some groups, without the finest ``resolution`` details."""

    start: int
    stop: int
    groups: tuple[int, ...]
    resolution: int = 0


Fetch = Callable[[int, int, int], bytes]  # (segment, stored resolution, group) -> stream


@dataclass(frozen=True, slots=True)
class Encoded:
    """An encoded signal: the header in CLIP, then segments, produced lazily.

    ``models`` are written once per file, before the clip that refers to them. ``known_models`` are
    those of SPEC.md's annexes that it refers to, which the archive profile stores as well.
    ``version``: the oldest codec version that reads it (None: the codec's). ``preset``: the preset
    in CLIP (0: the codec's).
    """

    header: bytes
    segments: Iterator[Segment]
    n_resolutions: int = 1
    models: tuple[Model, ...] = ()
    known_models: tuple[Model, ...] = ()
    version: int | None = None
    preset: int = 0


Encode = Callable[[SignalSource, Params], Encoded]
Decode = Callable[[bytes, Layout, Sequence[Span], Request, Fetch], Values]

# (header, layout, first, stop, groups) -> header of a signal cut to frames first <= f < stop, both
# segment boundaries, and to these groups, ascending
Cut = Callable[[bytes, Layout, int, int, tuple[int, ...]], bytes]

# (layout, span, groups, fetch) -> the streams of some groups of a segment, ascending, re-encoded
# without the others; ``fetch`` numbers this segment 0
Subset = Callable[[Layout, Span, Sequence[int], "Fetch"], tuple[bytes, ...]]


@dataclass(frozen=True, slots=True)
class RecodeRequest:
    """Request to re-encode some groups of a coded signal under its existing header.

    ``source`` has the whole signal with its new values, ``options`` the recorded parameters;
    ``fetch`` returns the streams to be replaced.
    """

    header: bytes
    source: SignalSource
    groups: tuple[int, ...]
    spans: Sequence[Span]
    options: Params
    fetch: Fetch


# Per span the streams of the groups, in stored order; they decode under the existing header,
# beside the streams of the other groups.
Recode = Callable[[RecodeRequest], Iterator[tuple[bytes, ...]]]


class LiveEncoder(Protocol):
    """Encodes frames as they arrive, each into the single stream of a segment of one frame.

    ``header``, ``models``, ``version`` and ``preset``, as in ``Encoded``, are known before the
    first frame. ``n_resolutions`` is 1, and there is one group.
    """

    header: bytes
    models: tuple[Model, ...]
    version: int | None
    preset: int = 0
    is_reference: bool = False  # the last frame does not need the previous one

    def push(self, values: Floats, valid: Bools | None = None) -> tuple[bytes, bool]:
        """Encode the next frame, (n_channels,): its stream, and True if its segment is fresh."""
        ...

    def change(self, options: Params) -> None:
        """Change some parameters, checked by ``Codec.options``, as soon as the stream allows.

        Raises OptionError for one that cannot change.
        """
        ...

    def charge(self, n_bytes: int) -> None:
        """Report the bytes of the last frame on the wire, framing and masks included.

        Called after each ``push`` if the option ``bitrate`` is given.
        """
        return


class LiveDecoder(Protocol):
    """The inverse; a frame of bad bytes raises FormatError and counts as lost.

    A frame that needs a lost one raises LostFrameError; frames that need none still decode.
    """

    def push(self, stream: bytes, fresh: bool) -> Floats:
        """Decode the next frame, (n_channels,)."""
        ...

    def skip(self, n_frames: int) -> None:
        """Report that ``n_frames`` frames were lost."""
        ...


Live = Callable[[Layout, Params], LiveEncoder]  # a layout of 0 frames, options
Follow = Callable[[bytes, Layout], LiveDecoder]  # a header

# (header) -> the ids of the models that it names; raises FormatError on bad bytes
Uses = Callable[[bytes], tuple[bytes, ...]]

# (skeleton, options) -> the groups of an encoder, and the numbers of the exact ones; None: groups
# by ``grouping``, none exact. Raises OptionError.
Partition = Callable[[Skeleton, Params], tuple[tuple[tuple[int, ...], ...], tuple[int, ...]] | None]

# (header, layout) -> the exact groups, ascending; raises FormatError on bad bytes
Exact = Callable[[bytes, Layout], tuple[int, ...]]

# (header, layout, spans) -> the stored frames, ascending, that the coarsest resolution alone
# decodes exactly
Preview = Callable[[bytes, Layout, Sequence[Span]], Ints]


@dataclass(frozen=True, slots=True)
class Codec:
    """One row of the codec table.

    Codecs with the same ``id`` share a bitstream; ``preset`` is the one that made a clip, 0 if none
    of the registered ones did.

    ``decode`` returns int64 ordinals or binary64 values, by ``domain``, of shape (rows, channels of
    the requested groups in the order requested). It checks the header even for no frames.

    A codec of values may also have groups of ordinals, the ``exact`` ones; a request is for groups
    of one sort. ``partition`` returns the groups of an encoder (both None: no exact groups).

    A clip may be cut without the codec (SPEC.md, "Cutting without re-encoding"): whole segments at
    its ends, groups, and the streams of the finest resolutions are removed, the rest is renumbered
    from 0. ``decode`` then gets the remaining numbers of frames, groups and resolutions, MUST
    return the same values as before, and treats details that are not stored like those that a
    request leaves out. ``cut`` adapts a header that depends on frames or channels (or None).
    ``subset`` re-encodes the remaining groups of a segment, for codecs that code all groups
    together. Both get the layout before the cut, and raise FormatError on bad bytes.

    ``positions``: the codec is made for positions of points; clips of channels are converted to the
    positions of their points, unless the parameter ``domain`` is ``channels``. ``uses``: the models
    that a header names (None: never any). ``live`` and ``follow`` encode and decode frame by frame
    (None: unsupported). ``live_options`` select live encoding in codecs that can do more.

    ``promise`` returns the targets that the codec meets by default (None: none). ``recode``
    re-encodes some groups in all segments (None: unsupported). ``preview`` returns the frames that
    the coarsest resolution decodes exactly (None: none). ``earlier`` has the ``decode`` of each
    earlier version. ``hash_optional``: readers may skip the comparison of the value hash.
    ``by_rows``: the first rows of a segment take less time than all. ``memory`` makes the parameter
    of that name, by which an encoder that a search calls repeatedly saves work (None: it does not).
    """

    id: int
    name: str
    version: int
    domain: Domain
    lossless: bool
    encode: Encode
    decode: Decode
    grouping: Grouping = "joint"
    parameters: tuple[Parameter, ...] = field(default=())
    dial: Dial | None = None
    promise: Callable[[Params], Settings] | None = None
    cut: Cut | None = None
    subset: Subset | None = None
    recode: Recode | None = None
    preview: Preview | None = None
    partition: Partition | None = None
    memory: Callable[[], object] | None = None
    exact: Exact | None = None
    positions: bool = False
    uses: Uses | None = None
    live: Live | None = None
    follow: Follow | None = None
    live_options: Params = field(default_factory=dict)
    earlier: Mapping[int, Decode] = field(default_factory=dict)
    hash_optional: bool = False
    by_rows: bool = False
    preset: int = 0

    def has(self, name: str) -> bool:
        """Return True if the codec has a parameter of that name."""
        return any(parameter.name == name for parameter in self.parameters)

    def settings(self, options: Params) -> Settings:
        """Return ``options`` as quality records store them, without inner ones."""
        known = {parameter.name: parameter for parameter in (*self.parameters, *TARGETS)}
        recorded = {name: known[name].recorded_value(value) for name, value in options.items()}
        return {name: value for name, value in recorded.items() if not known[name].inner}

    @property
    def all_parameters(self) -> tuple[Parameter, ...]:
        """Parameters, plus the targets if there is a dial."""
        return (*self.parameters, *(TARGETS if self.dial else ()))

    def document(self) -> Settings:
        """Entry of ``mcz codecs --json``; its keys are stable."""
        return {
            "name": self.name,
            "id": self.id,
            "preset": self.preset,
            "version": self.version,
            "lossless": self.lossless,
            "positions": self.positions,
            "live": self.live is not None,
            "quality": self.dial.parameter if self.dial else None,
            "parameters": [p.document() for p in self.all_parameters if not p.inner],
        }

    def options(self, params: Params, *, inner: bool = False) -> Settings:
        """Return all parameters, given ones parsed; raises OptionError for an unknown or bad one.

        ``inner`` permits parameters that only a search sets.
        """
        known = {parameter.name: parameter for parameter in self.all_parameters}
        names = [name for name, parameter in known.items() if inner or not parameter.inner]
        unknown = sorted(set(params) - set(names))
        if unknown:
            raise OptionError(
                f"codec {self.name} has no parameter {unknown[0]!r}; its parameters are "
                f"{', '.join(names) or 'none'}"
            )
        return {
            name: parameter.parse(params[name]) if name in params else parameter.default
            for name, parameter in known.items()
        }


def refuse_extras(name: str, header: bytes, layout: Layout) -> None:
    """Raise FormatError for a header or resolutions of a codec that has none."""
    if header:  # RAW-01, FAST-01
        raise FormatError(f"{name}: the codec has no header, but {len(header)} bytes are given")
    if layout.n_resolutions != 1:  # CLIP-15
        raise FormatError(f"{name}: the codec has 1 resolution, not {layout.n_resolutions}")
