"""The clips of a file, each created on access by its name, as users write it."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from pathlib import PurePosixPath
from weakref import WeakValueDictionary

from mcz.container import payloads
from mcz.container.directory import ClipRow
from mcz.container.reader import Container
from mcz.errors import FormatError, OptionError, UnknownNameError
from mcz.files.reading.clip import Clip
from mcz.model import text_format
from mcz.model.text_format import nearest

MOST_NAMES = 8  # names that a message lists
KEPT_CLIPS = 64
Named = Iterable[tuple[str, str]]  # a possible name of a clip, and its own name


def find_clip_name(clips: Clips, name: str) -> str:
    """The name of the clip that ``name`` refers to; see ``File.only_clip``. Raises OptionError."""
    matches = matching_clips(clips, name)
    if len(matches) == 1:
        return matches[0]
    if matches:
        raise OptionError(f"{name!r} may be {list_some(matches)}; choose one")
    raise OptionError(f"no clip {name!r}; {_suggestion(clips, name)}")


def names_of(clips: Clips) -> dict[str, set[str]]:
    """The possible names of clips, for many calls of ``matching_clips``."""
    known: dict[str, set[str]] = {name: {name} for name in clips}
    for names in _naming_ways(clips):
        clips_of: dict[str, set[str]] = {}
        for called, clip in names:
            clips_of.setdefault(called, set()).add(clip)
        known = clips_of | known
    return known


def matching_clips(clips: Clips, name: str) -> list[str]:
    """The names of the clips that ``name`` may refer to, sorted."""
    if name in clips.rows:
        return [name]
    for names in _naming_ways(clips):
        if matches := sorted({clip for known, clip in names if known == name}):
            return matches
    return []


def _naming_ways(clips: Clips) -> Iterator[Named]:
    """The names that clips may have, the plainest way first; the last reads of their sources."""
    names = [(name, name) for name in clips]
    others = list(_clip_aliases(clips))
    yield others
    yield _last_parts([*names, *others])
    paths = []
    for clip in clips.values():
        with suppress(FormatError):  # a damaged one hides no other
            if clip.source is not None:
                paths.append((clip.source.path, clip.name))
    yield paths
    yield _last_parts(paths)


def _clip_aliases(clips: Clips) -> Iterator[tuple[str, str]]:
    """The aliases of clips, which are paths of files, with their suffix and without."""
    for alias, (of, target) in clips.aliases.items():
        clip = target.decode("utf-8", "replace")
        if of == payloads.OF_CLIP and clip in clips.rows:
            yield alias, clip
            yield str(PurePosixPath(alias).parent / PurePosixPath(alias).stem), clip


def _last_parts(names: Named) -> Named:
    return [(name.rpartition("/")[2], clip) for name, clip in names]


def _suggestion(clips: Iterable[str], name: str) -> str:
    near = nearest(name, [*clips, *(clip.rpartition("/")[2] for clip in clips)])
    return f"did you mean {near}?" if near else f"there are: {list_some(clips) or 'none'}"


def list_some(names: Iterable[str]) -> str:
    known = list(names)
    return ", ".join(known[:MOST_NAMES]) + (" ..." if len(known) > MOST_NAMES else "")


class Clips(Mapping[str, Clip]):
    """Clips in file order, found by any name that ``File.only_clip`` accepts.

    A clip is the same object while it is referenced. Of unreferenced clips the last ``KEPT_CLIPS``
    are kept: a clip keeps the parts that were read, so keeping all clips of an archive would keep
    the whole archive in memory.
    """

    def __init__(self, container: Container) -> None:
        self._container = container
        self.rows: Mapping[str, ClipRow] = container.directory.clips  # only by their own names
        self.aliases: Mapping[str, tuple[int, bytes]] = container.directory.aliases
        self._alive: WeakValueDictionary[str, Clip] = WeakValueDictionary()
        self._last: deque[Clip] = deque(maxlen=KEPT_CLIPS)

    __repr__ = text_format.clips_text

    def __getitem__(self, name: str) -> Clip:
        """The clip that ``name`` refers to; raises UnknownNameError, which suggests a name."""
        if not isinstance(name, str):
            raise UnknownNameError(f"{name!r} is not the name of a clip", path=self.file_name)
        if name not in self.rows:
            try:
                name = find_clip_name(self, name)
            except OptionError as error:
                raise UnknownNameError(error.message, path=self.file_name) from None
        clip = self._alive.get(name)
        if clip is None:
            new = Clip(self._container, self.rows[name])
            clip = self._alive.setdefault(name, new)  # another thread may have created it too
            self._last.append(clip)
        return clip

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and len(matching_clips(self, name)) == 1

    def __iter__(self) -> Iterator[str]:
        return iter(self.rows)

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def file_name(self) -> str:
        return self._container.source.name
