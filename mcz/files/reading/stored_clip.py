"""The facts in the chunks of a clip, its values apart: parsed on demand."""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mcz.codecs import codec_by_id
from mcz.container import payloads
from mcz.container.chunks import ChunkType
from mcz.container.directory import ClipRow
from mcz.container.limits import check_decoded
from mcz.container.model_records import numbers_of, whole_time_base
from mcz.container.reader import Container
from mcz.errors import FormatError, OptionError, UnsupportedError
from mcz.files.reading.signal_info import SignalInfo, check_roles, read_signal
from mcz.files.reading.source_files import (
    SourceInfo,
    read_recording,
    scaling_of,
    source_info,
    sourced_skeleton,
)
from mcz.kinematics.points import point_names
from mcz.model.motion import Skeleton
from mcz.model.schema import parse
from mcz.model.signal import Scaling
from mcz.model.text_format import count_text

if TYPE_CHECKING:
    from mcz.sources.c3d.recording import Recording

LISTS = ("cut-joints", "edit-joints")
JOINTS = ("shell_max_joint", "slide_max_joint")
POINT = "max_position_error_point"
WORDS = ("param.contacts", "param.lossless", "param.quality")  # joints, or groups of them
REACHED = "quality_reached."  # before a joint or group: its reached quality
_BEFORE = re.compile(r"(?:uncut_|unedited_|edit_)*")
_WORD = re.compile(r"(.*?)((?::[0-9]+\+[0-9]+|=[^=,]*)?)")  # a joint, and its frames or limit
_INDEX = re.compile(r"0|[1-9][0-9]{0,15}")
Lookup = Callable[[str], str | None]  # None: unknown joint


