"""The document of ``mcz info``: a file, or a source file, described."""

from __future__ import annotations

import hashlib
import math
import os
import warnings
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mcz.codecs.basis_models import known_model_name
from mcz.container.chunks import ChunkType
from mcz.container.reader import Container
from mcz.container.segments import GROUP_NOTES, GroupNotes
from mcz.errors import FormatError, SkeletonWarning, UnsupportedError
from mcz.files.reading.clip import Clip
from mcz.files.reading.clips import Where
from mcz.files.reading.file import File
from mcz.files.reading.read import read_motion
from mcz.files.reading.signal_info import SignalInfo
from mcz.files.reading.sizes import (
    Sizes,
    clip_sizes,
    file_parts,
    file_ratio,
    models_used,
    ratios_of,
)
from mcz.files.reading.source_files import load, read_skeleton, recording, source_facts
from mcz.kinematics.rest_pose import figure_height
from mcz.model.clock import time_facts
from mcz.model.motion import Motion, Skeleton
from mcz.model.schema import parse
from mcz.model.types import JsonObject
from mcz.sources import FORMATS, Format, arrays_of

if TYPE_CHECKING:
    from mcz.sources.c3d.recording import Recording


def info(file: File, names: Sequence[str] | None = None, where: Where | None = None) -> JsonObject:
    """The document that ``mcz info --json`` prints; its keys are stable.

    ``names``, ``where``: only these clips and their skeletons, see ``File.select_clips``.
    """
    container, whole = file.container, names is None and where is None
    chosen = file.select_clips(names, where)
    sizes = [clip_sizes(container, clip) for clip in chosen]
    clips = [_clip_info(file, clip, own) for clip, own in zip(chosen, sizes, strict=True)]
    shared = container.directory.shared
    ids = {id_ for _, id_ in shared} if whole else file.skeleton_ids(chosen)
    used = {model["id"] for clip in clips for model in clip["models"]}
    models = [id_ for id_ in container.directory.ids(ChunkType.MODL) if whole or id_.hex() in used]
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
    """Facts of ``mcz info`` on the joints of a skeleton."""
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
    """The entry of a clip in the document of ``info``."""
    rate, source = clip.frame_rate, clip.source
    beside, unread = _facts_beside_values(clip)
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
        "times": beside["times"],
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
            {"id": id_.hex(), "name": known_model_name(id_)}
            for signal in clip.signals
            for id_ in models_used(signal)
        ],
        "source_mode": "parsed" if source else "none",
        "source_format": source.format if source else None,
        **source_facts(source),
        "recording": beside["recording"],
        "arrays": beside["arrays"],
        **exceptions_info(file.container, clip),
        "quality": clip.quality,
        "damage": [*clip.damage, *unread],
    }
    return document | ratios_of(file, clip, sizes)


def _exact_joints(clip: Clip, signal: SignalInfo) -> list[str]:
    """The joints that have exact channels besides lossy ones, if known."""
    try:
        columns = {c for group in signal.exact for c in signal.layout.groups[group]}
    except FormatError:
        return []
    skeleton = clip.skeleton
    pairs = enumerate(skeleton.addresses())
    return [name for joint, name in pairs if not columns.isdisjoint(skeleton.columns(joint))]


def _facts_beside_values(clip: Clip) -> tuple[JsonObject, list[str]]:
    """Facts in source and signals, each None if its bytes are damaged; and the faults."""
    facts: JsonObject = {"times": None, "recording": None, "arrays": None}
    unread = []
    for key, read in (("times", _times), ("recording", _recording), ("arrays", _arrays)):
        try:
            facts[key] = read(clip)
        except FormatError as error:
            unread.append(f"{key}: {error}")
    return facts, unread


def _times(clip: Clip) -> JsonObject | None:
    with suppress(UnsupportedError):
        return time_facts(clip.timeline)
    return None


def _recording(clip: Clip) -> JsonObject | None:
    return document_of(clip.recording)


def _arrays(clip: Clip) -> list[JsonObject] | None:
    if clip.source is None or FORMATS[clip.source.format].arrays is None:
        return None
    return arrays_of(clip.motion((0, 0)).source, [signal.name for signal in clip.signals])


