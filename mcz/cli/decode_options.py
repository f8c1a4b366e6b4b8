"""Options and input of ``mcz decode`` and ``mcz convert``, and checks of their combinations."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import TYPE_CHECKING, NamedTuple

from mcz.cli.common import Exit, Failure, errors_about, open_input, require_file, say
from mcz.cli.hints import in_options
from mcz.cli.outputs import CONVERSIONS, SCENES
from mcz.model.types import Params

if TYPE_CHECKING:
    from mcz.files.reading.file import File


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
    shown = options.is_scene
    refuse(
        options.up is not None and not (shown or options.target == "c3d"),
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
        given = replace(self, facts=dict(self.facts) | facts)
        return given, options._replace(unit=None, up=None, rate=None)

    @contextmanager
    def opened(self) -> Iterator[tuple[File, tuple[str, ...]]]:
        """The open .mcz, of a source file one in memory; and the files that were read for it."""
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
