"""``mcz extract``: frames, joints or coarser resolutions out of an .mcz, without re-encoding."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from typing import TYPE_CHECKING

import click

from mcz.cli.common import (
    Exit,
    Failure,
    echo,
    errors_about,
    plural,
    print_json,
    report_damage,
    require_file,
    say,
)
from mcz.cli.hints import add_salvage_hint
from mcz.cli.options import (
    clips_option,
    copies_option,
    decoded_option,
    force_option,
    frames_option,
    json_option,
    salvage_option,
    where_option,
)
from mcz.cli.outputs import resolve_output
from mcz.cli.terminal import Progress

if TYPE_CHECKING:
    from mcz.files.editing.extraction import ExtractedClip, Extraction


@click.command(short_help="Cut a part out of an .mcz, without re-encoding.")
@click.argument("file", metavar="IN.mcz", type=click.Path(readable=False))
@click.argument("output", metavar="OUT.mcz", type=click.Path(readable=False))
@click.option(
    "--resolution",
    metavar="K",
    type=click.IntRange(min=0),
    default=0,
    help="Leave out the K finest resolutions.",
)
@click.option(
    "--joints", metavar="a,b", help="Keep the channels of these joints, by name or index."
)
@frames_option("Keep frames A <= f < B, counted from 0.")
@click.option(
    "--recode",
    is_flag=True,
    help="Re-encode if joints are coded together, or if other frames would stay stored; adds a "
    "small error if lossy. Default: refuse such joints.",
)
@clips_option
@where_option
@salvage_option
@copies_option("yes if IN.mcz has copies")
@decoded_option
@force_option
@json_option
def extract_command(
    file: str,
    output: str,
    resolution: int,
    joints: str | None,
    frames: tuple[int, int | None] | None,
    recode: bool,
    clips: tuple[str, ...],
    where: str | None,
    salvage: bool,
    copies: bool | None,
    max_decoded: int | None,
    force: bool,
    as_json: bool,
) -> Exit:
    """Cut frames, joints or the finest resolutions out of IN.mcz, without re-encoding.

    Streams are copied byte for byte, so OUT.mcz has the values that IN.mcz has for the same frames,
    joints and resolution. Some codecs code all joints together: see --recode. The quality record
    lists the cuts. With --salvage, IN.mcz may be damaged outside the selected parts; mcz repair
    saves all intact parts.
    """
    import mcz

    if "-" in (file, output):
        raise Failure("extract reads and writes files, not standard streams", Exit.USAGE)
    require_file(file)
    output = resolve_output(output, file)
    with errors_about(file), add_salvage_hint(file, {"salvage": salvage}), Progress() as progress:
        extraction = mcz.extract(
            file,
            output,
            resolution=resolution,
            joints=None if joints is None else [joint.strip() for joint in joints.split(",")],
            frames=frames,
            clip=clips or None,
            where=where,
            salvage=salvage,
            force=force,
            max_decoded=max_decoded,
            copies=copies,
            recode=recode,
            progress=progress,
        )
    if as_json:
        print_json({"output": output, **asdict(extraction)})
    else:
        echo(*_lines(output, extraction))
    for text in () if as_json else extraction.left_out:
        say(f"left out: {text}")
    return report_damage(file, extraction.damage)


def _lines(output: str, extraction: Extraction) -> Iterator[str]:
    yield f"{output}: {plural(len(extraction.clips), 'clip')}, {extraction.size:,} bytes"
    for clip in extraction.clips:
        yield f"  {clip.name}: {', '.join(_parts(clip))}"


def _parts(clip: ExtractedClip) -> Iterator[str]:
    start, stop = clip.frames
    is_all = clip.stored_frames == stop - start
    stored = "" if is_all else f" ({clip.stored_frames:,} stored; --recode drops the others)"
    yield f"frames {start}:{stop}{stored}"
    if clip.joints is not None:
        yield f"joints {' '.join(clip.joints)}"
    if clip.resolution:
        yield f"resolution {clip.resolution}"
    if clip.recoded:
        yield "re-encoded"
    yield f"data {clip.data_bytes:,} of {clip.data_bytes_before:,} bytes"
