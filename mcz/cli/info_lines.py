"""Text of ``mcz info``: skeletons, times, recordings, arrays, source files, bytes and previews."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mcz.cli.terminal import can_show, plural, table
from mcz.errors import MczError
from mcz.model.motion import Motion
from mcz.model.types import Floats, JsonObject, Reals

if TYPE_CHECKING:
    from mcz.files.reading.clip import Clip
    from mcz.kinematics.frames import MotionLike


CELLS = 48  # of a line: greatest number of decoded segments
BLOCK = 2**19  # numbers that are worked on at a time
CHEAP = 2**19  # numbers that are decoded by default


def is_cheap(clip: Any) -> bool:
    """Return True if the energy of a clip is quick to compute."""
    return bool(clip.n_frames * clip.n_channels <= CHEAP)


def motion_energy(motion: MotionLike, cells: int = CELLS) -> Floats | None:
    """The mean speed of all points in ``cells`` equal parts of the frames, float64 (n,).

    In length units a second, or a frame if times are unknown; NaN where no position is known. No
    step crosses a break in time; fewer frames make fewer parts. A clip with more segments than
    parts decodes one segment a part. None without kinematics, or with fewer than two frames.
    """
    if motion.n_frames < 2:
        return None
    cells = min(cells, motion.n_frames - 1)
    edges = np.linspace(0, motion.n_frames - 1, cells + 1).astype(np.int64)
    signal: Any = motion.signals[0]
    sampled = not isinstance(motion, Motion) and len(signal.rows) > cells
    try:
        with np.errstate(all="ignore"):
            return _sample_speeds(motion, edges) if sampled else _full_speeds(motion, edges)
    except MczError:  # no kinematics, or damaged
        return None


def _seconds(motion: MotionLike) -> Floats:
    """Seconds from each frame to the next, NaN across a break; 1 if times are unknown."""
    timeline = motion.timeline
    return np.ones(motion.n_frames - 1) if timeline is None else timeline.steps


def _full_speeds(motion: MotionLike, edges: Any) -> Floats:
    from mcz.kinematics.poses import positions

    width = max(1, motion.skeleton.n_channels + 12 * motion.skeleton.n_joints)
    size = max(1, BLOCK // width)
    means = np.full(motion.n_frames - 1, np.nan)
    for start in range(0, len(means), size):
        stop = min(start + size, len(means))
        means[start:stop] = _steps(positions(motion, frames=(start, stop + 1)))
    means /= _seconds(motion)
    known = np.isfinite(means)
    counts = np.add.reduceat(known, edges[:-1])
    sums: Floats = np.add.reduceat(np.where(known, means, 0.0), edges[:-1])
    return sums / np.where(counts, counts, np.nan)


def _sample_speeds(motion: MotionLike, edges: Any) -> Floats:
    from mcz.kinematics.poses import positions

    middles = (edges[:-1] + edges[1:]) // 2
    samples = np.array(
        [_steps(positions(motion, frames=(at, at + 2)))[0] for at in middles.tolist()]
    )
    speeds: Floats = samples / _seconds(motion)[middles]
    return speeds


def _steps(places: Reals) -> Floats:
    """The mean step of all points from each frame to the next, (n_frames - 1,)."""
    moved = np.sqrt((np.diff(places, axis=0) ** 2).sum(axis=2))
    known = np.isfinite(moved)
    steps: Floats = np.where(known, moved, 0.0).sum(axis=1) / known.sum(axis=1)
    return steps


DEEPEST = 90  # characters before a joint's name; deeper joints are not indented further


def skeleton_lines(skeleton: JsonObject) -> Iterator[str]:
    yield ""
    unit = skeleton["unit_cm"]
    facts = [
        plural(skeleton["n_joints"], "joint"),
        plural(skeleton["n_channels"], "channel"),
        "unit unknown" if unit is None else f"1 unit = {unit:.6g} cm",
        f"angles in {skeleton['angle_unit'] or 'an unknown unit'}",
        f"{skeleton['up_axis']} up" if skeleton["up_axis"] else "up axis unknown",
    ]
    facts += [f"{skeleton['forward_axis']} forward"] if skeleton["forward_axis"] else []
    facts += [f"{skeleton['handedness']}-handed"] if skeleton["handedness"] else []
    name = f" {skeleton['name']}" if skeleton["name"] else ""
    id_ = f" ({skeleton['id'][:8]})" if "id" in skeleton else ""
    yield f"skeleton{name}{id_}: {', '.join(facts)}"
    if height := skeleton["height"]:
        yield _height(height, unit)
    if skeleton.get("base"):
        yield f"  derived from {skeleton['base'][:8]}"
    yield from _tree(skeleton["joints"])


def _height(height: float, unit_cm: float | None) -> str:
    from mcz.kinematics.rest_pose import note_on_height

    if unit_cm is None:
        return f"  height {height:.3g} units"
    text = note_on_height(height, unit_cm) or f"height {height * unit_cm:.3g} cm"
    return f"  {text}"


def _is_plain(joints: list[JsonObject]) -> bool:
    """Return whether the joints are numbers in order, all alike, as joints of an array."""
    alike = -1, joints[0]["channels"]
    return all(
        joint["name"] == str(index) and (joint["parent"], joint["channels"]) == alike
        for index, joint in enumerate(joints)
    )


def _tree(joints: list[JsonObject]) -> Iterator[str]:
    """The joints as a tree; a stack instead of recursion, since files choose the depth."""
    if len(joints) > 2 and _is_plain(joints):
        yield f"  0 to {len(joints) - 1}  {' '.join(joints[0]['channels'])}".rstrip()
        return
    children: dict[int, list[int]] = {}
    for index, joint in enumerate(joints):
        children.setdefault(joint["parent"], []).append(index)
    stack = [(root, "  ", "  ") for root in reversed(children.get(-1, []))]
    while stack:
        index, own, below = stack.pop()
        if len(below) > DEEPEST:
            own, below = f"{below} ... ", below[:DEEPEST]
        yield f"{own}{joints[index]['name']}  {' '.join(joints[index]['channels'])}".rstrip()
        for number, child in enumerate(reversed(children.get(index, []))):
            last = number == 0
            stack.append(
                (child, below + ("└─ " if last else "├─ "), below + ("   " if last else "│  "))
            )


def rate_text(clip: JsonObject) -> str:
    rate = clip["frame_rate"]
    if rate is None:
        return "at an unknown rate"
    about = "" if clip["frame_rate_exact"] else "about "
    seconds, times = clip["n_frames"] / rate, clip["times"]
    if times is not None and times["gaps"]:
        seconds = times["last"] - times["first"] + 1 / rate
    return f"at {about}{rate:g} Hz ({seconds:.2f} s)"


def time_lines(times: JsonObject | None) -> Iterator[str]:
    """The times of the frames, unless they run from 0 s on without a gap."""
    if times is None:
        return
    if times["first"] or times["gaps"]:
        gaps = f", {plural(times['gaps'], 'gap')}" if times["gaps"] else ""
        yield f"  time       {times['first']:.6g} s to {times['last']:.6g} s{gaps}"


MOST_ROWS = 24  # rows of a list; --json has all of them


def recording_lines(recording: JsonObject | None) -> Iterator[str]:
    """The lines for a part ``recording`` of the document of ``mcz info``."""
    if recording is None:
        return
    yield f"  recording  {', '.join(_recording_facts(recording))}"
    events = [
        [_time(event["time"]), event["context"], event["label"], event["subject"]]
        for event in recording["events"]
    ]
    yield from _rows(["event at", "side", "label", "subject"], events, "rlll")
    platforms = [
        [
            f"{number}",
            "?" if platform["type"] is None else f"{platform['type']}",
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
    """The lines for a part ``arrays`` of the document: arrays that are read, then kept ones."""
    if arrays is None:
        return
    for array in arrays:
        if array["signal"] is not None:
            name = array["name"] or "numbers"
            order = ", by columns" if array["order"] == "F" else ""
            columns = plural(array["columns"], "column")
            yield f"  array      {name}: {columns} of {array['type']}{order}, in {array['signal']}"
    byte_arrays = [array["name"] for array in arrays if array["signal"] is None]
    if byte_arrays:
        yield f"  kept       as bytes: {', '.join(byte_arrays)}"


def _recording_facts(recording: JsonObject) -> Iterator[str]:
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
    lines = table([heads, *rows[:MOST_ROWS]], align)
    yield from (f"    {line}".rstrip() for line in lines)
    if len(rows) > MOST_ROWS:
        yield f"    {len(rows) - MOST_ROWS} more; --json lists them"


def _time(time: float | None) -> str:
    return "?" if time is None else f"{time:.3f} s"


def _vector(vector: list[float | None] | None) -> str:
    if vector is None:
        return "?"
    return f"({', '.join('?' if x is None else f'{x:.6g}' for x in vector)})"


def source_lines(file: str, document: JsonObject) -> Iterator[str]:
    """The text of a source file's document, without line ends; the rest as for an MCZ file."""
    kind = document["format"].upper()
    yield f"{file}: {kind}, {document['file_bytes']:,} bytes; not yet an .mcz (mcz encode)"
    for skeleton in document["skeletons"]:
        yield from skeleton_lines(skeleton)
    for clip in document["clips"]:
        yield ""
        yield (
            f"clip {clip['name']}: {plural(clip['n_frames'], 'frame')} {rate_text(clip)}, "
            f"{plural(clip['n_channels'], 'channel')}, {plural(clip['n_joints'], 'joint')}"
        )
        yield from time_lines(clip["times"])
        if clip["skeleton_file"]:
            yield f"  skeleton   {clip['skeleton_file']}"
        for signal in clip["signals"][1:]:
            rows = plural(signal["samples_per_frame"], "row")
            shape = f"{plural(signal['n_channels'], 'channel')}, {rows} a frame"
            yield f"  signal     {signal['name']}: {shape}"
        if clip["n_invalid"]:
            yield f"  invalid    {plural(clip['n_invalid'], 'value')}"
        yield f"  sha256     {clip['source_sha256']}"
        share = 100 * clip["exceptions_share"]
        yield f"  exceptions {clip['n_exceptions']:,} numbers off their grid ({share:.3g} %)"
        yield from recording_lines(clip["recording"])
        yield from array_lines(clip["arrays"])
        for key, value in clip["metadata"].items():
            yield f"  {key}  {value[:80]}"
        if "preview" in clip:
            yield from preview_lines(clip["preview"])


