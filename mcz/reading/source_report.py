"""What a source file says of itself, as ``report.info`` has it of an MCZ file."""

from __future__ import annotations

import hashlib
import os
import warnings
from pathlib import Path

from mcz.clock import time_facts
from mcz.errors import SkeletonWarning
from mcz.formats import FORMATS, Format, arrays_of
from mcz.motion import Motion, Skeleton
from mcz.reading.recording import recording
from mcz.reading.recording_report import document_of
from mcz.reading.report import joint_facts
from mcz.reading.skeletons import take
from mcz.reading.source_files import load, read_skeleton
from mcz.types import JsonObject


def source_info(
    path: str | os.PathLike[str], skeleton: str | os.PathLike[str] | None = None
) -> JsonObject:
    """The document that ``mcz info --json`` prints of a source file.

    Its keys are those of ``report.info`` that have a meaning without MCZ; ``format`` is that of the
    file. ``skeleton`` is the ASF of an AMC. Raises SourceError or OptionError.
    """
    path = Path(path)
    source_format, data = load(path)
    document: JsonObject = {"format": source_format.name, "file_bytes": len(data)}
    if source_format.is_skeleton:
        return document | {"skeletons": [_skeleton_facts(read_skeleton(path))], "clips": []}
    taken = take(path, skeleton, data=data)
    if taken.remark:
        warnings.warn(f"{path}: {taken.remark}", SkeletonWarning, stacklevel=2)
    motion = taken.motion
    if motion.source is not None and source_format.is_table:  # of .csv there are several
        source_format = FORMATS[motion.source.format]
        document["format"] = source_format.name
    clip = _clip_facts(motion, source_format, path.name, data)
    clip["skeleton_file"] = _file_of(taken.skeleton)
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
