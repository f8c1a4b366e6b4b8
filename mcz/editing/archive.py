"""Archives: many files into one, more files into it, and all of them out again."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import partial
from itertools import chain
from pathlib import Path, PurePosixPath
from typing import Any

from mcz.codecs import chosen
from mcz.container import payloads
from mcz.container.reader import Container
from mcz.container.strict import check_path
from mcz.editing.appending import growing
from mcz.editing.outcomes import Outcome, Report
from mcz.editing.safe_names import Folder, PortableNames, notes_on
from mcz.errors import AccessError, ExistsError, FormatError, MczError, OptionError, SourceError
from mcz.formats import FORMATS
from mcz.reading.clip import Clip
from mcz.reading.fields import Where
from mcz.reading.file import File, open
from mcz.reading.source_files import read_bytes
from mcz.threads import limited
from mcz.writing.atomic import replacing
from mcz.writing.clip_writer import Progress
from mcz.writing.draft import Digest, Draft
from mcz.writing.entry import Entry, Terms
from mcz.writing.file import profile_of
from mcz.writing.inputs import refuse_inputs
from mcz.writing.names import check_name

NAMES = ("stored", "portable", "strict")  # what unpack does about names that are not portable


def pack(
    directory: str | os.PathLike[str],
    target: Any,
    *,
    codec: str | None = None,
    effort: str | None = None,
    params: Mapping[str, Any] | None = None,
    rate: float | None = None,
    unit: str | None = None,
    up: str | None = None,
    verbatim: bool = False,
    keep_all: bool = False,
    force: bool = False,
    archive: bool = False,
    copies: bool = True,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Report:
    """Pack every motion file below ``directory`` into one MCZ file.

    A file that cannot be parsed is reported and left out; ``verbatim`` keeps it as an attachment,
    ``keep_all`` also keeps files of other kinds so, which are skipped otherwise. Paths are stored
    relative to ``directory``. ``effort``, ``copies`` and ``threads`` are those of ``mcz.write``. An
    earlier MCZ file of the target's name is no part of the new one; any other file that the target
    would replace is refused, even with ``force``.
    """
    root = Path(directory)
    if not root.is_dir():
        raise OptionError(f"{root}: not a folder")
    paths, others = _files_below(root, target)
    if not keep_all:
        paths, left = _motion_files(paths)
        others += [_left_out(path, root) for path in left]
    verbatim = verbatim or keep_all
    coded = chosen(codec, effort)
    terms = Terms(coded, params, rate=rate, unit=unit, verbatim=verbatim, up=up)
    entries = [Entry(path, path.relative_to(root).as_posix(), terms) for path in paths]
    inputs = (*paths, *(params or {}).values())
    with limited(threads), replacing(target, force=force, inputs=inputs) as stream:
        draft = Draft(stream, profile_of(archive), copies=copies)
        report = _write_entries(draft, entries, progress)
        refuse_inputs(target, _inputs_of(entries))
        draft.finish()
    report.size = draft.writer.offset
    report.note(notes_on(entry.name for entry in entries))
    report.outcomes += sorted(others, key=lambda outcome: os.fsencode(outcome.path))
    return report


def _motion_files(paths: Sequence[Path]) -> tuple[list[Path], list[Path]]:
    """The files of source formats, and the others."""
    known = {suffix for source_format in FORMATS.values() for suffix in source_format.suffixes}
    motions = [path for path in paths if path.suffix.lower() in known]
    return motions, [path for path in paths if path.suffix.lower() not in known]


def _left_out(path: Path, root: Path) -> Outcome:
    name = path.relative_to(root).as_posix()
    return Outcome(name, "skipped", _size_of(path), "no motion file; --keep-all keeps it")


def _inputs_of(entries: Sequence[Entry]) -> Iterator[Path]:
    """The files that entries were made of, their skeletons among them."""
    return chain.from_iterable(entry.inputs for entry in entries)


def _size_of(path: Path) -> int:
    with suppress(OSError, ValueError):
        return path.stat().st_size
    return 0


def _files_below(root: Path, target: Any) -> tuple[list[Path], list[Outcome]]:
    """The files below ``root`` but for an earlier ``target``, and what else there is, in order."""
    own = Path(target).resolve() if isinstance(target, (str, os.PathLike)) else None
    if own is not None and own.suffix.lower() != ".mcz":
        own = None  # a file to be packed, which may not be replaced
    files: list[Path] = []
    others: list[Outcome] = []

    def say(path: Path, result: str, text: str) -> None:
        others.append(Outcome(path.relative_to(root).as_posix(), result, 0, text))

    def unreadable(error: OSError) -> None:
        if Path(error.filename) == root:
            raise AccessError(f"{root}: {error.strerror or error}") from None
        say(Path(error.filename), "failed", f"{error.filename}: {error.strerror or error}")

    for folder, folders, names in os.walk(root, onerror=unreadable):
        for path in (Path(folder, name) for name in (*folders, *names)):
            if path.is_symlink():
                say(path, "skipped", "a symbolic link; only files are packed")
            elif path.is_file():
                if path.resolve() != own:
                    files.append(path)
            elif not path.is_dir():
                say(path, "skipped", "neither a file nor a folder")

    def key(name: str) -> bytes:
        return os.fsencode(name)

    files.sort(key=lambda path: key(path.relative_to(root).as_posix()))
    return files, others


def append(
    sources: Sequence[str | os.PathLike[str]],
    target: str | os.PathLike[str],
    *,
    codec: str | None = None,
    effort: str | None = None,
    params: Mapping[str, Any] | None = None,
    skeleton: str | os.PathLike[str] | None = None,
    rate: float | None = None,
    unit: str | None = None,
    up: str | None = None,
    verbatim: bool = False,
    root: str | os.PathLike[str] | None = None,
    salvage: bool = False,
    force: bool = False,
    copies: bool | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Report:
    """Add files after the last valid FOOT of an MCZ file; what it held stays readable throughout.

    Each is stored under its path relative to ``root``, or without one under its name alone. A file
    that the target restores already under the same path is left out as "present"; another one
    under a path that is taken is refused. When a source cannot be added, nothing is.

    A target whose writing was cut short is taken up from its last valid FOOT. Where whole clips
    lie behind that, ``salvage`` keeps them and ``force`` drops them; otherwise a FormatError names
    them. Where its end is damaged, one of the two has to be given. ``threads`` is that of
    ``mcz.write``, and so is ``copies``, of all that has none yet; None: where the file has some.
    Raises AccessError while another process is appending, OptionError where the target is a source
    itself.
    """
    refuse_inputs(target, (*sources, skeleton, *(params or {}).values()))
    coded = chosen(codec, effort)
    terms = Terms(coded, params, skeleton, rate, unit, verbatim, up=up)
    entries = [Entry(Path(s), _name_below(s, root), terms) for s in sources]
    with limited(threads), growing(Path(target), salvage=salvage, force=force) as growth:
        container = growth.container
        wanted = bool(container.copies()) if copies is None else copies
        draft = Draft(
            growth.added,
            container.profile,
            container.directory,
            _stored_paths(container),
            copies=wanted,
            uncopied=container.uncopied() if wanted else (),
        )
        report = _write_entries(draft, entries, progress)
        if report.failures:
            raise SourceError("; ".join(o.message for o in report.failures))
        refuse_inputs(target, _inputs_of(entries))
        if growth.tail.kept or any(outcome.result != "present" for outcome in report.outcomes):
            draft.finish()
    report.size = Path(target).stat().st_size
    report.note(notes_on(draft.paths))
    tail = growth.tail
    text = "it lay whole behind the last FOOT of a file whose writing was cut short"
    result = "salvaged" if tail.kept else "dropped"
    report.outcomes += [Outcome(name, result, 0, text) for name in tail.names]
    return report


def _name_below(path: str | os.PathLike[str], root: str | os.PathLike[str] | None) -> str:
    if root is None:
        return Path(path).name
    try:
        return Path(path).resolve().relative_to(Path(root).resolve()).as_posix()
    except ValueError:
        raise OptionError(f"{path} does not lie below {root}") from None


def _stored_paths(container: Container) -> dict[str, Digest]:
    """What the file restores under each path: the SHA-256, or what finds it."""
    file = File(container)
    paths: dict[str, Digest] = {}
    for clip in file.clips.values():
        with suppress(FormatError):  # what is damaged cannot be restored
            if clip.source is not None and clip.source.path:
                paths.setdefault(clip.source.path, clip.source.sha256)
    for name, restore in named_files(file, clips=False):
        paths.setdefault(name, partial(_digest_of, restore))
    return paths


def _digest_of(restore: Callable[[], bytes]) -> bytes:
    return hashlib.sha256(restore()).digest()


def _write_entries(draft: Draft, entries: Sequence[Entry], progress: Progress | None) -> Report:
    report = Report()
    seen: dict[bytes, tuple[int, bytes]] = {}
    for done, entry in enumerate(entries):
        size = _size_of(entry.path)
        try:
            result = _write_entry(draft, entry, seen)
            notes = tuple(filter(None, (entry.remark, *entry.notes)))
            report.outcomes.append(Outcome(entry.name, result, size, entry.reason, notes))
        except MczError as error:
            report.outcomes.append(Outcome(entry.name, "failed", size, str(error)))
        if progress is not None:
            progress(done + 1, len(entries), entry.name)
    return report


def _write_entry(draft: Draft, entry: Entry, seen: dict[bytes, tuple[int, bytes]]) -> str:
    """Write one file, or only its name where the same bytes are there already."""
    digest = hashlib.sha256(read_bytes(entry.path)).digest()
    is_amc = entry.path.suffix.lower() == ".amc"  # its values hang on the ASF beside it
    writer = draft.writer
    if digest in seen and not is_amc and not draft.holds(entry.name, digest):
        check_name(entry.name)
        with draft.step():
            writer.alias(entry.name, *seen[digest])
        draft.paths[entry.name] = digest
        return "alias"
    clips, attachments = len(writer.directory.clips), len(writer.directory.attachments)
    result = entry.write(draft)
    if len(writer.directory.clips) > clips:
        name = next(reversed(writer.directory.clips))
        seen[digest] = (payloads.OF_CLIP, name.encode())
    elif len(writer.directory.attachments) > attachments:
        seen[digest] = (payloads.OF_ATTACHMENT, entry.name.encode())
    return result


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
