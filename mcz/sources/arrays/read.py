"""NPY, NPZ and pickles: bytes -> Motion, and back.

SPEC.md, "Template of arrays", is normative for the way back. ``meaning.py`` says which array is the
motion, ``restore.py`` what a file is made of.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import replace

from mcz.errors import MotionError, SourceError
from mcz.model.motion import Motion, Signal, Source
from mcz.sources.arrays.archive import Archive
from mcz.sources.arrays.columns import Array, columns_of, npy_array, npz_arrays, signal_of
from mcz.sources.arrays.deflate import is_kept
from mcz.sources.arrays.layout import MAX_PIECES, MAX_RUNS, Kind, Piece, build_arrays
from mcz.sources.arrays.libraries import CLIP, Library, join_clips
from mcz.sources.arrays.meaning import Meaning, meaning_of
from mcz.sources.arrays.pickles import Pickle, npy_objects, read_pickle, read_tensors
from mcz.sources.arrays.restore import Placed, pieces_of, restore_arrays


def read_npy(data: bytes, name: str = "motion") -> Motion:
    """The motion in an NPY file; ``name`` becomes its name.

    An array of objects is a pickle, which is read as one. Raises SourceError, with the offset at
    fault or the reason why it is no motion.
    """
    pickle = npy_objects(data)
    if pickle is not None:
        return _pickled("npy", name, pickle)
    return _motion("npy", name, [npy_array(data)], Archive(data, len(data)))


def read_pickle_file(data: bytes, name: str = "motion") -> Motion:
    """The motion in a pickle, also of joblib, which is never run; ``name`` becomes its name.

    Raises SourceError, with the offset at fault, for one that has anything else than data.
    """
    return _pickled("pickle", name, read_pickle(data))


def read_torch(data: bytes, name: str = "motion") -> Motion:
    """The motion in a file of torch.save; ``name`` becomes its name.

    Raises SourceError, with the offset at fault, for one that has anything else than data.
    """
    return _pickled("torch", name, read_tensors(data))


def _pickled(format_name: str, name: str, pickle: Pickle) -> Motion:
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
    if library is None:
        meaning = meaning_of(arrays)
        placed = {k: Placed(arrays[k].head, *place) for k, place in meaning.places.items()}
    else:
        meaning = meaning_of(library.arrays)
        placed = dict(library.placed(arrays, meaning.places))
    meaning.notes += notes
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
        meaning.skeleton,
        tuple(_signals(meaning)),
        meaning.rate,
        meaning.rate_is_exact,
        name,
        _metadata(arrays, archive, meaning, pieces),
        Source(format_name, template, detail, size=archive.size, sha256=digest),
    )


def _signals(meaning: Meaning) -> list[Signal]:
    return [
        signal_of(
            [columns_of(words) for words in part.words],
            part.name,
            part.per_frame,
            part.channels,
            part.role,
        )
        for part in meaning.parts
    ]


def _pieces(arrays: Sequence[Array], archive: Archive, placed: Mapping[int, Placed]) -> list[Piece]:
    kept = [
        (array.head.start, array.stop)
        for k, array in enumerate(arrays)
        if k not in placed and array.stop > array.head.start
    ]
    return pieces_of(archive, [*placed.values()], kept)


def _metadata(
    arrays: Sequence[Array], archive: Archive, meaning: Meaning, pieces: Sequence[Piece]
) -> dict[str, str]:
    """Metadata of the file: its words, and notes on oddities."""
    notes = [f"{array.name} is {array.kept}" for array in arrays if array.is_loud]
    notes += [f"the CRC-32 of {name} is not that of its bytes" for name in archive.wrong]
    kept = [piece for piece in pieces if piece.kind == Kind.DEFLATE and is_kept(piece.text)]
    if kept:
        size = sum(len(piece.text) for piece in kept)
        notes.append(f"{size} bytes of deflate, not zlib's, are kept as they are")
    notes += meaning.notes
    return meaning.metadata | ({"source-note": "; ".join(notes)} if notes else {})


def write_arrays(motion: Motion) -> bytes:
    """The array file that ``motion`` was made of, with its values.

    Raises MotionError for a motion of another source: ``mcz.to_npz`` writes that one.
    """
    if motion.source is None or motion.source.format not in ("npy", "npz", "pickle", "torch"):
        raise MotionError(f"motion {motion.name!r} was not read from arrays; use to_npz")
    return restore_arrays(motion)