class StoredClip:
    """The facts in CLIP, CEND and the chunks that belong to a clip."""

    def __init__(self, container: Container, row: ClipRow) -> None:
        self.container = container
        self._row = row
        self.name = row.name
        self.n_frames = row.n_frames

    @cached_property
    def _fields(self) -> payloads.Clip:
        return self.container.clip(self._row, shared=True)

    @cached_property
    def _cend(self) -> payloads.Cend | None:
        fields = self.container.cend(self._row)
        has_hash = fields is not None and fields.source_sha256 is not None
        if fields is not None and has_hash != (self._fields.source is not None):  # CEND-01
            raise FormatError("a source and its hash must be given together", clip=self.name)
        return fields

    @cached_property
    def skeleton(self) -> Skeleton:
        """The skeleton of the clip, its own source file not read."""
        return self.container.skeleton(self._row.skeleton)

    @property
    def skeleton_id(self) -> bytes:
        return self._row.skeleton

    @cached_property
    def base_skeleton(self) -> Skeleton | None:
        """The skeleton that this one was derived from, with its own source file if it has one."""
        base = self.skeleton.base
        return sourced_skeleton(self.container, base) if base else None

    @property
    def frame_rate(self) -> Fraction | None:
        """Frames a second, None while unknown."""
        if not self._row.rate_numerator:
            return None
        if not self._row.rate_denominator:
            raise FormatError("the denominator of the frame rate is 0", clip=self.name)
        return Fraction(self._row.rate_numerator, self._row.rate_denominator)

    @property
    def frame_rate_exact(self) -> bool:
        return not self._fields.flags & payloads.ROUNDED_RATE

    @cached_property
    def metadata(self) -> Mapping[str, str]:
        """Keys of the registry, or ``x-...``, and texts, as changed by META chunks."""
        return self.container.metadata(self._row)

    @property
    def counts_evenly(self) -> bool:
        """True if its frames are 1, 2, 3, ... without times of their own, as CLIP states."""
        flags = payloads.OPEN_CLIP | payloads.HAS_TIME_BASE
        timed = any(signal.role == payloads.TIMES for signal in self._fields.signals)
        return not (timed or self._fields.flags & flags)

    @cached_property
    def _time_base(self) -> payloads.TimeBase | None:
        return whole_time_base(self._fields, self._cend)

    @property
    def frame_numbers(self) -> NDArray[np.int64]:
        """The number of every frame, ascending: 1, 2, 3, ... without a time base."""
        where = f"clip {self.name!r}: frame numbers"
        check_decoded(where, 8 * self.n_frames, self.container.max_decoded)
        whole = not self.container.salvage
        return numbers_of(self._time_base, self.n_frames, self.name, whole=whole)

    @property
    def first_time(self) -> float | None:
        """The time of the first frame in seconds, None if its number and the rate imply it."""
        return None if self._time_base is None else self._time_base.first_time

    @property
    def damage(self) -> list[str]:
        """Damage of this clip that salvage found."""
        return self._row.damage

    @cached_property
    def signals(self) -> tuple[SignalInfo, ...]:
        """The signals; the motion, if there is one, is the first."""
        fields = self._fields
        if not fields.signals:  # CLIP-05
            raise FormatError("the clip has no signal", clip=self.name)
        check_roles(fields.signals, f"clip {self.name!r}")
        skeleton, rate = self.skeleton, self.frame_rate
        return tuple(
            read_signal(self.container, self._row, fields, index, skeleton, rate)
            for index in range(len(fields.signals))
        )

    @property
    def motion_signal(self) -> SignalInfo | None:
        """The signal with the role "motion", the first; None if there is none."""
        return self.signals[0] if self.signals[0].role == "motion" else None

    def signals_of(self, role: str) -> tuple[SignalInfo, ...]:
        """The signals of a role, one of ``mcz.model.signal.ROLES``."""
        return tuple(info for info in self.signals if info.role == role)

    @property
    def n_channels(self) -> int:
        """Channels of the first signal, the motion."""
        return self._row.signals[0].n_channels

    def __len__(self) -> int:
        """The number of frames."""
        return self.n_frames

    def __bool__(self) -> bool:
        """True, also without frames."""
        return True

    @property
    def shape(self) -> tuple[int, int]:
        """(n_frames, n_channels) of the motion signal."""
        return self.n_frames, self.n_channels

    def checked_range(self, frames: tuple[int, int] | None) -> tuple[int, int]:
        """``frames``, or all; raises OptionError if they are not in the clip."""
        if frames is None:
            return 0, self.n_frames
        try:
            start, stop = map(operator.index, frames)
        except (TypeError, ValueError):
            raise OptionError(
                f"frames is {frames!r}; it must be two integers, first and end"
            ) from None
        if not 0 <= start <= stop <= self.n_frames:
            count = count_text(self.n_frames, "frame")
            raise OptionError(f"it has {count}, not {start}:{stop}", clip=self.name)
        return start, stop

    @property
    def codec(self) -> str:
        """Name of the codec of the motion signal, ``codec N`` if it is unknown."""
        row = self._row.signals[0]
        try:
            return codec_by_id(row.codec, row.codec_version, row.preset).name
        except UnsupportedError:
            return f"codec {row.codec}"

    @property
    def source(self) -> SourceInfo | None:
        """Format, path, size and hash of the source file; None without one."""
        return source_info(self._fields, self._cend)

    @property
    def quality(self) -> dict[str, str] | None:
        """The quality record, with joints by name; None without one."""
        stored = self.stored_quality
        return None if stored is None else with_names(stored, self.skeleton)

    @property
    def stored_quality(self) -> dict[str, str] | None:
        """The quality record as stored, with joints by index."""
        for chunk in self._row.ancillary:
            if chunk.type == ChunkType.QUAL:
                fields = parse(payloads.Qual, self.container.payload(chunk), chunk.label)
                return {entry.key: entry.value for entry in fields.entries}
        return None

    def find_signal(self, signal: int | str) -> int:
        """The index of a signal given by index or name, the first of its name; OptionError."""
        if isinstance(signal, int):
            return signal
        names = [info.name for info in self.signals]
        if signal not in names:
            raise OptionError(
                f"clip {self.name!r} has no signal {signal!r}; its signals are {', '.join(names)}"
            )
        return names.index(signal)

    @cached_property
    def recording(self) -> Recording | None:
        """Facts in the source besides all numbers: events, force platforms, units, descriptions.

        None without any: only C3D has them. Raises FormatError on bad bytes.
        """
        try:
            return self._recording()
        except FormatError as error:
            self._complain(f"what its source says of the recording is lost: {error}", error)
            return None

    def _recording(self) -> Recording | None:
        return read_recording(self.container, self._fields, self.frame_rate)

    def scaling(self, signal: int) -> Scaling | None:
        """The scaling of the stored numbers of a signal; None: they are the values; FormatError.

        None also if salvage finds its source damaged: the numbers are intact.
        """
        try:
            return scaling_of(self.signals, signal, self._recording)
        except FormatError as error:
            name = self.signals[signal].name
            self._complain(f"the numbers of signal {name} are as they were stored: {error}", error)
            return None

    def is_scaled(self, signal: int) -> bool:
        """Return whether a signal's source scales its stored numbers, or did before damage."""
        try:
            return scaling_of(self.signals, signal, self._recording) is not None
        except FormatError:
            if not self.container.salvage:
                raise
            return True

    def _complain(self, text: str, error: FormatError) -> None:
        """Add to the damage found by salvage, once; raise ``error`` without salvage."""
        if not self.container.salvage:
            raise error
        line = f"clip {self.name!r}: {text}"
        if line not in self.container.damage:
            self.container.damage.append(line)

    @cached_property
    def value_hashes(self) -> tuple[bytes, ...]:
        """The SHA-256 of the values and the mask of every signal, as the file states them."""
        if self._cend is None:  # of a damaged file
            raise FormatError("the clip has no CEND", clip=self.name)
        hashes = tuple(bytes(each) for each in self._cend.value_sha256)
        if len(hashes) != len(self.signals):  # CEND-02
            raise FormatError(
                f"{len(hashes)} hashes for {len(self.signals)} signals", clip=self.name
            )
        return hashes


