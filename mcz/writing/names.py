"""Names in a file: of clips, of skeletons whose own files it restores, of paths."""

from __future__ import annotations

import os
from collections.abc import Mapping
from itertools import chain, count
from pathlib import Path

from mcz.container import payloads
from mcz.container.directory import Directory
from mcz.container.metadata_keys import KEYS, PRIVATE
from mcz.container.strict import is_plain_path
from mcz.container.writer import Writer
from mcz.errors import MotionError


def alias_once(writer: Writer, name: str, id_: bytes) -> None:
    """Let ``name`` be that of the skeleton ``id_``, unless it is another's already."""
    check_name(name)
    if name not in writer.directory.aliases:
        writer.alias(name, payloads.OF_SKELETON, id_)


def check_name(path: str) -> None:
    """Raise MotionError where a file cannot be stored and restored under ``path``."""
    try:
        path.encode("utf-8")
    except UnicodeEncodeError:
        raise MotionError(
            f"the name {os.fsencode(path)!r} is not UTF-8, as MCZ keeps names; rename the file"
        ) from None
    if not is_plain_path(path):
        raise MotionError(f"source path {path!r} is not relative and plain; rename the file")


METADATA_KEYS = tuple(KEYS)


def check_metadata(metadata: Mapping[str, str], name: str) -> None:
    """Raise MotionError for a key that neither SPEC.md's registry has nor is private."""
    for key in metadata:
        if key not in METADATA_KEYS and not key.startswith(PRIVATE):
            raise MotionError(
                f"metadata key {key!r} is not registered; registered are "
                f"{', '.join(METADATA_KEYS)}, and private keys begin with {PRIVATE!r}",
                clip=name,
            )


def clip_name(path: str, directory: Directory) -> str:
    """The relative path without its suffix; with it, or a number, where that name is taken."""
    names = chain((Path(path).with_suffix("").as_posix(), path), (f"{path}#{n}" for n in count(2)))
    return next(name for name in names if name not in directory.clips)
