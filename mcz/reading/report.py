"""What a file says of itself: the ``info`` document, its layout byte by byte, its faults.

Everything that ``mcz info`` and ``mcz verify`` print is computed here.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from mcz.clock import time_facts
from mcz.codecs.basis_models import name_of
from mcz.container import note_records
from mcz.container.chunks import ChunkType
from mcz.container.directory import ClipRow
from mcz.container.reader import Container
from mcz.container.scan import scan
from mcz.container.segments import GROUP_NOTES
from mcz.errors import (
    ChecksumError,
    FormatError,
    MczError,
    OptionError,
    UnsupportedError,
    remark_of,
)
from mcz.formats import FORMATS, arrays_of
from mcz.jobs import limited
from mcz.kinematics.rest import figure_height
from mcz.motion import Skeleton
from mcz.reading.clip import Clip
from mcz.reading.fields import Where
from mcz.reading.file import File, open
from mcz.reading.layout import layout as layout
from mcz.reading.quick_check import Problem as Problem
from mcz.reading.quick_check import heading, quick_check
from mcz.reading.ratios import file_ratio, ratios_of
from mcz.reading.recording_report import document_of
from mcz.reading.recovery_check import recovery_problems
from mcz.reading.sharing import shared_out
from mcz.reading.signal_info import SignalInfo, read_segments
from mcz.reading.sizes import Sizes, clip_sizes, file_parts, models_used
from mcz.schema import parse
from mcz.types import JsonObject, Target

Row = tuple[str, str, list[Problem]]  # kind, name and faults of a part of a file


def info(file: File, names: Sequence[str] | None = None, where: Where | None = None) -> JsonObject:
    """The document that ``mcz info --json`` prints; its keys are stable.

    ``names``, ``where``: of these clips alone, and of their skeletons, see ``File.chosen``.
    """
    container, whole = file.container, names is None and where is None
    chosen = file.chosen(names, where)
    sizes = [clip_sizes(container, clip) for clip in chosen]
    clips = [_clip_info(file, clip, own) for clip, own in zip(chosen, sizes, strict=True)]
    shared = container.directory.shared
    ids = {id_ for _, id_ in shared} if whole else file.skeleton_ids(chosen)
    used = {model["id"] for clip in clips for model in clip["models"]}
    models = [
        id_ for kind, id_ in shared if kind == ChunkType.MODL and (whole or id_.hex() in used)
    ]
    attachments = [{"name": a.name, "bytes": a.size} for a in file.attachments.values()]
    return {
        "format_version": file.header["format_version"],
        "needs_version": file.header["needs_version"],
        "profile": file.header["profile"],
        "file_bytes": file.size,
        "index_bytes": container.directory.index_bytes,
        "copy_bytes": sum(chunk.size for chunk in container.copies()),
        "parts": file_parts(container, sizes) if whole else None,
        "skeletons": [_skeleton_info(container, i, s) for i, s in file.skeletons if i in ids],
        "models": [_model_info(container, id_) for id_ in models],
        "clips": clips,
        "attachments": attachments if whole else [],
        "aliases": sorted(file.aliases) if whole else [],
        "cr_file": file_ratio(file) if whole else None,
        "damage": list(file.damage),
    }


def _skeleton_info(container: Container, id_: bytes, skeleton: Skeleton) -> JsonObject:
    chunk = container.directory.shared[ChunkType.SKEL, id_]
    return {
        "id": id_.hex(),
        "name": skeleton.name,
        "base": skeleton.base.hex() if skeleton.base else None,
        "chunk_bytes": chunk.size,
        **joint_facts(skeleton),
    }


def joint_facts(skeleton: Skeleton) -> JsonObject:
    """What ``mcz info`` says of the joints of a skeleton, wherever it comes from."""
    return {
        "n_joints": skeleton.n_joints,
        "n_channels": skeleton.n_channels,
        "unit_cm": skeleton.unit_cm,
        "height": figure_height(skeleton),
        "angle_unit": skeleton.angle_unit,
        "up_axis": skeleton.up_axis,
        "forward_axis": skeleton.forward_axis,
        "handedness": skeleton.handedness,
        "joints": [
            {
                "name": joint.name,
                "parent": joint.parent,
                "channels": [channel.label for channel in joint.channels],
            }
            for joint in skeleton.joints
        ],
    }


def _model_info(container: Container, id_: bytes) -> JsonObject:
    fields = container.model(id_)
    size = container.directory.shared[ChunkType.MODL, id_].size
    return {"id": id_.hex(), "kind": fields.kind, "chunk_bytes": size}


def _clip_info(file: File, clip: Clip, sizes: Sizes) -> JsonObject:
    rate = clip.frame_rate
    unread: list[str] = []
    document = {
        "name": clip.name,
        "codec": clip.codec,
        "codecs": [
            {
                "signal": s.name,
                "role": s.role,
                "channels": s.layout.n_channels,
                "samples_per_frame": s.layout.samples_per_frame,
                "id": s.codec_id,
                "preset": s.preset,
                "version": s.codec_version,
                "header": s.header.hex(),
                "segments": len(s.rows),
                "groups": s.counts.n_groups,
                "resolutions": s.counts.n_resolutions,
                "exact_joints": _exact_joints(clip, s),
                "stored_frames": s.layout.n_frames,
            }
            for s in clip.signals
        ],
        "skeleton": clip.skeleton_id.hex(),
        "n_frames": clip.n_frames,
        "n_channels": clip.n_channels,
        "n_joints": clip.skeleton.n_joints,
        "frame_rate": float(rate) if rate is not None else None,
        "frame_rate_exact": clip.frame_rate_exact,
        "times": _times(clip, unread),
        "metadata": dict(clip.metadata),
        "payload_bytes": sizes.payload,
        "overhead_bytes": sizes.overhead,
        "packets": sum(row.packet > 0 for signal in clip.signals for row in signal.rows),
        "packet_bytes": sizes.packets,
        "between_bytes": sizes.between,
        "source_chunk_bytes": sizes.source,
        "hash_bytes": sizes.hashes,
        "quality_bytes": sizes.quality,
        "model_bytes": sizes.models,
        "models": [
            {"id": id_.hex(), "name": name_of(id_)}
            for signal in clip.signals
            for id_ in models_used(signal)
        ],
        **_source_info(clip),
        "recording": _recording(clip, unread),
        "arrays": _arrays(clip, unread),
        **exceptions_info(file.container, clip),
        "quality": clip.quality,
        "damage": [*clip.damage, *unread],
    }
    return document | ratios_of(file, clip, sizes)


def _exact_joints(clip: Clip, signal: SignalInfo) -> list[str]:
    """The joints that have exact channels beside lossy ones, where they are known."""
    try:
        columns = {c for group in signal.exact for c in signal.layout.groups[group]}
    except FormatError:
        return []
    skeleton = clip.skeleton
    pairs = enumerate(skeleton.addresses())
    return [name for joint, name in pairs if not columns.isdisjoint(skeleton.columns(joint))]


def _recording(clip: Clip, unread: list[str]) -> JsonObject | None:
    """The recording; where the template is at fault, ``unread`` says so and the rest is shown."""
    try:
        return document_of(clip.recording)
    except FormatError as error:
        unread.append(f"recording: {error}")
        return None


def _times(clip: Clip, unread: list[str]) -> JsonObject | None:
    """The times of its frames; ``unread`` as above."""
    try:
        return time_facts(clip.timeline)
    except UnsupportedError:
        return None
    except FormatError as error:
        unread.append(f"times: {error}")
        return None


def _arrays(clip: Clip, unread: list[str]) -> list[JsonObject] | None:
    """What became of the arrays of the source, None where it has none; ``unread`` as above."""
    if clip.source is None or FORMATS[clip.source.format].arrays is None:
        return None
    try:
        source = clip.motion((0, 0)).source
        return arrays_of(source, [signal.name for signal in clip.signals])
    except FormatError as error:
        unread.append(f"arrays: {error}")
        return None


def _source_info(clip: Clip) -> JsonObject:
    source = clip.source
    if source is None:
        return {
            "source_mode": "none",
            "source_format": None,
            "source_path": None,
            "source_bytes": None,
            "source_sha256": None,
        }
    return {
        "source_mode": "parsed",
        "source_format": source.format,
        "source_path": source.path,
        "source_bytes": source.size,
        "source_sha256": source.sha256.hex(),
    }


def exceptions_info(container: Container, clip: Clip) -> JsonObject:
    """How many tokens are coded as exceptions, and their share."""
    n_exceptions = n_tokens = 0
    for signal in clip.signals:
        n_tokens += (
            signal.layout.n_frames * signal.layout.samples_per_frame * (signal.layout.n_channels)
        )
        for row in signal.rows:
            if not row.header.flags & GROUP_NOTES:
                continue
            table = container.table(row, signal.counts)
            wanted = [
                i
                for g in range(signal.counts.n_groups)
                if (i := table.group_notes(g)) is not None and table.lengths[i]
            ]
            if wanted:
                _, streams = container.streams(row, signal.counts, wanted)
                n_exceptions += sum(_count(streams[i]) for i in wanted)
    share = n_exceptions / n_tokens if n_tokens else 0.0
    return {"n_exceptions": n_exceptions, "exceptions_share": share}


def _count(notes: bytes) -> int:
    return len(parse(note_records.GroupNotes, notes, "group notes").exceptions)


def validate(file: File, clips: Sequence[Clip] | None = None) -> list[Problem]:
    """Every fault of the file, once: structure, checksums, values, sources, index.

    ``clips``: values and sources of these alone.
    """
    problems = structure_problems(file)
    for _, _, found in part_problems(file, clips):
        problems += found
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
    ``max_decoded`` and ``threads`` are those of ``mcz.open``. ``where``: check every checksum, but
    decode and restore only the clips that it takes, see ``File.find``; OptionError for none.
    ``quick``: check the checksums and the index alone, at the speed of the disk; all faults of a
    file that cannot be opened are told, too.
    ``jobs`` processes may work at once, by default one.
    """
    if quick:
        if where is not None:
            raise OptionError("a quick check is of the whole file; it takes no where")
        return quick_check(target)[1]
    with limited(jobs), open(target, max_decoded=max_decoded, threads=threads) as file:
        return validate(file, None if where is None else file.chosen(where=where))