def with_names(entries: Mapping[str, str], skeleton: Skeleton) -> dict[str, str]:
    """The entries of a stored record with names of joints; an index beyond all stays."""
    return _translate_keys(entries, _name_of(skeleton.addresses()), _name_of(point_names(skeleton)))


def with_indices(entries: Mapping[str, str], skeleton: Skeleton) -> dict[str, str]:
    """The entries as a file has them; joints that ``skeleton`` lacks are left out."""
    return _translate_keys(
        entries, _index_of(skeleton.addresses()), _index_of(point_names(skeleton))
    )


def _name_of(names: Sequence[str]) -> Lookup:
    def look_up(text: str) -> str:
        known = _INDEX.fullmatch(text) and int(text) < len(names)
        return names[int(text)] if known else text

    return look_up


def _index_of(names: Sequence[str]) -> Lookup:
    places = {name: str(index) for index, name in reversed(list(enumerate(names)))}

    def look_up(text: str) -> str | None:
        return places.get(text, None if _INDEX.fullmatch(text) else text)

    return look_up


def _translate_keys(entries: Mapping[str, str], joint: Lookup, point: Lookup) -> dict[str, str]:
    translated = {}
    for key, value in entries.items():
        before = _BEFORE.match(key)
        assert before is not None
        start, name, text = before[0], key[before.end() :], value
        if name in LISTS or name in WORDS:
            words = [_WORD.fullmatch(word) for word in value.split(",")]
            parts = [(joint(word[1]), word[2]) for word in words if word is not None]
            text = ",".join(f"{known}{rest}" for known, rest in parts if known is not None)
        elif name in JOINTS or name == POINT:
            text = (joint if name in JOINTS else point)(value) or ""
        elif name.startswith(REACHED):
            known = joint(name.removeprefix(REACHED))
            name = "" if known is None else REACHED + known
        if name and (text or not value):
            translated[start + name] = text
    return translated
