"""Text output of ``mcz diff``."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from mcz.cli.common import plural, table
from mcz.cli.figures import figure_lines
from mcz.cli.hints import in_options
from mcz.model.text_format import first_of
from mcz.model.types import JsonObject, Params

FEW = 12  # names of joints that are shown
SMALL_CM = 1.0  # below it distances are shown in mm


def lines_of(a: str, b: str, document: JsonObject) -> Iterator[str]:
    """The text that people read, without line ends."""
    entries = dict(document)
    names = entries.pop("name_a"), entries.pop("name_b")
    notes, ratios = entries.pop("notes"), [entries.pop("ratios_a"), entries.pop("ratios_b")]
    yield f"{a} ({names[0]}) and {b} ({names[1]})"
    joints, feet = entries.pop("joints"), entries.pop("feet")
    equal = entries.pop("equal_joints")
    beside = entries.pop("differences", ())
    by_joint, contacts = entries.pop("by_joint", []), entries.pop("contact_list", [])
    is_same = entries.get("mse_raw") == 0.0
    yield from (f"  {line}" for line in figure_lines(entries))
    if equal and not is_same:
        yield f"  joints equal in every bit: {first_of(equal, FEW)}"
    if feet is not None:
        yield f"  {_feet_line(feet)}"
    if joints is not None:
        yield from (f"  {line}" for line in _joint_lines(a, b, joints))
    for path, found in zip((a, b), ratios, strict=True):
        known = {key: value for key, value in (found or {}).items() if value is not None}
        if known:
            shown = ", ".join(f"{key} {value:.4g}" for key, value in known.items())
            yield f"  {path}: {shown}"
    yield from (f"  {_difference_line(found)}" for found in beside)
    yield from (f"  note: {in_options(note)}" for note in notes)
    for rows in (_table_by_joint(by_joint), _table_of_contacts(contacts)):
        yield from (f"  {line}".rstrip() for line in rows)


def _difference_line(found: Params) -> str:
    """Something beside the numbers that A and B do not say alike."""
    if found["a"] is None and found["b"] is None:
        return f"{found['what']}: not the same"
    text = f"{found['what']}: {_said(found['a'])} in A, {_said(found['b'])} in B"
    for key in ("only_in_a", "only_in_b", "changed"):
        if names := found[key]:
            words = key.replace("_", " ").replace(" a", " A").replace(" b", " B")
            text += f"; {words}: {first_of(names, FEW)}"
    return text


def _said(value: object) -> str:
    return "unknown" if value is None else f"{value:g}" if isinstance(value, float) else f"{value}"


def _joint_lines(a: str, b: str, found: JsonObject) -> Iterator[str]:
    n_joints = len(found["joints"])
    if not n_joints:
        yield "no joint has the same name in both"
        return
    suffix, unit = ("", "units") if found["unit_cm"] is None else ("_cm", "cm")
    if found["mean"] is not None:
        mean, most = found[f"mean{suffix}"], found[f"greatest{suffix}"]
        yield (
            f"{plural(n_joints, 'joint')} of the same name: mean {mean:.6g} {unit} apart, "
            f"at most {most:.6g} {unit} (frame {found['frame']}, {found['joint']})"
        )
    for path, names in ((a, found["only_in_a"]), (b, found["only_in_b"])):
        if names:
            yield f"joints of {path} alone: {first_of(names, FEW)}"


def _feet_line(feet: Params) -> str:
    """The joints, axis and frame rate used to detect contacts."""
    guessed = " (guessed)" if feet["up_guessed"] else ""
    assumed = " (assumed)" if feet["rate_assumed"] else ""
    return (
        f"feet: {first_of(feet['joints'], FEW)}; {feet['up_axis']} up{guessed}, "
        f"{feet['frame_rate']:g} frames a second{assumed}"
    )


def _table_by_joint(found: Sequence[Params]) -> list[str]:
    """A row a joint: distances of its points and of its shell, in mm where all are small."""
    if not found:
        return []
    in_cm = found[0]["mean_position_error_cm"] is not None
    points = [f"{key}_position_error{'_cm' if in_cm else ''}" for key in ("mean", "max")]
    shell = ["shell_mean_cm", "shell_max_cm"]
    greatest = max((joint[k] or 0.0 for joint in found for k in (points[1], shell[1])), default=0)
    unit, factor = ("units", 1.0) if not in_cm else ("cm", 1.0)
    if in_cm and greatest < SMALL_CM:
        unit, factor = "mm", 10.0
    rows = [["joint", f"mean {unit}", f"max {unit}", "frame"]]
    shelled = any(joint["shell_mean_cm"] is not None for joint in found)
    rows[0] += [f"shell mean {unit}", f"max {unit}", "frame"] if shelled else []
    for joint in found:
        row = [joint["joint"], *(_scaled(joint[key], factor) for key in points)]
        row.append(_text(joint["max_position_error_frame"]))
        if shelled:
            row += [_scaled(joint[key], factor) for key in shell]
            row.append(_text(joint["shell_max_frame"]))
        rows.append(row)
    return ["", *table(rows, "lrrrrrr"[: len(rows[0])]).split("\n")]


def _table_of_contacts(found: Sequence[Params]) -> list[str]:
    """A row a contact: its frames, how far the foot slides in it, and both paths, in mm."""
    if not found:
        return []
    keys = ("mean_mm", "max_mm", "path_mm", "path_original_mm")
    rows = [["contact of", "first", "frames", "mean mm", "max mm", "path mm", "original's mm"]]
    for each in found:
        counts = [str(each["first"]), str(each["n_frames"])]
        rows.append([each["joint"], *counts, *(_scaled(each[key], 1.0) for key in keys)])
    return ["", *table(rows, "lrrrrrr").split("\n")]


def _scaled(value: float | None, factor: float) -> str:
    return "" if value is None else f"{value * factor:.4g}"


def _text(value: int | None) -> str:
    return "" if value is None else str(value)
