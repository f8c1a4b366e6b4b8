"""Files that take the place of those that came from the same paths: ``mcz append --replace``."""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from mcz.container.metadata_keys import SAID
from mcz.files.editing.metadata_edit import set_metadata
from mcz.files.editing.reorganize import delete_clips
from mcz.files.editing.stored_files import stored_files
from mcz.files.reading.file import File, open
from mcz.files.reading.source_files import read_bytes

Said = dict[str, dict[str, str]]  # what is said of clips, by the paths of their files
Named = Sequence[tuple[Path, str]]  # files, each with its path in the archive


@contextmanager
def superseding(target: Path, named: Named) -> Iterator[Path]:
    """The path of a file to append ``named`` to: where others came from their paths, of a copy.

    The copy lacks those, and takes the place of ``target`` when the block ends well. What was said
    of a clip is said of the one that came in its place. Raises OptionError where a further name
    has the same content.
    """
    old: list[str] = []
    if named:
        with open(target) as file:
            old, said = _old(file, named)
    if not old:
        yield target
        return
    with tempfile.TemporaryDirectory(prefix=f".{target.name[:48]}.", dir=target.parent) as folder:
        copy = Path(folder, target.name)
        delete_clips(target, old, output=copy)
        yield copy
        with open(copy) as file:
            by_path = {clip.source.path: clip.name for clip in file.clips.values() if clip.source}
        changes = {
            by_path[path]: words for path, words in said.items() if words and path in by_path
        }
        if changes:
            set_metadata(copy, changes)
        os.chmod(copy, target.stat().st_mode)
        os.replace(copy, target)


def _old(file: File, named: Named) -> tuple[list[str], Said]:
    """The things that came from the paths of the files, and their metadata by path."""
    paths, _ = stored_files(file.container)
    clips = {clip.source.path: clip for clip in file.clips.values() if clip.source is not None}
    old: list[str] = []
    said: Said = {}
    for path, name in named:
        there = paths.get(name)
        if there is None:
            continue
        digest = there if isinstance(there, bytes) else there()
        if digest == hashlib.sha256(read_bytes(path)).digest():
            continue
        clip = clips.get(name)
        old.append(name if clip is None else clip.name)
        if clip is not None:
            words = {key: value for key, value in clip.metadata.items() if _is_said(key)}
            said[name] = words
    return old, said


def _is_said(key: str) -> bool:
    return (key in SAID and key != "mtime") or key.startswith("x-")
