"""``mcz decode``: the original file out of an .mcz file, or its numbers."""

from __future__ import annotations

import sys
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING

import click
import numpy as np

from mcz.cli.common import (
    Exit,
    Failure,
    opened,
    print_json,
    printable,
    say,
    to_frames,
    write_output,
)
from mcz.cli.options import force_option, json_option

if TYPE_CHECKING:
    from mcz.clip import Clip
    from mcz.file import File

Output = tuple[str, str, bytes]  # kind, file name, content


@click.command(short_help="The original file again, or its numbers.")
@click.argument("file", metavar="FILE.mcz", type=click.Path())
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
    help="Leave out the K finest details (with --to).",
)
@click.option(
    "--to",
    "target",
    type=click.Choice(["csv", "npz", "c3d"]),
    help="Numbers, or the markers as a plain C3D, instead of the source file.",
)
@click.option("--with-skeleton", is_flag=True, help="Write the skeleton's own file (ASF) too.")
@click.option("--salvage", is_flag=True, help="Write what a damaged file still holds.")
@force_option
@json_option
def command(
    file: str,
    output: str | None,
    name: str | None,
    frames: tuple[int, int | None] | None,
    joints: str | None,
    resolution: int,
    target: str | None,
    with_skeleton: bool,
    salvage: bool,
    force: bool,
    as_json: bool,
) -> Exit:
    """Write the original file of a clip, byte for byte, or its numbers as CSV, NPZ or C3D.

    A file without clips gives its skeleton's ASF or its attachment.
    """
    if target in (None, "c3d") and (joints is not None or resolution):
        raise Failure("--joints and --resolution need --to csv or --to npz", Exit.USAGE)
    if output == "-" and (as_json or with_skeleton):
        raise Failure("-o - leaves no room for --json or --with-skeleton", Exit.USAGE)
    with opened(file, salvage=salvage) as held:
        if held.clips:
            clip = held.only_clip(name)
            cut = _cut(clip, frames)
            if target is None:
                outputs = [_source(clip, cut)]
            elif target == "c3d":
                outputs = [_markers(clip, cut)]
            else:
                outputs = [_export(clip, target, cut, joints, resolution)]
            if with_skeleton:
                outputs.append(_skeleton(held, clip.skeleton_id))
        else:
            outputs = [_other(held, name)]
        damage = list(held.damage)
    _deliver(file, output, outputs, force, as_json, damage)
    for line in damage:
        say(f"{file}: salvage: {line}")
    return Exit.SALVAGED if damage else Exit.FINE


def _cut(clip: Clip, frames: tuple[int, int | None] | None) -> tuple[int, int] | None:
    if frames is None:
        return None
    start, stop = frames
    return start, clip.n_frames if stop is None else stop


def _source(clip: Clip, cut: tuple[int, int] | None) -> Output:
    data = clip.source_bytes(cut)
    path = clip.source.path if clip.source else ""
    return "source", PurePosixPath(path).name or f"{_stem(clip)}.out", data


def _markers(clip: Clip, cut: tuple[int, int] | None) -> Output:
    """The clip as a plain C3D; refused where its joints are no markers."""
    from mcz.sources import plain_source

    return "c3d", f"{_stem(clip)}.c3d", plain_source(clip.motion(cut), "c3d")


def _export(
    clip: Clip, target: str, cut: tuple[int, int] | None, joints: str | None, resolution: int
) -> Output:
    from mcz.cli.export import EXPORTS, Table, channel_names

    chosen = None if joints is None else [joint.strip() for joint in joints.split(",")]
    values, mask = clip.read_masked(cut, chosen, resolution)
    names = channel_names(clip.skeleton)
    if chosen is not None:
        skeleton = clip.skeleton
        names = [names[c] for joint in chosen for c in skeleton.columns(skeleton.find(joint))]
    start, stop = cut or (0, clip.n_frames)
    numbers = clip.frame_numbers[start:stop]
    table = Table(
        names,
        np.asarray(values, dtype=np.float64),
        np.ones(values.shape, np.bool_) if mask is None else mask,
        np.repeat(numbers, len(values) // max(1, len(numbers))),  # a number for every row
        clip.frame_rate,
    )
    return target, f"{_stem(clip)}.{target}", EXPORTS[target](table)


def _stem(clip: Clip) -> str:
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
    damage: list[str],
) -> None:
    """Write the outputs where they belong and say so."""
    if output == "-":
        sys.stdout.buffer.write(outputs[0][2])
        return
    folder = Path() if file == "-" else Path(file).parent
    if output is not None:
        folder = Path(output) if Path(output).is_dir() else Path(output).parent
    rows = []
    for place, (kind, name, data) in enumerate(outputs):
        named = output is not None and not Path(output).is_dir() and place == 0
        path = Path(str(output)) if named else folder / name
        write_output(path, data, force)
        rows.append({"path": str(path), "kind": kind, "bytes": len(data)})
    if as_json:
        print_json({"outputs": rows, "damage": damage})
    else:
        for row in rows:
            click.echo(printable(f"{row['path']}  {row['bytes']:,} bytes"))
