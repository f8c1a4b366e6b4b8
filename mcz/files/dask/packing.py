"""``mcz.dask.pack``: files are read and coded on the machines of a cluster, and joined here."""

from __future__ import annotations

import os
import posixpath
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory
from typing import Any, cast

from mcz.container.limits import profile_named
from mcz.container.source import file_system
from mcz.errors import AccessError, MczError, OptionError, SourceError
from mcz.files.dask.cluster import Cluster, connect
from mcz.files.editing.archive import write_in_turn
from mcz.files.editing.batch_report import Outcome, Report
from mcz.files.editing.coded_parts import Part, PartRequest, RemotePart, encode_part, request_of
from mcz.files.editing.folders import NO_MOTION, files_below, motion_files, notes_on, size_of
from mcz.files.jobs import Answer
from mcz.files.reading.source_files import SourceOptions
from mcz.files.writing.atomic import WriteTransaction, replacing
from mcz.files.writing.source_encoder import SourceEncoder, WritingOptions, encoding_options
from mcz.hints import Remark
from mcz.model.types import Params, Progress, Target
from mcz.sources import wants_skeleton


def pack(
    root: str | os.PathLike[str],
    target: Target,
    client: object = None,
    *,
    codec: str | None = None,
    effort: str | None = None,
    params: Params | None = None,
    rate: float | None = None,
    force_rate: bool = False,
    unit: str | None = None,
    up: str | None = None,
    arrays: str | None = None,
    model: str | os.PathLike[str] | None = None,
    verbatim: bool = False,
    keep_all: bool = False,
    force: bool = False,
    profile: str = "base",
    copies: bool = True,
    progress: Progress | None = None,
) -> Report:
    """Pack every motion file below ``root`` into one MCZ file, as ``mcz.pack``.

    ``root`` and ``target`` are paths or URLs for fsspec ("s3://bucket/takes"); all machines can
    read ``root``, only this one writes ``target``. ``client`` is a ``distributed.Client``, the
    address of a scheduler, or None for the client of the process. The bytes equal those of
    ``mcz.pack``. Raises OptionError, and WorkerError where the cluster has no workers; a file whose
    machines are lost repeatedly is reported as failed.
    """
    root = os.fspath(root)
    files, others = list_files(root, target)
    taken, left = _chosen(files, keep_all)
    options = SourceOptions(
        rate=rate,
        force_rate=force_rate,
        unit=unit,
        up=up,
        arrays=arrays,
        model=model,
        verbatim=verbatim or keep_all,
        flat=True,
    )
    encoding = encoding_options(codec, effort, params)
    paths = [os.path.join(root, one.name) for one in taken] if "://" not in root else []  # noqa: PTH118
    inputs = (*paths, *encoding.params.values())
    report, writing = Report(), WritingOptions(force, profile_named(profile), copies)
    skeletons = [one.name for one in files if one.name.lower().endswith(".asf")]
    entries = [SourceEncoder(Path(root, one.name), one.name, options, encoding) for one in taken]
    asks = (
        RemoteFile(
            root, request_of(entry, writing.profile), skeletons_beside(entry.name, skeletons)
        )
        for entry in entries
    )
    with connect(client) as used, replacing(target, force=force, inputs=inputs) as stream:
        transaction = WriteTransaction(stream, writing.profile, copies=writing.copies)
        with closing(Cluster(used).in_order(encode_remotely, asks, None)) as answers:
            given = cast(Iterator[Answer[Part]], answers)  # no item is None
            made = zip(entries, given, taken, strict=True)
            parts = (RemotePart(entry, answer, one.size) for entry, answer, one in made)
            write_in_turn(transaction, parts, len(taken), report, progress, {})
        transaction.finish()
    report.size = transaction.writer.offset
    report.add_messages(notes_on(one.name for one in taken))
    report.outcomes += sorted([*others, *left], key=lambda one: os.fsencode(one.path))
    return report


