"""The clips of a file, found by any of their names or by a query of their fields.

docs/reference/queries.md describes the fields. The first ones of the table are in the index of the
file, the others read the CLIP or the skeleton of the clip.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import PurePosixPath
from typing import TYPE_CHECKING, TypeAlias
from weakref import WeakValueDictionary

from mcz.codecs import codec_by_id
from mcz.container import payloads
from mcz.container.chunks import CHECK_SIZE, FRAMING, HEADER, ChunkType, head_size
from mcz.container.directory import ClipRow, SegmentRow
from mcz.container.metadata import SETTABLE, SPELLINGS, Record
from mcz.container.reader import Container
from mcz.errors import FormatError, OptionError, UnknownNameError, UnsupportedError
from mcz.files.reading.clip import Clip
from mcz.model import text_format
from mcz.model.text_format import nearest_names, suggest_names
from mcz.sources import format_by_id

if TYPE_CHECKING:
    from mcz.files.queries import Query, Value

Where: TypeAlias = "str | Query | Callable[[Clip], bool]"
Getter: TypeAlias = "Callable[[Clip], Value]"
# Short names of fields, among them headings of listings.
SHORT = {
    "clip": "name",
    "frames": "n_frames",
    "channels": "n_channels",
    "joints": "n_joints",
    "rate": "frame_rate",
    "fps": "frame_rate",
    "unit": "unit_cm",
    "up": "up_axis",
}
METADATA = "metadata."  # before a key that is also the name of a field


def filter_clips(clips: Iterable[Clip], where: Where, of: Collection[Clip]) -> Iterator[Clip]:
    """Filter ``clips``, one by one, by the query ``where``; ``of`` are all clips of their file.

    Raises OptionError for a malformed query, and for a name that is unknown in all clips.
    """
    from mcz.files.queries import Query

    if isinstance(where, str):
        where = Query(where)
    if isinstance(where, Query):
        where = _matcher(where, of)
    elif not callable(where):
        raise OptionError(f"where is {where!r}; it must be a string or a function of a clip")
    return filter(where, clips)


def _matcher(query: Query, clips: Collection[Clip]) -> Callable[[Clip], bool]:
    getters = {name: _query_getter(query, name, clips) for name in query.names if clips}

    def matches(clip: Clip) -> bool:
        return query.matches(lambda name: getters[name](clip))

    return matches


def _query_getter(query: Query, name: str, clips: Collection[Clip]) -> Getter:
    getter = _find_getter(name, clips)
    if getter is None:
        raise query.unknown(name, _known_names(name, clips))
    return getter


def getter_of(name: str, clips: Collection[Clip]) -> Getter:
    """Return the getter of a field, or of a metadata key that any of ``clips`` has.

    Raises OptionError for a name that is neither.
    """
    getter = _find_getter(name, clips)
    if getter is None:
        known_names = suggest_names(sorted(_known_names(name, clips)), name)
        raise OptionError(
            f"{name!r} is neither a field nor a metadata key; the fields and keys are {known_names}"
        )
    return getter


def _find_getter(name: str, clips: Collection[Clip]) -> Getter | None:
    if name in FIELDS:
        return FIELDS[name]
    key = name.removeprefix(METADATA)
    key = SPELLINGS.get(key, key)
    is_key = key in SETTABLE or any(_last_record(key, clip) for clip in clips)
    is_key = is_key or any(key in clip.metadata for clip in clips)
    if is_key:
        return partial(_metadata, key)
    return FIELDS[SHORT[name]] if name in SHORT else None


def _known_names(name: str, clips: Collection[Clip]) -> list[str]:
    keys = {key for clip in clips for key in clip.metadata}
    return [METADATA + key for key in keys] if name.startswith(METADATA) else [*FIELDS, *keys]


def _metadata(key: str, clip: Clip) -> Value:
    """The value of a metadata key; CLIP is not read if a later META has it."""
    last = _last_record(key, clip)
    return clip.metadata.get(key) if last is None else last.entries.get(key)


def _last_record(key: str, clip: Clip) -> Record | None:
    records = reversed(clip.container.metadata_records(clip.name))
    return next((r for r in records if key in r.entries or key in r.removed), None)


def _lossless(clip: Clip) -> Value:
    try:
        return all(
            codec_by_id(s.codec, s.codec_version, s.preset).lossless for s in _row(clip).signals
        )
    except UnsupportedError:
        return None


def _bytes(clip: Clip) -> Value:
    """The clip's own chunks, CLIP, DATA, CEND and QUAL; not its skeleton nor its template."""
    row = _row(clip)
    chunks = [row.clip, *(chunk for chunk in row.ancillary if chunk.type == ChunkType.QUAL)]
    chunks += [row.cend] if row.cend else []
    closed = FRAMING * sum(not segment.packet for segment in row.segments)
    coded = sum(segment.size for segment in row.segments) + packet_framing(row.segments)
    return sum(chunk.size for chunk in chunks) + closed + coded


