"""Vectors of manifest.json, the requests for each, and the capabilities that a decoder declares."""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
VECTORS = HERE / "vectors"
GROUPS = ("valid", "uncommon", "invalid")
FORMATS = ("asf", "amc", "bvh", "c3d", "c3d-outputs", "trc", "mot", "sto", "motive", "vicon", "csv")
FORMATS += ("npy", "npz", "pickle", "torch", "mvnx")
MAX_LINE = 2**20  # bytes of the JSON line
SPARE_OUTPUT = 2**25  # bytes that an answer may have beyond what is expected
# Classes of SPEC.md, "Classes of conformance": the codecs of each, None for all.
CLASSES: dict[str, frozenset[str] | None] = {
    "core": frozenset({"raw", "fast"}),
    "archival": frozenset({"raw", "fast", "best"}),
    "lossy": frozenset({"raw", "fast", "best", "posewave"}),
    "research": None,
}
SIZES = {"<f8": 8, "<i8": 8, "u1": 1}  # bytes of a value

Vector = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Request:
    """One call of the decoder: ``expected`` are rows with a sha256, what ``listing`` names."""

    vector: Vector
    arguments: tuple[str, ...]
    listing: str  # "arrays" or "sources"
    expected: list[dict[str, Any]]

    @property
    def path(self) -> Path:
        return VECTORS / str(self.vector["file"])

    @property
    def words(self) -> str:
        """The arguments as a person reads them."""
        return " ".join(self.arguments)

    @property
    def max_output(self) -> int:
        """Bytes that the answer may have; more is a fault by itself."""
        expected = sum(_size(row) for row in self.expected)
        return MAX_LINE + expected + SPARE_OUTPUT


def _size(row: dict[str, Any]) -> int:
    if "shape" not in row:
        return int(row["bytes"])
    size = SIZES[row["dtype"]]
    for length in row["shape"]:
        size *= int(length)
    return size


def load() -> dict[str, Any]:
    """manifest.json."""
    manifest: dict[str, Any] = json.loads((HERE / "manifest.json").read_text("utf-8"))
    return manifest


def load_manifest() -> list[Vector]:
    """The vectors of manifest.json."""
    vectors: list[Vector] = load()["vectors"]
    return vectors


def all_requests(vector: Vector) -> Iterator[Request]:
    """The calls that ``vector`` asks for, of a decoder that can do everything."""
    for mode in vector["modes"]:
        arguments = ("--source",) if mode == "sources" else ()
        yield Request(vector, arguments, mode, vector["expected"].get(mode, []))
    for part in vector.get("parts", []):
        yield Request(vector, tuple(part["arguments"]), "arrays", part["arrays"])


def requests(vector: Vector, options: Collection[str]) -> Iterator[Request]:
    """The calls that ``vector`` asks for, of a decoder with these optional arguments."""
    can = Capabilities(options=frozenset(options))
    return (request for request in all_requests(vector) if not can.lacks(request))


