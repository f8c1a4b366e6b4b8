"""``mcz.write``, ``mcz.encode`` and ``mcz.to_npz``: one motion, or one source file, to a new file.

The path of a motion: ``prepare`` converts it for its codec, ``tuned_plan`` finds the parameters
that meet a target and decides on the chunks of the clip, ``write_plan`` encodes and writes them.
``SourceEncoder`` brings a source file that far; archives have one for each of their files.
"""

from __future__ import annotations

import hashlib
import os
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path

from mcz.codecs import DEFAULT, choose_name, codec_by_name
from mcz.codecs.contract import Codec
from mcz.container.chunks import ChunkType
from mcz.container.directory import ClipRow, Directory
from mcz.container.limits import LARGE, Profile, profile_named
from mcz.container.writer import Writer
from mcz.errors import LimitError, MotionError, OptionError, SkeletonWarning, SourceError, remark_of
from mcz.files.reading.read import NONE, NOTE, Given, ReadMotion, read_motion
from mcz.files.reading.source_files import (
    SourceOptions,
    content_note,
    parse_rate,
    read_bytes,
    read_skeleton,
    stating_rate,
)
from mcz.files.tables import table_of
from mcz.files.tables import to_npz as npz_of
from mcz.files.writing.atomic import (
    WriteTransaction,
    check_metadata,
    check_name,
    clip_name,
    refuse_inputs,
    replacing,
)
from mcz.files.writing.clip_writer import write_plan, write_skeletons
from mcz.files.writing.planning import (
    StoredSkeleton,
    prepare,
    stored_with_base,
    under_its_path,
    with_true_sources,
)
from mcz.files.writing.tuning import tuned_plan
from mcz.hints import Hint, Remark
from mcz.kinematics.rest_pose import height_note
from mcz.model.checks import PATH, check_arguments
from mcz.model.clock import SAME_RATE
from mcz.model.motion import A_MOTION, Motion, Skeleton
from mcz.model.text_format import fields_text
from mcz.model.threads import limit_threads
from mcz.model.types import Params, Progress, Target
from mcz.model.units import in_unit
from mcz.sources import FORMATS, Format, format_of, is_table, wants_skeleton


@dataclass(frozen=True, slots=True)
class EncodingOptions:
    """Options of encoding: the name of a codec and its parameters.

    Raises OptionError for an unknown codec.
    """

    codec: str = DEFAULT
    params: Params = field(default_factory=dict)

    def __post_init__(self) -> None:
        codec_by_name(self.codec)

    @property
    def selected_codec(self) -> Codec:
        return codec_by_name(self.codec)


def encoding_options(
    codec: str | None, effort: str | None, params: Params | None
) -> EncodingOptions:
    """Options of a codec, or of an ``effort`` in its place; raises OptionError for both."""
    return EncodingOptions(choose_name(codec, effort), dict(params or {}))


