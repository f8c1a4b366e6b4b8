"""Objects of the model <-> what a file has: skeletons, channels, time bases, hashes of values.

HEAD and CLIP are parsed here, with their versions. SPEC.md, "HEAD", "SKEL", "Time" and "CEND", are
normative.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mcz.container import payloads
from mcz.container.limits import PROFILES, Profile, check
from mcz.errors import FormatError, MotionError, OptionError, UnsupportedError
from mcz.model.clock import MAX_NUMBER
from mcz.model.motion import CHANNEL_KINDS, ORIGIN, Channel, Joint, Skeleton
from mcz.model.schema import build, parse, parse_shared
from mcz.model.skeleton import AXES, HANDS
from mcz.model.types import Ints, Values

ANGLE_UNITS = ("", "deg", "rad")
MOST_KNOWN, MOST_BYTES = 64, 1 << 16  # number of kept skeletons, and greatest length of a payload
_known: dict[tuple[bytes, int], tuple[payloads.Skel, Skeleton]] = {}  # by payload and profile
AXIS_ORDERS = ("XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX")


def build_skeleton(skeleton: Skeleton, source: payloads.SkeletonSource | None) -> bytes:
    """The payload of SKEL; ``source``: its source file."""
    record = payloads.Skel(
        name=skeleton.name,
        flags=int(skeleton.intrinsic),
        unit_cm=skeleton.unit_cm,
        angle_unit=ANGLE_UNITS.index(skeleton.angle_unit),
        up_axis=AXES.index(skeleton.up_axis),
        forward_axis=AXES.index(skeleton.forward_axis),
        handedness=HANDS.index(skeleton.handedness),
        base=skeleton.base or None,  # b"": derived from an unknown one
        source=source,
        joints=[_joint_record(joint) for joint in skeleton.joints],
    )
    return build(record, f"skeleton {skeleton.name!r}")


def _joint_record(joint: Joint) -> payloads.Joint:
    has_offset = _bits(joint.offset) != _bits(ORIGIN)
    has_axis = _bits(joint.axis) != _bits(ORIGIN) or joint.axis_order != "XYZ"
    return payloads.Joint(
        name=joint.name,
        parent=joint.parent + 1,
        flags=joint.adds_to_offset * payloads.ADDS_TO_OFFSET
        | has_offset * payloads.HAS_OFFSET
        | has_axis * payloads.HAS_AXIS,
        offset=joint.offset if has_offset else None,
        axis=joint.axis if has_axis else None,
        axis_order=AXIS_ORDERS.index(joint.axis_order) if has_axis else None,
        tails=list(joint.tails),
        channels=channel_records(joint.channels),
    )


def _bits(vector: tuple[float, ...]) -> tuple[str, ...]:
    return tuple(map(repr, vector))  # -0.0 differs from 0.0 here


def channel_records(channels: tuple[Channel, ...]) -> list[payloads.Channel]:
    return [
        payloads.Channel(
            flags=bool(c.name) * payloads.HAS_NAME | bool(c.unit) * payloads.HAS_UNIT,
            kind=CHANNEL_KINDS.index(c.kind) + 1 if c.kind else 0,
            name=c.name or None,
            unit=c.unit or None,
        )
        for c in channels
    ]


def parse_channels(rows: Sequence[payloads.Channel]) -> tuple[Channel, ...]:
    """Channels; a kind beyond the registry is a plain scalar, coded like any other."""
    channels = []
    for row in rows:
        known = 0 < row.kind <= len(CHANNEL_KINDS)
        kind = CHANNEL_KINDS[row.kind - 1] if known else ""  # SKEL-07
        unknown = f"kind-{row.kind}" if row.kind and not known else ""
        channels.append(Channel(kind, row.name or unknown, row.unit or ""))
    return tuple(channels)


def read_skeleton(
    payload: bytes, profile: Profile, label: str, where: str
) -> tuple[payloads.Skel, Skeleton]:
    """The fields of SKEL and its Skeleton; raises FormatError or LimitError.

    The last ones are kept, as the files of a data set often have one skeleton.
    """
    key = payload, profile.id
    entry = _known.get(key)
    if entry is None:
        fields = parse(payloads.Skel, payload, label, profile.counts)
        entry = fields, parse_skeleton(fields, profile, where)
        if len(payload) <= MOST_BYTES:
            while len(_known) >= MOST_KNOWN:
                _known.pop(next(iter(_known)), None)
            _known[key] = entry
    return entry


def parse_skeleton(fields: payloads.Skel, profile: Profile, where: str) -> Skeleton:
    """The Skeleton of the fields of SKEL; raises FormatError or LimitError."""
    check(f"{where}: joints", len(fields.joints), profile.joints)
    check(f"{where}: channels", sum(len(j.channels) for j in fields.joints), profile.channels)
    try:
        return Skeleton(
            joints=tuple(_parse_joint(row) for row in fields.joints),
            name=fields.name,
            unit_cm=fields.unit_cm,
            angle_unit=ANGLE_UNITS[fields.angle_unit],
            up_axis=AXES[fields.up_axis],
            forward_axis=AXES[fields.forward_axis],
            handedness=HANDS[fields.handedness],
            intrinsic=bool(fields.flags & 1),
            base=fields.base,
        )
    except MotionError as error:
        raise FormatError(str(error), where=where) from None


def _parse_joint(row: payloads.Joint) -> Joint:
    return Joint(
        name=row.name,
        parent=row.parent - 1,
        offset=_vector(row.offset),
        tails=tuple(map(_vector, row.tails)),
        axis=_vector(row.axis),
        axis_order=AXIS_ORDERS[row.axis_order] if row.axis_order is not None else "XYZ",
        channels=parse_channels(row.channels),
        adds_to_offset=bool(row.flags & payloads.ADDS_TO_OFFSET),
    )


def _vector(stored: payloads.Vector | None) -> tuple[float, float, float]:
    if stored is None:
        return ORIGIN
    x, y, z = stored
    return x, y, z


def time_base_of(numbers: Ints | None, first_time: float | None) -> payloads.TimeBase | None:
    """The time base of frames with these ascending ``numbers``, None if CLIP needs none."""
    if numbers is None or not len(numbers):
        numbers = np.ones(1, np.int64)
    missing = missing_runs(numbers)
    if numbers[0] == 1 and first_time is None and not missing:
        return None
    return payloads.TimeBase(number=int(numbers[0]), first_time=first_time, missing=missing)


def missing_runs(numbers: Ints) -> list[payloads.MissingRun]:
    """The runs of missing numbers between ascending ones."""
    steps = np.diff(numbers)
    after = np.flatnonzero(steps != 1)
    runs = zip(np.diff(after, prepend=-1).tolist(), steps[after].tolist(), strict=True)
    return [payloads.MissingRun(frames=frames, length=step - 1) for frames, step in runs]


def put_time_base(fields: payloads.Clip, base: payloads.TimeBase | None) -> None:
    """Set or remove the time base of a CLIP."""
    fields.time_base = base
    fields.flags &= ~payloads.HAS_TIME_BASE
    fields.flags |= 0 if base is None else payloads.HAS_TIME_BASE


def whole_time_base(fields: payloads.Clip, cend: payloads.Cend | None) -> payloads.TimeBase | None:
    """The time base of a clip, with the runs that CEND has in the place of CLIP; FormatError."""
    base = fields.time_base
    is_open = bool(fields.flags & payloads.OPEN_CLIP)
    late = cend.missing if cend is not None else []
    if is_open and base is not None and base.missing:  # TIME-04
        raise FormatError("the clip is open, but states missing frames", clip=fields.name)
    timed = any(signal.role == payloads.TIMES for signal in fields.signals)
    if timed and base is not None and base.first_time is not None:  # TIME-07
        raise FormatError(
            "both the time of the first frame and a signal of times are given", clip=fields.name
        )
    if late and not is_open:  # TIME-05
        raise FormatError("CEND states missing frames, but the clip is not open", clip=fields.name)
    if not late:
        return base
    first_time = None if base is None else base.first_time
    number = 1 if base is None else base.number
    return payloads.TimeBase(number=number, first_time=first_time, missing=late)


def numbers_of(base: payloads.TimeBase | None, n_frames: int, name: str, *, whole: bool) -> Ints:
    """The number of every frame; raises FormatError.

    ``whole``: ``n_frames`` is the original number of frames; else missing runs may follow the last
    frame.
    """
    base = base or payloads.TimeBase(number=1)
    steps = np.ones(n_frames, np.int64)
    steps[:1] = base.number
    frame, last = 0, base.number + n_frames - 1
    for run in base.missing:
        frame, last = frame + run.frames, last + run.length
        if frame < n_frames:
            steps[frame] += min(run.length, MAX_NUMBER)
        elif whole:  # TIME-02
            raise FormatError(f"frames are missing after frame {n_frames - 1}", clip=name)
    if whole and last > MAX_NUMBER:  # TIME-03
        raise FormatError(f"the number of the last frame, {last}, is too large", clip=name)
    return np.cumsum(steps)


class MissingRunCounter:
    """Counts the missing runs of a clip, frame by frame, from ``number`` on."""

    def __init__(self, number: int) -> None:
        self.runs: list[payloads.MissingRun] = []
        self._last, self._frames, self._gap = number - 1, 0, 0  # since the run before

    def miss(self, count: int) -> None:
        """Skip ``count`` frames after the last one; raises OptionError before the first."""
        if count < 1 or not (self._frames or self.runs):
            raise OptionError(f"{count} frames cannot be marked as missing here")
        if self._last + self._gap + count >= MAX_NUMBER:
            raise OptionError("a frame number is beyond 2^52 - 1")
        self._gap += count

    def frame(self) -> None:
        """Count the next frame."""
        if self._gap:
            self.runs.append(payloads.MissingRun(frames=self._frames, length=self._gap))
        self._frames = 1 if self._gap else self._frames + 1
        self._last += 1 + self._gap
        self._gap = 0


def build_head(profile: Profile) -> bytes:
    """The payload of a HEAD that this writer writes."""
    return build(payloads.Head(profile=profile.id), "HEAD")


def parse_head(payload: bytes) -> Profile:
    """The profile of the file; raises UnsupportedError if it needs a newer reader."""
    head = parse(payloads.Head, payload, "HEAD")
    if head.profile not in PROFILES:
        raise UnsupportedError(f"HEAD: profile {head.profile} is unknown")  # CONV-16
    return PROFILES[head.profile]


def parse_clip(payload: bytes, head: bytes, where: str, *, shared: bool = False) -> payloads.Clip:
    """The fields of CLIP, which must not need more than ``head``, the payload of HEAD, states.

    With ``shared`` clips with equal signals share these.
    """
    needed, stated = tuple(payload[:2]), tuple(head[2:4])
    if stated and needed > stated:  # CLIP-22
        raise FormatError(f"the file needs format {needed}, but HEAD states {stated}", where=where)
    if shared:
        return parse_shared(payloads.Clip, payload, where, "signals")
    return parse(payloads.Clip, payload, where)


ROWS = 4096  # at a time, so that hashing needs little memory
PIECE = 2**20  # bytes of a mask that are made at a time


def canonical(values: Values) -> bytes:
    """The bytes that hashes and conformance compare: little-endian, row after row, one NaN."""
    return _canonical(values).tobytes()


def _canonical(values: Values) -> Values:
    """The canonical array, ``values`` itself if it has these bytes."""
    if values.dtype == np.int64:
        return np.ascontiguousarray(values, "<i8")  # CEND-03
    if values.size and np.isnan(values.min()):  # some are
        values = np.where(np.isnan(values), math.nan, values)
    return np.ascontiguousarray(values, "<f8")  # CEND-03


def value_hash(values: Values, mask: NDArray[np.bool_] | None) -> bytes:
    """SHA-256 of the canonical array and, if any value is invalid, of the mask."""
    digest = ValueDigest()
    for start in range(0, len(values), ROWS):
        rows = slice(start, start + ROWS)
        digest.update(values[rows], None if mask is None else mask[rows])
    return digest.digest()


class ValueDigest:
    """SHA-256 of the canonical array and, if any value is invalid, of the mask after it.

    So masks are kept until the end, a mask that is all valid as a count.
    """

    def __init__(self) -> None:
        self._hash = hashlib.sha256()
        self._masks: list[bytes | int] = []

    def update(self, values: Values, mask: NDArray[np.bool_] | None) -> None:
        """Add rows; ``mask`` None: all are valid."""
        self._hash.update(_canonical(values).data)
        if mask is not None and not mask.all():
            self._masks.append(mask.astype("u1").tobytes())  # CEND-04
        elif self._masks and isinstance(self._masks[-1], int):
            self._masks[-1] += values.size
        else:
            self._masks.append(values.size)

    def digest(self) -> bytes:
        """The hash of all that was added."""
        whole = self._hash.copy()
        if any(isinstance(mask, bytes) for mask in self._masks):  # CEND-04
            for mask in self._masks:
                for part in _parts(mask):
                    whole.update(part)
        return whole.digest()


def _parts(mask: bytes | int) -> list[bytes]:
    if isinstance(mask, bytes):
        return [mask]
    pieces, rest = divmod(mask, PIECE)
    return [b"\1" * PIECE] * pieces + [b"\1" * rest]