LEVELS, PLAIN_LEVELS = "▁▂▃▄▅▆▇█", "_.-=+*%#"
EIGHTHS, PLAIN = "▏▎▍▌▋▊▉█", "#"
Bar = tuple[str, int]  # name and number of bytes

WIDTH = 24  # letters of the longest bar
MOST_BARS = 8


def preview_of(clip: Clip) -> JsonObject:
    """The keys of a clip's preview; ``motion`` is None if there is none."""
    from mcz.files.reading.sizes import byte_shares

    shares = [
        {"signal": s.signal, "joints": s.name, "resolution": s.resolution, "bytes": s.n_bytes}
        for s in byte_shares(clip)
    ]
    return {"motion": motion_of(clip), "payload": shares}


def motion_of(motion: MotionLike) -> JsonObject | None:
    """The speeds of equal parts of the time, and their unit; None if unknown."""

    speeds = motion_energy(motion)
    if speeds is None:
        return None
    unit = motion.skeleton.unit_cm
    values = [float(speed) * (unit or 1.0) for speed in speeds]
    length, time = "units" if unit is None else "cm", "s" if motion.timeline else "frame"
    known = [value if math.isfinite(value) else None for value in values]
    return {"unit": f"{length}/{time}", "mean_speeds": known}


def preview_lines(preview: JsonObject) -> Iterator[str]:
    """The preview as text."""
    motion = preview["motion"]
    if motion is not None and any(speed is not None for speed in motion["mean_speeds"]):
        speeds = motion["mean_speeds"]
        most = max(speed for speed in speeds if speed is not None)
        yield f"  motion     {sparkline(speeds)}  mean speed, up to {most:.4g} {motion['unit']}"
    bars, rest = bars_of(preview.get("payload", []))
    if len(bars) > 1:
        greatest, total = max(n for _, n in bars), sum(n for _, n in (*bars, *rest))
        rows = [(name, bar(n / greatest), n) for name, n in bars]
        rows += [(name, "", n) for name, n in rest]
        cells = [[name, own, f"{n:,}", f"{100 * n / total:.1f} %"] for name, own, n in rows]
        lines = table([["payload", "", "bytes", "share"], *cells], "llrr")
        yield from (f"  {line}" for line in lines)


