"""The figures of a comparison or of a quality record, as people read them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from mcz.cli.common import plural, printable, table

SETTING = "param."
SHOWN_ELSEWHERE = (
    *("frames", "channels", "point_set", "points", "unit_cm", "codec"),
    *("max_position_error_frame", "max_position_error_point"),
)
WIDEST = 80  # characters that are shown of a key or value: records in files may say anything
UNCUT = "uncut_"  # in front of the figures of a clip before it was cut
DISTANCES = ("rms_coordinate_error", "mean_position_error", "max_position_error")


def figure_lines(entries: Mapping[str, Any]) -> Iterator[str]:
    """Lines of the figures in ``entries``, metric id -> number or text; None is left out."""
    held = {_shown(k): _shown(v) for k, v in entries.items() if v is not None}
    yield from _what(held)
    rows = [["metric", "value", "unit", "cm", ""], *_rows(held)]
    if len(rows) > 1:
        yield from table(rows, "lrlrl").split("\n")


def reached(quality: Mapping[str, str]) -> str:
    """The error of a lossy clip in one line: of its points, or, without any, of its channels."""
    cm = "mean_position_error_cm" in quality
    suffix, unit = ("_cm", "cm") if cm else ("", "units")
    mean, most = (quality.get(f"{key}_position_error{suffix}") for key in ("mean", "max"))
    if mean is None or most is None:
        mse = quality.get("mse")
        text = "error unknown" if mse is None else f"mean squared error of channels {_number(mse)}"
    else:
        where = ", ".join(
            f"{word} {quality[f'max_position_error_{word}']}"
            for word in ("frame", "point")
            if f"max_position_error_{word}" in quality
        )
        text = f"error of positions: mean {_number(mean)} {unit}, greatest {_number(most)} {unit}"
        text += f" ({where})" if where else ""
        text += "" if cm else "; --unit gives centimeters"
    remark = quality.get("target_remark")
    return f"{text}; {remark}" if remark else text


def _what(held: Mapping[str, str]) -> Iterator[str]:
    """Settings, and how much was compared."""
    if "codec" in held:
        settings = [
            f"{key.removeprefix(SETTING)} {value}"
            for key, value in held.items()
            if key.startswith(SETTING)
        ]
        yield ", ".join([f"codec {held['codec']}", *settings])
    counts = [
        plural(int(held[key]), key.removesuffix("s"))
        for key in ("frames", "channels", "points")
        if _is_number(held.get(key))
    ]
    if "point_set" in held:
        counts.append(f"point set {held['point_set']}")
        unit = held.get("unit_cm")
        counts.append(f"1 unit = {_number(unit)} cm" if unit else "unit unknown")
    if counts:
        yield ", ".join(counts)


def _rows(held: Mapping[str, str]) -> Iterator[list[str]]:
    where = [
        f"{word} {held[key]}"
        for word, key in (
            ("frame", "max_position_error_frame"),
            ("point", "max_position_error_point"),
        )
        if key in held
    ]
    for key, value in held.items():
        metric = key.removeprefix(UNCUT)
        beside = key.removesuffix("_cm") in held and key.endswith("_cm")
        if key in SHOWN_ELSEWHERE or key.startswith(SETTING) or beside:
            continue
        note = ", ".join(where) if key == "max_position_error" else ""
        if key.endswith("_cm"):
            yield [key.removesuffix("_cm"), "", "", _number(value), note]
        elif metric in DISTANCES:
            yield [key, _number(value), "units", _number(held.get(f"{key}_cm", "")), note]
        else:
            squared = "channels, squared" if metric.rpartition(".")[2].startswith("mse") else ""
            yield [key, _number(value), squared, "", note]


def _shown(value: Any) -> str:
    return printable(str(value)[:WIDEST])


def _is_number(value: Any) -> bool:
    try:
        int(value)
    except (TypeError, ValueError):
        return False
    return True


def _number(value: Any) -> str:
    """
    >>> _number("0.20411111"), _number(3), _number("?")
    ('0.204111', '3', '?')
    """
    try:
        return f"{float(value):.6g}"
    except (TypeError, ValueError):
        return str(value)
