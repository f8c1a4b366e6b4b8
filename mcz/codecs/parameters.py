"""Parameters of codecs: what a caller may set, how its text is read, presets of several at once."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from mcz.arguments import choice as choice
from mcz.arguments import in_range as in_range
from mcz.arguments import integer as integer
from mcz.arguments import number as number
from mcz.types import Params, Settings

MAX_DECIMALS = 15
SCALED = 255  # in place of decimals: there are steps

Presets = Mapping[str, Params]


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter of a codec, as ``--param name=value`` gives it.

    ``inner``: it is found by a search for a target; nobody is told of it, and no record names it.
    ``show`` gives the text from which ``parse`` makes a value (None: numbers or words as they are,
    with commas between several).
    """

    name: str
    default: object
    help: str
    parse: Callable[[Any], Any]
    inner: bool = False
    show: Callable[[Any], str] | None = None

    def shown(self, value: object) -> Any:
        """A value as a record is given it."""
        return value if self.show is None or value is None else self.show(value)

    @property
    def range(self) -> str:
        """Range in words; "" if ``parse`` states none."""
        return str(getattr(self.parse, "range", ""))


@dataclass(frozen=True, slots=True)
class Dial:
    """The one parameter that trades quality for size: the greater, the smaller the file.

    ``rises``: the greater, the better the quality instead. ``whole``: it is an integer. A caller
    who names a size or an error has it searched for between ``low`` and ``high``, from ``guess`` on
    where that gives a setting for a target and its limit.
    """

    parameter: str
    low: float
    high: float
    rises: bool = False
    whole: bool = False
    guess: Callable[[str, float], float | None] | None = None


def _bounds(text: Any) -> str:
    """Bounds of channels, which are read where the units of these are known."""
    return str(text)


# What a caller may ask for instead of setting the dial of a codec; None: not asked for.
TARGETS = (
    Parameter(
        "target_bytes",
        None,
        "at most so many bytes of payload, overhead and models",
        integer("target_bytes", 1, 2**53 - 1),
    ),
    Parameter(
        "kbps",
        None,
        "at most so many kilobits of payload a second, framing not counted",
        number("kbps", 1e-9, 1e9),
    ),
    Parameter(
        "mean_error",
        None,
        "at most this mean error of each channel of the motion",
        in_range("0.1, or 0.1deg,1mm", _bounds),
    ),
    Parameter(
        "max_error",
        None,
        "at most this error of each channel of the motion",
        in_range("0.1, or 0.1deg,1mm", _bounds),
    ),
    Parameter(
        "mean_error_cm",
        None,
        "at most this mean position error",
        number("mean_error_cm", 1e-9, 1e9),
    ),
    Parameter(
        "max_error_cm",
        None,
        "at most this maximum position error",
        number("max_error_cm", 1e-9, 1e9),
    ),
)


def preset_parameter(presets: Presets) -> Parameter:
    """The parameter that names one of ``presets``: default, or the published method's."""
    (published,) = set(presets) - {"default"}
    help_ = f"default, or {published} for the published method"
    return Parameter("preset", "default", help_, choice("preset", tuple(presets)))


def decimals_parameter(help_: str) -> Parameter:
    return Parameter("Q", None, help_, integer("Q", 0, MAX_DECIMALS))


def preset_values(presets: Presets, params: Params) -> Settings:
    """Values of a preset, each replaced by the caller's where given."""
    values = presets[params["preset"]].items()
    return {name: value if params[name] is None else params[name] for name, value in values}
