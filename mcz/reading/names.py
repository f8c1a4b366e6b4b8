"""Which clip of a file a name means, as users write it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from pathlib import PurePosixPath
from typing import Protocol

from mcz.brief import nearest
from mcz.container import payloads
from mcz.errors import FormatError, OptionError
from mcz.reading.clip import Clip

FEW = 8  # names that a message lists


class Clips(Protocol):
    """The clips of a file by their own names, and its aliases: name -> (of, target)."""

    @property
    def rows(self) -> Mapping[str, object]: ...
    @property
    def aliases(self) -> Mapping[str, tuple[int, bytes]]: ...
    def __iter__(self) -> Iterator[str]: ...
    def values(self) -> Iterable[Clip]: ...


Named = Iterable[tuple[str, str]]  # what a clip may be called, and its own name


def clip_called(clips: Clips, name: str) -> str:
    """The name of the clip that ``name`` means; see ``File.only_clip``. Raises OptionError."""
    found = clips_meant(clips, name)
    if len(found) == 1:
        return found[0]
    if found:
        raise OptionError(f"{name!r} may be {listed(found)}; choose one")
    raise OptionError(f"no clip {name!r}; {_suggestion(clips, name)}")


def names_of(clips: Clips) -> dict[str, set[str]]:
    """What the clips may be called, as ``clips_meant`` finds it, for who asks for many."""
    known: dict[str, set[str]] = {name: {name} for name in clips}
    for names in _ways(clips):
        found: dict[str, set[str]] = {}
        for called, clip in names:
            found.setdefault(called, set()).add(clip)
        known = found | known
    return known


def clips_meant(clips: Clips, name: str) -> list[str]:
    """The names of the clips that ``name`` may mean, sorted."""
    if name in clips.rows:
        return [name]
    for names in _ways(clips):
        found = sorted({clip for known, clip in names if known == name})
        if found:
            return found
    return []


def _ways(clips: Clips) -> Iterator[Named]:
    """What the clips may be called, the plainest way first; the last reads of their sources."""
    names = [(name, name) for name in clips]
    others = list(_of_clips(clips))
    yield others
    yield _last_parts([*names, *others])
    paths = list(_paths(clips))
    yield paths
    yield _last_parts(paths)


def _of_clips(clips: Clips) -> Iterator[tuple[str, str]]:
    """The aliases of clips, which are paths of files, with their suffix and without."""
    for alias, (of, target) in clips.aliases.items():
        clip = target.decode("utf-8", "replace")
        if of == payloads.OF_CLIP and clip in clips.rows:
            yield alias, clip
            yield str(PurePosixPath(alias).parent / PurePosixPath(alias).stem), clip


def _paths(clips: Clips) -> Iterator[tuple[str, str]]:
    for clip in clips.values():
        with suppress(FormatError):  # one that is damaged hides no other
            if clip.source is not None:
                yield clip.source.path, clip.name


def _last_parts(names: Named) -> Named:
    return [(name.rpartition("/")[2], clip) for name, clip in names]


def _suggestion(clips: Iterable[str], name: str) -> str:
    near = nearest(name, [*clips, *(clip.rpartition("/")[2] for clip in clips)])
    return f"did you mean {near}?" if near else f"there are: {listed(clips) or 'none'}"


def listed(names: Iterable[str]) -> str:
    """Some names, few of many."""
    known = list(names)
    return ", ".join(known[:FEW]) + (" ..." if len(known) > FEW else "")
