"""Estimates of the time that an export takes. Nothing here knows Blender."""

from __future__ import annotations

from mcz.kernels import lacks_compiled_kernels

# CPU time a value, on one core, of 2,783 frames of 62 channels: docs/guides/blender.md
COMPILED = {"fast": 0.7e-6, "best": 11e-6, "lossy": 72e-6}
INTERPRETED = {"fast": 22e-6, "best": 1.25e-3, "lossy": 4.1e-3}
SHORT = 60.0  # seconds for which nobody is warned


def seconds_of(codec: str, n_values: int) -> float:
    """Estimate how long ``n_values`` numbers take to encode."""
    speeds = INTERPRETED if lacks_compiled_kernels() else COMPILED
    return n_values * speeds[codec]


def slow_warning(codec: str, n_values: int) -> str:
    """Return a warning for an export of over a minute, with how long it may take, or nothing."""
    seconds = seconds_of(codec, n_values)
    if seconds <= SHORT:
        return ""
    why = "without compiled kernels " if lacks_compiled_kernels() else ""
    text = f"{why}this export takes up to {in_words(seconds)}, and Blender waits for it"
    if codec != "fast":
        text += f"; with codec Fast, {in_words(seconds_of('fast', n_values))}"
    return text[0].upper() + text[1:]


def in_words(seconds: float) -> str:
    """A duration, rounded up to a unit that suits it."""
    for size, unit in ((3600, "hour"), (60, "minute")):
        if seconds > 2 * size:
            return f"{-(-seconds // size):.0f} {unit}s"
    count = max(1, -(-seconds // 1))
    return f"{count:.0f} second{'s' if count > 1 else ''}"
