"""``mcz decode``: the original file out of an .mcz file, or its numbers."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any, NamedTuple

import click
import numpy as np

from mcz.cli.common import (
    Exit,
    Failure,
    binary_output,
    opened,
    plain_name,
    print_json,
    printable,
    say,
    to_frames,
    to_rate,
    write_output,
)
from mcz.cli.options import decoded_option, force_option, json_option

if TYPE_CHECKING:
    from mcz.cli.export import Table
    from mcz.files.clip import Clip
    from mcz.files.conversion import Fit
    from mcz.files.file import File
    from mcz.motion import Motion

Output = tuple[str, str, bytes]  # kind, file name, content
CONVERSIONS = ("bvh", "amc", "c3d")


class _Part(NamedTuple):
    """What of a clip is wanted: the arguments of ``Clip.motion``."""

    frames: tuple[int, int] | None
    resolution: int
    decimate: bool


@click.command(short_help="The original file again, or its numbers.")
@click.argument("file", metavar="FILE.mcz", type=click.Path(readable=False))
@click.option(
    "-o",
    "--output",
    metavar="OUT",
    help="A file, a folder, or - for standard output. Default: the source's name, beside FILE.mcz.",
)
@click.option("--clip", "name", metavar="NAME", help="Which clip; needed where there are several.")
@click.option(
    "--frames", metavar="A:B", callback=to_frames, help="Frames A <= f < B, counted from 0."
)
@click.option("--joints", metavar="a,b", help="Joints by name or index (with --to).")
@click.option(
    "--resolution",
    metavar="K",
    type=click.IntRange(min=0),
    default=0,
    help="Leave out the K finest details.",
)
@click.option(
    "--decimate", is_flag=True, help="Write every 2^K-th frame alone, at the rate divided by 2^K."
)
@click.option(
    "--preview",
    "preview",
    is_flag=True,
    help="Only frames that can be read without decoding the rest (with --to).",
)
@click.option(
    "--to",
    "target",
    type=click.Choice(["csv", "npz", *CONVERSIONS]),
    help="Numbers, or the motion as another format, instead of the source file.",
)
@click.option(
    "--rate",
    metavar="R",
    callback=to_rate,
    help="Frames a second (with --to bvh or c3d), where the clip does not know them.",
)
@click.option(
    "--solve-ik",
    "solve",
    is_flag=True,
    help="Fit the skeleton of a clip of positions to them (with --to amc or bvh).",
)
@click.option("--with-skeleton", is_flag=True, help="Write the skeleton's own file (ASF) too.")
@click.option("--salvage", is_flag=True, help="Write what a damaged file still holds.")
@decoded_option
@force_option
@json_option
def command(
    file: str,
    output: str | None,
    name: str | None,
    frames: tuple[int, int | None] | None,
    joints: str | None,
    resolution: int,
    decimate: bool,
    preview: bool,
    target: str | None,
    rate: Fraction | None,
    solve: bool,
    with_skeleton: bool,
    salvage: bool,
    max_decoded: int | None,
    force: bool,
    as_json: bool,
) -> Exit:
    """Write the original file of a clip, byte for byte, or its numbers, or another format.

    A file without clips gives its skeleton's ASF or its attachment.
    """
    if target in (None, *CONVERSIONS) and joints is not None:
        raise Failure("--joints needs --to csv or --to npz", Exit.USAGE)
    if preview and (target is None or frames is not None or resolution or salvage):
        raise Failure(
            "--preview needs --to, and goes with none of --frames --resolution --salvage",
            Exit.USAGE,
        )
    if decimate and not resolution:
        raise Failure("--decimate needs --resolution", Exit.USAGE)
    if rate is not None and target not in CONVERSIONS:
        raise Failure(f"--rate needs --to {' or '.join(CONVERSIONS)}", Exit.USAGE)
    if solve and target not in ("amc", "bvh"):
        raise Failure("--solve-ik needs --to amc or --to bvh", Exit.USAGE)
    if output == "-" and (as_json or with_skeleton):
        raise Failure("-o - leaves no room for --json or --with-skeleton", Exit.USAGE)
    fit: Fit | None = None
    with opened(file, salvage=salvage, max_decoded=max_decoded) as held:
        if held.clips:
            clip = held.only_clip(name)
            part = _Part(_cut(clip, frames), resolution, decimate)
            if target is None:
                outputs = [_source(clip, part)]
            elif target in CONVERSIONS:
                motion = _motion(clip, part, preview)
                if solve:
                    motion, fit = _solved(clip, motion)
                elif target in ("amc", "bvh"):
                    _check_moves(clip)
                outputs = _converted(motion, target, rate, with_skeleton)
            else:
                outputs = [_export(clip, target, part, joints, preview)]
            if with_skeleton and target != "amc":
                outputs.append(_skeleton(held, clip.skeleton_id))
        elif target is not None or frames is not None:
            raise Failure(f"{file}: it has no clips, so --to and --frames do not apply", Exit.USAGE)
        else:
            outputs = [_other(held, name)]
        damage = list(held.damage)
    facts = {"damage": damage} if fit is None else {"damage": damage, "fit": _facts(fit)}
    _deliver(file, output, outputs, force, as_json, facts)
    if fit is not None:
        say(f"{file}: {_told(fit)}")
    for line in damage:
        say(f"{file}: salvage: {line}")
    return Exit.SALVAGED if damage else Exit.FINE


def _cut(clip: Clip, frames: tuple[int, int | None] | None) -> tuple[int, int] | None:
    if frames is None:
        return None
    start, stop = frames
    return start, clip.n_frames if stop is None else stop


def _source(clip: Clip, part: _Part) -> Output:
    data = clip.source_bytes(part.frames, part.resolution, decimate=part.decimate)
    path = clip.source.path if clip.source else ""
    return "source", PurePosixPath(path).name or f"{_stem(clip)}.out", data


def _motion(clip: Clip, part: _Part, preview: bool) -> Motion:
    if preview:
        from mcz.files.preview import preview_motion

        return preview_motion(clip)
    return clip.motion(part.frames, part.resolution, decimate=part.decimate)


def _check_moves(clip: Clip) -> None:
    """Raise Failure for positions of a skeleton that is here, too: it can be fitted to them."""
    from mcz.kinematics import point_set

    if clip.skeleton.base and point_set(clip.skeleton) == "markers":
        held = f"{clip.container.source.name}: clip {clip.name!r} holds positions"
        raise Failure(f"{held}; --solve-ik fits its skeleton to them", Exit.USAGE)


def _solved(clip: Clip, motion: Motion) -> tuple[Motion, Fit]:
    """The motion of the clip's base skeleton whose points lie where those of ``motion`` do."""
    from mcz.files.conversion import from_positions

    base = clip.base_skeleton
    if base is None:
        raise Failure(
            f"{clip.container.source.name}: clip {clip.name!r} names no skeleton that --solve-ik "
            "could fit to its positions",
            Exit.USAGE,
        )
    return from_positions(motion, base)


