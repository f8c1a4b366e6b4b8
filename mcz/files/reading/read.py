"""``mcz.read``: the motion in a file of any format, and its certain skeleton.

An ASF is used silently if its name fits the take and all bones fit the file. One that the caller
named, or the only one nearby whose bones fit, is used with a remark. Any other case is an error
that lists the candidates.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path

from mcz.errors import OptionError, SkeletonWarning, SourceError
from mcz.files.reading.file import is_mcz, open
from mcz.files.reading.source_files import SourceOptions, load, read_skeleton, read_source
from mcz.hints import Hint
from mcz.model.checks import PATH, check_arguments
from mcz.model.motion import Motion, Skeleton
from mcz.model.text_format import first_names
from mcz.model.units import in_unit
from mcz.sources import Format, format_of
from mcz.sources.text.bones import Candidate, Match, match_bones, skeletons_around

NONE = "none"  # given in place of a skeleton file: use none
NOTE = "skeleton-note"
SHOWN = 8  # names in a message
Given = str | os.PathLike[str] | Skeleton | None
Counts = Mapping[str, int]


@check_arguments(path=PATH)
def read(
    path: str | os.PathLike[str],
    *,
    skeleton: str | os.PathLike[str] | Skeleton | None = None,
    rate: Fraction | float | None = None,
    unit: str | None = None,
    up: str | None = None,
    arrays: str | None = None,
    model: str | os.PathLike[str] | None = None,
    clip: str | None = None,
    max_decoded: int | None = None,
    threads: int | None = None,
    verify: bool = False,
) -> Motion:
    """The motion in a file of any source format, or in an MCZ file.

    An AMC finds its ASF next to it, or takes ``skeleton``, a path, a Skeleton or "none"; the
    metadata state how one was found, and a SkeletonWarning reports a name or dofs that do not fit.
    ``rate`` in frames a second, ``unit`` (a key of ``UNIT_CM``) and ``up``, the axis that points up
    ("x" to "-z"), state facts that the file lacks. ``arrays`` is the meaning of the numbers of a
    plain NPY or NPZ: "positions", "rotation-vectors", "quaternions-wxyz" or "quaternions-xyzw".
    ``model`` is a file of SMPL or a related model, with the bone lengths of a body in an NPZ
    ("{gender}" and "{body}" in it: those of the take). ``clip`` chooses a clip of an MCZ file, with
    ``max_decoded``, ``threads`` and ``verify`` as in ``open``. Raises SourceError, FormatError or
    OptionError.
    """
    path = Path(path)
    if is_mcz(path):
        with open(path, max_decoded=max_decoded, threads=threads, verify=verify) as file:
            motion = file.only_clip(clip).motion()
    else:
        source_format, data = load(path)
        if source_format.is_skeleton:
            raise OptionError(
                "the file has a skeleton but no motion; read it with mcz.read_skeleton", path=path
            )
        result = read_motion(path, skeleton, data=data)
        if result.remark:
            warnings.warn(f"{path}: {result.remark}", SkeletonWarning, stacklevel=3)
        motion = result.motion
    options = SourceOptions(rate=rate, unit=unit, up=up, arrays=arrays, model=model)
    return options.applied_to(motion)


@dataclass(frozen=True, slots=True)
class SkeletonChoice:
    """A skeleton for a motion file: ``how`` it was found, "" if it was given, and a remark, or "".

    ``path`` is its file's, if it was read from one here.
    """

    skeleton: Skeleton
    how: str
    remark: str = ""
    path: Path | None = None


@dataclass(frozen=True, slots=True)
class ReadMotion:
    """A motion as read from its file, and the skeleton that was chosen for it."""

    motion: Motion
    chosen: SkeletonChoice | None

    @property
    def skeleton(self) -> Skeleton | None:
        return self.chosen.skeleton if self.chosen is not None else None

    @property
    def remark(self) -> str:
        """The remark about the skeleton, "" if there is none."""
        return self.chosen.remark if self.chosen is not None else ""


def read_motion(
    path: Path,
    skeleton_file: Given = None,
    unit: str | None = None,
    data: bytes | None = None,
    *,
    flat: bool = False,
) -> ReadMotion:
    """Read the motion file ``path``, whose bytes are ``data`` if already read.

    ``skeleton_file`` is the skeleton of a format that needs one: an object, the path of a file,
    "none" for none, or None to search. The metadata state how one was found. ``flat``: a file with
    several possible skeletons nearby is read without one, and the metadata mention it. Raises
    SourceError if no skeleton can be chosen, and as ``read_source``.
    """
    source_format, data = load(path) if data is None else (format_of(path, data), data)
    if not source_format.wants_skeleton:
        return ReadMotion(read_source(path, source_format, None, data), None)
    try:
        chosen = choose_skeleton(path, source_format, data, skeleton_file)
    except AmbiguousError as error:
        if not flat:
            raise
        motion = read_source(path, source_format, None, data)
        return ReadMotion(with_note(motion, f"kept without a skeleton: {error.reason}"), None)
    if chosen is not None:
        chosen = replace(chosen, skeleton=in_unit(chosen.skeleton, unit))
    if chosen is None:
        return ReadMotion(read_source(path, source_format, None, data), None)
    motion = read_source(path, source_format, chosen.skeleton, data)
    if motion.skeleton is not chosen.skeleton:  # bones may come later than in the first frame
        chosen = _with_misfits(
            path, source_format, data, chosen, is_named=skeleton_file is not None
        )
    return ReadMotion(with_note(motion, chosen.how), chosen)


def with_note(motion: Motion, how: str) -> Motion:
    """``motion`` with metadata on ``how`` its skeleton was found, "" if it was given."""
    if not how:
        return motion
    notes = "; ".join(filter(None, (how, motion.metadata.get(NOTE, ""))))
    return replace(motion, metadata=dict(motion.metadata) | {NOTE: notes})


def choose_skeleton(
    path: Path, source_format: Format, data: bytes, skeleton_file: Given
) -> SkeletonChoice | None:
    """The skeleton for the file ``path`` with the bytes ``data``, None if there is none."""
    assert source_format.bones is not None
    counts = source_format.bones(data)
    if isinstance(skeleton_file, Skeleton):
        return _check_asked(
            path,
            skeleton_file,
            _file_of(skeleton_file) or f"the skeleton {skeleton_file.name!r}",
            counts,
        )
    if skeleton_file is not None:
        if skeleton_file == NONE:
            return None
        choice = _check_asked(path, read_skeleton(skeleton_file), str(skeleton_file), counts)
        return replace(choice, path=Path(skeleton_file))
    return _choose_candidate(path, skeletons_around(path), counts) if counts else None


def _check_asked(path: Path, skeleton: Skeleton, label: str, counts: Counts) -> SkeletonChoice:
    """Return ``skeleton``; raises SourceError if it shares only the root with the file."""
    match = match_bones(skeleton, counts)
    if match.is_foreign:
        raise SourceError(
            f"{label} has none of its bones: {_first_bones(match.lacking)}", path=path
        )
    return SkeletonChoice(skeleton, "")


def _file_of(skeleton: Skeleton) -> str:
    return _printable(Path(skeleton.source.path).name) if skeleton.source is not None else ""


@dataclass(frozen=True, slots=True)
class _Candidate:
    """A candidate and how its bones match; ``skeleton`` None if it cannot be read."""

    candidate: Candidate
    skeleton: Skeleton | None
    match: Match
    fault: str = ""

    @property
    def grade(self) -> int:
        """2: bones and dofs fit; 1: bones do; 0: some are lacking."""
        return 0 if self.match.lacking or self.skeleton is None else 2 - bool(self.match.differing)

    def describe(self, folder: Path) -> str:
        """The file, relative to ``folder``, and how its bones match."""
        path = _seen_from(folder, self.candidate.path)
        if self.fault:
            return f"{path} (which cannot be read)"
        if self.match.lacking:
            return f"{path} (which lacks {_first_bones(self.match.lacking)})"
        if self.match.differing:
            return f"{path} (other dofs of {_first_bones(self.match.differing)})"
        return f"{path} (whose bones fit)"


def _choose_candidate(
    path: Path, around: Sequence[Candidate], counts: Counts
) -> SkeletonChoice | None:
    candidates = [_try(candidate, counts) for candidate in around if candidate.name_of]
    for grade in (2, 1):
        fitting = [one for one in candidates if one.grade == grade]
        nearest = [one for one in fitting if one.candidate.rank == fitting[0].candidate.rank]
        if nearest:
            return _only_fitting(path, nearest, candidates)
    others = [_try(candidate, counts) for candidate in around if not candidate.name_of]
    if candidates:
        raise _undecidable_error(
            path, [*candidates, *others], "a skeleton has its name, but not its bones"
        )
    for grade in (2, 1):
        fitting = [one for one in others if one.grade == grade]
        if fitting:
            return _only_fitting(path, fitting, others)
    if others:
        raise _undecidable_error(path, others, "no skeleton around has its name or its bones")
    return None


def _try(candidate: Candidate, counts: Counts) -> _Candidate:
    try:
        skeleton = read_skeleton(candidate.path)
    except SourceError as error:
        if candidate.name_of:
            raise
        return _Candidate(candidate, None, Match((), (), 0), str(error))
    return _Candidate(candidate, skeleton, match_bones(skeleton, counts))


def _only_fitting(path: Path, fitting: list[_Candidate], all_: list[_Candidate]) -> SkeletonChoice:
    first = fitting[0]
    if len(fitting) > 1:
        if first.candidate.name_of:
            raise _ambiguous_error(path, fitting, f"{len(fitting)} skeletons are equally near")
        text = f"no skeleton has its name, and {len(fitting)} have its bones"
        raise _ambiguous_error(path, all_, text)
    assert first.skeleton is not None
    asf, name_of = first.candidate.path, first.candidate.name_of
    label = _printable(asf.name)
    how = f"ASF of the name of {name_of}" if name_of else f"ASF the only one that fits: {label}"
    remark = "" if name_of else f"its skeleton is {asf}, the only one around whose bones fit"
    if first.match.differing:
        remark = remark or f"its skeleton is {asf}"
        remark += f"; the dofs of {_first_bones(first.match.differing)} are not those of the file"
    return SkeletonChoice(first.skeleton, how, remark, asf)


def _with_misfits(
    path: Path, source_format: Format, data: bytes, chosen: SkeletonChoice, *, is_named: bool
) -> SkeletonChoice:
    """``chosen`` with a remark on the bones of the whole file that it does not fit."""
    assert source_format.bones is not None
    match = match_bones(chosen.skeleton, source_format.bones(data, whole=True))
    label = _printable(str(chosen.path or chosen.skeleton.name or "the skeleton"))
    if match.lacking and not is_named:
        name = label if chosen.path is None else _printable(_seen_from(path.parent, chosen.path))
        raise SourceError(
            f"{name} lacks {_first_bones(match.lacking)}", path=path, hint=Hint.SKELETON
        )
    remark = chosen.remark
    if match.lacking:
        remark = f"{label} lacks {_first_bones(match.lacking)}; they are scalars without kinematics"
    elif match.differing and not remark:
        text = f"the dofs of {_first_bones(match.differing)} are not those of the file"
        remark = f"its skeleton is {label}; {text}"
    return replace(chosen, remark=remark)


class AmbiguousError(SourceError):
    """Several skeletons are possible; ``reason`` names them, without their folders."""

    reason = ""


def _ambiguous_error(path: Path, candidates: Sequence[_Candidate], text: str) -> AmbiguousError:
    riddle = _undecidable_error(path, candidates, text)
    error = AmbiguousError(riddle.message, **riddle.fields)
    error.reason = (
        f"{text}: {_first_bones([_printable(one.candidate.path.name) for one in candidates])}"
    )
    return error


def _undecidable_error(path: Path, candidates: Sequence[_Candidate], text: str) -> SourceError:
    names = first_names([_printable(one.describe(path.parent)) for one in candidates], SHOWN)
    return SourceError(f"{text}: {names}", path=path, hint=Hint.SKELETON)


def _seen_from(folder: Path, path: Path) -> str:
    try:
        return os.path.relpath(path, folder)
    except ValueError:  # on another drive
        return str(path)


def _first_bones(names: Sequence[str]) -> str:
    more = f" and {len(names) - 3} more" if len(names) > 3 else ""
    return " ".join(names[:3]) + more


def _printable(name: str) -> str:
    """A name of a file as text that any file can store."""
    return name.encode("utf-8", "backslashreplace").decode()