def _chosen(files: Sequence[Entry], keep_all: bool) -> tuple[list[Entry], list[Outcome]]:
    motions, _ = motion_files([Path(one.name) for one in files])
    known = {path.as_posix() for path in motions}
    left = [Outcome(o.name, "skipped", o.size, NO_MOTION) for o in files if o.name not in known]
    return (list(files), []) if keep_all else ([o for o in files if o.name in known], left)


@dataclass(frozen=True, slots=True)
class Entry:
    """A file below the root: its relative path, and its size in bytes."""

    name: str
    size: int


@dataclass(frozen=True, slots=True)
class RemoteFile:
    """A file below ``root`` to encode; ``beside``: names of the ASFs that it may need."""

    root: str
    ask: PartRequest
    beside: tuple[str, ...]


def is_url(root: str) -> bool:
    return "://" in root


def list_files(root: str, target: Target) -> tuple[list[Entry], list[Outcome]]:
    """The files below ``root`` except an earlier ``target``, in the order of an archive.

    Raises OptionError where it is not a folder, AccessError where it cannot be listed.
    """
    if not is_url(root):
        folder = Path(root)
        if not folder.is_dir():
            raise OptionError("not a folder", path=root)
        paths, others = files_below(folder, target)
        files = [Entry(path.relative_to(folder).as_posix(), size_of(path)) for path in paths]
        return files, others
    fs, base = _opened(root)
    own = _opened(str(target))[1] if is_url(str(target)) else None
    try:
        details = fs.find(base, detail=True)
    except Exception as error:  # each kind of store has errors of its own
        raise AccessError(str(error), path=root) from None
    files = [
        Entry(posixpath.relpath(path, base), int(entry["size"] or 0))
        for path, entry in details.items()
        if entry["type"] == "file" and path != own and not path.endswith("/")
    ]
    if not files:
        raise OptionError("no file is below it", path=root)
    return sorted(files, key=lambda one: os.fsencode(one.name)), []


def _opened(url: str) -> tuple[Any, str]:
    """The file system of a URL and the path of its folder in it; raises OptionError."""
    fs, path = file_system(url)
    return fs, path.rstrip("/")


def skeletons_beside(name: str, skeletons: list[str]) -> tuple[str, ...]:
    """ASFs that an AMC may have: in its folder and a sibling ``asf``."""
    path = PurePosixPath(name)
    if not wants_skeleton(name):
        return ()
    beside, above = path.parent, path.parent.parent

    def is_near(folder: PurePosixPath) -> bool:
        is_sibling = folder.parent == above != beside and folder.name.lower() == "asf"
        return folder == beside or is_sibling

    return tuple(asf for asf in skeletons if is_near(PurePosixPath(asf).parent))


def encode_remotely(state: object, ask: RemoteFile) -> Part:
    """The part of a file, made by a machine that can read it; raises as ``encode_part``."""
    with ExitStack() as stack:
        root = ask.root
        if is_url(root):
            own = stack.enter_context(TemporaryDirectory(prefix="mcz-"))
            root = str(Path(own, "root"))  # the folder around it has no ASF
            _fetch(ask, Path(root))
        try:
            part = encode_part(state, replace(ask.ask, path=Path(root, ask.ask.name)))
        except MczError as error:
            if error.path is not None:
                error.path = _named(error.path, root, ask.root)
            raise
    return replace(
        part,
        reason=_named(part.reason, root, ask.root),
        remark=_named(part.remark, root, ask.root),
        notes=tuple(_named(note, root, ask.root) for note in part.notes),
        inputs=(),
    )


def _named(text: str, copy: str, root: str) -> str:
    """``text`` about a copy, with the name of the file itself."""
    if isinstance(text, Remark):
        return Remark(_named(text.words, copy, root), text.hint)
    return text.replace(copy, root.rstrip("/"))


def _fetch(ask: RemoteFile, folder: Path) -> None:
    """Copy the file, and the skeletons that it may need, below ``folder``."""
    fs, base = _opened(ask.root)
    for name in (ask.ask.name, *ask.beside):
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            path.write_bytes(fs.cat_file(f"{base}/{name}"))
        except Exception as error:  # each kind of store has errors of its own
            raise SourceError(f"{ask.root.rstrip('/')}/{name}: {error}") from None
