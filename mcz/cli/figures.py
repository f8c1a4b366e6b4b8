"""The figures of a comparison or of a quality record, as text."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from mcz.cli.terminal import plural, printable, table
from mcz.model.types import Params

SETTING = "param."
SHOWN_ELSEWHERE = (
    *("frames", "channels", "point_set", "points", "unit_cm", "codec"),
    *("max_position_error_frame", "max_position_error_point"),
    *("shell_radius_cm", "shell_max_frame", "shell_max_joint"),
    *("contacts", "contact_frames", "slide_mean_mm", "slide_max_mm", "slide_max_frame"),
    *("slide_max_joint", "slide_path_mm", "slide_path_original_mm"),
)
WIDEST = 80  # shown characters of a key or value: records in files may have any
UNCUT = "uncut_"  # in front of the figures of a clip before it was cut
UNITS = {  # by how an id ends
    **dict.fromkeys(("mse", "mse_raw"), "channels, squared"),
    **dict.fromkeys((".max_error", ".mean_error"), "channels"),
    "_cm_s": "cm/s",
    "_cm_s2": "cm/s2",
}
DISTANCES = ("rms_coordinate_error", "mean_position_error", "max_position_error")


def figure_lines(entries: Params) -> Iterator[str]:
    """Lines of the figures in ``entries``, metric id -> number or text; None is left out."""
    figures = {_printable_text(k): _printable_text(v) for k, v in entries.items() if v is not None}
    yield from _subject_words(figures)
    rows = [["metric", "value", "unit", "cm", ""], *_rows(figures)]
    if len(rows) > 1:
        yield from table(rows, "lrlrl")
    yield from _contact_lines(figures)


def error_summary(quality: Mapping[str, str]) -> str:
    """The error of a lossy clip on one line, of its channels if it has no points."""
    cm = "mean_position_error_cm" in quality
    suffix, unit = ("_cm", "cm") if cm else ("", "units")
    mean, most = (quality.get(f"{key}_position_error{suffix}") for key in ("mean", "max"))
    if mean is None or most is None:
        mse = quality.get("mse")
        text = "error unknown" if mse is None else f"mean squared error of channels {_number(mse)}"
        greatest = quality.get("max_channel_error")
        if greatest is not None:
            frame, channel = (quality[f"max_channel_error_{word}"] for word in ("frame", "channel"))
            text += f", greatest error {_number(greatest)} (frame {frame}, {channel})"
            if "param.max_error" not in quality:
                text += "; no bound is kept for channels that place no point"
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


def _subject_words(figures: Mapping[str, str]) -> Iterator[str]:
    """Settings, and how much was compared."""
    if "codec" in figures:
        settings = [
            f"{key.removeprefix(SETTING)} {value}"
            for key, value in figures.items()
            if key.startswith(SETTING)
        ]
        yield ", ".join([f"codec {figures['codec']}", *settings])
    counts = [
        plural(int(figures[key]), key.removesuffix("s"))
        for key in ("frames", "channels", "points")
        if _is_number(figures.get(key))
    ]
    if "point_set" in figures:
        counts.append(f"point set {figures['point_set']}")
        unit = figures.get("unit_cm")
        counts.append(f"1 unit = {_number(unit)} cm" if unit else "unit unknown")
    if counts:
        yield ", ".join(counts)


def _rows(figures: Mapping[str, str]) -> Iterator[list[str]]:
    notes = {
        "max_position_error": _place_text(figures, "max_position_error", "point"),
        "shell_mean_cm": _radius(figures),
        "shell_max_cm": _place_text(figures, "shell_max", "joint"),
    }
    for key, value in figures.items():
        metric = key.removeprefix(UNCUT)
        beside = key.removesuffix("_cm") in figures and key.endswith("_cm")
        if key in SHOWN_ELSEWHERE or key.startswith(SETTING) or beside:
            continue
        note = notes.get(key, "")
        if key.endswith("_cm"):
            yield [key.removesuffix("_cm"), "", "", _number(value), note]
        elif metric in DISTANCES:
            yield [key, _number(value), "units", _number(figures.get(f"{key}_cm", "")), note]
        else:
            unit = next((unit for end, unit in UNITS.items() if key.endswith(end)), "")
            yield [key, _number(value), unit, "", note]


def _place_text(figures: Mapping[str, str], metric: str, label: str) -> str:
    """The place of a maximum, if recorded: ``frame 7, point Head``."""
    words = ("frame", label)
    return ", ".join(f"{w} {figures[f'{metric}_{w}']}" for w in words if f"{metric}_{w}" in figures)


def _radius(figures: Mapping[str, str]) -> str:
    radius = figures.get("shell_radius_cm")
    return "" if radius is None else f"{_number(radius)} cm from where joints start"


def _contact_lines(figures: Mapping[str, str]) -> Iterator[str]:
    if "contacts" not in figures:
        return
    some = figures["contacts"] != "0" and "contact_frames" in figures
    frames = f", {figures['contact_frames']} frames" if some else ""
    yield f"contacts of feet: {figures['contacts']}{frames}"
    keys = ("mean", "max", "path", "path_original")
    mean, most, path, meant = (_number(figures.get(f"slide_{key}_mm", "?")) for key in keys)
    if "slide_mean_mm" in figures:
        where = _place_text(figures, "slide_max", "joint")
        at = f" ({where})" if where else ""
        yield f"feet slide {mean} mm on average, at most {most} mm{at}"
    if "slide_path_mm" in figures:
        yield f"feet move {path} mm in all, {meant} mm in the original"


def _printable_text(value: object) -> str:
    return printable(str(value)[:WIDEST])


def _is_number(value: str | float | None) -> bool:
    try:
        return value is not None and isinstance(int(value), int)
    except ValueError:
        return False


def _number(value: str | float) -> str:
    """
    >>> _number("0.20411111"), _number(3), _number("?")
    ('0.204111', '3', '?')
    """
    try:
        return f"{float(value):.6g}"
    except (TypeError, ValueError):
        return str(value)
