"""The plan of a clip: a motion prepared for its codec, and decisions before writing."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from mcz.codecs import codec_by_name
from mcz.codecs.contract import Codec, Encoded
from mcz.codecs.parameters import TARGETS
from mcz.container import payloads
from mcz.container.limits import LARGE, Profile, check
from mcz.container.model_records import channel_records, put_time_base, time_base_of
from mcz.container.scanner import is_plain_path
from mcz.errors import MotionError, OptionError
from mcz.files.reading.source_files import stating_rate
from mcz.files.writing.signal_source import MemorySource, as_stored, group_kind, settle
from mcz.kinematics.points import in_positions, point_set
from mcz.kinematics.rest_pose import NO_LENGTHS, has_no_lengths
from mcz.model.clock import TIMES
from mcz.model.motion import ROLES, Motion, Signal, Skeleton, Source
from mcz.model.schema import MAX_COUNT, build
from mcz.model.types import JsonObject, Params
from mcz.model.units import axes_of
from mcz.sources import FORMATS

MAX_ERROR, MEAN_ERROR = "max_error", "mean_error"
FURTHER_CODEC = "fast"  # of all signals other than the motion, if its codec is lossy


@dataclass(frozen=True, slots=True)
class StoredSkeleton:
    """A skeleton that a file stores.

    If it ``derives``, its base is the previous one. ``path`` names its own file, which the MCZ file
    restores; empty: it restores none.
    """

    skeleton: Skeleton
    derives: bool = False
    path: str = ""


@dataclass(frozen=True, slots=True)
class Prepared:
    """A motion in the form of its codec, and the stored skeletons, its own last."""

    motion: Motion
    skeletons: tuple[StoredSkeleton, ...] = ()


def prepare(
    motion: Motion, codec: Codec, params: Params, skeletons: tuple[StoredSkeleton, ...] = ()
) -> Prepared:
    """``motion``, or the positions of its points if ``codec`` codes those.

    ``skeletons`` are those of ``Prepared``, of the given motion. Raises OptionError if positions
    have no meaning, MotionError if there are none.
    """
    options = codec.options(split_bounds(params)[0])
    skeletons = skeletons or (StoredSkeleton(motion.skeleton),)
    if not wants_positions(codec, options, motion.skeleton):
        return Prepared(motion, skeletons)
    check_bones(motion.skeleton, f"codec {codec.name}, of positions,")
    made = in_positions(motion, virtual_markers=bool(options.get("virtual_markers")))
    if made is motion:
        return Prepared(motion, skeletons)
    return Prepared(made, (*skeletons, StoredSkeleton(made.skeleton, derives=True)))


def split_bounds(params: Params) -> tuple[JsonObject, JsonObject]:
    """The parameters of a codec, and bounds of signals other than the motion."""
    bounds = {key: value for key, value in params.items() if _is_bound(key)}
    return {key: value for key, value in params.items() if key not in bounds}, bounds


def _is_bound(key: str) -> bool:
    name, _, error = key.rpartition(".")
    return bool(name) and error in (MAX_ERROR, MEAN_ERROR)


def stored_with_base(skeleton: Skeleton, base: StoredSkeleton | None) -> tuple[StoredSkeleton, ...]:
    """The stored skeletons of one that was read with ``base``, whose file is unchanged."""
    if base is None:
        return (StoredSkeleton(skeleton),)
    derives = skeleton.base is not None or axes_of(skeleton) != axes_of(base.skeleton)
    return base, StoredSkeleton(skeleton, derives)


def under_its_path(skeleton: Skeleton) -> StoredSkeleton:
    """``skeleton`` with the path of its own file, if it has one."""
    path = skeleton.source.path if skeleton.source is not None else ""
    return StoredSkeleton(skeleton, path=path)


def wants_positions(codec: Codec, options: Params, skeleton: Skeleton) -> bool:
    """Return True if a codec codes positions of points instead of channels."""
    if not codec.positions or options.get("domain") == "channels" or not skeleton.joints:
        return False
    return point_set(skeleton) != "markers"


def check_bones(skeleton: Skeleton, label: str) -> None:
    """Raise OptionError if rotations move no point, since no bone has a length.

    Arrays of body models are such: ``label`` would then depend on the root alone.
    """
    if has_no_lengths(skeleton):
        raise OptionError(
            f"{label} has no meaning: {NO_LENGTHS}, so rotations move no point; set rest offsets"
        )


def with_true_sources(motion: Motion, *, lossless: bool) -> Motion:
    """``motion`` whose sources state the size and the hash of the file that they restore.

    Values may have been replaced since they were read: then the source has no original file. A
    skeleton that differs from its own file has none. Raises MotionError or FormatError if the
    source cannot hold the values.
    """
    motion = replace(motion, skeleton=_with_true_source(motion.skeleton)).with_consecutive_numbers()
    source = motion.source
    if source is None:
        return motion
    if source.format not in FORMATS:
        raise MotionError(f"source format {source.format!r} is not one of {', '.join(FORMATS)}")
    if source.sha256 and _facts(_restore_source(motion, lossless)) == (source.size, source.sha256):
        return motion
    return with_source_hash(replace(motion, source=source.without_file()), lossless=lossless)


def _with_true_source(skeleton: Skeleton) -> Skeleton:
    source = skeleton.source
    if source is None:
        return skeleton
    try:
        data = FORMATS["asf"].write(skeleton) if source.format == "asf" else b""
    except MotionError:  # printed again, and the format cannot hold it
        data = b""
    known = (source.size, source.sha256) == _facts(data)
    return skeleton if data == source.template and known else replace(skeleton, source=None)


def with_source_hash(motion: Motion, *, lossless: bool) -> Motion:
    """``motion`` with size and hash of its changed or cut source file.

    Unless ``lossless``, its values may lie off their grids.
    """
    if motion.source is None or motion.source.sha256:
        return motion
    motion = stating_rate(motion)
    size, digest = _facts(_restore_source(motion, lossless))
    assert motion.source is not None
    return replace(motion, source=replace(motion.source, size=size, sha256=digest))


def _restore_source(motion: Motion, lossless: bool) -> bytes:
    assert motion.source is not None
    stored = as_stored(motion)
    signals = tuple(_as_read(signal, lossless) for signal in stored.signals)
    data: bytes = FORMATS[motion.source.format].write(replace(stored, signals=signals))
    return data


def _as_read(signal: Signal, lossless: bool) -> Signal:
    try:
        return settle(signal)[1]
    except MotionError:
        if lossless:
            raise
        return signal


def _facts(data: bytes) -> tuple[int, bytes]:
    return len(data), hashlib.sha256(data).digest()


@dataclass(frozen=True, slots=True)
class SignalPlan:
    """A signal, its codec, and the segments that are yet to be encoded."""

    source: MemorySource
    codec: Codec
    encoded: Encoded

    def lossy_channels(self) -> NDArray[np.bool_]:
        """The channels whose values the codec may change, (n_channels,)."""
        layout, codec = self.source.layout, self.codec
        free = np.full(layout.n_channels, not codec.lossless)
        for group in codec.exact(self.encoded.header, layout) if codec.exact else ():
            free[list(layout.groups[group])] = False
        return free


@dataclass(frozen=True, slots=True)
class ClipPlan:
    """A clip in stored form, in the order of its chunks.

    ``prepared`` has the values that a file stores; ``models`` are payloads of MODL. ``options`` are
    those of the motion's codec, ``remarks`` further entries of its quality record.
    """

    prepared: Prepared
    options: Params
    models: tuple[bytes, ...]
    signals: tuple[SignalPlan, ...]
    remarks: Mapping[str, str] = field(default_factory=dict)

    @property
    def motion(self) -> Motion:
        return self.prepared.motion

    @property
    def codec(self) -> Codec:
        return self.signals[0].codec


def plan_clip(prepared: Prepared, codec: Codec, params: Params, profile: Profile) -> ClipPlan:
    """The plan of a motion with the codec ``codec``, for a file of a profile.

    A lossy codec takes only the motion; further signals stay lossless. Raises OptionError for a bad
    parameter or a target that is not met yet (see ``tuning.py``), MotionError for values that the
    codec cannot hold, LimitError for a clip beyond the profile.
    """
    options = codec.options(params, inner=True)
    if codec.dial and find_targets(options) and options[codec.dial.parameter] is None:
        raise OptionError(
            f"{', '.join(find_targets(options))}: a value of {codec.dial.parameter} must be "
            "found first"
        )
    counted = prepared.motion.with_consecutive_numbers()
    motion = as_stored(with_source_hash(counted, lossless=codec.lossless))
    for signal in motion.signals:
        check(f"signal {signal.name!r}: channels", signal.n_channels, profile.channels)
    signals = tuple(
        _signal_plan(motion, index, codec, options, profile) for index in range(len(motion.signals))
    )
    models = tuple(model for plan in signals for model in _model_payloads(plan.encoded, profile))
    return ClipPlan(Prepared(motion, prepared.skeletons), options, models, signals)


def plan_open_clip(
    prepared: Prepared, codec: Codec, options: Params, encoded: Encoded, profile: Profile
) -> ClipPlan:
    """The plan of a clip without known frames."""
    check("channels", prepared.motion.signals[0].n_channels, profile.channels)
    source = MemorySource(prepared.motion, 0, codec, profile.segment_bytes)
    models = tuple(_model_payloads(encoded, profile))
    return ClipPlan(prepared, options, models, (SignalPlan(source, codec, encoded),))


def find_targets(options: Params) -> JsonObject:
    return {t.name: options[t.name] for t in TARGETS if options.get(t.name) is not None}


def _signal_plan(
    motion: Motion, index: int, codec: Codec, options: Params, profile: Profile
) -> SignalPlan:
    if index and not codec.lossless:
        codec = codec_by_name(FURTHER_CODEC)
        options = codec.options({})
    signal = motion.signals[index]
    if not codec.lossless and signal.channels is not None:
        raise MotionError(
            f"codec {codec.name} needs the skeleton's channels, but signal {signal.name!r} "
            "has its own"
        )
    if codec.domain == "values" and signal.values.dtype == np.int64:
        raise MotionError(
            f"codec {codec.name} cannot encode integers, and signal {signal.name!r} has them"
        )
    row_bytes = 8 * max(1, signal.n_channels)
    most = min(profile.segment_bytes, profile.coded_bytes, profile.rows * row_bytes)
    source = MemorySource(motion, index, codec, most, options)
    if codec.domain == "values" and source.signal.values.dtype == np.int64:
        raise MotionError(
            f"codec {codec.name} cannot encode integers, and signal {source.signal.name!r} has them"
        )
    return SignalPlan(source, codec, codec.encode(source, options))


def _model_payloads(encoded: Encoded, profile: Profile) -> Iterator[bytes]:
    """Models that a signal needs, with well-known ones if all shall be in the file."""
    known = encoded.known_models if profile is LARGE else ()
    for model in (*encoded.models, *known):
        yield build(payloads.Modl(kind=model.kind, data=model.data), "MODL")


def clip_record(plan: ClipPlan, skeleton: bytes, template: bytes | None) -> payloads.Clip:
    """CLIP of a plan; ``skeleton`` and ``template`` are the ids of its SKEL and its SRCE."""
    motion = plan.motion
    rate = motion.frame_rate
    if rate is not None and max(rate.numerator, rate.denominator) > MAX_COUNT:
        raise MotionError(f"frame rate {rate}: a term exceeds 2^53 - 1")
    record = payloads.Clip(
        name=motion.name,
        flags=0 if motion.frame_rate_exact else payloads.ROUNDED_RATE,
        skeleton=skeleton,
        n_frames=motion.n_frames,
        rate_numerator=rate.numerator if rate else 0,
        rate_denominator=rate.denominator if rate else 1,
        metadata=payloads.metadata_records(dict(sorted(motion.metadata.items()))),
        source=_source_record(motion.source, template),
        signals=[_signal_record(signal) for signal in plan.signals],
    )
    first_time = None if motion.signals_of(TIMES) else motion.first_time
    put_time_base(record, time_base_of(motion.frame_numbers, first_time))
    return record


def _source_record(source: Source | None, template: bytes | None) -> payloads.ClipSource | None:
    if source is None or template is None:
        return None
    if source.path and not is_plain_path(source.path):
        raise MotionError(f"source path {source.path!r} is not a plain relative path")
    return payloads.ClipSource(
        template=template,
        format=FORMATS[source.format].id,
        detail=source.detail,
        path=source.path,
        size=source.size,
    )


def _signal_record(plan: SignalPlan) -> payloads.Signal:
    signal, codec, encoded = plan.source.signal, plan.codec, plan.encoded
    own, is_listed = signal.channels is not None, plan.source.is_listed
    kind = payloads.GROUP_LISTED if is_listed else group_kind(signal, codec.grouping)
    sizes = [len(group) for group in plan.source.layout.groups] if is_listed else None
    return payloads.Signal(
        name=signal.name,
        flags=payloads.OWN_CHANNELS if own else 0,
        role=ROLES.index(signal.role or ""),
        of=signal.of,
        channels=channel_records(signal.channels) if signal.channels is not None else None,
        samples_per_frame=signal.samples_per_frame,
        grids=payloads.grid_runs(signal.grids),
        codec=codec.id,
        preset=encoded.preset or codec.preset,
        codec_version=codec.version if encoded.version is None else encoded.version,
        header=encoded.header,
        groups=payloads.Groups(kind=kind, sizes=sizes),
        n_resolutions=encoded.n_resolutions,
    )
