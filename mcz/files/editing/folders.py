"""Folders on disk: files to pack, names that every system can hold, and files written safely."""

from __future__ import annotations

import os
import re
import stat
import unicodedata
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path, PurePosixPath

from mcz.errors import AccessError, ExistsError, OptionError, reason_of, remark_of
from mcz.files.editing import Outcome
from mcz.files.reading.clips import MOST_NAMES, list_some
from mcz.files.writing.atomic import replacing
from mcz.hints import Hint, Remark
from mcz.model.types import Target
from mcz.sources import FORMATS

ODD = re.compile(r'[<>:"|?*\\]')
# Controls, what turns the direction of text, line ends and other characters that are not seen; but
# not the joiners that some scripts and emoji are spelled with.
HIDDEN = re.compile(
    "[\x00-\x1f\x7f-\x9f\xad\u061c\u180e\u200b\u200e\u200f\u2028-\u202e\u2060-\u206f\ufeff"
    "\ufff9-\ufffb\U000e0001-\U000e007f]"
)
DEVICES = re.compile(r"(?i)(con|prn|aux|nul|conin\$|conout\$|(com|lpt)[0-9¹²³])[ ]*(\..*)?")
LONGEST = 255  # bytes of UTF-8 that a part of a path may have


def fault_of(part: str) -> str:
    """Name the fault of a path's part that is invalid on some systems; "" for none."""
    if match := HIDDEN.search(part) or ODD.search(part):
        return f"it has {match[0]!a}"
    if DEVICES.fullmatch(part):
        return "it names a device"
    if part != part.rstrip(" ."):
        return f"it ends with {part[-1]!r}"
    if _size_of(part) > LONGEST:
        return f"it is longer than {LONGEST}"
    return ""


def _size_of(part: str) -> int:
    return len(part.encode("utf-8", "surrogatepass"))


def fold_name(name: str) -> str:
    """Fold a name as disks that ignore case or accents do."""
    if name.isascii():
        return name.lower()
    return unicodedata.normalize("NFC", unicodedata.normalize("NFKC", name).casefold())


def notes_on(names: Iterable[str], of: Collection[str] | None = None) -> dict[str, str]:
    """Reasons by path, for each that is invalid on some systems, alone or next to another.

    ``of``: the paths to check, None: all.
    """
    notes: dict[str, str] = {}
    originals: dict[str, str] = {}
    for name in names:
        is_asked = of is None or name in of
        for part in PurePosixPath(name).parts if is_asked else ():
            if fault := fault_of(part):
                who = "unpack does not write" if HIDDEN.search(part) else "Windows cannot hold"
                notes.setdefault(name, f"{who} the name {part!r}: {fault}")
        path = name
        while path:
            other = originals.setdefault(fold_name(path), path)
            if other != path:
                if is_asked:
                    text = f"many disks treat {path!r} and {other!r} as one name"
                    notes.setdefault(name, text)
                break
            path = path.rpartition("/")[0]
    return notes


class PortableNames:
    """Gives paths names that are valid on every system, also next to each other.

    ``change`` makes such a name from a part of a path; ``taken`` names are never used.
    """

    def __init__(
        self, change: Callable[[str], str] | None = None, taken: Iterable[str] = ()
    ) -> None:
        self._change = _portable if change is None else change
        self._given: dict[str, str] = {}  # parts of a path, joined by "/" -> their new name
        self._taken = set(map(fold_name, taken))

    def __call__(self, path: str) -> str:
        """The path, or one like it: the same for the same folder, another for another file."""
        above, _, part = path.rpartition("/")
        if path not in self._given:
            folder = f"{self(above)}/" if above else ""
            self._given[path] = self._free(folder, self._change(part))
        return self._given[path]

    def _free(self, folder: str, part: str) -> str:
        stem, dot, suffix = part.rpartition(".") if "." in part[1:] else (part, "", "")
        name, number = part, 1
        while fold_name(folder + name) in self._taken:
            number += 1
            end = f"~{number}{dot}{suffix}"
            while stem and _size_of(stem + end) > LONGEST:
                stem = stem[:-1]
            name = stem + end
        self._taken.add(fold_name(folder + name))
        return folder + name


def visible(part: str) -> str:
    """Replace each invisible character of a part of a path by ``_``.

    >>> visible("a:b" + chr(0x202E) + "gpj.c3d"), visible("Icon" + chr(13))
    ('a:b_gpj.c3d', 'Icon_')
    """
    return HIDDEN.sub("_", part)


