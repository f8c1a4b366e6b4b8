"""Options of ``mcz decode``, and checks of their combinations."""

from __future__ import annotations

from fractions import Fraction
from typing import NamedTuple

from mcz.cli.common import Exit, Failure
from mcz.cli.suffixes import CONVERSIONS, SCENES

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


def check_options(wanted: DecodeOptions, salvage: bool) -> None:
    """Raise Failure for options that do not go together."""
    if not wanted.target or wanted.is_converted:
        refuse(wanted.joints is not None, "--joints needs --to csv or --to npz")
    lone = wanted.frames is not None or wanted.resolution or salvage or wanted.filtered
    refuse(
        wanted.preview and (wanted.target is None or bool(lone)),
        "--preview needs --to, and goes with none of --frames --resolution --salvage --post-filter",
    )
    refuse(wanted.decimate and not wanted.resolution, "--decimate needs --resolution")
    refuse(
        wanted.rate is not None and not (wanted.is_converted or wanted.filtered),
        f"--rate needs --to {' or '.join((*CONVERSIONS, *SCENES))}, or --post-filter",
    )
    refuse(
        wanted.solve and wanted.target not in ("amc", "bvh", *SCENES),
        f"--solve-ik needs {' or '.join(f'--to {to}' for to in ('amc', 'bvh', *SCENES))}",
    )


def check_signal(wanted: DecodeOptions) -> None:
    """Raise Failure for options that do not go with a signal that is not the motion."""
    numbers = wanted.target is not None and not wanted.is_converted
    refuse(wanted.signal is not None and not numbers, "--signal needs --to csv or --to npz")
    refuse(wanted.stored and wanted.signal in (None, EVENTS), "--stored needs --signal")
    other = wanted.joints is not None or wanted.preview or wanted.filtered
    refuse(
        wanted.signal is not None and other,
        "--signal goes with none of --joints --preview --post-filter",
    )
    shown = wanted.is_scene
    refuse(
        wanted.up is not None and not (shown or wanted.target == "c3d"),
        f"--up needs --to {' or '.join(('c3d', *SCENES))}",
    )
    refuse(
        wanted.unit is not None and not wanted.is_converted,
        f"--unit needs --to {' or '.join((*CONVERSIONS, *SCENES))}",
    )
    refuse(wanted.key_error is not None and wanted.target != "glb", "--key-error needs --to glb")


def refuse(wrong: bool, reason: str) -> None:
    """Raise Failure with the reason if ``wrong``."""
    if wrong:
        raise Failure(reason, Exit.USAGE)