def part_problems(file: File, clips: Sequence[Clip] | None = None) -> Iterator[Row]:
    """Kind, name and faults of every skeleton, clip and attachment, one after the other.

    ``clips``: of these alone, and of their skeletons.
    """
    items = [("skeletons", "")]
    items += [("clip", clip.name) for clip in (file if clips is None else clips)]
    items += [("attachment", name) for name in (file.attachments if clips is None else ())]
    items += [("recovery data", "")] if clips is None else []
    names = None if clips is None else [clip.name for clip in clips]
    with shared_out(_problems_of, file, items, names) as answers:
        for answer in answers:
            yield from answer()


def _problems_of(shared: tuple[File, Sequence[str] | None], item: tuple[str, str]) -> list[Row]:
    """The rows of ``part_problems`` for all skeletons, a clip or an attachment."""
    (file, names), (kind, name) = shared, item
    if kind == "clip":
        return [(kind, name, clip_problems(file, file.clips[name]))]
    if kind == "recovery data":
        return [(kind, *row) for row in recovery_problems(file.container)]
    if kind == "attachment":
        return [(kind, name, _attachment_problems(file, name))]
    return _skeleton_rows(file, None if names is None else [file.clips[name] for name in names])


def _skeleton_rows(file: File, clips: Sequence[Clip] | None) -> list[Row]:
    problems: list[Problem] = []
    rows: list[Row] = []
    for id_, skeleton in _guarded(problems, file, clips):
        found: list[Problem] = []
        _check(found, file, id_)
        rows.append(("skeleton", skeleton.name or id_.hex(), found))
    return [*rows, ("skeletons", "", problems)] if problems else rows


