"""Bags: folders of files with the checksums of each, checked and made.

RFC 8493 (BagIt), section 2, is normative for manifests, ``bagit.txt`` and ``bag-info.txt``.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import date
from pathlib import Path, PurePosixPath

from mcz.errors import AccessError, ExistsError, FormatError, OptionError, reason_of
from mcz.files.reading.faults import quick_check
from mcz.model.checks import PATH, PATHS, check_arguments
from mcz.model.text_format import count_text, is_utf8

PAYLOAD = "data"
DECLARATION = "bagit.txt"
INFO = "bag-info.txt"
ALGORITHMS = ("sha256", "sha512")  # known to every tool: section 2.4
BLOCK = 1024 * 1024  # bytes that are hashed at a time
_LINES = re.compile(r"\r\n|\r|\n")  # names may contain other line ends
_LINE = re.compile(r"([0-9A-Fa-f]+)[ \t]+\*?(\S.*)")
_TAG = re.compile(r"([^\s:][^:]*?)\s*:\s*(.*)")
_ESCAPES = {"%": "%25", "\n": "%0A", "\r": "%0D"}

Pairs = Iterable[tuple[str, str]]


def digests(path: Path, algorithms: Iterable[str] = ALGORITHMS) -> dict[str, str]:
    """The digests of a file, by algorithm, in hex."""
    hashes = {name: hashlib.new(name) for name in algorithms}
    with path.open("rb") as stream:
        while block := stream.read(BLOCK):
            for digest in hashes.values():
                digest.update(block)
    return {name: digest.hexdigest() for name, digest in hashes.items()}


def manifest_text(digest_of: Mapping[str, str]) -> str:
    """A manifest of the paths in ``digest_of``, in their order."""
    return "".join(f"{digest}  {_escape_path(path)}\n" for path, digest in digest_of.items())


def read_manifest(text: str) -> Iterator[tuple[str, str]]:
    """Path and digest of each line; raises OptionError for a bad line."""
    for number, line in enumerate(_LINES.split(text), 1):
        if not line.strip():
            continue
        match = _LINE.fullmatch(line)
        if match is None:
            raise OptionError(f"line {number} is not a digest and a path: {line[:80]!r}")
        yield _unescape_path(match[2]), match[1].lower()


def is_inside(path: str) -> bool:
    """Return True if a path of a manifest stays in the bag on every system."""
    pure = PurePosixPath(path)
    is_odd = pure.is_absolute() or ".." in pure.parts or "\\" in path or "\0" in path
    return bool(pure.parts) and not is_odd and ":" not in pure.parts[0] and pure.parts[0] != "~"


def tags_text(pairs: Pairs) -> str:
    """``bag-info.txt`` and the like; raises OptionError for a bad line."""
    lines = []
    for name, value in pairs:
        if not name.strip() or name != name.strip() or re.search(r"[:\r\n]", name):
            raise OptionError(f"{name!r} is not a valid name in {INFO}")
        if re.search(r"[\r\n]", value) or value != value.strip():
            raise OptionError(f"{INFO}: {name}: {value!r} is not one line of text")
        lines.append(f"{name}: {value}\n")
    return "".join(lines)


def read_tags(text: str) -> list[tuple[str, str]]:
    """Names and values, with folded lines joined; raises OptionError."""
    pairs: list[tuple[str, str]] = []
    for number, line in enumerate(_LINES.split(text), 1):
        if not line.strip():
            continue
        if line[0] in " \t" and pairs:
            pairs[-1] = pairs[-1][0], f"{pairs[-1][1]} {line.strip()}"
            continue
        match = _TAG.fullmatch(line.rstrip())
        if match is None:
            raise OptionError(f"line {number} is not a name and a value: {line[:80]!r}")
        pairs.append((match[1], match[2]))
    return pairs


def _escape_path(path: str) -> str:
    return re.sub(r"[%\r\n]", lambda match: _ESCAPES[match[0]], path)


def _unescape_path(path: str) -> str:
    return re.sub(r"%(0[AaDd]|25)", lambda match: chr(int(match[1], 16)), path)


VERSIONS = ("0.93", "0.94", "0.95", "0.96", "0.97", "1.0")
KNOWN = ("md5", "sha1", "sha224", "sha256", "sha384", "sha512")
_MANIFEST = re.compile(r"(tag)?manifest-([a-z0-9]+)\.txt")


@dataclass(slots=True)
class BagCheck:
    """Result of a validation: ``problems``, empty for a valid bag.

    ``files``: the paths of the payload, of ``n_bytes``. ``info``: the lines of bag-info.txt.
    ``algorithms``: those of the payload's manifests.
    """

    folder: Path
    version: str = ""
    info: list[tuple[str, str]] = field(default_factory=list)
    algorithms: list[str] = field(default_factory=list)
    files: list[str] = field(default_factory=list)
    n_bytes: int = 0
    problems: list[str] = field(default_factory=list)


def is_bag(folder: str | os.PathLike[str]) -> bool:
    return (Path(folder) / DECLARATION).is_file()


@check_arguments(folder=PATH)
def check_bag(
    folder: str | os.PathLike[str], progress: Callable[[int, int, str], object] | None = None
) -> BagCheck:
    """Compare each file of a bag with each manifest; lists missing, extra and changed files.

    Raises OptionError if the folder is not a bag, AccessError if a file cannot be read.
    """
    check = BagCheck(Path(folder))
    if not is_bag(folder):
        raise OptionError(f"not a bag: {DECLARATION} is missing", path=folder)
    try:
        _BagValidator(check, progress).run()
    except OSError as error:
        raise AccessError(reason_of(error), path=error.filename or folder) from None
    return check


class _BagValidator:
    def __init__(self, check: BagCheck, progress: Callable[[int, int, str], object] | None) -> None:
        self.check, self.progress = check, progress
        self.encoding = "utf-8"

    def run(self) -> None:
        check = self.check
        self._read_declaration()
        check.files = sorted(self._list_files(PAYLOAD))
        payload, tags = self._read_manifests()
        check.algorithms = sorted(payload)
        if not payload:
            self._fault("no manifest-ALGORITHM.txt of an algorithm that is known")
        self._check_listing(payload)
        self._compare(payload, tags)
        self._check_oxum()
        if (check.folder / "fetch.txt").is_file():
            self._fault("fetch.txt: the bag has files elsewhere; fetch them first")

    def _fault(self, text: str) -> None:
        self.check.problems.append(text)

    def _text(self, name: str) -> str:
        data = (self.check.folder / name).read_bytes()
        try:
            return data.decode("utf-8-sig" if self.encoding == "utf-8" else self.encoding)
        except UnicodeDecodeError as error:
            self._fault(f"{name}: no {self.encoding} at byte {error.start}")
            return data.decode("utf-8", "replace")

    def _tags(self, name: str) -> list[tuple[str, str]]:
        try:
            return read_tags(self._text(name))
        except OptionError as error:
            self._fault(f"{name}: {error}")
            return []

    def _read_declaration(self) -> None:
        tags = dict(self._tags(DECLARATION))
        self.check.version = tags.get("BagIt-Version", "")
        if self.check.version not in VERSIONS:
            self._fault(f"{DECLARATION}: BagIt-Version {self.check.version!r} is not known")
        encoding = tags.get("Tag-File-Character-Encoding", "")
        try:
            "".encode(encoding or "none")
            self.encoding = encoding.lower()
        except LookupError:
            self._fault(f"{DECLARATION}: Tag-File-Character-Encoding {encoding!r} is not known")
        if (self.check.folder / INFO).is_file():
            self.check.info = self._tags(INFO)

    def _list_files(self, name: str) -> Iterable[str]:
        root = self.check.folder
        if not (root / name).is_dir():
            self._fault(f"no folder {name}")
        for folder, _, names in os.walk(root / name):
            for file in names:
                yield (Path(folder) / file).relative_to(root).as_posix()

    def _read_manifests(self) -> tuple[dict[str, dict[str, str]], dict[str, dict[str, str]]]:
        """The digests in the manifests of payload and tags, by algorithm and path."""
        payload: dict[str, dict[str, str]] = {}
        tags: dict[str, dict[str, str]] = {}
        for name in sorted(path.name for path in self.check.folder.iterdir()):
            matched = _MANIFEST.fullmatch(name)
            if matched is None:
                continue
            if matched[2] not in KNOWN or matched[2] not in hashlib.algorithms_available:
                self._fault(f"{name}: the algorithm {matched[2]} is not known")
                continue
            (tags if matched[1] else payload)[matched[2]] = self._read_rows(name, not matched[1])
        return payload, tags

    def _read_rows(self, name: str, of_payload: bool) -> dict[str, str]:
        rows: dict[str, str] = {}
        try:
            for path, digest in read_manifest(self._text(name)):
                path = path.removeprefix("./")
                if not is_inside(path) or path.startswith(f"{PAYLOAD}/") != of_payload:
                    self._fault(f"{name}: {path!r} does not belong there")
                elif rows.setdefault(path, digest) != digest:
                    self._fault(f"{name}: {path} is listed twice, with two digests")
        except OptionError as error:
            self._fault(f"{name}: {error}")
        return rows

    def _check_listing(self, payload: dict[str, dict[str, str]]) -> None:
        """Check that every file is in every manifest, or in one before version 1.0."""
        everywhere = self.check.version == "1.0"
        for path in self.check.files:
            absent = [name for name, rows in payload.items() if path not in rows]
            if absent and (everywhere or len(absent) == len(payload)):
                self._fault(f"{path} is not in manifest-{absent[0]}.txt")

    def _compare(self, payload: dict[str, dict[str, str]], tags: dict[str, dict[str, str]]) -> None:
        stated: dict[str, dict[str, str]] = {}
        for manifests in (payload, tags):
            for algorithm, rows in manifests.items():
                for path, digest in rows.items():
                    stated.setdefault(path, {})[algorithm] = digest
        for done, (path, digest_of) in enumerate(stated.items()):
            if self.progress is not None:
                self.progress(done, len(stated), path)
            file = self.check.folder / path
            if not file.is_file():
                self._fault(f"{path} is missing")
                continue
            for algorithm, digest in digests(file, digest_of).items():
                if digest != digest_of[algorithm]:
                    self._fault(f"{path}: its {algorithm} is {digest}, not {digest_of[algorithm]}")

    def _check_oxum(self) -> None:
        check = self.check
        check.n_bytes = sum((check.folder / path).stat().st_size for path in check.files)
        oxum = f"{check.n_bytes}.{len(check.files)}"
        for name, value in check.info:
            if name.lower() == "payload-oxum" and value != oxum:
                self._fault(f"{INFO}: Payload-Oxum is {value}, there is {oxum}")


SUFFIX = ".mcz"
OXUM = "Payload-Oxum"  # bytes and files of the payload, which we count ourselves


@check_arguments(files=PATHS, folder=PATH)
def bag(
    files: Sequence[str | os.PathLike[str]],
    folder: str | os.PathLike[str],
    info: Mapping[str, str] | None = None,
    *,
    software: str = "mcz",
) -> Path:
    """Make ``folder``, which must not exist, a bag with copies of ``files``; return it.

    ``info``: lines of ``bag-info.txt``, such as {"Source-Organization": "..."}; Bagging-Date is
    today unless given, Bag-Software-Agent is ``software``. Every ``.mcz`` is checked quickly first.
    The folder gets its name when it is complete. Raises FormatError for a damaged ``.mcz``,
    ExistsError if ``folder`` exists, OptionError for two files of one name and a name with % or
    a line end, AccessError if a file cannot be read or written.
    """
    target, paths = Path(folder), [Path(file) for file in files]
    lines = _info_lines(dict(info or {}), software)
    if os.path.lexists(target):
        raise ExistsError("already exists; a bag must be a new folder", path=target)
    _check_files(paths)
    try:
        temporary = Path(
            tempfile.mkdtemp(prefix=f".{target.name[:48]}.", suffix=".part", dir=target.parent)
        )
    except OSError as error:
        raise AccessError(reason_of(error), path=target) from None
    try:
        _fill(temporary, paths, lines)
        umask = os.umask(0)
        os.umask(umask)
        temporary.chmod(0o777 & ~umask)  # mkdtemp made it private
        if os.path.lexists(target):
            raise ExistsError("already exists; a bag must be a new folder", path=target)
        temporary.rename(target)
    except BaseException as error:
        with suppress(OSError):
            shutil.rmtree(temporary)
        if isinstance(error, OSError):
            raise AccessError(reason_of(error), path=target) from error
        raise
    return target


def _info_lines(info: dict[str, str], software: str) -> list[tuple[str, str]]:
    if any(name.lower() == OXUM.lower() for name in info):
        raise OptionError(f"{OXUM} is computed, so it cannot be set")
    present = {name.lower() for name in info}
    ours = {"Bagging-Date": date.today().isoformat(), "Bag-Software-Agent": software}
    lines = [*info.items(), *(pair for pair in ours.items() if pair[0].lower() not in present)]
    tags_text(lines)  # raises before any work
    return lines


def _check_files(paths: Sequence[Path]) -> None:
    if not paths:
        raise OptionError("a bag needs at least one file")
    names: dict[str, Path] = {}
    for path in paths:
        other = names.setdefault(path.name.casefold(), path)
        if other is not path:
            raise OptionError(f"{other} and {path} would have the same name in the bag")
        if odd := set(path.name) & set("%\r\n"):  # RFC 8493 escapes them, but some tools do not
            raise OptionError(
                f"the name contains {'%' if '%' in odd else 'a line end'}, which tools for bags "
                "treat differently; rename the file",
                path=path,
            )
        if not is_utf8(path.name):  # as manifests are
            raise OptionError("the name is not valid UTF-8; rename the file", path=path)
        if not path.is_file():
            raise AccessError(f"{'not a file' if path.exists() else 'no such file'}", path=path)
    for path in paths:
        if path.suffix.lower() != SUFFIX:
            continue
        problems = quick_check(path)[1]
        if problems:
            more = f" and {len(problems) - 1} more" if len(problems) > 1 else ""
            text = f"{count_text(len(problems), 'fault')}: {problems[0].message}{more}"
            raise FormatError(f"damaged, so it was not added to the bag; {text}", path=path)


def _fill(folder: Path, paths: Sequence[Path], lines: list[tuple[str, str]]) -> None:
    data = folder / PAYLOAD
    data.mkdir()
    by_algorithm: dict[str, dict[str, str]] = {name: {} for name in ALGORITHMS}
    size = 0
    for path in sorted(paths, key=lambda path: path.name):
        copy = data / path.name
        shutil.copyfile(path, copy)
        _sync(copy)
        size += copy.stat().st_size
        if _add_digests(by_algorithm, f"{PAYLOAD}/{path.name}", copy) != digests(path):
            raise AccessError("the file changed while it was copied", path=path)
    tags = {
        DECLARATION: "BagIt-Version: 1.0\nTag-File-Character-Encoding: UTF-8\n",
        INFO: tags_text([*lines, (OXUM, f"{size}.{len(paths)}")]),
    }
    tags |= {f"manifest-{name}.txt": manifest_text(rows) for name, rows in by_algorithm.items()}
    manifests: dict[str, dict[str, str]] = {name: {} for name in ALGORITHMS}
    for name, text in tags.items():
        _write(folder / name, text)
        _add_digests(manifests, name, folder / name)
    for name, rows in manifests.items():
        _write(folder / f"tagmanifest-{name}.txt", manifest_text(rows))


def _add_digests(by_algorithm: dict[str, dict[str, str]], name: str, path: Path) -> dict[str, str]:
    digest_of = digests(path)
    for algorithm, digest in digest_of.items():
        by_algorithm[algorithm][name] = digest
    return digest_of


def _write(path: Path, text: str) -> None:
    path.write_bytes(text.encode("utf-8"))
    _sync(path)


def _sync(path: Path) -> None:
    with path.open("rb") as stream:
        os.fsync(stream.fileno())