def _portable(part: str) -> str:
    """
    >>> [_portable(name) for name in ("a:b", "CON", "nul.bvh", "walk. ", "walk.bvh")]
    ['a_b', 'CON_', 'nul_.bvh', 'walk__', 'walk.bvh']
    """
    part = ODD.sub("_", visible(part))
    bare = part.rstrip(" .")
    part = bare + "_" * (len(part) - len(bare))
    if DEVICES.fullmatch(part):
        stem, dot, rest = part.partition(".")
        part = f"{stem.rstrip(' ')}_{dot}{rest}"
    while fault_of(part):  # too long
        stem, dot, suffix = part.rpartition(".")
        part = f"{stem[:-1]}{dot}{suffix}" if dot and len(suffix) < 16 else part[:-1]
    return part


class Folder:
    """A folder of new files; links in it are not followed, and no file is written twice."""

    def __init__(self, root: Path) -> None:
        self._root = root
        self._written: dict[tuple[int, int], str] = {}  # device and number of a file -> its path

    def place(self, path: str, *, force: bool) -> Path:
        """Return the place of the file ``path``, with the folders above it created.

        Raises AccessError if a link, or something other than a file or folder, is in the way,
        and ExistsError for an existing file, which with ``force`` is one that was just written: the
        disk does not distinguish the two names.
        """
        parts = PurePosixPath(path).parts
        if os.name == "nt":
            for part in parts:
                if fault := fault_of(part):
                    raise AccessError(f"this system does not allow the name {part!r}: {fault}")
        make_folder(self._root)
        place = self._root
        for part in parts[:-1]:
            place = place / part
            status = _lstat(place)
            if status is None:
                place.mkdir(exist_ok=True)
            elif not stat.S_ISDIR(status.st_mode) or _is_junction(place):
                raise AccessError(f"it is {_kind(status)}, but a folder is needed", path=place)
        place = place / parts[-1]
        status = _lstat(place)
        if status is None:
            return place
        if not stat.S_ISREG(status.st_mode):
            raise AccessError(f"it is {_kind(status)}; refusing to write to it", path=place)
        if (other := self._written.get((status.st_dev, status.st_ino))) is not None:
            raise ExistsError(
                f"this disk treats the name like {other!r}, which was just written",
                hint=Hint.PORTABLE_NAMES,
            )
        if not force:
            raise ExistsError("already exists", path=place, hint=Hint.FORCE)
        return place

    def write(self, path: str, data: bytes, source: Target, *, force: bool, name: str = "") -> Path:
        """Write the file ``path`` from ``source``; return its place, as ``place``.

        ``name`` is its name for the error if another file has its place.
        """
        place = self.place(path, force=force)
        with replacing(place, force=force, inputs=(source,)) as stream:
            stream.write(data)
        if (status := _lstat(place)) is not None:
            self._written[status.st_dev, status.st_ino] = name or path
        return place


def _lstat(place: Path) -> os.stat_result | None:
    try:
        return place.lstat()
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        raise AccessError(reason_of(error), path=place) from None


def _is_junction(place: Path) -> bool:
    attributes = getattr(place.lstat(), "st_file_attributes", 0)
    return bool(attributes & getattr(stat, "FILE_ATTRIBUTE_REPARSE_POINT", 0))


def _kind(status: os.stat_result) -> str:
    if stat.S_ISLNK(status.st_mode):
        return "a symbolic link"
    if stat.S_ISDIR(status.st_mode):
        return "a folder"
    return "a file" if stat.S_ISREG(status.st_mode) else "neither a file nor a folder"


SNIFFED = 2**16  # bytes at the start that show the type of a file


def files_below(root: Path, target: Target | None) -> tuple[list[Path], list[Outcome]]:
    """The files below ``root`` except the target, sorted; and outcomes of other entries."""
    archive = Path(target).resolve() if isinstance(target, (str, os.PathLike)) else None
    if archive is not None and archive.suffix.lower() != ".mcz":
        archive = None  # not an archive: it is packed, and not overwritten
    files: list[Path] = []
    others: list[Outcome] = []

    def add_outcome(path: Path, result: str, text: str) -> None:
        others.append(Outcome(path.relative_to(root).as_posix(), result, 0, text))

    def unreadable(error: OSError) -> None:
        if Path(error.filename) == root:
            raise AccessError(reason_of(error), path=root) from None
        add_outcome(Path(error.filename), "failed", remark_of(error))

    for folder, folders, names in os.walk(root, onerror=unreadable):
        for path in (Path(folder, name) for name in (*folders, *names)):
            if path.is_symlink():
                add_outcome(path, "skipped", "a symbolic link; only files are packed")
            elif path.is_file():
                if path.resolve() != archive:
                    files.append(path)
            elif not path.is_dir():
                add_outcome(path, "skipped", "neither a file nor a folder")

    files.sort(key=lambda path: os.fsencode(path.relative_to(root).as_posix()))
    return files, others


