"""The faults of a file: of its checksums and index alone, or of all of it, decoded."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import partial

from mcz.container.checksums import ChecksumReport, check_checksums
from mcz.container.chunks import Chunk, ChunkType
from mcz.container.reader import Container
from mcz.container.recovery import encode_packets, read_packet
from mcz.container.scan import scan
from mcz.container.source import ByteSource
from mcz.errors import (
    ChecksumError,
    FormatError,
    MczError,
    OptionError,
    UnsupportedError,
    error_context,
    remark_of,
)
from mcz.files.jobs import limit_jobs, share_clips
from mcz.files.reading.clip import Clip
from mcz.files.reading.clips import Where
from mcz.files.reading.file import File, open, open_bytes
from mcz.files.reading.signal_info import read_segments
from mcz.model.text_format import fields_text
from mcz.model.types import Target

HEADINGS = tuple(
    "HEAD SKEL SRCE MODL ATTA ALIA CLIP DATA CEND QUAL META REPT COPY RECV INDX".split()
)


@dataclass(frozen=True, slots=True)
class Problem:
    """One fault: its place, the heading of SPEC.md, and a message.

    ``clip`` is the clip that the message names.
    """

    offset: int
    heading: str
    message: str
    clip: str | None = None

    __repr__ = fields_text


def heading(source: ByteSource, offset: int) -> str:
    """The heading of SPEC.md for the chunk at ``offset``."""
    kind = source.read(offset, min(4, source.size - offset)).decode("latin-1")
    return kind if kind in HEADINGS else "Chunks"


def quick_check(
    target: Target, progress: Callable[[int, int], object] | None = None
) -> tuple[ChecksumReport, list[Problem]]:
    """Check every checksum of a file and its index; returns the report and the faults.

    While another process appends to the file, this is of the file up to its last end. ``progress``
    is called with the number of bytes done and the size of the file. Raises UnsupportedError where
    it needs a newer reader, AccessError where it cannot be read.
    """
    with closing(open_bytes(target)) as source, error_context(path=source.name):
        if source.grows():
            with open(target) as file:
                return _check_quickly(file.container.source, progress)
        return _check_quickly(source, progress)


def _check_quickly(
    source: ByteSource, progress: Callable[[int, int], object] | None
) -> tuple[ChecksumReport, list[Problem]]:
    seen = check_checksums(source, progress)
    return seen, [Problem(at, heading(source, at), text) for at, text in seen.faults]


Row = tuple[str, str, list[Problem]]  # kind, name and faults of a part of a file


def validate(file: File, clips: Sequence[Clip] | None = None) -> list[Problem]:
    """Every fault of the file, once: structure, checksums, values, sources, index.

    ``clips``: values and sources of these only.
    """
    problems = structure_problems(file)
    for _, _, problems_of_part in part_problems(file, clips):
        problems += problems_of_part
    first: dict[str, Problem] = {}
    for problem in problems:  # a chunk that is damaged hurts all that need it
        first.setdefault(problem.message, problem)
    return list(first.values())


def structure_problems(file: File) -> list[Problem]:
    """The faults of chunks, their order, their checksums and the index."""
    try:
        scan(file.container.source, whole=True)
    except FormatError as error:
        offset = error.offset or 0
        return [Problem(offset, heading(file.container.source, offset), remark_of(error))]
    return []


def verify(
    target: Target,
    max_decoded: int | None = None,
    threads: int | None = None,
    where: Where | None = None,
    quick: bool = False,
    jobs: int | None = None,
) -> list[Problem]:
    """Check every checksum of a file, decode everything, restore every source.

    Returns the faults, none for a sound file; raises FormatError where it cannot even be opened.
    ``max_decoded`` and ``threads`` are as in ``mcz.open``. ``where``: check every checksum, but
    decode and restore only the clips that match it, see ``File.find``; OptionError for none.
    ``quick``: check only the checksums and the index, at the speed of the disk; it also reports all
    faults of a file that cannot be opened. ``jobs`` processes work in parallel, by default one.
    """
    if quick:
        if where is not None:
            raise OptionError("a quick check covers the whole file, so where is not allowed")
        return quick_check(target)[1]
    with limit_jobs(jobs), open(target, max_decoded=max_decoded, threads=threads) as file:
        return validate(file, None if where is None else file.chosen(where=where))


def part_problems(file: File, clips: Sequence[Clip] | None = None) -> Iterator[Row]:
    """Kind, name and faults of every skeleton, clip and attachment, one after the other.

    ``clips``: only these, and their skeletons.
    """
    items = [("skeletons", "")]
    items += [("clip", clip.name) for clip in (file if clips is None else clips)]
    items += [("attachment", name) for name in (file.attachments if clips is None else ())]
    items += [("recovery data", "")] if clips is None else []
    names = None if clips is None else [clip.name for clip in clips]
    with share_clips(_problems_of, file, items, names) as answers:
        for answer in answers:
            yield from answer()


def _problems_of(shared: tuple[File, Sequence[str] | None], item: tuple[str, str]) -> list[Row]:
    (file, names), (kind, name) = shared, item
    if kind == "clip":
        return [(kind, name, clip_problems(file, file.clips[name]))]
    if kind == "recovery data":
        return [(kind, *row) for row in recovery_problems(file.container)]
    if kind == "attachment":
        offset = file.container.directory.attachments[name].parts[0].offset
        return [(kind, name, _problems(offset, "ATTA", file.attachments[name].read))]
    return _skeleton_rows(file, None if names is None else [file.clips[name] for name in names])


def _skeleton_rows(file: File, clips: Sequence[Clip] | None) -> list[Row]:
    try:
        ids = None if clips is None else file.skeleton_ids(clips)
        skeletons = [
            (id_, skeleton) for id_, skeleton in file.skeletons if ids is None or id_ in ids
        ]
    except MczError as error:
        return [("skeletons", "", [Problem(0, "SKEL", remark_of(error))])]
    rows: list[Row] = []
    for id_, skeleton in skeletons:
        offset = file.container.directory.shared[ChunkType.SKEL, id_].offset
        problems = _problems(offset, "SKEL", partial(_restore_skeleton, file, id_))
        rows.append(("skeleton", skeleton.name or id_.hex(), problems))
    return rows


def _restore_skeleton(file: File, id_: bytes) -> None:
    if file.skeleton(id_, with_source=True).source is not None:
        file.skeleton_bytes(id_)


def _problems(offset: int, heading: str, work: Callable[[], object]) -> list[Problem]:
    return [Problem(offset, heading, remark_of(error)) for error in _errors_of(work)]


def clip_problems(file: File, clip: Clip) -> list[Problem]:
    """The faults of one clip: its values and its restored source."""
    row = file.container.directory.clips[clip.name]
    problems = [
        Problem(row.clip.offset, _clip_heading(error), remark_of(error), error.clip)
        for error in _clip_errors(clip)
    ]
    return list(dict.fromkeys(problems))


def _clip_errors(clip: Clip) -> Iterator[MczError]:
    """The faults of each signal; one that is unsupported does not hide more."""
    errors = _errors_of(lambda: clip.signals)
    yield from errors
    sound = not errors
    for signal in clip.signals if sound else ():
        try:
            clip.check_values(signal.index)
        except MczError as error:
            sound = False
            yield error
            if isinstance(error, UnsupportedError):
                yield from _errors_of(read_segments, clip.container, signal)
    if sound and clip.source is not None:
        yield from _errors_of(clip.source_bytes)


def _errors_of(work: Callable[..., object], *arguments: object) -> list[MczError]:
    try:
        work(*arguments)
    except MczError as error:
        return [error]
    return []


def _clip_heading(error: MczError) -> str:
    if isinstance(error, UnsupportedError):
        return "Codecs"
    return "CEND" if isinstance(error, ChecksumError) else "CLIP"


def recovery_chunks(container: Container) -> list[Chunk]:
    """The RECV chunks of a file; without a clip no index lists them, and the file is walked."""
    if container.directory.clips:
        return container.directory.clips.ancillary(ChunkType.RECV)
    return [chunk for chunk in scan(container.source).chunks if chunk.type == ChunkType.RECV]


def recovery_problems(container: Container) -> Iterator[tuple[str, list[Problem]]]:
    """Yield the protected bytes of each RECV, and its faults."""
    for chunk in recovery_chunks(container):
        try:
            yield _check_recovery(container.source, chunk), []
        except MczError as error:
            yield f"at {chunk.offset}", [Problem(chunk.offset, "RECV", remark_of(error))]


def _check_recovery(source: ByteSource, chunk: Chunk) -> str:
    first = read_packet(source, chunk.payload_offset)
    if first is None:
        raise FormatError("its first packet is damaged", where=f"chunk {chunk.label}")
    shape = first[0].shape
    sizes = shape.chunk_offset, shape.payload_size
    if sizes != (chunk.offset, chunk.length) or shape.stop > source.size:
        raise FormatError(
            f"it protects {shape}, not the bytes before and after it", where=f"chunk {chunk.label}"
        )
    _, packets = encode_packets(shape, lambda block: shape.block(block, source.read))
    at = chunk.payload_offset
    for packet in packets:
        if source.read(at, len(packet)) != packet:
            raise FormatError(
                f"the packet at {at} does not match the protected bytes",
                where=f"chunk {chunk.label}",
            )
        at += len(packet)
    return f"bytes {shape.start} to {shape.stop}"