def sparkline(numbers: Sequence[float | None], blocks: bool | None = None) -> str:
    """Numbers from 0 as letters of growing height, a blank for None.

    >>> sparkline([0, 1.0, None, 8.0], blocks=True), sparkline([0, 1.0, None, 8.0], blocks=False)
    ('▁▂ █', '_. #')
    """
    letters = LEVELS if (can_show(LEVELS) if blocks is None else blocks) else PLAIN_LEVELS
    most = max((n for n in numbers if n is not None), default=0.0) or 1.0
    return "".join(
        " " if n is None else letters[min(7, max(0, int(8 * n / most)))] for n in numbers
    )


def bar(share: float, blocks: bool | None = None) -> str:
    """
    >>> bar(0.5, blocks=False), bar(1 / 24, blocks=True), bar(1.5 / 24, blocks=True)
    ('############', '█', '█▌')
    """
    eighths = math.ceil(share * WIDTH * 8 - 1e-9)
    if not (can_show(EIGHTHS) if blocks is None else blocks):
        return PLAIN * math.ceil(eighths / 8)
    return EIGHTHS[7] * (eighths // 8) + (EIGHTHS[eighths % 8 - 1] if eighths % 8 else "")


def bars_of(payload: Sequence[JsonObject]) -> tuple[list[Bar], list[Bar]]:
    """Bars and the rest: the largest joints, or the resolutions of a single group."""
    from mcz.files.reading.sizes import Share, by_group

    groups = by_group(
        Share(of["signal"], None, of["joints"], of["resolution"], of["bytes"]) for of in payload
    )
    if len(groups) == 1:
        ((_, parts),) = groups.items()
        return [(_part_name(resolution), n) for resolution, n in parts.items()], []
    sums = {name: sum(parts.values()) for name, parts in groups.items()}
    ordered = sorted(sums.items(), key=lambda each: -each[1])
    rest = ordered[MOST_BARS:]
    others = [(f"{len(rest)} others", sum(n for _, n in rest))] if rest else []
    return ordered[:MOST_BARS], others


def _part_name(resolution: int | None) -> str:
    if resolution is None:
        return "exceptions, masks"
    return f"resolution {resolution}" + (", coarsest" if resolution == 0 else "")
