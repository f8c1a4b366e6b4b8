"""The codec contract: what a codec is given, what it gives back, what it declares.

SPEC.md, "Codecs", is normative. A codec knows neither the container nor any source format.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.parameters import TARGETS, Dial, Parameter
from mcz.errors import FormatError, OptionError
from mcz.motion import Skeleton
from mcz.numbers import Grid
from mcz.schema import varint
from mcz.types import Params, Settings, Values

Domain = Literal["ordinals", "values"]
Grouping = Literal["all", "joint", "channel"]

ID_SIZE = 16  # bytes of the id of a model


@dataclass(frozen=True, slots=True)
class Segment:
    """A run of frames, coded; ``streams`` lie coarsest resolution first, in it group by group.

    The segment bears upon frames first - lead to first + n_frames + tail - 1.
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
    """A learned model, as MODL has it: ``kind`` of the registry, ``data`` as the kind says."""

    kind: int
    data: bytes


# id of a MODL -> the model, None where the file has none of that id.
FindModel = Callable[[bytes], Model | None]


def model_id(model: Model) -> bytes:
    """The id that a clip names the model by: that of its MODL."""
    return hashlib.sha256(b"MODL\0" + varint(model.kind) + model.data).digest()[:ID_SIZE]


def model_finder(models: Sequence[Model]) -> FindModel:
    """Finds those that an encoder has made or named."""
    return {model_id(model): model for model in models}.get


