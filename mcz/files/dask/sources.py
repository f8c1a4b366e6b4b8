"""Source files below a folder or a URL, as the machines of a cluster list and read them."""

from __future__ import annotations

import os
import posixpath
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory
from typing import Any

from mcz.container.source import file_system
from mcz.errors import AccessError, MczError, OptionError, SourceError
from mcz.files.editing.batch_report import Outcome
from mcz.files.editing.coded_parts import Ask, Part, coded
from mcz.files.editing.folders import files_below, size_of
from mcz.hints import Remark
from mcz.model.types import Target
from mcz.sources import wants_skeleton


@dataclass(frozen=True, slots=True)
class Found:
    """A file below the root: its relative path, and its size in bytes."""

    name: str
    size: int


@dataclass(frozen=True, slots=True)
class FarAsk:
    """A file below ``root`` that is to be coded; ``beside``: names of the ASFs that it may need."""

    root: str
    ask: Ask
    beside: tuple[str, ...]


def is_url(root: str) -> bool:
    return "://" in root


def listed(root: str, target: Target) -> tuple[list[Found], list[Outcome]]:
    """The files below ``root`` but for an earlier ``target``, in the order of an archive.

    Raises OptionError where it is no folder, AccessError where it cannot be listed.
    """
    if not is_url(root):
        folder = Path(root)
        if not folder.is_dir():
            raise OptionError("not a folder", path=root)
        paths, others = files_below(folder, target)
        found = [Found(path.relative_to(folder).as_posix(), size_of(path)) for path in paths]
        return found, others
    fs, base = _opened(root)
    own = _opened(str(target))[1] if is_url(str(target)) else None
    try:
        details = fs.find(base, detail=True)
    except Exception as error:  # each kind of store has errors of its own
        raise AccessError(str(error), path=root) from None
    found = [
        Found(posixpath.relpath(path, base), int(entry["size"] or 0))
        for path, entry in details.items()
        if entry["type"] == "file" and path != own and not path.endswith("/")
    ]
    if not found:
        raise OptionError("no file is below it", path=root)
    return sorted(found, key=lambda one: os.fsencode(one.name)), []


def _opened(url: str) -> tuple[Any, str]:
    """The file system of a URL and the path of its folder in it; raises OptionError."""
    fs, path = file_system(url)
    return fs, path.rstrip("/")


def skeletons_beside(name: str, skeletons: list[str]) -> tuple[str, ...]:
    """ASFs that ``mcz.sources.text.find`` tries for an AMC: in its folder and a sibling ``asf``."""
    path = PurePosixPath(name)
    if not wants_skeleton(name):
        return ()
    beside, above = path.parent, path.parent.parent

    def is_near(folder: PurePosixPath) -> bool:
        is_sibling = folder.parent == above != beside and folder.name.lower() == "asf"
        return folder == beside or is_sibling

    return tuple(asf for asf in skeletons if is_near(PurePosixPath(asf).parent))


def coded_there(state: object, ask: FarAsk) -> Part:
    """The part of a file, made by whoever can read it; raises as ``coded`` does."""
    with ExitStack() as stack:
        root = ask.root
        if is_url(root):
            own = stack.enter_context(TemporaryDirectory(prefix="mcz-"))
            root = str(Path(own, "root"))  # around it there is nothing that may be taken for an ASF
            _fetch(ask, Path(root))
        try:
            part = coded(state, replace(ask.ask, path=Path(root, ask.ask.name)))
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
    """``text`` about a copy, said of the file itself."""
    if isinstance(text, Remark):
        return Remark(_named(text.words, copy, root), text.hint)
    return text.replace(copy, root.rstrip("/"))


def _fetch(ask: FarAsk, folder: Path) -> None:
    """Copy the file, and the skeletons that it may need, below ``folder``."""
    fs, base = _opened(ask.root)
    for name in (ask.ask.name, *ask.beside):
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            path.write_bytes(fs.cat_file(f"{base}/{name}"))
        except Exception as error:  # each kind of store has errors of its own
            raise SourceError(f"{ask.root.rstrip('/')}/{name}: {error}") from None
