"""``mcz decode`` and ``mcz convert``: the original file, its numbers, or another format."""

from __future__ import annotations

from pathlib import PurePosixPath
from typing import TYPE_CHECKING, Any

import click

from mcz.cli import shared_options
from mcz.cli.clip_outputs import (
    ConversionSummary,
    clip_outputs,
    skeleton_output,
    summary_facts,
    summary_lines,
)
from mcz.cli.common import Exit, Failure, JsonRefused, report_damage
from mcz.cli.decode_options import (
    SOURCE_GIVEN,
    DecodeOptions,
    Input,
    check_options,
    check_signal,
    refuse,
)
from mcz.cli.outputs import (
    TARGETS,
    Output,
    check_count,
    check_suffix,
    suffix_of,
    target_of,
    target_of_clip,
    write_outputs,
)
from mcz.cli.shared_options import ITS_RATE_HELP
from mcz.cli.terminal import plural, say
from mcz.files.reading.differences import RESTORED
from mcz.model.types import JsonObject, Settings

if TYPE_CHECKING:
    from mcz.files.reading.clip import Clip
    from mcz.files.reading.file import File


@click.command(short_help="Restore the original file, or write its numbers.")
@click.argument("file", metavar="FILE.mcz", type=click.Path(readable=False))
@click.option(
    "-o",
    "--output",
    metavar="OUT",
    help="Write to a file, whose suffix sets the format, a folder, or - for standard output. "
    "Default: the source's name, beside FILE.mcz.",
)
@click.option(
    "--clip",
    "names",
    metavar="NAME",
    multiple=True,
    help="Choose a clip (repeatable). Required if there are several.",
)
@shared_options.where
@shared_options.frames("Use only frames A <= f < B, counted from 0.")
@click.option(
    "--joints", metavar="a,b", help="Write only these joints, by name or index (with --to)."
)
@click.option(
    "--resolution",
    metavar="K",
    type=click.IntRange(min=0),
    default=0,
    help="Leave out the K finest resolutions.",
)
@click.option(
    "--decimate",
    is_flag=True,
    help="Write only every 2^K-th frame, at the frame rate divided by 2^K (with --resolution).",
)
@click.option(
    "--preview",
    "preview",
    is_flag=True,
    help="Write only the preview frames, without decoding the rest (with --to).",
)
@click.option(
    "--post-filter",
    "filtered",
    is_flag=True,
    help="Smooth the coding noise in positions of markers.",
)
@click.option(
    "--to",
    "target",
    type=click.Choice(TARGETS),
    help="Write numbers, or the motion in another format, instead of the source file. Default: by "
    "the suffix of OUT.",
)
@click.option(
    "--signal",
    metavar="NAME",
    help="Write another signal, such as analog or outputs, or the events (with --to csv or npz).",
)
@click.option(
    "--stored",
    is_flag=True,
    help="Write the numbers as stored, not in units (with --signal).",
)
@shared_options.up("Set the up axis of a clip that states none (with --to c3d, glb or usda).")
@shared_options.unit("a clip that states none (with --to another format)")
@shared_options.key_error
@shared_options.rate("Set the frame rate, replacing the clip's own (with --to, --post-filter).")
@click.option(
    "--solve-ik",
    "solve",
    is_flag=True,
    help="Fit the skeleton of a clip of positions to its points (--to amc, bvh, glb or usda).",
)
@click.option("--with-skeleton", is_flag=True, help="Also write the skeleton's own file (ASF).")
@shared_options.salvage
@click.option(
    "--unverified", is_flag=True, help="Read fewer bytes, but do not check their checksums."
)
@shared_options.max_decoded
@shared_options.force
@shared_options.threads
@shared_options.json
def decode_command(
    file: str,
    output: str | None,
    names: tuple[str, ...],
    where: str | None,
    salvage: bool,
    unverified: bool,
    max_decoded: int | None,
    force: bool,
    as_json: bool,
    **settings: Any,
) -> Exit:
    """Restore the original file of a clip byte for byte, or write its numbers or another format.

    A file without clips gives its skeleton's ASF or its attachment. Given a source file instead of
    FILE.mcz, decode works like mcz convert.
    """
    options = DecodeOptions(**settings)
    refuse(unverified and salvage, "--salvage needs the checksums; leave out --unverified")
    source = Input(file, salvage=salvage, unverified=unverified, max_decoded=max_decoded)
    return decode(source, options, output, names=names, where=where, force=force, as_json=as_json)


def decode(
    source: Input,
    options: DecodeOptions,
    output: str | None,
    *,
    names: tuple[str, ...],
    where: str | None,
    force: bool,
    as_json: bool,
) -> Exit:
    """Write the requested outputs of an input, and report them."""
    file, salvage = source.file, source.salvage
    if output == "-" and (as_json or options.with_skeleton):
        raise JsonRefused(
            "-o - writes to standard output, so it excludes --json and --with-skeleton", Exit.USAGE
        )
    if source.is_source:
        source, options = source.with_facts(options)
        refuse(output is None and options.target is None, f"{file}: {SOURCE_GIVEN}")
    if target_of(suffix_of(output)) is None:
        check_options(options, salvage)
        check_signal(options)
    outputs: list[Output] = []
    summaries: dict[str, ConversionSummary] = {}
    with source.open_file() as (opened, inputs):
        for clip in _select_clips(opened, output, names, where):
            clip_options = _with_target(clip, output, options, salvage)
            parts, summaries[clip.name] = clip_outputs(opened, clip, clip_options)
            outputs += [part for part in parts if part not in outputs]  # an ASF that clips share
        if not opened.clips:
            if options.target is not None or options.frames is not None or options.filtered:
                text = "it has no clips, so --to, --frames and --post-filter do not apply"
                raise Failure(text, Exit.USAGE, path=file)
            outputs = [_output_without_clips(opened, names)]
            check_suffix(output, outputs[0].name, is_skeleton=outputs[0].kind == "skeleton")
        facts: JsonObject = {"damage": opened.damage, "unverified_segments": opened.unverified}
    write_outputs(inputs, output, outputs, force, as_json, facts | summary_facts(summaries))
    if facts["unverified_segments"]:
        say(f"{file}: {plural(facts['unverified_segments'], 'segment')} read in part, not verified")
    for line in summary_lines(summaries):
        say(f"{file}: {line}")
    return report_damage(file, facts["damage"])