@dataclass(frozen=True, slots=True)
class Layout:
    """Facts of a signal that encoder and decoder share.

    ``n_frames`` are the stored ones. ``groups`` lists the channels of each group;
    ``samples_per_frame`` rows make a frame.
    """

    n_frames: int
    groups: tuple[tuple[int, ...], ...]
    samples_per_frame: int = 1
    skeleton: Skeleton | None = None
    frame_rate: Fraction | None = None
    grids: tuple[Grid, ...] = ()
    n_resolutions: int = 1
    segment_bytes: int = 2**53  # decoded, 8 a value: the most that a segment may have
    find_model: FindModel | None = None  # in the file; a decoder's
    n_channels: int = field(init=False, repr=False, compare=False)
    derived: dict[str, object] = field(default_factory=dict, init=False, repr=False, compare=False)
    # what a codec makes of it once, by the name of the codec

    def __post_init__(self) -> None:
        object.__setattr__(self, "n_channels", sum(map(len, self.groups)))

    @property
    def most_frames(self) -> int:
        """The frames that a segment may have, at least 1."""
        per_frame = 8 * self.samples_per_frame * max(1, self.n_channels)
        return max(1, self.segment_bytes // per_frame)


class SignalSource(Protocol):
    """The encoder's view of a signal, read by frames, so that it need not be in memory."""

    layout: Layout
    breaks: Sequence[int]  # frames at which a segment of a codec of ordinals must begin

    def ordinals(self, start: int, stop: int) -> NDArray[np.int64]:
        """Grid ordinals of frames start <= f < stop, (rows, n_channels)."""
        ...

    def grids(self, frame: int) -> tuple[Grid, ...]:
        """The grids in force at a frame."""
        ...

    def values(self, start: int, stop: int) -> NDArray[np.float64]:
        """Values of these frames in source units, (rows, n_channels)."""
        ...

    def valid(self, start: int, stop: int) -> NDArray[np.bool_] | None:
        """Mask of the valid values, None if all are valid."""
        ...


@dataclass(frozen=True, slots=True)
class Request:
    """Frames start <= f < stop of some groups; the finest ``resolution`` details left out."""

    start: int
    stop: int
    groups: tuple[int, ...]
    resolution: int = 0


Fetch = Callable[[int, int, int], bytes]  # (segment, stored resolution, group) -> stream


@dataclass(frozen=True, slots=True)
class Encoded:
    """An encoded signal: what goes into CLIP, then the segments as they are made.

    ``models`` are written before the clip that refers to them, once a file. ``known`` are those of
    SPEC.md's annexes that it refers to: a file of the archive profile has them, too. ``version``
    is the least of the codec's that reads it (None: the codec's own). ``preset`` is that of
    CLIP (0: the codec's own).
    """

    header: bytes
    segments: Iterator[Segment]
    n_resolutions: int = 1
    models: tuple[Model, ...] = ()
    known: tuple[Model, ...] = ()
    version: int | None = None
    preset: int = 0


Encode = Callable[[SignalSource, Params], Encoded]
Decode = Callable[[bytes, Layout, Sequence[Span], Request, Fetch], Values]

# (header, layout, first, stop, groups) -> header of a signal that is left with frames
# first <= f < stop, both of them ends of segments, and with these groups, ascending.
Cut = Callable[[bytes, Layout, int, int, tuple[int, ...]], bytes]

# (layout, span, groups, fetch) -> the streams of some groups of a segment, ascending, coded without
# the others; ``fetch`` counts this segment as 0.
Subset = Callable[[Layout, Span, Sequence[int], "Fetch"], tuple[bytes, ...]]


@dataclass(frozen=True, slots=True)
class RecodeRequest:
    """Groups of a coded signal that are coded anew, with the header that they have.

    ``source`` holds the whole signal with its new values, ``options`` are the parameters, where
    they were recorded, ``fetch`` gives the streams that are replaced.
    """

    header: bytes
    source: SignalSource
    groups: tuple[int, ...]
    spans: Sequence[Span]
    options: Params
    fetch: Fetch


# Of each span the streams of the groups, in stored order, which a decoder reads under the header
# beside the streams of all other groups.
Recode = Callable[[RecodeRequest], Iterator[tuple[bytes, ...]]]


class LiveEncoder(Protocol):
    """Codes frames as they come, each into the one stream of a segment of one frame.

    ``header``, ``models``, ``version`` and ``preset``, as those of ``Encoded``, are known before
    the first frame. ``n_resolutions`` is 1, and there is one group.
    """

    header: bytes
    models: tuple[Model, ...]
    version: int | None
    preset: int = 0
    is_reference: bool = False  # of the last frame: it needs not the one before

    def push(
        self, values: NDArray[np.float64], valid: NDArray[np.bool_] | None = None
    ) -> tuple[bytes, bool]:
        """The stream of the next frame, (n_channels,), and whether its segment starts fresh."""
        ...

    def change(self, options: Params) -> None:
        """Change some parameters, checked by ``Codec.options``, as soon as the stream allows.

        Raises OptionError for one that cannot change.
        """
        ...

    def charge(self, n_bytes: int) -> None:
        """Take in how many bytes the last frame took on the wire, framing and masks included.

        It is called after each ``push`` where the option ``bitrate`` is given.
        """
        return


class LiveDecoder(Protocol):
    """The inverse: raises FormatError on bad bytes, and takes such a frame for one that was lost.

    A frame that needs a lost one raises LostFrameError; those that need none go on.
    """

    def push(self, stream: bytes, fresh: bool) -> NDArray[np.float64]:
        """The values of the next frame, (n_channels,)."""
        ...

    def skip(self, n_frames: int) -> None:
        """So many frames that were due did not come."""
        ...


Live = Callable[[Layout, Params], LiveEncoder]  # a layout of 0 frames, options
Follow = Callable[[bytes, Layout], LiveDecoder]  # a header

# (header) -> the ids of the models that it names; raises FormatError for bad bytes.
Uses = Callable[[bytes], tuple[bytes, ...]]

# (skeleton, options) -> the groups of an encoder, and the numbers of those of ordinals; None: as
# ``grouping`` says, none of ordinals. Raises OptionError.
Partition = Callable[[Skeleton, Params], tuple[tuple[tuple[int, ...], ...], tuple[int, ...]] | None]

# (header, layout) -> the groups of ordinals, ascending; raises FormatError for bad bytes.
Exact = Callable[[bytes, Layout], tuple[int, ...]]

# (header, layout, spans) -> the stored frames, ascending, that the coarsest resolution alone gives
# exactly as all resolutions do.
Preview = Callable[[bytes, Layout, Sequence[Span]], NDArray[np.int64]]


@dataclass(frozen=True, slots=True)
class Codec:
    """One row of the codec table.

    Codecs of one ``id`` have one bitstream; ``preset`` tells which of them made a clip, and 0 that
    none of those that are registered did.

    ``decode`` returns int64 ordinals or binary64 values, as ``domain`` says, of shape
    (rows, channels of the requested groups in the order requested). It checks the header also where
    no frame is requested.

    A codec of values may have groups of ordinals beside them, which are ``exact``: a request is for
    groups of one sort. ``partition`` says which groups an encoder makes (both None: no such codec).

    A clip may be cut without the codec's help, SPEC.md, "Cutting without re-encoding": whole
    segments at its ends, groups, and the streams of the finest resolutions are left out, and what
    is left is renumbered from 0. ``decode`` then is given the numbers of frames, groups and
    resolutions that are left, MUST give the same values as before, and takes details that are
    not stored as those that a request leaves out. ``cut`` makes the header fit where it says
    something of frames or channels (None: it holds as it is). ``subset`` codes what is left of a
    segment anew, of a codec that codes all groups together: it recodes all of them, too. Both are
    given the layout before the cut, and raise FormatError for bad bytes.

    ``positions``: it is made for positions of points; of a clip of channels it is given those of
    its points, unless its parameter ``domain`` says ``channels``. ``uses``: the models that a
    header names (None: there never are any). ``live`` and ``follow``: coding and decoding frame by
    frame (None: the codec cannot). ``live_options``: what a caller asks for who means that, where
    frame by frame is not all that the codec can do.

    ``promise`` gives the targets that it meets where a caller asks for none and leaves its dial
    alone (None: none).

    ``recode`` codes some groups anew in all segments (None: the codec cannot do that). ``preview``
    says what can be read without decoding the rest (None: nothing exactly). ``earlier`` has the
    ``decode`` of each earlier version. ``hash_optional``: readers may omit to compare the value
    hash.
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
    exact: Exact | None = None
    positions: bool = False
    uses: Uses | None = None
    live: Live | None = None
    follow: Follow | None = None
    live_options: Params = field(default_factory=dict)
    earlier: Mapping[int, Decode] = field(default_factory=dict)
    hash_optional: bool = False
    preset: int = 0

    def has(self, name: str) -> bool:
        """Return True if the codec has a parameter of that name."""
        return any(parameter.name == name for parameter in self.parameters)

    def settings(self, options: Params) -> Settings:
        """``options`` as a quality record has them, without inner ones."""
        known = {parameter.name: parameter for parameter in (*self.parameters, *TARGETS)}
        shown = {name: known[name].shown(value) for name, value in options.items()}
        return {name: value for name, value in shown.items() if not known[name].inner}

    def options(self, given: Params, *, inner: bool = False) -> Settings:
        """All parameters, those given checked; raises OptionError for an unknown or bad one.

        Parameters that only a search finds may be given where ``inner`` is true.
        """
        known = {p.name: p for p in (*self.parameters, *(TARGETS if self.dial else ()))}
        listed = [name for name, parameter in known.items() if inner or not parameter.inner]
        unknown = sorted(set(given) - set(listed))
        if unknown:
            raise OptionError(
                f"codec {self.name} has no parameter {unknown[0]!r}; it has "
                f"{', '.join(listed) or 'none'}"
            )
        return {
            name: parameter.parse(given[name]) if name in given else parameter.default
            for name, parameter in known.items()
        }


def refuse_extras(name: str, header: bytes, layout: Layout) -> None:
    """Raise FormatError where a codec without header and resolutions is given some."""
    if header:  # RAW-01, FAST-01
        raise FormatError(f"{name}: a header of {len(header)} bytes, which it does not have")
    if layout.n_resolutions != 1:  # CLIP-15
        raise FormatError(f"{name}: {layout.n_resolutions} resolutions, it has 1")
