"""No output takes the place of an input, under whatever name, and whoever forces it."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterable
from urllib.parse import unquote, urlsplit

from mcz.errors import OptionError

LOCAL = ("file", "local")  # protocols of fsspec whose files are those of this machine


def refuse_inputs(target: object, inputs: Iterable[object]) -> None:
    """Raise OptionError where ``target`` is one of ``inputs``, by its file and not by its name.

    Each is a path, an fsspec target, a stream or anything else, which is no file. Links of both
    sorts lead to the same file; a device, a pipe or what does not exist yet is nobody's input.
    """
    target_is = _identity(target)
    if target_is is None:
        return
    for source in inputs:
        if _identity(source) == target_is:
            name = _name(target)
            other = f" ({_name(source)})" if _name(source) != name else ""
            raise OptionError(f"{name}: it is the input itself{other}; name another output")


def _name(file: object) -> str:
    return str(file if isinstance(file, (str, os.PathLike)) else getattr(file, "name", "a stream"))


def _identity(file: object) -> object:
    """What tells a file from all others; None for what is no file."""
    if isinstance(file, (str, os.PathLike)):
        path = os.fspath(file)
        if isinstance(path, str) and "://" in path:
            url = urlsplit(path)
            if url.scheme not in LOCAL:
                return path
            path = unquote(url.path)
        return _stat_of(path)
    try:
        number = getattr(file, "fileno", None)
        return None if number is None else _stat_of(number())
    except (OSError, ValueError):  # a stream of memory, or a closed one
        return None


def _stat_of(file: str | bytes | int) -> tuple[int, int] | None:
    try:
        found = os.stat(file)  # noqa: PTH116 - of a path or a number
    except (OSError, ValueError):  # ValueError: a name with a zero byte
        return None
    return (found.st_dev, found.st_ino) if stat.S_ISREG(found.st_mode) else None
