"""Parameters of codecs: their parsers, defaults, targets and presets; step codes."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from mcz.model.checks import choice as choice
from mcz.model.checks import in_range as in_range
from mcz.model.checks import integer as integer
from mcz.model.checks import number as number
from mcz.model.types import Params, Settings

MAX_DECIMALS = 15
SCALED = 255  # in place of decimals: scaled steps
MIDDLE_CODE = 128  # the step code of 1
DEFAULT_IN_HELP = re.compile("(.+); default:? (.+)")  # defaults that a preset or the clip decides

Presets = Mapping[str, Params]


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter of a codec, as set by ``--param name=value``.

    ``inner``: set only by a search for a target, not listed and not recorded. ``show`` formats a
    value as text that ``parse`` reads (None: numbers or words, separated by commas).
    """

    name: str
    default: object
    help: str
    parse: Callable[[Any], Any]
    inner: bool = False
    show: Callable[[Any], str] | None = None

    def recorded_value(self, value: object) -> Any:
        """Return a value as quality records store it."""
        return value if self.show is None or value is None else self.show(value)

    @property
    def range(self) -> str:
        """Range in words; "" if ``parse`` states none."""
        return str(getattr(self.parse, "range", ""))

    def document(self) -> Settings:
        """Name, default, range and meaning, for JSON."""
        match = DEFAULT_IN_HELP.fullmatch(self.help)
        decided, meaning = (match[2], match[1]) if match else (None, self.help)
        default = decided if self.default is None else self.default
        return {"name": self.name, "default": default, "range": self.range, "meaning": meaning}


@dataclass(frozen=True, slots=True)
class Dial:
    """The one parameter that trades quality for size: the greater, the smaller the file.

    ``rises``: greater means better quality instead. ``is_integer``: settings are integers. To meet
    a target size or error, it is searched between ``low`` and ``high``, starting at ``guess``
    (target, limit) if that returns a setting.
    """

    parameter: str
    low: float
    high: float
    rises: bool = False
    is_integer: bool = False
    guess: Callable[[str, float], float | None] | None = None


def _bounds(text: Any) -> str:
    """Keep bounds of channels as text; they are parsed once the units are known."""
    return str(text)


# Targets, which a caller may set instead of the dial of a codec; None: unset
TARGETS = (
    Parameter(
        "target_bytes",
        None,
        "greatest size in bytes: payload, overhead and models",
        integer("target_bytes", 1, 2**53 - 1),
    ),
    Parameter(
        "kbps",
        None,
        "greatest rate in kilobits of payload a second, framing not counted",
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
    """Return the parameter that names one of ``presets``: default, or the published method."""
    (published,) = set(presets) - {"default"}
    help_ = f"default, or {published} for the published method"
    return Parameter("preset", "default", help_, choice("preset", tuple(presets)))


def decimals_parameter(help_: str) -> Parameter:
    return Parameter("Q", None, help_, integer("Q", 0, MAX_DECIMALS))


def preset_values(presets: Presets, params: Params) -> Settings:
    """Values of a preset, each replaced by the caller's if given."""
    values = presets[params["preset"]].items()
    return {name: value if params[name] is None else params[name] for name, value in values}


def ratio_of(code: int) -> float:
    """Step of a step code, about 2^((code - 128) / 4). SPEC.md, "Steps and scales"."""
    return math.ldexp(4 + code % 4, code // 4 - 34)


def code_of(ratio: float) -> int:
    """The step code nearest to a ratio."""
    if ratio <= 0:
        return 0
    if ratio == math.inf:
        return 255
    guess = int(4 * math.log2(ratio)) + MIDDLE_CODE
    near = range(max(0, guess - 2), min(255, guess + 3) + 1)
    return min(
        near, key=lambda c: abs(math.log(ratio_of(c) / ratio)), default=0 if guess < 0 else 255
    )
