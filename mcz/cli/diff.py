"""``mcz diff``: how far one motion is from another, in channels, units and centimeters."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from fractions import Fraction
from math import inf
from typing import TYPE_CHECKING, Any

import click

from mcz.cli import shared_options
from mcz.cli.common import (
    Exit,
    Failure,
    errors_about,
    in_options,
    open_input,
    require_file,
)
from mcz.cli.figures import figure_lines
from mcz.cli.terminal import echo, plural, print_json, table
from mcz.model.text_format import first_names
from mcz.model.types import JsonObject, Params

if TYPE_CHECKING:
    from mcz.files.reading.file import File
    from mcz.model.motion import Motion


RATIOS = ("cr_source", "cr_float32", "cr_40B")
FrameRange = tuple[int, int | None] | None


def _to_radius(ctx: click.Context, param: click.Parameter, value: float) -> float:
    if not 0 < value < inf:
        raise click.BadParameter(f"{value:g} is not a length above 0")
    return value


def _to_names(ctx: click.Context, param: click.Parameter, value: str | None) -> tuple[str, ...]:
    return () if value is None else tuple(name.strip() for name in value.split(",") if name.strip())


@click.command(short_help="Measure how far one motion is from another.")
@click.argument("a", metavar="A", type=click.Path(readable=False))
@click.argument("b", metavar="B", type=click.Path(readable=False))
@click.option(
    "--clip",
    "names",
    metavar="NAME",
    multiple=True,
    help="Choose a clip of an .mcz (repeatable). Default: the only one, or all that both have.",
)
@shared_options.where
@shared_options.frames("Use only frames A <= f < B of both, counted from 0.")
@shared_options.unit("a file that states none")
@shared_options.skeleton(shared_options.SKELETON_HELP)
@shared_options.rate()
@shared_options.up("Set the up axis of a file that states none.")
@shared_options.arrays
@shared_options.model
@click.option(
    "--shell",
    "shell_cm",
    metavar="CM",
    type=float,
    default=3.0,
    callback=_to_radius,
    help="Set the radius of the shell, three points around each joint. Default: 3.",
)
@click.option("--by-joint", is_flag=True, help="Print the distances of every joint.")
@click.option("--contacts", is_flag=True, help="Print every contact of a foot with the floor.")
@click.option(
    "--feet",
    metavar="NAME,...",
    callback=_to_names,
    help="Name the joints that stand on the floor. Default: those called foot, toe, ankle or heel.",
)
@shared_options.max_decoded
@shared_options.json
def diff_command(
    a: str,
    b: str,
    names: tuple[str, ...],
    where: str | None,
    frames: FrameRange,
    max_decoded: int | None,
    as_json: bool,
    **settings: Any,
) -> Exit:
    """Compare B with A, the original; both may be an .mcz or a source file.

    Print errors of channels and of positions in length units and cm (docs/reference/measures.md),
    sliding of feet that stand in A, and compression ratios of an .mcz. The exit code is 0 whenever
    the two could be compared, however much they differ. --where selects clips of A, or of B if A is
    not an .mcz.
    """
    options = _Options(frames=frames, **settings)
    if (a, b) == ("-", "-"):
        raise Failure("only one of A and B can be standard input", Exit.USAGE)
    with ExitStack() as stack:
        left, right = (_Side(path, stack, options, max_decoded) for path in (a, b))
        if where is not None:
            names = _filter_names(left, right, names, where)
        only: dict[str, list[str]] = {}
        pairs: Sequence[str | None] = names or (None,)
        if _has_several(left, right) and not names:
            pairs = _common_clips(left, right, left.clips)
            only["only_in_a"] = sorted(set(left.clips) - set(right.clips))
            only["only_in_b"] = sorted(set(right.clips) - set(left.clips))
        documents = [_compare(left, right, name, options) for name in pairs]
    if as_json:
        print_json({"a": a, "b": b, "clips": documents, **only})
        return Exit.FINE
    for number, document in enumerate(documents):
        echo(*([""] if number else []), *lines_of(a, b, document))
    for key, clips in only.items():
        echo(*(f"only in {a if key == 'only_in_a' else b}: {name}" for name in clips))
    return Exit.FINE


@dataclass(frozen=True, slots=True, kw_only=True)
class _Options:
    frames: FrameRange
    unit: str | None
    rate: Fraction | None
    up: str | None
    skeleton: str | None
    arrays: str | None
    model: str | None
    shell_cm: float
    by_joint: bool
    contacts: bool
    feet: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class _Loaded:
    """One motion to compare, its first frame in its clip, and its ratios."""

    motion: Motion
    start: int
    ratios: dict[str, float | None] | None


class _Side:
    """A or B: a source file, or an .mcz that stays open."""

    def __init__(
        self, path: str, stack: ExitStack, options: _Options, max_decoded: int | None
    ) -> None:
        from mcz.files.reading.file import is_mcz

        self.path, self._options = path, options
        self.file: File | None = None
        if path == "-" or is_mcz(path):
            self.file = stack.enter_context(open_input(path, max_decoded=max_decoded))
        else:
            require_file(path)

    @property
    def clips(self) -> list[str]:
        return [] if self.file is None else list(self.file.clips)

    def load(self, name: str | None) -> _Loaded:
        """The motion called ``name``, or the only one: its chosen frames, with the given facts."""
        import mcz
        from mcz.files.reading.sizes import clip_ratios
        from mcz.files.reading.source_files import SourceOptions

        options, ratios = self._options, None
        with errors_about(self.path):
            if self.file is None:
                motion = mcz.read(
                    self.path, skeleton=options.skeleton, arrays=options.arrays, model=options.model
                )
                start, stop = _range(options.frames, motion.n_frames, self.path)
                motion = motion.cut(start, stop)
            else:
                clip = self.file.only_clip(name)
                start, stop = _range(options.frames, clip.n_frames, f"clip {clip.name!r}")
                motion = clip.motion((start, stop))
                all_ratios = clip_ratios(self.file, clip)
                ratios = {key: all_ratios[key] for key in RATIOS}
            facts = SourceOptions(rate=options.rate, unit=options.unit, up=options.up)
            return _Loaded(facts.complete(motion), start, ratios)


def _range(frames: FrameRange, n_frames: int, owner: str) -> tuple[int, int]:
    start, stop = frames or (0, None)
    stop = n_frames if stop is None else stop
    if not start <= stop <= n_frames:
        raise Failure(f"{owner} has {n_frames} frames; {start}:{stop} is outside", Exit.USAGE)
    return start, stop


def _has_several(left: _Side, right: _Side) -> bool:
    """Return whether clips are paired by name: two .mcz files, at least one with several clips."""
    return bool(left.file and right.file) and max(len(left.clips), len(right.clips)) > 1


def _filter_names(left: _Side, right: _Side, names: tuple[str, ...], where: str) -> tuple[str, ...]:
    """The names of the clips that match ``where``; empty if each side is one clip."""
    side = left if left.file is not None else right
    if side.file is None:
        raise Failure("--where selects clips of an .mcz, and neither file is one", Exit.USAGE)
    clips = side.file.select_clips(names or None, where)
    if names:
        return tuple(name for name in names if side.file[name] in clips)
    names = tuple(clip.name for clip in clips)
    if left.file is not None and right.file is not None:
        return _common_clips(left, right, names) if _has_several(left, right) else ()
    return names


def _common_clips(left: _Side, right: _Side, names: Sequence[str]) -> tuple[str, ...]:
    """The ``names`` of clips that both sides have; raises Failure if there are none."""
    shared = set(left.clips) & set(right.clips)
    both = tuple(name for name in names if name in shared)
    if not both:
        raise Failure(f"{left.path} and {right.path} have no clip in common", Exit.USAGE)
    return both


def _compare(left: _Side, right: _Side, name: str | None, options: _Options) -> JsonObject:
    from mcz.files.reading.differences import document_of
    from mcz.kinematics.metrics.diff_document import diff_document

    one, other = left.load(name), right.load(name)
    if one.motion.n_frames != other.motion.n_frames:
        raise Failure(
            f"{left.path} has {one.motion.n_frames} frames, {right.path} "
            f"{other.motion.n_frames}; choose common ones with --frames A:B"
        )
    with errors_about(f"{left.path}, {right.path}"):
        document = diff_document(
            one.motion,
            other.motion,
            start=one.start,
            shell_cm=options.shell_cm,
            contacts=options.feet or options.contacts or None,
            by_joint=options.by_joint,
            contact_list=options.contacts,
        )
        document["differences"] = document_of(one.motion, other.motion)
    return document | {"ratios_a": one.ratios, "ratios_b": other.ratios}


SHOWN_NAMES = 12  # names of joints that a line lists
SMALL_CM = 1.0  # below it distances are shown in mm


def lines_of(a: str, b: str, document: JsonObject) -> Iterator[str]:
    """The text that people read, without line ends."""
    entries = dict(document)
    names = entries.pop("name_a"), entries.pop("name_b")
    notes, ratios = entries.pop("notes"), [entries.pop("ratios_a"), entries.pop("ratios_b")]
    yield f"{a} ({names[0]}) and {b} ({names[1]})"
    joints, feet = entries.pop("joints"), entries.pop("feet")
    equal = entries.pop("equal_joints")
    differences = entries.pop("differences", ())
    by_joint, contacts = entries.pop("by_joint", []), entries.pop("contact_list", [])
    is_same = entries.get("mse_raw") == 0.0
    yield from (f"  {line}" for line in figure_lines(entries))
    if equal and not is_same:
        yield f"  joints equal in every bit: {first_names(equal, SHOWN_NAMES)}"
    if feet is not None:
        yield f"  {_feet_line(feet)}"
    if joints is not None:
        yield from (f"  {line}" for line in _joint_lines(a, b, joints))
    for path, entry in zip((a, b), ratios, strict=True):
        known = {key: value for key, value in (entry or {}).items() if value is not None}
        if known:
            shown = ", ".join(f"{key} {value:.4g}" for key, value in known.items())
            yield f"  {path}: {shown}"
    yield from (f"  {_difference_line(entry)}" for entry in differences)
    yield from (f"  note: {in_options(note)}" for note in notes)
    for rows in (_table_by_joint(by_joint), _table_of_contacts(contacts)):
        yield from (f"  {line}".rstrip() for line in rows)


def _difference_line(difference: Params) -> str:
    if difference["a"] is None and difference["b"] is None:
        return f"{difference['what']}: not the same"
    a, b = _value_text(difference["a"]), _value_text(difference["b"])
    text = f"{difference['what']}: {a} in A, {b} in B"
    for key in ("only_in_a", "only_in_b", "changed"):
        if names := difference[key]:
            words = key.replace("_", " ").replace(" a", " A").replace(" b", " B")
            text += f"; {words}: {first_names(names, SHOWN_NAMES)}"
    return text


def _value_text(value: object) -> str:
    return "unknown" if value is None else f"{value:g}" if isinstance(value, float) else f"{value}"


def _joint_lines(a: str, b: str, joints: JsonObject) -> Iterator[str]:
    n_joints = len(joints["joints"])
    if not n_joints:
        yield "no joint has the same name in both"
        return
    suffix, unit = ("", "units") if joints["unit_cm"] is None else ("_cm", "cm")
    if joints["mean"] is not None:
        mean, most = joints[f"mean{suffix}"], joints[f"greatest{suffix}"]
        yield (
            f"{plural(n_joints, 'joint')} of the same name: mean {mean:.6g} {unit} apart, "
            f"at most {most:.6g} {unit} (frame {joints['frame']}, {joints['joint']})"
        )
    for path, names in ((a, joints["only_in_a"]), (b, joints["only_in_b"])):
        if names:
            yield f"joints only in {path}: {first_names(names, SHOWN_NAMES)}"


def _feet_line(feet: Params) -> str:
    """The joints, axis and frame rate used to detect contacts."""
    guessed = " (guessed)" if feet["up_guessed"] else ""
    assumed = " (assumed)" if feet["rate_assumed"] else ""
    return (
        f"feet: {first_names(feet['joints'], SHOWN_NAMES)}; {feet['up_axis']} up{guessed}, "
        f"{feet['frame_rate']:g} frames a second{assumed}"
    )


def _table_by_joint(joints: Sequence[Params]) -> list[str]:
    """A row a joint: distances of its points and of its shell, in mm if all are small."""
    if not joints:
        return []
    in_cm = joints[0]["mean_position_error_cm"] is not None
    points = [f"{key}_position_error{'_cm' if in_cm else ''}" for key in ("mean", "max")]
    shell = ["shell_mean_cm", "shell_max_cm"]
    greatest = max((joint[k] or 0.0 for joint in joints for k in (points[1], shell[1])), default=0)
    unit, factor = ("units", 1.0) if not in_cm else ("cm", 1.0)
    if in_cm and greatest < SMALL_CM:
        unit, factor = "mm", 10.0
    rows = [["joint", f"mean {unit}", f"max {unit}", "frame"]]
    shelled = any(joint["shell_mean_cm"] is not None for joint in joints)
    rows[0] += [f"shell mean {unit}", f"max {unit}", "frame"] if shelled else []
    for joint in joints:
        row = [joint["joint"], *(_scaled_text(joint[key], factor) for key in points)]
        row.append(_frame_text(joint["max_position_error_frame"]))
        if shelled:
            row += [_scaled_text(joint[key], factor) for key in shell]
            row.append(_frame_text(joint["shell_max_frame"]))
        rows.append(row)
    return ["", *table(rows, "lrrrrrr"[: len(rows[0])])]


def _table_of_contacts(contacts: Sequence[Params]) -> list[str]:
    """A row a contact: its frames, the sliding of the foot in it, and both paths, in mm."""
    if not contacts:
        return []
    keys = ("mean_mm", "max_mm", "path_mm", "path_original_mm")
    rows = [["contact of", "first", "frames", "mean mm", "max mm", "path mm", "original's mm"]]
    for each in contacts:
        counts = [str(each["first"]), str(each["n_frames"])]
        rows.append([each["joint"], *counts, *(_scaled_text(each[key], 1.0) for key in keys)])
    return ["", *table(rows, "lrrrrrr")]


def _scaled_text(value: float | None, factor: float) -> str:
    return "" if value is None else f"{value * factor:.4g}"


def _frame_text(value: int | None) -> str:
    return "" if value is None else str(value)