def _facts(fit: Fit) -> dict[str, Any]:
    """What ``--json`` says of a fit."""
    keys = ("mean_error", "max_error", "marker_mean_error", "marker_max_error")
    distances = {name: getattr(fit, name) for key in keys for name in (key, f"{key}_cm")}
    return {
        "n_points": fit.n_points,
        "n_markers": fit.n_markers,
        **distances,
        "frame": fit.frame,
        "point": fit.point,
        "unsolved": list(fit.unsolved),
    }


def _told(fit: Fit) -> str:
    """A fit in words."""
    scale, unit = (1.0, "units") if fit.unit_cm is None else (fit.unit_cm, "cm")
    if fit.mean_error is None or fit.max_error is None:
        told = "inverse kinematics: no position is known"
    else:
        told = (
            f"inverse kinematics: {fit.n_points} points {fit.mean_error * scale:.3g} {unit} off on "
            f"average, at most {fit.max_error * scale:.3g} {unit} (frame {fit.frame}, {fit.point})"
        )
    if fit.marker_mean_error is not None and fit.marker_max_error is not None:
        told += (
            f"; {fit.n_markers} virtual markers {fit.marker_mean_error * scale:.3g}, at most "
            f"{fit.marker_max_error * scale:.3g} {unit}"
        )
    if fit.unsolved:
        told += f"; left at 0: {', '.join(fit.unsolved)}"
    return told


def _converted(
    motion: Motion, target: str, rate: Fraction | None, with_skeleton: bool
) -> list[Output]:
    """The motion as a plain file of another format, with its ASF where an AMC is to have one."""
    from mcz.files.conversion import converted_files

    files = converted_files(motion, target, rate, with_skeleton)
    kinds = {"asf": "skeleton"}
    return [(kinds.get(s, s), f"{_stem(motion)}.{s}", data) for s, data in files.items()]


