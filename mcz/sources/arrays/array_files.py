"""NPY, NPZ and pickles: bytes -> Motion, and back; several clips of a file are one motion.

Clip follows clip, and a frame number is missing between two. SPEC.md, "Template of arrays", is
normative for the way back, and says how a PART divides the rows among the arrays of a file.
``interpretation.py`` decides which array is the motion, ``restore.py`` has the contents of a file.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeGuard

import numpy as np

from mcz.errors import MotionError, OptionError, SourceError
from mcz.model.checks import check_arguments
from mcz.model.clock import numbers_or_rows
from mcz.model.motion import A_MOTION, Motion, Signal, Source
from mcz.model.types import Ints
from mcz.sources.arrays.archive import Archive
from mcz.sources.arrays.columns import Array, columns_of, npy_array, npz_arrays, signal_of
from mcz.sources.arrays.deflate import is_kept
from mcz.sources.arrays.interpretation import Interpretation, frames_of, interpret_arrays
from mcz.sources.arrays.layout import MAX_PIECES, MAX_RUNS, Piece, PieceKind, build_arrays
from mcz.sources.arrays.pickles import Pickle, npy_objects, read_pickle, read_tensors
from mcz.sources.arrays.restore import Placed, pieces_of, restore_arrays

CLIP, CLIPS = "x-clip", "x-clips"  # the key of a clip in its file; those of all, with their frames
NOTHING = np.empty((0, 0))  # the numbers of an array without rows
NO_CLIPS = "{n} clips in one file, such as {one!r} and {two!r}, have no array in common"


@dataclass(frozen=True, slots=True)
class Library:
    """The arrays that all clips have, joined; ``members`` are the indices of each in its file.

    ``parts`` are the frame numbers of each clip, [first, stop).
    """

    names: tuple[str, ...]
    parts: tuple[tuple[int, int], ...]
    arrays: list[Array]
    members: list[Sequence[int]]

    @property
    def frame_numbers(self) -> Ints:
        return np.concatenate([np.arange(*part) for part in self.parts])

    @property
    def metadata(self) -> dict[str, str]:
        """The first and the last frame number of each clip, as JSON."""
        pairs = zip(self.names, self.parts, strict=True)
        return {CLIPS: json.dumps({name: [a, b - 1] for name, (a, b) in pairs})}

    def placed(
        self, arrays: Sequence[Array], places: Mapping[int, tuple[int, Sequence[int]]]
    ) -> Iterator[tuple[int, Placed]]:
        """The arrays of a file by their index; ``places`` are those of joined arrays."""
        for joined, (signal, channels) in places.items():
            for index, part in zip(self.members[joined], self.parts, strict=True):
                yield index, Placed(arrays[index].head, signal, channels, part)


def join_clips(arrays: Sequence[Array], clips: Mapping[str, Mapping[str, int]]) -> Library:
    """Join the arrays of clips; ``clips`` have the index of each array by its name.

    Arrays that some clips lack, or have in another shape, are in none. A clip may be empty, as
    those beside a range of frames are. Raises SourceError if no arrays of frames are left.
    """
    arrays = [replace(a, kept="", words=NOTHING) if _is_empty(a) else a for a in arrays]
    named = {
        name: {key: replace(arrays[k], name=key) for key, k in members.items()}
        for name, members in clips.items()
    }
    keys = {k for each in named.values() for k, a in each.items() if _has_frames(a) and a.n_rows}
    own = {
        name: each
        for name, each in named.items()
        if any(key in keys and _has_frames(array) for key, array in each.items())
    }
    rows = {key: [each.get(key) for each in own.values()] for key in next(iter(own.values()), {})}
    shared = {key: arrays for key, arrays in rows.items() if _are_alike(arrays)}
    if all(each.kept or not each.n_rows for arrays in shared.values() for each in arrays):
        one, two = [*clips][:2]
        raise SourceError(NO_CLIPS.format(n=len(clips), one=one[:80], two=two[:80]))
    counts = [frames_of([each[key] for key in shared]) for each in own.values()]
    starts = np.cumsum([1, *(count + 1 for count in counts)]).tolist()
    joined = {
        key: _join_arrays(arrays)
        for key, arrays in shared.items()
        if arrays[0].kept or _have_even_rows(arrays, counts)
    }
    return Library(
        tuple(own),
        tuple((start, start + n) for start, n in zip(starts, counts, strict=False)),
        [*joined.values()],
        [[clips[name][key] for name in own] for key in joined],
    )


def _are_alike(arrays: Sequence[Array | None]) -> TypeGuard[Sequence[Array]]:
    """Return True for numbers of the same type and shape in all clips, or for equal facts."""
    facts = {array and _fact(array) for array in arrays}
    return None not in facts and len(facts) == 1


def _fact(array: Array) -> object:
    """Everything of an array that all clips have alike."""
    head = array.head
    if array.kept:
        words = None if array.words is None else array.words.tobytes()
        return head.code, head.shape, words, array.text
    return head.code, head.shape[1:]


def _has_frames(array: Array) -> bool:
    return not array.kept and len(array.head.shape) > 1


def _is_empty(array: Array) -> bool:
    """Return True for an array of frames that has none."""
    head = array.head
    return head.is_number and len(head.shape) > 1 and head.shape[0] == 0


def _have_even_rows(arrays: Sequence[Array], counts: Sequence[int]) -> bool:
    """Return True for as many rows a frame in every clip."""
    pairs = [(array.n_rows, count) for array, count in zip(arrays, counts, strict=True)]
    rows, most = max(pairs, key=lambda pair: pair[1])
    return all(n_rows * most == rows * count for n_rows, count in pairs)


def _join_arrays(arrays: Sequence[Array]) -> Array:
    """The array of all clips."""
    one = max(arrays, key=lambda array: 0 if array.kept else array.n_rows)
    if one.kept:
        return one
    words = np.concatenate([array.numbers for array in arrays if array.n_rows])
    head = replace(one.head, shape=(len(words), *one.head.shape[1:]))
    return replace(one, head=head, words=words)


@check_arguments(motion=A_MOTION)
def split_clips(motion: Motion) -> dict[str, Motion]:
    """The clips of a library of motions, such as a pickle of several, by their names.

    Each has its own frames, numbered from 1, and no source. Raises OptionError for any other
    motion.
    """
    try:
        clips = json.loads(motion.metadata[CLIPS])
        spans = {str(name): (int(first), int(last)) for name, (first, last) in clips.items()}
    except (KeyError, ValueError, TypeError, AttributeError, RecursionError, OverflowError):
        raise OptionError(f"motion {motion.name!r} is not a library of clips") from None
    numbers = numbers_or_rows(motion.frame_numbers, motion.n_frames)
    metadata = {key: value for key, value in motion.metadata.items() if key != CLIPS}
    parts = {}
    for name, (first, last) in spans.items():
        start, stop = np.searchsorted(numbers, (first, last + 1)).tolist()
        part = replace(motion[start:stop], source=None, frame_numbers=None, first_time=None)
        parts[name] = replace(part, name=name, metadata={CLIP: name} | metadata)
    return parts


def read_npy(data: bytes, name: str = "motion") -> Motion:
    """The motion in an NPY file; ``name`` becomes its name.

    An array of objects is a pickle, which is read as one. Raises SourceError, with the offset at
    fault or the reason why it is no motion.
    """
    pickle = npy_objects(data)
    if pickle is not None:
        return _pickle_motion("npy", name, pickle)
    return _motion("npy", name, [npy_array(data)], Archive(data, len(data)))


def read_pickle_file(data: bytes, name: str = "motion") -> Motion:
    """The motion in a pickle, also of joblib, which is never run; ``name`` becomes its name.

    Raises SourceError, with the offset at fault, for one that has anything else than data.
    """
    return _pickle_motion("pickle", name, read_pickle(data))


def read_torch(data: bytes, name: str = "motion") -> Motion:
    """The motion in a file of torch.save; ``name`` becomes its name.

    Raises SourceError, with the offset at fault, for one that has anything else than data.
    """
    return _pickle_motion("torch", name, read_tensors(data))


def _pickle_motion(format_name: str, name: str, pickle: Pickle) -> Motion:
    library = join_clips(pickle.arrays, pickle.clips) if pickle.clips else None
    motion = _motion(format_name, name, pickle.arrays, pickle.archive, pickle.notes, library)
    if library is not None:
        metadata = library.metadata | dict(motion.metadata)
        numbers = library.frame_numbers
        if len(numbers) != motion.n_frames:
            raise SourceError(
                f"the clips have {len(numbers)} frames, but the motion has {motion.n_frames}"
            )
        return replace(motion, metadata=metadata, frame_numbers=numbers)
    clip = {CLIP: pickle.clip} if pickle.clip else {}
    return replace(motion, metadata=clip | dict(motion.metadata))


def read_npz(data: bytes, name: str = "motion") -> Motion:
    """The motion in an NPZ file; ``name`` becomes its name.

    Members that are pickled or no arrays are kept as their bytes. Raises SourceError, with the
    offset at fault or the reason why it is no motion.
    """
    return _motion("npz", name, *npz_arrays(data))


def _motion(
    format_name: str,
    name: str,
    arrays: Sequence[Array],
    archive: Archive,
    notes: Sequence[str] = (),
    library: Library | None = None,
) -> Motion:
    """The motion in ``arrays`` of one clip, or of ``library``, with its source."""
    if library is None:
        interpretation = interpret_arrays(arrays)
        placed = {k: Placed(arrays[k].head, *place) for k, place in interpretation.places.items()}
    else:
        interpretation = interpret_arrays(library.arrays)
        placed = dict(library.placed(arrays, interpretation.places))
    interpretation.notes += notes
    pieces = _pieces(arrays, archive, placed)
    n_runs = sum(len(piece.runs) for piece in pieces)
    if len(pieces) > MAX_PIECES or n_runs > MAX_RUNS:
        raise SourceError(
            f"{len(arrays)} arrays in {len(pieces)} pieces with {n_runs} runs of numbers "
            f"exceed the limits of {MAX_PIECES} pieces and {MAX_RUNS} runs"
        )
    template, detail = build_arrays(pieces)
    digest = hashlib.sha256(memoryview(archive.data)[: archive.size]).digest()
    return Motion(
        interpretation.skeleton,
        tuple(_signals(interpretation)),
        interpretation.rate,
        interpretation.rate_is_exact,
        name,
        _metadata(arrays, archive, interpretation, pieces),
        Source(format_name, template, detail, size=archive.size, sha256=digest),
    )


def _signals(interpretation: Interpretation) -> list[Signal]:
    return [
        signal_of(
            [columns_of(words) for words in part.words],
            part.name,
            part.per_frame,
            part.channels,
            part.role,
        )
        for part in interpretation.parts
    ]


def _pieces(arrays: Sequence[Array], archive: Archive, placed: Mapping[int, Placed]) -> list[Piece]:
    unread = [
        (array.head.start, array.stop)
        for k, array in enumerate(arrays)
        if k not in placed and array.stop > array.head.start
    ]
    return pieces_of(archive, [*placed.values()], unread)


def _metadata(
    arrays: Sequence[Array],
    archive: Archive,
    interpretation: Interpretation,
    pieces: Sequence[Piece],
) -> dict[str, str]:
    """Metadata of the file: its words, and notes on oddities."""
    notes = [f"{array.name} is {array.kept}" for array in arrays if array.is_loud]
    notes += [f"the CRC-32 of {name} is not that of its bytes" for name in archive.wrong]
    verbatim = [
        piece for piece in pieces if piece.kind == PieceKind.DEFLATE and is_kept(piece.text)
    ]
    if verbatim:
        size = sum(len(piece.text) for piece in verbatim)
        notes.append(f"{size} bytes of deflate, not zlib's, are kept as they are")
    notes += interpretation.notes
    return interpretation.metadata | ({"source-note": "; ".join(notes)} if notes else {})


def write_arrays(motion: Motion) -> bytes:
    """The array file that ``motion`` was made of, with its values.

    Raises MotionError for a motion of another source: ``mcz.to_npz`` writes that one.
    """
    if motion.source is None or motion.source.format not in ("npy", "npz", "pickle", "torch"):
        raise MotionError(f"motion {motion.name!r} was not read from arrays; use to_npz")
    return restore_arrays(motion)
