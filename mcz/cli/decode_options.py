"""Options, input and selected parts of ``mcz decode`` and ``mcz convert``, and their checks.

A selection of a clip is written as a source file, a motion or a table.
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from fractions import Fraction
from hashlib import sha256
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mcz.cli.common import Exit, Failure, errors_about, in_options, open_input, require_file
from mcz.cli.outputs import CONVERSIONS, SCENES
from mcz.cli.terminal import say
from mcz.files.reading.differences import CUT, FILTERED, LOSSY, SALVAGED, fidelity_of
from mcz.model.types import Params, Values

if TYPE_CHECKING:
    from mcz.files.reading.clip import Clip
    from mcz.files.reading.file import File
    from mcz.files.tables import Event, Table
    from mcz.model.clock import Timeline
    from mcz.model.motion import Motion


EVENTS = "events"  # a signal that tables make of a recording


class DecodeOptions(NamedTuple):
    """The options of ``mcz decode`` and ``mcz convert``, by name."""

    frames: tuple[int, int | None] | None = None
    joints: str | None = None
    resolution: int = 0
    decimate: bool = False
    preview: bool = False
    filtered: bool = False
    target: str | None = None
    rate: Fraction | None = None
    solve: bool = False
    with_skeleton: bool = False
    up: str | None = None
    unit: str | None = None
    key_error: float | None = None
    signal: str | None = None
    stored: bool = False

    @property
    def is_converted(self) -> bool:
        """Return whether the target is a motion or scene format."""
        return self.target in CONVERSIONS or self.is_scene

    @property
    def is_scene(self) -> bool:
        """Return whether the target is a scene format."""
        return self.target in SCENES


def check_options(options: DecodeOptions, salvage: bool) -> None:
    """Raise Failure for options that exclude each other."""
    if not options.target or options.is_converted:
        refuse(options.joints is not None, "--joints needs --to csv or --to npz")
    lone = options.frames is not None or options.resolution or salvage or options.filtered
    refuse(
        options.preview and (options.target is None or bool(lone)),
        "--preview needs --to, and excludes --frames, --resolution, --salvage and --post-filter",
    )
    refuse(options.decimate and not options.resolution, "--decimate needs --resolution")
    refuse(
        options.rate is not None and not (options.is_converted or options.filtered),
        f"--rate needs --to {' or '.join((*CONVERSIONS, *SCENES))}, or --post-filter",
    )
    refuse(
        options.solve and options.target not in ("amc", "bvh", *SCENES),
        f"--solve-ik needs {' or '.join(f'--to {to}' for to in ('amc', 'bvh', *SCENES))}",
    )


def check_signal(options: DecodeOptions) -> None:
    """Raise Failure for options that do not apply to a signal other than the motion."""
    numbers = options.target is not None and not options.is_converted
    refuse(options.signal is not None and not numbers, "--signal needs --to csv or --to npz")
    refuse(options.stored and options.signal in (None, EVENTS), "--stored needs --signal")
    other = options.joints is not None or options.preview or options.filtered
    refuse(
        options.signal is not None and other,
        "--signal excludes --joints, --preview and --post-filter",
    )
    is_picture = options.is_scene
    refuse(
        options.up is not None and not (is_picture or options.target == "c3d"),
        f"--up needs --to {' or '.join(('c3d', *SCENES))}",
    )
    refuse(
        options.unit is not None and not options.is_converted,
        f"--unit needs --to {' or '.join((*CONVERSIONS, *SCENES))}",
    )
    refuse(options.key_error is not None and options.target != "glb", "--key-error needs --to glb")


def refuse(wrong: bool, reason: str) -> None:
    """Raise Failure with the reason if ``wrong``."""
    if wrong:
        raise Failure(reason, Exit.USAGE)


SOURCE_GIVEN = (
    "a source file, not an .mcz; set the output with -o or --to, or compress it with mcz encode"
)
NO_LIMIT = 2**53  # of decoded bytes: the file was just written


@dataclass(frozen=True, slots=True)
class Input:
    """A file, and options of its reader; ``facts`` are arguments of ``mcz.encode``."""

    file: str
    salvage: bool = False
    unverified: bool = False
    max_decoded: int | None = None
    facts: Params = field(default_factory=dict)

    @property
    def is_source(self) -> bool:
        from mcz.files.reading.file import is_source

        return is_source(self.file)

    def with_facts(self, options: DecodeOptions) -> tuple[Input, DecodeOptions]:
        """Move the facts from the options of a source file to the input; return both."""
        refuse(self.salvage or self.unverified, "--salvage and --unverified need an .mcz")
        facts = {"unit": options.unit, "up": options.up, "rate": options.rate}
        merged = replace(self, facts=dict(self.facts) | facts)
        return merged, options._replace(unit=None, up=None, rate=None)

    @contextmanager
    def open_file(self) -> Iterator[tuple[File, tuple[str, ...]]]:
        """The open .mcz, in memory for a source file, and the files that were read for it."""
        if not self.is_source:
            options = {"salvage": self.salvage, "unverified": self.unverified, "verify": True}
            with open_input(self.file, max_decoded=self.max_decoded, **options) as file:  # CEND-06
                yield file, (self.file,)
            return
        import mcz

        require_file(self.file)
        coded = io.BytesIO()
        with errors_about(self.file):
            written = mcz.encode(self.file, coded, profile="large", **self.facts)
            for note in written.notes:
                say(f"{self.file}: {in_options(note)}")
            with mcz.open(coded.getvalue(), max_decoded=NO_LIMIT) as file:
                yield file, written.inputs


@dataclass(frozen=True, slots=True)
class ClipSelection:
    """Selected frames of a clip at a resolution; ``rate`` is used if the clip states none."""

    clip: Clip
    frames: tuple[int, int] | None
    resolution: int
    decimate: bool
    rate: Fraction | None

    def source_bytes(self) -> bytes:
        """The source file, of these frames."""
        return self.clip.source_bytes(self.frames, self.resolution, decimate=self.decimate)

    def fidelity(self, data: bytes) -> str:
        """A word for the fidelity of its ``source_bytes``, ``data``, to the source file."""
        whole, source = fidelity_of(self.clip), self.clip.source
        if whole == LOSSY or self.resolution:
            return LOSSY
        is_checked = self.frames is None and not self.clip.container.salvage
        if is_checked or (source is not None and sha256(data).digest() == source.sha256):
            return whole
        return CUT if self.frames is not None else SALVAGED

    def motion(self) -> Motion:
        return self.clip.motion(self.frames, self.resolution, decimate=self.decimate)

    def table(self, joints: Sequence[int | str] | None, names: list[str]) -> Table:
        """The channels of ``joints``, under their ``names``."""
        values, mask = self.clip.read_masked(self.frames, joints, self.resolution)
        return self._table(values, mask, 0, names)

    def of_signal(self, signal: int, stored: bool, names: list[str], units: list[str]) -> Table:
        """All channels of another signal, in their units, or as ``stored``."""
        values, mask = self.clip.read_masked(self.frames, None, self.resolution, signal=signal)
        scaling = self.clip.scaling(signal)
        if scaling is not None:
            if stored:
                units = [""] * len(units)
            else:
                values = scaling.values(values)
        return self._table(values, mask, signal, names, units)

    def events(self, events: Sequence[Event]) -> list[Event]:
        """The events within the selected frames, by time."""
        timeline, (start, stop) = self._timeline(), self.frames or (0, self.clip.n_frames)
        if self.frames is None or timeline is None or start == stop:
            return list(events)
        first, last = timeline.times[start], timeline.times[stop - 1]
        return [event for event in events if first <= event.time <= last]

    def _table(
        self,
        values: Values,
        mask: NDArray[np.bool_] | None,
        signal: int,
        names: list[str],
        units: Sequence[str] = (),
    ) -> Table:
        """A table of the chosen rows and columns of a signal."""
        from mcz.files.reading.views import decimate_rows
        from mcz.files.tables import Table

        clip, per_frame = self.clip, self.clip.signals[signal].samples_per_frame
        mask = np.ones(values.shape, np.bool_) if mask is None else mask
        start, stop = self.frames or (0, clip.n_frames)
        numbers, rate = clip.frame_numbers[start:stop], self.rate or clip.frame_rate
        timeline = self._timeline()
        times = None
        if timeline is not None:
            times = timeline.samples(per_frame)[start * per_frame : stop * per_frame]
        if self.decimate:
            step = 2**self.resolution
            values = decimate_rows(values, per_frame, step)
            mask = decimate_rows(mask, per_frame, step)
            numbers, rate = numbers[::step], rate and rate / step
            if times is not None:
                times = decimate_rows(times[:, None], per_frame, step)[:, 0]
        return Table(
            names,
            _floats(values),
            mask,
            _repeat_rows(numbers, len(values)),
            rate,
            units,
            times=times,
            samples_per_frame=per_frame,
        )

    def _timeline(self) -> Timeline | None:
        return self.clip.timeline_at(self.rate)


class FilteredSelection(ClipSelection):
    """A ``ClipSelection`` of a ``FilteredClip``."""

    def fidelity(self, data: bytes) -> str:
        return FILTERED


class PreviewSelection(ClipSelection):
    """The frames of a clip that can be read without decoding the rest."""

    def motion(self) -> Motion:
        return preview_motion(self.clip)

    def table(self, joints: Sequence[int | str] | None, names: list[str]) -> Table:
        from mcz.files.tables import Table

        preview = self.clip.read_preview(joints)
        numbers, rate = self.clip.frame_numbers[preview.frames], self.clip.frame_rate
        timeline = self._timeline()
        return Table(
            names,
            _floats(preview.values),
            np.ones(preview.values.shape, np.bool_) if preview.mask is None else preview.mask,
            _repeat_rows(numbers, len(preview.values)),
            rate / preview.step if rate is not None and preview.is_regular else None,
            times=None if timeline is None else timeline.times[preview.frames],
        )


def preview_motion(clip: Clip) -> Motion:
    """The preview as a motion at a lower frame rate, without the further signals and the source.

    A last frame at a shorter distance is left out.
    """
    from mcz.model.clock import Timeline
    from mcz.model.motion import Motion, Signal

    preview = clip.read_preview()
    gaps = np.diff(preview.frames)
    n_frames = len(preview.frames) - int(len(gaps) > 0 and gaps[-1] != preview.step)
    info, rate = clip.signals[0], clip.frame_rate
    n_rows = n_frames * info.layout.samples_per_frame
    signal = Signal(
        values=preview.values[:n_rows],
        grids=info.grids,
        name=info.name,
        samples_per_frame=info.layout.samples_per_frame,
        mask=None if preview.mask is None else preview.mask[:n_rows],
        channels=info.channels,
        role=info.role if info.of is None else "",
    )
    frames, timeline = preview.frames[:n_frames], clip.timeline
    motion = Motion(
        skeleton=clip.skeleton,
        signals=(signal,),
        frame_rate=None if rate is None else rate / preview.step,
        frame_rate_exact=clip.frame_rate_exact,
        name=clip.name,
        metadata=clip.metadata,
        frame_numbers=clip.frame_numbers[frames],
        number_step=preview.step,
    )
    if timeline is not None:
        timeline = Timeline(timeline.times[frames], motion.frame_rate, timeline.rounding)
    return motion.at_times(timeline)


def _floats(values: Values) -> NDArray[np.float64]:
    return np.asarray(values, dtype=np.float64)


def _repeat_rows(numbers: NDArray[np.int64], n_rows: int) -> NDArray[np.int64]:
    return np.repeat(numbers, n_rows // max(1, len(numbers)))
