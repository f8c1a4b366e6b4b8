"""Matching of the bones of an AMC file to the joints of a skeleton."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from math import degrees, radians
from pathlib import Path

from mcz.model.motion import ROTATION_KINDS, Channel, Joint, Skeleton

Columns = dict[str, int]  # bone -> column of its first value
ROOT = "root"  # every ASF has it, whatever else it describes


@dataclass(frozen=True, slots=True)
class Match:
    """Match of an AMC file's bones with a skeleton.

    ``lacking`` are the bones that it does not have, ``differing`` those that have other numbers of
    values there; ``n_known`` counts the bones beside the root that it has.
    """

    lacking: tuple[str, ...]
    differing: tuple[str, ...]
    n_known: int

    @property
    def is_foreign(self) -> bool:
        """True if the skeleton has none of the bones but the root, which all have."""
        return bool(self.lacking) and not self.n_known


def match_bones(skeleton: Skeleton, counts: Mapping[str, int]) -> Match:
    """Match bones with these numbers of values to ``skeleton``."""
    names = match_names(skeleton, counts)
    channels: dict[str | None, int] = {j.name: len(j.channels) for j in skeleton.joints}
    known = [bone for bone in counts if names[bone] is not None]
    return Match(
        lacking=tuple(bone for bone in counts if names[bone] is None),
        differing=tuple(bone for bone in known if channels[names[bone]] != counts[bone]),
        n_known=sum(bone.casefold() != ROOT for bone in known),
    )


def flat_skeleton(counts: Mapping[str, int], angle_unit: str) -> tuple[Skeleton, Columns]:
    """The skeleton of bones of which only the names and numbers of values are known."""
    joints = [Joint(name, channels=_scalars(count)) for name, count in counts.items()]
    skeleton = Skeleton(tuple(joints), "", angle_unit=angle_unit, intrinsic=False)
    return skeleton, _columns(skeleton, {name: name for name in counts})


def fit_skeleton(
    skeleton: Skeleton, counts: Mapping[str, int], angle_unit: str
) -> tuple[Skeleton, Columns]:
    """``skeleton``, or one derived from it if its channels are not those of the bones."""
    names = match_names(skeleton, counts)
    channels: dict[str | None, int] = {j.name: len(j.channels) for j in skeleton.joints}
    fits = all(channels.get(names[bone]) == count for bone, count in counts.items())
    if not fits or angle_unit != skeleton.angle_unit:
        skeleton = derive_skeleton(skeleton, counts, angle_unit)
        names = match_names(skeleton, counts)
    return skeleton, _columns(skeleton, names)


def match_names(skeleton: Skeleton, bones: Mapping[str, int]) -> dict[str, str | None]:
    """The joint of each bone: the one of its name, or the only one but for upper and lower case."""
    joints = {joint.name for joint in skeleton.joints}
    folded: dict[str, list[str]] = {}
    for name in joints:
        folded.setdefault(name.casefold(), []).append(name)
    matched: set[str | None] = {*(joints & bones.keys())}
    result: dict[str, str | None] = {}
    for bone in bones:
        candidates = [name for name in folded.get(bone.casefold(), []) if name not in matched]
        result[bone] = bone if bone in joints else candidates[0] if len(candidates) == 1 else None
        matched.add(result[bone])
    return result


def derive_skeleton(
    skeleton: Skeleton, counts: Mapping[str, int], angle_unit: str = ""
) -> Skeleton:
    """``skeleton`` with the channels that the bones of an AMC file have; ``base`` is b"".

    A joint whose number of values differs has rx ry rz if there are 3, else plain scalars; a root
    joint always has plain scalars then. Bones without a joint become root joints of plain scalars.
    The axes are converted if the AMC has another ``angle_unit``.
    """
    names = match_names(skeleton, counts)
    counts_by_name = {names[bone]: count for bone, count in counts.items()}
    angle_unit = angle_unit or skeleton.angle_unit
    convert = degrees if angle_unit == "deg" else radians
    joints = []
    for joint in skeleton.joints:
        count = counts_by_name.get(joint.name, len(joint.channels))
        if count != len(joint.channels):
            turns = count == 3 and joint.parent >= 0
            kinds = tuple(Channel(kind) for kind in ROTATION_KINDS)
            joint = replace(joint, channels=kinds if turns else _scalars(count))
        if angle_unit != skeleton.angle_unit:
            x, y, z = map(convert, joint.axis)
            joint = replace(joint, axis=(x, y, z))
        joints.append(joint)
    joints += [Joint(b, channels=_scalars(n)) for b, n in counts.items() if names[b] is None]
    return replace(skeleton, joints=tuple(joints), angle_unit=angle_unit, base=b"", source=None)


def _scalars(count: int) -> tuple[Channel, ...]:
    return tuple(Channel("", str(k + 1)) for k in range(count))


def _columns(skeleton: Skeleton, names: Mapping[str, str | None]) -> Columns:
    """The first column of each bone."""
    first: dict[str, int] = {}
    column = 0
    for joint in skeleton.joints:
        first.setdefault(joint.name, column)
        column += len(joint.channels)
    return {bone: first[name or bone] for bone, name in names.items()}


_SEPARATORS = re.compile(r"[^0-9A-Za-z]")
_NUMBER = re.compile(r"[0-9]+$")

TAKE, SUBJECT, NUMBER = "the take", "the subject", "the take without its number"


@dataclass(frozen=True, slots=True)
class Candidate:
    """An ASF file that may be that of an AMC; ``name_of`` is whose name it has, "" of neither.

    Those of equal ``rank`` are equally near.
    """

    path: Path
    name_of: str
    rank: int


def skeletons_around(amc_path: str | Path) -> list[Candidate]:
    """The ASF files around an AMC file, those whose names fit it first, the best at the front.

    A name fits that is the stem of the AMC (``TAKE``), or that stem up to one of its separators,
    the longest first (``SUBJECT``: 14.asf for 14_02.amc); first beside it, then in a sibling folder
    ``asf``; after that the stem without the number at its end (``NUMBER``: walk.asf for
    walk2.amc). Case matters in stems, not in ``asf``.
    """
    path = Path(amc_path)
    beside = _skeletons(path.parent)
    siblings: list[Path] = []
    entries = _entries(path.absolute().parent.parent)
    for folder in sorted(p for p in entries if p.name.lower() == "asf" and p.is_dir()):
        siblings += _skeletons(folder)
    candidates: dict[Path, Candidate] = {}
    exact, short = list(_stems(path.stem)), [(_NUMBER.sub("", path.stem), NUMBER)]
    places = [(n, f) for names in (exact, short) for f in (beside, siblings) for n in names]
    for rank, ((stem, name_of), files) in enumerate(places):
        for file in files:
            if stem and file.stem == stem:
                candidates.setdefault(file, Candidate(file, name_of, rank))
    others = (file for file in (*beside, *siblings) if file not in candidates)
    return [*candidates.values(), *(Candidate(file, "", len(places)) for file in others)]


def _stems(stem: str) -> Iterator[tuple[str, str]]:
    """The stem, then its parts before each separator, longest first; whose name each is."""
    yield stem, TAKE
    for match in reversed(list(_SEPARATORS.finditer(stem))):
        if match.start():
            yield stem[: match.start()], SUBJECT


def _skeletons(folder: Path) -> list[Path]:
    return sorted(p for p in _entries(folder) if p.suffix.lower() == ".asf" and p.is_file())


def _entries(folder: Path) -> list[Path]:
    try:
        return list(folder.iterdir())
    except OSError:
        return []
