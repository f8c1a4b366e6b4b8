"""Checks within chunks: of a strict pass, and of files of the profile small.

Faults that only decoding shows are found where clips are decoded. SPEC.md, "Strict reading",
"QUAL", "META", "COPY" and "Limits and profiles", are normative.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import PurePosixPath

from mcz.container import payloads
from mcz.container.chunks import Chunk, ChunkType
from mcz.container.copies import check_copies, parse_copies
from mcz.container.dictionary_deflate import is_packed
from mcz.container.directory import Directory
from mcz.container.limits import Profile
from mcz.container.metadata import parse_meta
from mcz.container.model_records import parse_skeleton
from mcz.errors import FormatError, LimitError
from mcz.model.numbers import GridKind
from mcz.model.schema import Record, parse

Templates = Mapping[bytes, int]  # id of a SRCE -> its source format
# The source formats of the registry, by the kind of their content.
OF_SKELETONS, OF_CLIPS = frozenset({1}), frozenset({*range(2, 15), 16, 17})


def is_plain_path(name: str) -> bool:
    """Return True for a relative path that stays below its folder on every system."""
    parts = name.split("/")
    # PATH-01, PATH-02, PATH-03, PATH-04
    odd = any(part in ("", ".", "..") for part in parts) or "\\" in name or "\0" in name
    return not (odd or PurePosixPath(name).is_absolute() or ":" in parts[0])  # PATH-05


def check_path(name: str, where: str) -> None:
    if not is_plain_path(name):
        raise FormatError(f"path {name!r} is not a plain relative path", where=where)


def check_skeleton(
    plain: bytes, where: str, directory: Directory, templates: Templates, profile: Profile
) -> bool:
    """Check a SKEL that is not packed; return whether it has a source file of its own."""
    fields = parse(payloads.Skel, plain, where, profile.counts)
    parse_skeleton(fields, profile, where)
    if fields.base is not None:
        _refer(directory, ChunkType.SKEL, fields.base, where)  # SKEL-02
    if fields.source is not None:
        _check_source(fields.source, where, directory, templates, OF_CLIPS)
    return bool(fields.source)


def _check_source(
    source: payloads.ClipSource | payloads.SkeletonSource,
    where: str,
    directory: Directory,
    templates: Templates,
    others: frozenset[int],
) -> None:
    """``others``: the formats of the other kind of content."""
    id_ = bytes(source.template)
    _refer(directory, ChunkType.SRCE, id_, where)  # GRAM-03
    if templates.get(id_, source.format) != source.format:  # CLIP-03, SKEL-04
        raise FormatError(
            f"source format is {source.format}, but its SRCE has {templates[id_]}", where=where
        )
    if source.format in others:  # CLIP-04, SKEL-03
        raise FormatError(
            f"source format {source.format} is of the other sort of source", where=where
        )


def check_clip(
    fields: payloads.Clip, where: str, directory: Directory, templates: Templates
) -> bool:
    """Check the references and names of CLIP; return whether it has a source file."""
    _refer(directory, ChunkType.SKEL, fields.skeleton, where)  # GRAM-02
    if fields.source is not None:
        _check_source(fields.source, where, directory, templates, OF_SKELETONS)
        if fields.source.path:
            check_path(fields.source.path, where)
    keys = [pair.key for pair in fields.metadata]
    if len(keys) != len(set(keys)):  # CLIP-02, CLIP-21
        raise FormatError(f"a key of the metadata occurs twice: {sorted(keys)}", where=where)
    return bool(fields.source)


def _refer(directory: Directory, kind: bytes, id_: bytes, where: str) -> None:
    if (kind, bytes(id_)) not in directory.shared:
        raise FormatError(f"no earlier {kind.decode()} has the id {bytes(id_).hex()}", where=where)


def check_target(fields: payloads.Alia, where: str, sourced: Collection[tuple[int, bytes]]) -> None:
    """Check that the target of an alias precedes it, and can be restored."""
    if (fields.of, bytes(fields.target)) not in sourced:  # GRAM-04
        raise FormatError(
            f"chunk {where}: its target {fields.target!r} is no earlier clip or skeleton with "
            "a source"
        )


def check_ancillary(
    chunk: Chunk,
    payload: bytes,
    file_bytes: int,
    directory: Directory,
    before: Sequence[Chunk],
    payload_of: Callable[[Chunk], bytes] | None,
) -> None:
    """Check ``chunk`` of a file of ``file_bytes``, after ``directory`` and the chunks ``before``.

    Raises FormatError. Without ``payload_of``, which reads earlier chunks again, copies are not
    compared with them.
    """
    if chunk.type == ChunkType.QUAL:
        parse(payloads.Qual, payload, chunk.label)  # QUAL-02
    elif chunk.type == ChunkType.META:
        if not directory.clips:  # META-01
            raise FormatError(f"chunk {chunk.label} precedes the first clip")
        parse_meta(payload, chunk, file_bytes)
    elif chunk.type == ChunkType.COPY:
        copies = parse_copies(payload, chunk, file_bytes)
        if payload_of is not None:
            check_copies(copies, chunk, before, payload_of)


CODECS = {0, 1}  # raw and fast
ENCODED: dict[bytes, type[Record]] = {
    ChunkType.SRCE: payloads.Srce,
    ChunkType.ATTA: payloads.Atta,
    ChunkType.META: payloads.Meta,
}
ABSENT = {ChunkType.INDX, ChunkType.COPY, ChunkType.MODL}


def check_plain(kind: bytes, payload: bytes, where: str) -> None:
    """Raise LimitError for a chunk that a file of the profile small cannot have."""
    record = ENCODED.get(kind)
    if record is not None:
        packed = vars(parse(record, payload, where))["flags"] & payloads.ENCODING != payloads.STORED
    else:
        packed = kind == ChunkType.SKEL and is_packed(payload, where)
    if packed:  # LIMIT-22
        raise LimitError("profile small does not allow packed contents", where=where)
    if kind in ABSENT:  # LIMIT-23
        raise LimitError("profile small does not allow this chunk", where=where)
    if kind == ChunkType.CLIP:
        _check_clip(parse(payloads.Clip, payload, where), where)


def _check_clip(fields: payloads.Clip, where: str) -> None:
    for signal in fields.signals:
        if signal.codec not in CODECS:  # LIMIT-20
            raise LimitError(
                f"profile small allows only codecs raw and fast, not codec {signal.codec}",
                where=where,
            )
        if any(run.grid.kind == GridKind.PRINTED for run in signal.grids):  # LIMIT-21
            raise LimitError("profile small does not allow grid PRINTED", where=where)