class SourceEncoder:
    """One source file on its way into an MCZ file, under the relative path ``name``."""

    def __init__(
        self, path: Path, name: str, options: SourceOptions, encoding: EncodingOptions
    ) -> None:
        self.path, self.name, self.options, self.encoding = path, name, options, encoding
        self.reason = ""  # for keeping it verbatim
        self.remark = ""  # on a skeleton that may not be its own
        self.notes: tuple[str, ...] = ()  # remarks of its reader
        self.inputs: list[Path] = [path]  # its source files
        self.quality: dict[str, str] | None = None  # the quality record of a lossy clip

    def digest(self) -> bytes:
        return hashlib.sha256(read_bytes(self.path)).digest()

    @property
    def source_bytes(self) -> int:
        """The size of the file, and of the ASF that is stored with it."""
        files = self.inputs[:1] if self.reason else dict.fromkeys(self.inputs)
        return sum(path.stat().st_size for path in files)

    def write(self, transaction: WriteTransaction, progress: Progress | None = None) -> str:
        """Write the file; return how: "skeleton", "parsed", "present" or "verbatim"."""
        check_name(self.name)
        data = read_bytes(self.path)
        digest = hashlib.sha256(data).digest()
        if transaction.holds(self.name, digest):
            return "present"
        skeleton = self._given_skeleton(data)
        try:
            with transaction.step():
                result = self._parse(transaction.writer, data, skeleton, progress)
        except (SourceError, MotionError, LimitError) as error:
            if not self.options.verbatim:
                if isinstance(error, SourceError):
                    error.add(hint=Hint.VERBATIM)
                elif isinstance(error, LimitError) and transaction.writer.profile is not LARGE:
                    error.add(hint=Hint.LARGE)
                raise
            self.reason, self.remark, self.notes = remark_of(error), "", ()
            with transaction.step():
                transaction.writer.attachment(self.name, data)
            result = "verbatim"
        transaction.paths[self.name] = digest
        return result

    def _given_skeleton(self, data: bytes) -> Given:
        """The requested skeleton, whose errors are not the source's fault."""
        option = self.options.skeleton
        if option is None or option == NONE or not wants_skeleton(self.path, data):
            return None if option is None else NONE
        self.inputs.append(Path(option))
        return read_skeleton(option)

    def _parse(
        self, writer: Writer, data: bytes, skeleton_file: Given, progress: Progress | None
    ) -> str:
        source_format = format_of(self.path, data)
        if source_format.is_skeleton:
            self.notes = tuple(filter(None, [content_note(self.path, source_format)]))
            skeleton = in_unit(read_skeleton(self.path), self.options.unit)
            write_skeletons(writer, (StoredSkeleton(skeleton, path=self.name),))
            return "skeleton"
        _refuse_early(source_format, data, writer.profile)
        result = read_motion(
            self.path, skeleton_file, self.options.unit, data, flat=self.options.flat
        )
        motion = self.options.applied_to(result.motion)
        self._keep_notes(result, motion)
        notes = rate_notes(result.motion.frame_rate, self.options)
        self.notes += tuple(filter(None, [*notes, height_note(motion.skeleton)]))
        if motion.source is not None:
            motion = replace(motion, source=replace(motion.source, path=self.name))
        motion = replace(motion, name=clip_name(self.name, writer.directory))
        codec, params = self.encoding.selected_codec, self.encoding.params
        if not codec.lossless:  # the restored file differs: it states its rate
            motion = stating_rate(motion)
        base = None if result.skeleton is None else self._store_skeleton(result.skeleton)
        prepared = prepare(motion, codec, params, stored_with_base(motion.skeleton, base))
        plan = tuned_plan(prepared, codec, params, writer.profile)
        self.quality = write_plan(writer, plan, progress)
        return "parsed"

    def _keep_notes(self, result: ReadMotion, motion: Motion) -> None:
        """Keep what is odd about a file once the options have added what it left open."""
        self.remark = result.remark
        keys = ("source-note", *(() if result.skeleton is not None else (NOTE,)))
        notes = (motion.metadata.get(key, "") for key in keys)
        self.notes = tuple(filter(None, notes))
        if result.chosen is not None and result.chosen.path is not None:
            self.inputs.append(result.chosen.path)

    def _store_skeleton(self, skeleton: Skeleton) -> StoredSkeleton:
        """The skeleton of an ASF, under its own name if that is kept."""
        if not self.options.keep_skeleton:
            return StoredSkeleton(skeleton)
        path = skeleton.source.path if skeleton.source is not None else ""
        return StoredSkeleton(skeleton, path=path or f"{skeleton.name}.asf")


def rate_notes(stated: Fraction | None, options: SourceOptions) -> Iterator[str]:
    """A note if the frame rate in a file differs from the requested one."""
    if stated is None or options.rate is None:
        return
    requested = float(parse_rate(options.rate))
    if abs(float(stated) / requested - 1) <= SAME_RATE:
        return
    if options.force_rate:
        yield (f"its {float(stated):g} frames a second are replaced by {requested:g}, as requested")
    else:
        text = f"it states {float(stated):g} frames a second, not the requested {requested:g}"
        yield Remark(text, Hint.FORCE_RATE)