@dataclass(frozen=True, slots=True)
class Capabilities:
    """Capabilities that a decoder declares; None means all."""

    options: frozenset[str] = frozenset()
    codecs: frozenset[str] | None = None
    sources: frozenset[str] | None = None  # formats whose files it restores
    version: str | None = None  # of the format

    @classmethod
    def parse(cls, text: bytes) -> Capabilities:
        """Parse the line of ``--capabilities``; ValueError if it is malformed."""
        document = json.loads(text)
        if not isinstance(document, dict):
            raise ValueError("the capabilities are no object")
        version = document.get("format")
        is_known = isinstance(version, str) and re.fullmatch(r"[0-9]+\.[0-9]+", version)
        if version is not None and not is_known:
            raise ValueError(f"format is {version!r}, no version such as 0.9")
        sources = _words(document, "sources")
        if sources is not None and not sources <= set(FORMATS):
            raise ValueError(f"sources are {', '.join(sorted(sources))}; known: {FORMATS}")
        declared = cls(
            options=_words(document, "options") or frozenset(),
            codecs=_words(document, "codecs"),
            sources=sources,
            version=version,
        )
        return declared.within(document["class"]) if "class" in document else declared

    def within(self, name: str) -> Capabilities:
        """These without what a class lacks; ValueError where there is no such class."""
        if name not in CLASSES:
            raise ValueError(f"class is {name!r}; known: {', '.join(CLASSES)}")
        own = CLASSES[name]
        codecs = self.codecs if own is None else own & (own if self.codecs is None else self.codecs)
        sources: frozenset[str] | None = frozenset() if name == "core" else self.sources
        return replace(self, codecs=codecs, sources=sources)

    def lacks(self, request: Request) -> list[str]:
        """List in words the capabilities that ``request`` needs and this decoder lacks."""
        vector = request.vector
        missing = [
            word
            for word in request.arguments
            if word.startswith("--") and word != "--source" and word not in self.options
        ]
        if self.codecs is not None:
            missing += [
                f"codec {name}" for name in vector.get("codecs", []) if name not in self.codecs
            ]
        if self.sources == frozenset() and request.listing == "sources":
            missing.append("sources")
        elif self.sources is not None and request.listing == "sources":
            missing += [f"source {name}" for name in restored(vector) if name not in self.sources]
        since = vector.get("since", "0.0")
        if self.version is not None and _version(since) > _version(self.version):
            missing.append(f"format {since}")
        return missing

    def is_full(self, vectors: Sequence[Vector]) -> bool:
        """True if only optional arguments keep the decoder from answering all of ``vectors``."""
        requests = (request for vector in vectors for request in all_requests(vector))
        lacks = (lack for request in requests for lack in self.lacks(request))
        return all(lack.startswith("--") for lack in lacks)


def restored(vector: Vector) -> list[str]:
    """The formats of the files that a decoder must restore for the sources of ``vector``."""
    if "formats" in vector:
        return list(vector["formats"])
    expected = vector["expected"].get("sources")
    if expected is None:
        return list(FORMATS)
    return sorted({format_of(row["path"]) for row in expected} & set(FORMATS))


def format_of(path: str) -> str:
    """The suffix of ``path``, without its dot."""
    return path.rpartition(".")[2].lower()


def _words(document: dict[str, Any], key: str) -> frozenset[str] | None:
    words = document.get(key)
    if words is None:
        return None
    if not isinstance(words, list) or not all(isinstance(word, str) for word in words):
        raise ValueError(f"{key} is no list of strings: {words!r}")
    return frozenset(words)


def _version(text: str) -> tuple[int, ...]:
    return tuple(map(int, text.split(".")))


def select(vectors: Sequence[Vector], patterns: Sequence[str]) -> list[Vector]:
    """The vectors that one of ``patterns`` means, all without any.

    A pattern is a group, a codec (or a folder named like it), the id of a requirement, a glob of
    paths or ids, or else a part of the path. ValueError names one that means no vector.
    """
    codecs = {name for vector in vectors for name in vector.get("codecs", [])}
    chosen: set[str] = set()
    for pattern in patterns:
        meant = {vector["file"] for vector in vectors if _means(pattern, vector, codecs)}
        if not meant:
            raise ValueError(f"no vector is meant by {pattern!r}")
        chosen |= meant
    return [vector for vector in vectors if not patterns or vector["file"] in chosen]


def _means(pattern: str, vector: Vector, codecs: Collection[str]) -> bool:
    file, ids = vector["file"], vector.get("requirements", [])
    if pattern in GROUPS:
        return bool(vector["group"] == pattern)
    if pattern in codecs:
        return pattern in vector.get("codecs", []) or f"/{pattern}/" in file
    if re.search(r"[*?\[]", pattern):
        names = [file, file.removesuffix(".mcz"), *ids]
        return any(fnmatchcase(name, pattern) for name in names)
    if pattern.partition("/")[0] in GROUPS:  # "valid/raw" is a part of "invalid/raw", too
        return bool(file.startswith(pattern))
    return pattern in ids or pattern in file
