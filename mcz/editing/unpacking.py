"""All files of an archive out of it again, each under its path, and only when it is whole."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path, PurePosixPath
from typing import Any

from mcz.container import payloads
from mcz.container.strict import check_path
from mcz.editing.outcomes import Outcome, Report
from mcz.editing.safe_names import Folder, PortableNames, notes_on
from mcz.errors import ExistsError, FormatError, MczError, OptionError
from mcz.reading.clip import Clip
from mcz.reading.fields import Where
from mcz.reading.file import File, open
from mcz.writing.atomic import replacing
from mcz.writing.clip_writer import Progress

NAMES = ("stored", "portable", "strict")  # what unpack does about names that are not portable


def unpack(
    target: Any,
    directory: str | os.PathLike[str],
    *,
    clips: Sequence[str] | None = None,
    where: Where | None = None,
    salvage: bool = False,
    force: bool = False,
    names: str = "stored",
    max_decoded: int | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Report:
    """Write every source file and attachment of an MCZ file below ``directory``.

    ``clips``: of these clips alone, and of their skeletons; ``where``: of those that it takes, see
    ``File.find``. Each file appears under its name only when it is whole and its hash is right. No
    symbolic link below ``directory`` is followed. Clips without a source are reported as skipped.
    With ``salvage`` the file may be damaged: what is whole is written, the rest is reported as
    damaged. ``max_decoded`` and ``threads`` are those of ``mcz.open``.

    ``names`` decides about names that some system cannot hold, or not beside another: "stored"
    writes them as they are, and refuses what this system or disk cannot hold; "portable" gives
    them others, which the outcomes tell; "strict" refuses them. One file never replaces another of
    the same archive.
    """
    if names not in NAMES:
        raise OptionError(f"names is {names!r}, not one of {', '.join(NAMES)}")
    folder, report = Folder(Path(directory)), Report()
    with open(target, salvage=salvage, max_decoded=max_decoded, threads=threads) as opened:
        file = File(opened.container.strictly())
        report.damage += opened.damage
        wanted, whole = file.chosen(clips, where), clips is None and where is None
        jobs = list(named_files(file) if whole else _files_of(file, wanted))
        renamed, written, notes = PortableNames(), set[str](), notes_on(name for name, _ in jobs)
        for done, (name, restore) in enumerate(jobs):
            try:
                as_name = str(safe_path(name))
                if names == "portable":
                    as_name = renamed(as_name)
                if names == "strict" and name in notes:
                    raise FormatError(notes[name])
                if name in written:
                    raise FormatError("another file in the archive has the same path")  # PATH-06
                data = restore()
                written.add(name)
                path = folder.place(as_name, force=force)
                with replacing(path, force=force, inputs=(target,)) as stream:
                    stream.write(data)
                folder.note(name, path)
                text = "" if as_name == name else f"as {as_name}"
                report.outcomes.append(Outcome(name, "restored", len(data), text))
            except (MczError, OSError) as error:
                result = "exists" if isinstance(error, ExistsError) else "failed"
                if salvage and isinstance(error, FormatError):
                    result = "damaged"
                report.outcomes.append(Outcome(name, result, 0, f"{name}: {error}"))
            if progress is not None:
                progress(done + 1, len(jobs), name)
        report.outcomes += _without_file(wanted)
    return report


def _without_file(clips: Iterable[Clip]) -> Iterator[Outcome]:
    """The clips that have no source file, or one without a name."""
    for clip in clips:
        with suppress(FormatError):  # it has failed already
            if clip.source is None or not clip.source.path:
                text = "it has no source file" if clip.source is None else "its file has no name"
                yield Outcome(clip.name, "skipped", 0, text)


def named_files(file: File, *, clips: bool = True) -> Iterator[tuple[str, Any]]:
    """Path and restoring function of every file that the archive holds under a name."""
    yield from _sources_of(file.clips.values() if clips else ())
    for attachment in file.attachments.values():
        yield attachment.name, attachment.read
    for name, (of, target) in file.aliases.items():
        yield name, _alias_reader(file, name, of, target)


def _sources_of(clips: Iterable[Clip]) -> Iterator[tuple[str, Any]]:
    for clip in clips:
        try:
            source = clip.source
        except FormatError as error:  # damage of one clip is no other's
            yield clip.name, partial(_fail, error)
            continue
        if source is not None and source.path:
            yield source.path, clip.source_bytes


def _files_of(file: File, clips: Sequence[Clip]) -> Iterator[tuple[str, Any]]:
    """The same of some clips: their sources, and the files of their skeletons."""
    yield from _sources_of(clips)
    skeletons = file.skeleton_ids(clips)
    for name, (of, target) in file.aliases.items():
        if of == payloads.OF_SKELETON and target in skeletons:
            yield name, _alias_reader(file, name, of, target)


def _fail(error: FormatError) -> bytes:
    raise error


def _alias_reader(file: File, name: str, of: int, target: bytes) -> Any:
    """What restores an alias; it raises FormatError where its target is not there."""
    if of == payloads.OF_SKELETON:
        return lambda: file.skeleton_bytes(target)

    def restore() -> bytes:
        table: Mapping[str, Any] = file.clips if of == payloads.OF_CLIP else file.attachments
        found = table.get(target.decode("utf-8", "replace"))
        if found is None:
            raise FormatError(f"alias {name!r} names {target!r}, which is not there")
        data: bytes = found.source_bytes() if of == payloads.OF_CLIP else found.read()
        return data

    return restore


def safe_path(name: str) -> PurePosixPath:
    """``name`` as a relative path; raises FormatError where it would leave the folder."""
    check_path(name, "archive")
    return PurePosixPath(name)