def _refuse_early(source_format: Format, data: bytes, profile: Profile) -> None:
    """Raise LimitError for more joints than the profile allows, before any is read."""
    if source_format.has_more_joints and source_format.has_more_joints(data, profile.joints):
        raise LimitError(
            f"there are more joints than the limit of {profile.joints}",
            hint=Hint.LARGE if profile is not LARGE else None,
        )


SHORT = 65536  # bytes of a source file whose skeleton and texts dominate the output


@dataclass(frozen=True, slots=True)
class WrittenClip:
    """A written clip: name, shape of the motion, and the quality record of a lossy one."""

    name: str
    n_frames: int
    n_channels: int
    quality: Mapping[str, str] | None = None

    __repr__ = fields_text


@dataclass(frozen=True, slots=True)
class Written:
    """The result of ``write`` and ``encode``.

    ``decoded_bytes``: the least ``max_decoded`` for reading every signal. ``notes``: odd facts of
    the source file. ``source_bytes``: size of the restored files (for ``encode``, the source and
    its ASF), 0 without a source. ``inputs``: these files, for ``encode``.
    """

    size: int
    clips: tuple[WrittenClip, ...]
    n_skeletons: int
    n_attachments: int
    decoded_bytes: int
    notes: tuple[str, ...] = ()
    source_bytes: int = 0
    inputs: tuple[str, ...] = ()

    __repr__ = fields_text


def summarize(
    directory: Directory,
    size: int,
    quality: Mapping[str, str] | None = None,
    notes: tuple[str, ...] = (),
    source_bytes: int = 0,
) -> Written:
    """The content of a file of one clip or none, its size, and the quality record of that clip."""
    return Written(
        size=size,
        clips=tuple(
            WrittenClip(row.name, row.n_frames, row.signals[0].n_channels, quality)
            for row in directory.clips.values()
        ),
        n_skeletons=len(directory.ids(ChunkType.SKEL)),
        n_attachments=len(directory.attachments),
        decoded_bytes=max(map(_decoded_bytes, directory.clips.values()), default=0),
        notes=notes,
        source_bytes=source_bytes,
    )


def _decoded_bytes(row: ClipRow) -> int:
    return max(
        8 * row.n_frames * signal.samples_per_frame * max(1, signal.n_channels)
        for signal in row.signals
    )


@check_arguments(motion=A_MOTION)
def write(
    motion: Motion,
    target: Target,
    codec: str | None = None,
    *,
    effort: str | None = None,
    force: bool = False,
    profile: str = "base",
    copies: bool = False,
    threads: int | None = None,
    progress: Progress | None = None,
    **params: object,
) -> Written:
    """Write ``motion`` to a new MCZ file: a path, an fsspec target or a binary stream.

    ``effort`` names a lossless codec in place of ``codec``: "fast", the default, is read fastest,
    "best" is smallest. ``params`` are the codec's; ``profile`` is "base", "large", which allows
    more, or "small", for embedded readers. ``copies``: chunks that the clip depends on, such as
    skeleton and template, are stored a second time, so that a flipped bit there costs no frame
    (``mcz.open`` with ``salvage``). ``threads`` encode in parallel, by default one a processor; the
    bytes are the same. Raises OptionError, MotionError, or LimitError if the profile is too
    small; MotionError also for a key of the metadata that SPEC.md does not register, unless it is
    private (``x-...``).
    """
    check_metadata(motion.metadata, motion.name)
    chosen, limits = codec_by_name(choose_name(codec, effort)), profile_named(profile)
    motion = with_true_sources(motion, lossless=chosen.lossless)
    prepared = prepare(motion, chosen, params, (under_its_path(motion.skeleton),))
    with limit_threads(threads), replacing(target, force=force, inputs=params.values()) as stream:
        _refuse_other_suffix(target)
        plan = tuned_plan(prepared, chosen, params, limits)
        writer = Writer(stream, profile=limits, copies=copies)
        quality = write_plan(writer, plan, progress)
        writer.finish()
    return summarize(writer.directory, writer.offset, quality)