def _export(clip: Clip, target: str, part: _Part, joints: str | None, preview: bool) -> Output:
    from mcz.cli.export import EXPORTS, channel_names

    chosen = None if joints is None else [joint.strip() for joint in joints.split(",")]
    names = channel_names(clip.skeleton, clip.signals[0].channels)
    if chosen is not None:
        skeleton = clip.skeleton
        names = [names[c] for joint in chosen for c in skeleton.columns(skeleton.find(joint))]
    if preview:
        table = _preview_table(clip, chosen, names)
    else:
        table = _table(clip, part, chosen, names)
    return target, f"{_stem(clip)}.{target}", EXPORTS[target](table)


def _table(clip: Clip, part: _Part, joints: list[str] | None, names: list[str]) -> Table:
    from mcz.cli.export import Table
    from mcz.files.decimation import decimated_rows

    values, mask = clip.read_masked(part.frames, joints, part.resolution)
    mask = np.ones(values.shape, np.bool_) if mask is None else mask
    start, stop = part.frames or (0, clip.n_frames)
    numbers, rate = clip.frame_numbers[start:stop], clip.frame_rate
    if part.decimate:
        step, per_frame = 2**part.resolution, clip.signals[0].layout.samples_per_frame
        values, mask = (decimated_rows(rows, per_frame, step) for rows in (values, mask))
        numbers, rate = numbers[::step], rate and rate / step
    return Table(
        names,
        np.asarray(values, dtype=np.float64),
        mask,
        np.repeat(numbers, len(values) // max(1, len(numbers))),  # a number for every row
        rate,
    )


def _preview_table(clip: Clip, joints: list[str] | None, names: list[str]) -> Table:
    from mcz.cli.export import Table
    from mcz.files.preview import preview

    found = preview(clip, joints)
    numbers, rate = clip.frame_numbers[found.frames], clip.frame_rate
    return Table(
        names,
        np.asarray(found.values, dtype=np.float64),
        np.ones(found.values.shape, np.bool_) if found.mask is None else found.mask,
        np.repeat(numbers, len(found.values) // max(1, len(numbers))),
        rate / found.step if rate is not None and found.is_regular else None,
    )


def _stem(clip: Clip | Motion) -> str:
    """The clip's name without folders, which must not lead out of the output's folder."""
    return PurePosixPath(clip.name).name.strip(".") or "clip"


def _skeleton(held: File, wanted: bytes) -> Output:
    """The skeleton's own file; its name is that of the alias that refers to it."""
    names = [name for name, (_, target) in held.aliases.items() if target == wanted]
    name = PurePosixPath(names[0]).name if names else "skeleton.asf"
    return "skeleton", name, held.skeleton_bytes(wanted)


def _other(held: File, name: str | None) -> Output:
    """The attachment called ``name``, or the only thing in a file without clips."""
    names = list(held.attachments)
    if name is None and len(held.skeletons) == 1 and not names:
        return _skeleton(held, held.skeletons[0][0])
    if name is None and len(names) == 1:
        name = names[0]
    if name is None or name not in held.attachments:
        shown = ", ".join(names) or "nothing"
        raise Failure(f"no clips; choose with --clip among {shown}", Exit.USAGE)
    return "attachment", PurePosixPath(name).name, held.attachments[name].read()


def _deliver(
    file: str,
    output: str | None,
    outputs: list[Output],
    force: bool,
    as_json: bool,
    facts: dict[str, Any],
) -> None:
    """Write the outputs where they belong and say so."""
    if output == "-":
        binary_output().write(outputs[0][2])
        return
    folder = Path() if file == "-" else Path(file).parent
    if output is not None:
        folder = Path(output) if Path(output).is_dir() else Path(output).parent
    rows = []
    for place, (kind, name, data) in enumerate(outputs):
        named = output is not None and not Path(output).is_dir() and place == 0
        path = Path(str(output)) if named else folder / plain_name(name)
        write_output(path, data, force)
        rows.append({"path": str(path), "kind": kind, "bytes": len(data)})
    if as_json:
        print_json({"outputs": rows, **facts})
    else:
        for row in rows:
            click.echo(printable(f"{row['path']}  {row['bytes']:,} bytes"))