def _attachment_problems(file: File, name: str) -> list[Problem]:
    try:
        file.attachments[name].read()
    except MczError as error:
        offset = file.container.directory.attachments[name].parts[0].offset
        return [Problem(offset, "ATTA", remark_of(error))]
    return []


def _guarded(
    problems: list[Problem], file: File, clips: Sequence[Clip] | None
) -> list[tuple[bytes, Skeleton]]:
    try:
        ids = None if clips is None else file.skeleton_ids(clips)
        return [(id_, found) for id_, found in file.skeletons if ids is None or id_ in ids]
    except MczError as error:
        problems.append(Problem(0, "SKEL", remark_of(error)))
        return []


def _check(problems: list[Problem], file: File, id_: bytes) -> None:
    try:
        if file.skeleton(id_, with_source=True).source is not None:
            file.skeleton_bytes(id_)
    except MczError as error:
        offset = file.container.directory.shared[ChunkType.SKEL, id_].offset
        problems.append(Problem(offset, "SKEL", remark_of(error)))


def clip_problems(file: File, clip: Clip) -> list[Problem]:
    """The faults of one clip: its values and its restored source."""
    row: ClipRow = file.container.directory.clips[clip.name]
    found = [
        Problem(row.clip.offset, _clip_heading(error), remark_of(error), error.clip)
        for error in _clip_errors(clip)
    ]
    return list(dict.fromkeys(found))


def _clip_errors(clip: Clip) -> Iterator[MczError]:
    """What is wrong with each signal; one that is unsupported does not hide more."""
    found = _error(lambda: clip.signals)
    yield from found
    sound = not found
    for signal in clip.signals if sound else ():
        try:
            clip.check_values(signal.index)
        except MczError as error:
            sound = False
            yield error
            if isinstance(error, UnsupportedError):
                yield from _error(read_segments, clip.container, signal)
    if sound and clip.source is not None:
        yield from _error(clip.source_bytes)


def _error(work: Callable[..., object], *arguments: object) -> list[MczError]:
    try:
        work(*arguments)
    except MczError as error:
        return [error]
    return []


def _clip_heading(error: MczError) -> str:
    if isinstance(error, UnsupportedError):
        return "Codecs"
    return "CEND" if isinstance(error, ChecksumError) else "CLIP"
