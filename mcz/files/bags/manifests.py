"""The text of bags: manifests, ``bagit.txt`` and ``bag-info.txt``, both ways.

RFC 8493, section 2, is normative.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path, PurePosixPath

from mcz.errors import OptionError

PAYLOAD = "data"
DECLARATION = "bagit.txt"
INFO = "bag-info.txt"
ALGORITHMS = ("sha256", "sha512")  # that every tool knows: section 2.4
BLOCK = 1024 * 1024  # bytes that are hashed at a time
_LINES = re.compile(r"\r\n|\r|\n")  # names may hold what else ends a line elsewhere
_LINE = re.compile(r"([0-9A-Fa-f]+)[ \t]+\*?(\S.*)")
_TAG = re.compile(r"([^\s:][^:]*?)\s*:\s*(.*)")
_ESCAPES = {"%": "%25", "\n": "%0A", "\r": "%0D"}

Pairs = Iterable[tuple[str, str]]


def digests(path: Path, algorithms: Iterable[str] = ALGORITHMS) -> dict[str, str]:
    """The digests of a file, by algorithm, in hex."""
    hashes = {name: hashlib.new(name) for name in algorithms}
    with path.open("rb") as stream:
        while block := stream.read(BLOCK):
            for found in hashes.values():
                found.update(block)
    return {name: found.hexdigest() for name, found in hashes.items()}


def manifest_text(digest_of: Mapping[str, str]) -> str:
    """A manifest of the paths in ``digest_of``, in their order."""
    return "".join(f"{digest}  {_escaped(path)}\n" for path, digest in digest_of.items())


def read_manifest(text: str) -> Iterator[tuple[str, str]]:
    """Path and digest of each line; raises OptionError for a line that is none."""
    for number, line in enumerate(_LINES.split(text), 1):
        if not line.strip():
            continue
        found = _LINE.fullmatch(line)
        if found is None:
            raise OptionError(f"line {number} is no digest and path: {line[:80]!r}")
        yield _unescaped(found[2]), found[1].lower()


def is_inside(path: str) -> bool:
    """Return True if a path of a manifest stays in the bag on every system."""
    pure = PurePosixPath(path)
    odd = pure.is_absolute() or ".." in pure.parts or "\\" in path or "\0" in path
    return bool(pure.parts) and not odd and ":" not in pure.parts[0] and pure.parts[0] != "~"


def tags_text(pairs: Pairs) -> str:
    """``bag-info.txt`` and the like; raises OptionError for what cannot be one of its lines."""
    lines = []
    for name, value in pairs:
        if not name.strip() or name != name.strip() or re.search(r"[:\r\n]", name):
            raise OptionError(f"{name!r} is no name of a line of {INFO}")
        if re.search(r"[\r\n]", value) or value != value.strip():
            raise OptionError(f"{INFO}: {name}: {value!r} is not one line of text")
        lines.append(f"{name}: {value}\n")
    return "".join(lines)


def read_tags(text: str) -> list[tuple[str, str]]:
    """Names and values, lines that are folded put together; raises OptionError."""
    pairs: list[tuple[str, str]] = []
    for number, line in enumerate(_LINES.split(text), 1):
        if not line.strip():
            continue
        if line[0] in " \t" and pairs:
            pairs[-1] = pairs[-1][0], f"{pairs[-1][1]} {line.strip()}"
            continue
        found = _TAG.fullmatch(line.rstrip())
        if found is None:
            raise OptionError(f"line {number} is no name and value: {line[:80]!r}")
        pairs.append((found[1], found[2]))
    return pairs


def _escaped(path: str) -> str:
    return re.sub(r"[%\r\n]", lambda found: _ESCAPES[found[0]], path)


def _unescaped(path: str) -> str:
    return re.sub(r"%(0[AaDd]|25)", lambda found: chr(int(found[1], 16)), path)