def motion_files(paths: Sequence[Path]) -> tuple[list[Path], list[Path]]:
    """The files of source formats, and the others."""
    motions = [path for path in paths if _is_motion(path)]
    chosen = set(motions)
    return motions, [path for path in paths if path not in chosen]


def _is_motion(path: Path) -> bool:
    """Return True for a suffix of a source format and, if other formats share it, fitting content.

    An unreadable file counts: opening it reports the error.
    """
    suffix = path.suffix.lower()
    for source_format in FORMATS.values():
        if suffix in source_format.suffixes:
            if source_format.is_motion is None:
                return True
            try:
                with path.open("rb") as file:
                    return source_format.is_motion(file.read(SNIFFED))
            except OSError:
                return True
    return False


NO_MOTION = Remark("no motion file", Hint.KEEP_ALL)


def skipped_outcome(path: Path, root: Path) -> Outcome:
    name = path.relative_to(root).as_posix()
    return Outcome(name, "skipped", size_of(path), NO_MOTION)


def dropped_facts(root: Path, packed: Sequence[Path], timeless: Iterable[Path]) -> Iterator[str]:
    """Parts of a folder that no archive has: empty folders, modes, times of ``timeless`` files."""

    def some(word: str, paths: Iterable[Path]) -> Iterator[str]:
        names = [path.relative_to(root).as_posix() for path in paths]
        if names:
            yield f"{word}: {list_some(names)}" + (
                f" ({len(names)} in all)" if names[MOST_NAMES:] else ""
            )

    walk = os.walk(root)
    yield from some(
        "empty folders", sorted(Path(f) for f, below, files in walk if not below + files)
    )
    if os.name == "posix":
        yield from some("modes of executable files", filter(_is_executable, packed))
    yield from some("times of files that are not clips", timeless)


def _is_executable(path: Path) -> bool:
    with suppress(OSError):
        return bool(path.stat().st_mode & 0o111)
    return False


def size_of(path: Path) -> int:
    with suppress(OSError, ValueError):
        return path.stat().st_size
    return 0


def find_sources(
    sources: Sequence[str | os.PathLike[str]], root: str | os.PathLike[str] | None, target: Target
) -> tuple[list[tuple[Path, str]], list[Outcome]]:
    """The files that ``sources`` name, with their names in an archive; and the files left out.

    A folder stands for the motion files below it, under their paths relative to it. ``root``: all
    names are relative to it; raises OptionError for a file outside of it.
    """
    files: list[tuple[Path, str]] = []
    skipped: list[Outcome] = []
    for source in map(Path, sources):
        if not source.is_dir():
            files.append((source, source.name if root is None else _relative(source, root)))
            continue
        paths, others = files_below(source, target)
        paths, others_ = motion_files(paths)
        skipped += [*others, *(skipped_outcome(path, source) for path in others_)]
        base = source if root is None else root
        files += [(path, _relative(path, base)) for path in paths]
    return files, skipped


def _relative(path: Path, root: str | os.PathLike[str]) -> str:
    try:
        return path.resolve().relative_to(Path(root).resolve()).as_posix()
    except ValueError:
        raise OptionError(f"the file is not below {root}", path=path) from None


SECOND = 10**9
TIMESTAMP = re.compile(r"([0-9-]{10}T[0-9:]{8})(?:\.([0-9]{1,9}))?Z")


def stamp(path: Path) -> str:
    """The time of a file, with as many decimals as it needs; raises OSError.

    >>> import tempfile
    >>> path = Path(tempfile.mkstemp()[1])
    >>> os.utime(path, ns=(0, 1_500_000_000_250_000_000))
    >>> stamp(path), nanoseconds(stamp(path))
    ('2017-07-14T02:40:00.25Z', 1500000000250000000)
    """
    seconds, rest = divmod(path.stat().st_mtime_ns, SECOND)
    text = datetime.fromtimestamp(seconds, UTC).strftime("%Y-%m-%dT%H:%M:%S")
    return text + (f".{rest:09d}".rstrip("0") if rest else "") + "Z"


def nanoseconds(text: str) -> int | None:
    """Nanoseconds since 1970; None if the text is not such a time."""
    match = TIMESTAMP.fullmatch(text)
    if not match:
        return None
    try:
        seconds = int(datetime.fromisoformat(match[1] + "+00:00").timestamp())
    except (ValueError, OverflowError):
        return None
    return seconds * SECOND + int((match[2] or "").ljust(9, "0"))


def make_folder(path: Path) -> None:
    """Create a folder and those above it; raises AccessError if a file is in the way."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError):
        raise AccessError("it is a file, but a folder is needed", path=path) from None


def set_time(path: Path, text: str | None) -> bool:
    """Set the modification time to a metadata text; return whether it is a time."""
    time = None if text is None else nanoseconds(text)
    if time is not None:
        os.utime(path, ns=(time, time))
    return time is not None
