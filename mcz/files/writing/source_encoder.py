"""One source file on its way into an MCZ file: read, coded, named, and the options of all that."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path

from mcz.codecs import DEFAULT, choose_name, codec_by_name
from mcz.codecs.contract import Codec
from mcz.container.limits import BASE, LARGE, Profile
from mcz.container.writer import Writer
from mcz.errors import LimitError, MotionError, SourceError, remark_of
from mcz.files import jobs
from mcz.files.reading.read import NONE, NOTE, Given, ReadMotion, read_motion
from mcz.files.reading.source_files import (
    SourceOptions,
    content_note,
    parse_rate,
    read_bytes,
    read_skeleton,
)
from mcz.files.reading.source_info import stating_rate
from mcz.files.writing.atomic import WriteTransaction, check_name, clip_name
from mcz.files.writing.clip_writer import write_skeletons
from mcz.files.writing.planning import StoredSkeleton, prepare, stored_with_base
from mcz.files.writing.tuning import write_motion
from mcz.hints import Hint, Remark
from mcz.kinematics.rest_pose import height_note
from mcz.model import threads
from mcz.model.clock import SAME_RATE
from mcz.model.motion import Motion, Skeleton
from mcz.model.types import Params, Progress
from mcz.model.units import in_unit
from mcz.sources import Format, format_of, wants_skeleton


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


@dataclass(frozen=True, slots=True)
class WritingOptions:
    """Options of the output file.

    ``force`` replaces an existing file. ``copies``: chunks that clips depend on are stored a second
    time. ``threads`` encode in parallel, by default one a processor, and ``jobs`` processes, by
    default one; the bytes are the same.
    """

    force: bool = False
    profile: Profile = BASE
    copies: bool = False
    threads: int | None = None
    jobs: int | None = None
    progress: Progress | None = None

    @contextmanager
    def in_force(self) -> Iterator[None]:
        """Limit threads and processes of calls within the block."""
        with threads.limit_threads(self.threads), jobs.limit_jobs(self.jobs):
            yield


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
        kept = self.inputs[:1] if self.reason else dict.fromkeys(self.inputs)
        return sum(path.stat().st_size for path in kept)

    def write(self, transaction: WriteTransaction, progress: Progress | None = None) -> str:
        """Write the file; return how: "skeleton", "parsed", "present" or "verbatim"."""
        check_name(self.name)
        data = read_bytes(self.path)
        digest = hashlib.sha256(data).digest()
        if transaction.holds(self.name, digest):
            return "present"
        given = self._given_skeleton(data)
        try:
            with transaction.step():
                result = self._parse(transaction.writer, data, given, progress)
        except (SourceError, MotionError, LimitError) as error:
            if not self.options.verbatim:
                if isinstance(error, SourceError):
                    error.add(hint=Hint.VERBATIM)
                raise
            self.reason, self.remark, self.notes = remark_of(error), "", ()
            with transaction.step():
                transaction.writer.attachment(self.name, data)
            result = "verbatim"
        transaction.paths[self.name] = digest
        return result

    def _given_skeleton(self, data: bytes) -> Given:
        """The requested skeleton, whose errors are not the source's fault."""
        given = self.options.skeleton
        if given is None or given == NONE or not wants_skeleton(self.path, data):
            return None if given is None else NONE
        self.inputs.append(Path(given))
        return read_skeleton(given)

    def _parse(self, writer: Writer, data: bytes, given: Given, progress: Progress | None) -> str:
        source_format = format_of(self.path, data)
        if source_format.is_skeleton:
            self.notes = tuple(filter(None, [content_note(self.path, source_format)]))
            skeleton = in_unit(read_skeleton(self.path), self.options.unit)
            write_skeletons(writer, (StoredSkeleton(skeleton, path=self.name),))
            return "skeleton"
        _refuse_early(source_format, data, writer.profile)
        taken = read_motion(self.path, given, self.options.unit, data, flat=self.options.flat)
        motion = self.options.applied_to(taken.motion)
        self._keep_notes(taken, motion)
        notes = rate_notes(taken.motion.frame_rate, self.options)
        self.notes += tuple(filter(None, [*notes, height_note(motion.skeleton)]))
        if motion.source is not None:
            motion = replace(motion, source=replace(motion.source, path=self.name))
        motion = replace(motion, name=clip_name(self.name, writer.directory))
        codec, params = self.encoding.selected_codec, self.encoding.params
        if not codec.lossless:  # the restored file differs: it states its rate
            motion = stating_rate(motion)
        base = None if taken.skeleton is None else self._store_skeleton(taken.skeleton)
        prepared = prepare(motion, codec, params, stored_with_base(motion.skeleton, base))
        self.quality = write_motion(writer, prepared, codec, params, progress)
        return "parsed"

    def _keep_notes(self, taken: ReadMotion, motion: Motion) -> None:
        """Keep what is odd about a file once the options have told what it left open."""
        self.remark = taken.remark
        keys = ("source-note", *(() if taken.skeleton is not None else (NOTE,)))
        notes = (motion.metadata.get(key, "") for key in keys)
        self.notes = tuple(filter(None, notes))
        if taken.chosen is not None and taken.chosen.path is not None:
            self.inputs.append(taken.chosen.path)

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
    asked = float(parse_rate(options.rate))
    if abs(float(stated) / asked - 1) <= SAME_RATE:
        return
    if options.force_rate:
        yield f"its {float(stated):g} frames a second are kept as {asked:g}, as was asked for"
    else:
        text = f"it states {float(stated):g} frames a second, {asked:g} are asked for"
        yield Remark(text, Hint.FORCE_RATE)


def _refuse_early(source_format: Format, data: bytes, profile: Profile) -> None:
    """Raise LimitError for more joints than the profile has, before any of them is read."""
    if source_format.has_more_joints and source_format.has_more_joints(data, profile.joints):
        raise LimitError(
            f"joints: there are more than the limit of {profile.joints}",
            hint=Hint.LARGE if profile is not LARGE else None,
        )