def _select_clips(
    file: File, output: str | None, names: tuple[str, ...], where: str | None
) -> list[Clip]:
    if where is not None:
        clips = file.select_clips(names or None, where)
    elif not file.clips:
        return []
    else:
        clips = file.clips_called(names) if names else [file.only_clip(None)]
    check_count(output, len(clips))
    return clips


def _with_target(
    clip: Clip, output: str | None, options: DecodeOptions, salvage: bool
) -> DecodeOptions:
    """``options`` with the target of the output's suffix, unless ``--to`` sets one."""
    if options.target is None:
        plain = not (options.solve or options.preview)
        options = options._replace(target=target_of_clip(clip, output, plain=plain))
    check_options(options, salvage)
    check_signal(options)
    return options


def _output_without_clips(file: File, names: tuple[str, ...]) -> Output:
    """The attachment of this name, or the only attachment or skeleton of a file without clips."""
    attachments = list(file.attachments)
    if len(names) > 1:
        raise Failure(
            "there are no clips; decode writes one attachment, mcz unpack all", Exit.USAGE
        )
    if not names and not attachments and len(file.skeletons) == 1:
        return skeleton_output(file, file.skeletons[0][0])
    name = next(iter(names or attachments), "")
    if name not in file.attachments or (not names and len(attachments) > 1):
        listing = ", ".join(attachments) or "nothing"
        raise Failure(f"there are no clips; choose one of {listing} with --clip", Exit.USAGE)
    data = file.attachments[name].read()
    return Output("attachment", PurePosixPath(name).name, data, RESTORED)


OF_SOURCES = ("skeleton", "arrays", "model")


@click.command(short_help="Convert a motion file to another format, in one step.")
@click.argument("file", metavar="IN", type=click.Path(readable=False))
@click.argument("output", metavar="OUT")
@click.option(
    "--to",
    "target",
    type=click.Choice(TARGETS),
    help="Set the format. Default: by the suffix of OUT.",
)
@click.option("--clip", "names", metavar="NAME", multiple=True, help="Choose the clip of an .mcz.")
@shared_options.where
@shared_options.frames("Use only frames A <= f < B, counted from 0.")
@click.option(
    "--joints", metavar="a,b", help="Write only these joints, by name or index (to csv or npz)."
)
@shared_options.skeleton(f"{shared_options.SKELETON_HELP} Default: found as in mcz encode.")
@shared_options.rate(ITS_RATE_HELP)
@shared_options.unit("a file that states none")
@shared_options.up("Set the up axis of a file that states none.")
@shared_options.arrays
@shared_options.model
@shared_options.key_error
@click.option("--with-skeleton", is_flag=True, help="Also write the skeleton's own file (ASF).")
@shared_options.max_decoded
@shared_options.force
@shared_options.threads
@shared_options.json
def convert_command(
    file: str,
    output: str,
    names: tuple[str, ...],
    where: str | None,
    max_decoded: int | None,
    force: bool,
    as_json: bool,
    **options: Any,
) -> Exit:
    """Convert IN to OUT, between any two formats that mcz knows; the suffix of OUT sets the format.

    This combines mcz encode and mcz decode. A note names facts that OUT cannot hold. A copy in the
    format of IN has the same bytes, unless --frames selects a part.
    """
    facts = {name: options.pop(name) for name in OF_SOURCES}
    choice = DecodeOptions(**options)
    source = Input(file, max_decoded=max_decoded, facts=facts)
    suffix = suffix_of(output)
    refuse(
        not suffix and choice.target is None,
        f"{output}: it has no suffix; use --to",
    )
    if suffix != ".mcz" or choice.target is not None:
        refuse(
            not source.is_source and any(facts.values()),
            f"{', '.join(f'--{name}' for name in OF_SOURCES)} need a source file, not {file}",
        )
        return decode(
            source, choice, output, names=names, where=where, force=force, as_json=as_json
        )
    refuse(not source.is_source, f"{output}: use mcz extract for clips of an .mcz")
    has_parts = bool(names or where or choice.frames or choice.joints)
    refuse(has_parts, f"{output}: an .mcz is made from a whole file; cut it with mcz extract")
    from mcz.cli.encode import encode_command

    facts |= {"rate": choice.rate, "unit": choice.unit, "up": choice.up}
    settings: Settings = {"source": file, "output": output, "force": force, "as_json": as_json}
    code: Exit = click.get_current_context().invoke(  # without callbacks
        encode_command, params=None, **settings, **facts
    )
    return code