def packet_framing(rows: Sequence[SegmentRow]) -> int:
    """Bytes of open DATA outside of packet bodies; ``rows`` are in file order."""
    total = n_packets = end = 0
    for row in rows:
        if row.packet:
            head = head_size(n_packets, row.size)
            if not n_packets or row.offset - end != CHECK_SIZE + head:  # another DATA
                total += _end_size(n_packets) + HEADER.size
                n_packets, head = 0, head_size(0, row.size)
            total += head + CHECK_SIZE
            n_packets += 1
        end = row.stop
    return total + _end_size(n_packets)


def _end_size(n_packets: int) -> int:
    return head_size(n_packets, 0) + CHECK_SIZE if n_packets else 0


def _row(clip: Clip) -> ClipRow:
    return clip.container.directory.clips[clip.name]


def _source(clip: Clip) -> Value:
    source = clip._fields.source
    return source.path or None if source else None


def _format(clip: Clip) -> Value:
    """The usual suffix of the source's format, without the dot."""
    source = clip._fields.source
    return format_by_id(source.format).suffixes[0][1:] if source else None


FIELDS: dict[str, Getter] = {
    "name": lambda clip: clip.name,
    "n_frames": lambda clip: clip.n_frames,
    "frame_rate": lambda clip: float(rate) if (rate := clip.frame_rate) else None,
    "duration": lambda clip: float(clip.n_frames / rate) if (rate := clip.frame_rate) else None,
    "n_channels": lambda clip: clip.n_channels,
    "codec": lambda clip: clip.codec,
    "lossless": _lossless,
    "bytes": _bytes,
    "source": _source,
    "format": _format,
    "skeleton": lambda clip: clip.skeleton.name or None,
    "n_joints": lambda clip: clip.skeleton.n_joints,
    "unit_cm": lambda clip: clip.skeleton.unit_cm,
    "up_axis": lambda clip: clip.skeleton.up_axis or None,
    "forward_axis": lambda clip: clip.skeleton.forward_axis or None,
    "handedness": lambda clip: clip.skeleton.handedness or None,
}


MOST_NAMES = 8  # names that a message lists
KEPT_CLIPS = 64
Named = Iterable[tuple[str, str]]  # a possible name of a clip, and its own name


def find_clip_name(clips: Clips, name: str) -> str:
    """The name of the clip that ``name`` refers to; see ``File.only_clip``. Raises OptionError."""
    matches = matching_clips(clips, name)
    if len(matches) == 1:
        return matches[0]
    if matches:
        raise OptionError(f"{name!r} is ambiguous: {list_some(matches)}; choose one")
    raise OptionError(f"no clip {name!r}; {_suggestion(clips, name)}")


def names_of(clips: Clips) -> dict[str, set[str]]:
    """The possible names of clips, for many calls of ``matching_clips``."""
    known: dict[str, set[str]] = {name: {name} for name in clips}
    for names in _name_getters(clips):
        clips_of: dict[str, set[str]] = {}
        for called, clip in names:
            clips_of.setdefault(called, set()).add(clip)
        known = clips_of | known
    return known


def matching_clips(clips: Clips, name: str) -> list[str]:
    """The names of the clips that ``name`` may refer to, sorted."""
    if name in clips.rows:
        return [name]
    for names in _name_getters(clips):
        if matches := sorted({clip for known, clip in names if known == name}):
            return matches
    return []


def _name_getters(clips: Clips) -> Iterator[Named]:
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
    near = nearest_names(name, [*clips, *(clip.rpartition("/")[2] for clip in clips)])
    return f"did you mean {near}?" if near else f"there are: {list_some(clips) or 'none'}"


def list_some(names: Iterable[str]) -> str:
    known = list(names)
    return ", ".join(known[:MOST_NAMES]) + (" ..." if len(known) > MOST_NAMES else "")


class Clips(Mapping[str, Clip]):
    """Clips in file order, found by any name that ``File.only_clip`` accepts.

    A clip is the same object while it is referenced. The last ``KEPT_CLIPS`` unreferenced clips are
    cached, not all: a clip holds the parts that were read, so all clips could hold the whole
    archive in memory.
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
            raise UnknownNameError(f"no clip is called {name!r}", path=self.file_name)
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
