"""Versions and profiles: the format that a file needs, and the limits that it keeps.

SPEC.md, "Versions" and "Limits and profiles", are normative.
"""

from __future__ import annotations

from dataclasses import dataclass

from construct import Container, Int8ul

from mcz.errors import LimitError, OptionError, UnsupportedError
from mcz.hints import Hint
from mcz.model.schema import CheckedInRecord

MIB = 2**20


@dataclass(frozen=True, slots=True)
class Profile:
    """Upper bounds; bytes are decoded bytes unless the name states otherwise."""

    id: int
    name: str
    channels: int
    joints: int
    segment_bytes: int
    model_bytes: int
    chunk_bytes: int
    packet_bytes: int
    text_bytes: int
    signals: int
    rows: int
    is_plain: bool = False  # nothing is packed, codecs and grids are few: see ``scanner.py``
    # decoded size of a segment that writers make, so that its DATA is short
    coded_bytes: int = 2**53

    @property
    def counts(self) -> dict[str, int]:
        """Greatest numbers of joints and channels of a skeleton, checked while it is parsed."""
        return {"joints": self.joints, "channels": self.channels}


BASE = Profile(
    0,
    "base",
    channels=16_384,  # LIMIT-01, LIMIT-03
    joints=4_096,  # LIMIT-01, LIMIT-04
    segment_bytes=64 * MIB,  # LIMIT-05
    model_bytes=64 * MIB,  # LIMIT-06
    chunk_bytes=2**31,  # LIMIT-07
    packet_bytes=64 * 1024,  # LIMIT-08
    text_bytes=64 * MIB,  # LIMIT-09
    signals=2**16,  # LIMIT-18
    rows=2**23,  # LIMIT-19
)
LARGE = Profile(1, "large", 2**20, 2**18, 2**34, 2**31, 2**40, 64 * 1024, 2**31, 2**20, 2**31)
KIB = 2**10
SMALL = Profile(
    2,
    "small",
    channels=256,
    joints=256,
    segment_bytes=2 * MIB,
    model_bytes=0,
    chunk_bytes=64 * KIB,  # LIMIT-07
    packet_bytes=64 * KIB,
    text_bytes=64 * KIB,
    signals=16,
    rows=1024,
    is_plain=True,
    coded_bytes=48 * KIB,
)
PROFILES = {profile.id: profile for profile in (BASE, LARGE, SMALL)}


def profile_named(name: str) -> Profile:
    """The profile "small", "base" or "large"; raises OptionError."""
    for profile in PROFILES.values():
        if profile.name == name:
            return profile
    raise OptionError(f"profile {name!r} is not small, base or large", value=name)


def check(noun: str, value: int, limit: int) -> None:
    if value > limit:  # LIMIT-02
        raise LimitError(f"{noun}: {value} is over the limit of {limit}", value=value)


def check_decoded(noun: str, value: int, limit: int) -> None:
    """Raise LimitError if ``value`` bytes exceed the limit that the caller sets for a file."""
    if value > limit:  # LIMIT-02
        raise LimitError(
            f"{noun}: {value} bytes are over the limit of {limit} decoded bytes",
            value=value,
            hint=Hint.MAX_DECODED,
        )


def index_limit(file_bytes: int) -> int:
    """Greatest inflated size of an index: a row is hardly longer than the thing that it lists."""
    return max(64 * 1024, 2 * file_bytes)  # LIMIT-13


def metadata_limit(file_bytes: int) -> int:
    """The bytes that the records of a META may inflate to."""
    return max(64 * 1024, 2 * file_bytes)  # LIMIT-17


def search_limit(file_bytes: int) -> int:
    """The bytes that searches for the next intact chunk may read in vain, in all."""
    return max(64 * MIB, 8 * file_bytes)


def output_limit(file_bytes: int) -> int:
    """The bytes that a reader decodes from one file unless its caller allows more."""
    return max(64 * MIB, 4096 * file_bytes)  # LIMIT-10


FORMAT = 1, 0
FORMAT_NAME = f"{FORMAT[0]}.{FORMAT[1]}"


def _check_version(needs_minor: int, record: Container) -> bool:
    needed = record.needs_major, needs_minor  # HEAD-04
    words = f"it needs format {needed[0]}.{needed[1]}, but this reader knows {FORMAT_NAME}"
    if needed > FORMAT:  # HEAD-01, CLIP-23
        raise UnsupportedError(words)
    if not needed[0]:  # HEAD-03
        raise UnsupportedError(words, hint=Hint.OLD_FORMAT)
    return True


NEEDS_MINOR = CheckedInRecord(Int8ul, _check_version)
