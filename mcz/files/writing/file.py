"""``mcz.write``, ``mcz.encode`` and ``mcz.to_npz``: one motion, or one source file, to a new file.

The path of a motion: ``prepare`` converts it for its codec, ``tuning`` finds the parameters that
meet a target, ``planning`` decides on the chunks of a clip, ``clip_writer`` writes them.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path

from mcz.container.chunks import ChunkType
from mcz.container.directory import ClipRow, Directory
from mcz.container.limits import profile_named
from mcz.container.writer import Writer
from mcz.errors import OptionError, SkeletonWarning
from mcz.files.reading.source_files import SourceOptions
from mcz.files.tables import table_of
from mcz.files.tables import to_npz as npz_of
from mcz.files.writing.atomic import WriteTransaction, check_metadata, refuse_inputs, replacing
from mcz.files.writing.planning import prepare, under_its_path, with_true_sources
from mcz.files.writing.source_encoder import SourceEncoder, encoding_options
from mcz.files.writing.tuning import write_motion
from mcz.model.motion import Motion
from mcz.model.text_format import brief
from mcz.model.threads import limit_threads
from mcz.model.types import Params, Progress, Target
from mcz.sources import is_table

SHORT = 65536  # bytes of a source file whose skeleton and texts dominate the output


@dataclass(frozen=True, slots=True)
class WrittenClip:
    """A written clip: name, shape of the motion, and the quality record of a lossy one."""

    name: str
    n_frames: int
    n_channels: int
    quality: Mapping[str, str] | None = None

    __repr__ = brief


@dataclass(frozen=True, slots=True)
class Written:
    """The result of ``write`` and ``encode``.

    ``decoded_bytes``: the least ``max_decoded`` for reading every signal. ``notes``: odd facts of
    the source file. ``source_bytes``: size of the restored files, of ``encode`` the source and its
    ASF; 0 without a source. ``inputs``: of ``encode`` these files.
    """

    size: int
    clips: tuple[WrittenClip, ...]
    n_skeletons: int
    n_attachments: int
    decoded_bytes: int
    notes: tuple[str, ...] = ()
    source_bytes: int = 0
    inputs: tuple[str, ...] = ()

    __repr__ = brief


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
        n_skeletons=sum(kind == ChunkType.SKEL for kind, _ in directory.shared),
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
    bytes are the same. Raises OptionError, MotionError, or LimitError where the profile is too
    small; MotionError also for a key of the metadata that SPEC.md does not register, unless it is
    private (``x-...``).
    """
    if not isinstance(motion, Motion):
        raise OptionError(f"a motion is written to a target, not {type(motion).__name__}")
    check_metadata(motion.metadata, motion.name)
    codec_options = encoding_options(codec, effort, params).selected_codec
    motion = with_true_sources(motion, lossless=codec_options.lossless)
    prepared = prepare(motion, codec_options, params, (under_its_path(motion.skeleton),))
    with limit_threads(threads), replacing(target, force=force, inputs=params.values()) as stream:
        writer = Writer(stream, profile=profile_named(profile), copies=copies)
        quality = write_motion(writer, prepared, codec_options, params, progress)
        writer.finish()
    return summarize(writer.directory, writer.offset, quality)


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
            "a skeleton alone is kept unchanged; give the up axis with its AMC", path=path
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
        transaction.finish()
    if entry.remark:
        warnings.warn(f"{path}: {entry.remark}", SkeletonWarning, stacklevel=2)
    directory, size = transaction.writer.directory, transaction.writer.offset
    written = summarize(directory, size, entry.quality, entry.notes, entry.source_bytes)
    return replace(written, inputs=tuple(map(str, entry.inputs)))


def to_npz(motion: Motion, target: Target, *, force: bool = False) -> None:
    """Write channels, skeleton, rotations and positions of ``motion`` as an NPZ without pickles.

    docs/guides/tables.md lists the arrays; "about" in the file describes their relations.
    ``target`` is a path, an fsspec target or a binary stream. Raises ExistsError where it exists
    and not ``force``, and AccessError.
    """
    data = npz_of(table_of(motion))
    with replacing(target, force=force) as stream:
        stream.write(data)
