"""Recording lines of ``mcz info``: events, force platforms, channels, outputs."""

from __future__ import annotations

from collections.abc import Iterator

from mcz.cli.common import plural, table
from mcz.model.types import JsonObject

MOST = 24  # rows of a list; --json has all of them


def recording_lines(recording: JsonObject | None) -> Iterator[str]:
    """The lines for a part ``recording`` of the document of ``mcz info``."""
    if recording is None:
        return
    yield f"  recording  {', '.join(_facts(recording))}"
    events = [
        [_time(event["time"]), event["context"], event["label"], event["subject"]]
        for event in recording["events"]
    ]
    yield from _rows(["event at", "side", "label", "subject"], events, "rlll")
    platforms = [
        [
            f"{number}",
            _text(platform["type"]),
            " ".join(map(str, platform["channels"])),
            " ".join(map(_vector, platform["corners"])),
            _vector(platform["origin"]),
        ]
        for number, platform in enumerate(recording["platforms"], 1)
    ]
    heads = ["platform", "type", "channels", "corners", "origin"]
    yield from _rows(heads, platforms, "rrlll")
    channels = [
        [f"{number}", channel["name"], channel["unit"], channel["description"]]
        for number, channel in enumerate(recording["analog"], 1)
    ]
    yield from _rows(["channel", "name", "unit", "description"], channels, "rlll")
    outputs = [
        [point["name"], point["unit"], " ".join(point["groups"]).lower(), point["description"]]
        for point in recording["points"]
        if point["groups"]
    ]
    yield from _rows(["output", "unit", "of", "description"], outputs, "llll")


def array_lines(arrays: list[JsonObject] | None) -> Iterator[str]:
    """The lines for a part ``arrays`` of the document: each that is read, then what is kept."""
    if arrays is None:
        return
    for array in arrays:
        if array["signal"] is not None:
            name = array["name"] or "numbers"
            order = ", by columns" if array["order"] == "F" else ""
            columns = plural(array["columns"], "column")
            yield f"  array      {name}: {columns} of {array['type']}{order}, in {array['signal']}"
    kept = [array["name"] for array in arrays if array["signal"] is None]
    if kept:
        yield f"  kept       as bytes: {', '.join(kept)}"


def _facts(recording: JsonObject) -> Iterator[str]:
    yield f"first frame {recording['first_frame']}"
    yield f"points in {recording['unit'] or 'an unknown unit'}"
    axis, screen = recording["up_axis"], recording["y_screen"]
    if axis:
        yield f"{axis} up"
    else:
        yield f"{screen} up on the screen" if screen else "up axis unknown"
    if recording["analog"]:
        rate = recording["analog_rate"]
        channels = plural(len(recording["analog"]), "analog channel")
        yield f"{channels} at {'an unknown rate' if not rate else f'{rate:g} Hz'}"


def _rows(heads: list[str], rows: list[list[str]], align: str) -> Iterator[str]:
    if not rows:
        return
    shown = table([heads, *rows[:MOST]], align).split("\n")
    yield from (f"    {line}".rstrip() for line in shown)
    if len(rows) > MOST:
        yield f"    {len(rows) - MOST} more; --json lists them"


def _time(time: float | None) -> str:
    return "?" if time is None else f"{time:.3f} s"


def _text(number: int | None) -> str:
    return "?" if number is None else f"{number}"


def _vector(vector: list[float | None] | None) -> str:
    if vector is None:
        return "?"
    return f"({', '.join('?' if x is None else f'{x:.6g}' for x in vector)})"