def _refuse_other_suffix(target: Target) -> None:
    """Raise OptionError for a name of another format: its owner meant to convert."""
    suffix = Path(target).suffix.lower() if isinstance(target, (str, os.PathLike)) else ""
    if any(suffix in source_format.suffixes for source_format in FORMATS.values()):
        raise OptionError(
            f"an MCZ file must not have the suffix {suffix}; convert writes that format",
            path=str(target),
        )


@check_arguments(source=PATH)
def encode(
    source: str | os.PathLike[str],
    target: Target,
    *,
    codec: str | None = None,
    effort: str | None = None,
    params: Params | None = None,
    skeleton: str | os.PathLike[str] | None = None,
    rate: Fraction | float | None = None,
    unit: str | None = None,
    up: str | None = None,
    arrays: str | None = None,
    model: str | os.PathLike[str] | None = None,
    verbatim: bool = False,
    force: bool = False,
    profile: str = "base",
    copies: bool = False,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Written:
    """Encode one source file as an MCZ file.

    ``skeleton`` is the ASF of an AMC, as in ``mcz.read``, with the same SkeletonWarning.
    ``verbatim`` keeps a file that cannot be parsed as an attachment. ``up`` is the axis that points
    up ("x" to "-z"). ``arrays`` and ``model`` are as in ``mcz.read``; ``effort``, ``copies`` and
    ``threads`` as in ``mcz.write``. Raises SourceError, OptionError, MotionError or LimitError;
    nothing is left under the final name then. A target that is the source or its skeleton is
    refused, even with ``force``.
    """
    path = Path(source)
    if up is not None and path.suffix.lower() == ".asf":
        raise OptionError(
            "a lone skeleton is stored unchanged; set the up axis when you encode its AMC",
            path=path,
        )
    options = SourceOptions(
        skeleton=skeleton,
        rate=rate,
        unit=unit,
        up=up,
        arrays=arrays,
        model=model,
        verbatim=verbatim,
        keep_skeleton=True,
    )
    entry = SourceEncoder(path, path.name, options, encoding_options(codec, effort, params))
    inputs = (source, skeleton, *(params or {}).values())  # a parameter may name a file
    with limit_threads(threads), replacing(target, force=force, inputs=inputs) as stream:
        short = is_table(path) or (path.exists() and path.stat().st_size <= SHORT)
        transaction = WriteTransaction(
            stream, profile_named(profile), hold=verbatim, copies=copies, short=short
        )
        entry.write(transaction, progress)
        refuse_inputs(target, entry.inputs)
        _refuse_other_suffix(target)
        transaction.finish()
    if entry.remark:
        warnings.warn(f"{path}: {entry.remark}", SkeletonWarning, stacklevel=3)
    directory, size = transaction.writer.directory, transaction.writer.offset
    written = summarize(directory, size, entry.quality, entry.notes, entry.source_bytes)
    return replace(written, inputs=tuple(map(str, entry.inputs)))


@check_arguments(motion=A_MOTION)
def to_npz(motion: Motion, target: Target, *, force: bool = False) -> None:
    """Write channels, skeleton, rotations and positions of ``motion`` as an NPZ without pickles.

    docs/guides/tables.md lists the arrays; "about" in the file describes their relations.
    ``target`` is a path, an fsspec target or a binary stream. Raises ExistsError if it exists
    and not ``force``, and AccessError.
    """
    data = npz_of(table_of(motion))
    with replacing(target, force=force) as stream:
        stream.write(data)