def exceptions_info(container: Container, clip: Clip) -> JsonObject:
    """Number and share of tokens that are coded as exceptions."""
    n_exceptions = n_tokens = 0
    for signal in clip.signals:
        n_tokens += (
            signal.layout.n_frames * signal.layout.samples_per_frame * (signal.layout.n_channels)
        )
        for row in signal.rows:
            if not row.header.flags & GROUP_NOTES:
                continue
            table = container.table(row, signal.counts)
            indices = [
                i
                for g in range(signal.counts.n_groups)
                if (i := table.group_notes(g)) is not None and table.lengths[i]
            ]
            if indices:
                _, streams = container.streams(row, signal.counts, indices)
                notes = (parse(GroupNotes, streams[i], "group notes") for i in indices)
                n_exceptions += sum(len(one.exceptions) for one in notes)
    share = n_exceptions / n_tokens if n_tokens else 0.0
    return {"n_exceptions": n_exceptions, "exceptions_share": share}


def source_info(
    path: str | os.PathLike[str], skeleton: str | os.PathLike[str] | None = None
) -> JsonObject:
    """The document that ``mcz info --json`` prints for a source file.

    Its keys are those of ``report.info`` that apply without MCZ; ``format`` is the file's.
    ``skeleton`` is the ASF of an AMC. Raises SourceError or OptionError.
    """
    path = Path(path)
    source_format, data = load(path)
    document: JsonObject = {"format": source_format.name, "file_bytes": len(data)}
    if source_format.is_skeleton:
        return document | {"skeletons": [_skeleton_facts(read_skeleton(path))], "clips": []}
    result = read_motion(path, skeleton, data=data)
    if result.remark:
        warnings.warn(f"{path}: {result.remark}", SkeletonWarning, stacklevel=2)
    motion = result.motion
    if motion.source is not None and source_format.is_table:  # there are several formats of .csv
        source_format = FORMATS[motion.source.format]
        document["format"] = source_format.name
    clip = _clip_facts(motion, source_format, path.name, data)
    clip["skeleton_file"] = _file_of(result.skeleton)
    return document | {"skeletons": [_skeleton_facts(motion.skeleton)], "clips": [clip]}


def _file_of(skeleton: Skeleton | None) -> str | None:
    return skeleton.source.path if skeleton is not None and skeleton.source else None


def _skeleton_facts(skeleton: Skeleton) -> JsonObject:
    return {"name": skeleton.name, **joint_facts(skeleton)}


def _clip_facts(motion: Motion, source_format: Format, name: str, data: bytes) -> JsonObject:
    rate, signal = motion.frame_rate, motion.signals[0]
    n_invalid = 0 if signal.mask is None else int(signal.mask.size - signal.mask.sum())
    n_exceptions = sum(len(s.exceptions) for s in motion.signals)
    n_tokens = sum(s.values.size for s in motion.signals)
    return {
        "name": motion.name,
        "n_frames": motion.n_frames,
        "n_channels": signal.n_channels,
        "n_joints": motion.skeleton.n_joints,
        "frame_rate": None if rate is None else float(rate),
        "frame_rate_exact": motion.frame_rate_exact,
        "times": time_facts(motion.timeline),
        "metadata": dict(motion.metadata),
        "signals": [
            {"name": s.name, "n_channels": s.n_channels, "samples_per_frame": s.samples_per_frame}
            for s in motion.signals
        ],
        "n_invalid": n_invalid,
        "recording": document_of(recording(motion)),
        "arrays": arrays_of(motion.source, [s.name for s in motion.signals]),
        "source_format": source_format.name,
        "source_path": name,
        "source_bytes": len(data),
        "source_sha256": hashlib.sha256(data).hexdigest(),
        "n_exceptions": n_exceptions,
        "exceptions_share": n_exceptions / n_tokens if n_tokens else 0.0,
    }


def document_of(recording: Recording | None) -> JsonObject | None:
    """The recording as JSON: unknown values and NaN become None; texts may be empty."""
    if recording is None:
        return None
    document: JsonObject = _plain(asdict(recording))
    return document | {"up_axis": recording.up_axis}


def _plain(thing: object) -> Any:
    if isinstance(thing, dict):
        return {key: _plain(value) for key, value in thing.items()}
    if isinstance(thing, (list, tuple)):
        return [_plain(value) for value in thing]
    if isinstance(thing, float) and not math.isfinite(thing):
        return None
    return thing
