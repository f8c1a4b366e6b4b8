"""``mcz info`` and ``mcz-info``: show the contents of a file and the size of each part."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import TYPE_CHECKING

import click

from mcz.cli import shared_options
from mcz.cli.command_groups import StrictCommand
from mcz.cli.common import (
    EXIT_CODES,
    OPTION_HINTS,
    Exit,
    Failure,
    errors_about,
    in_options,
    open_input,
    report_damage,
    require_file,
    run,
)
from mcz.cli.figures import figure_lines
from mcz.cli.info_lines import (
    array_lines,
    preview_lines,
    preview_of,
    rate_text,
    recording_lines,
    skeleton_lines,
    time_lines,
)
from mcz.cli.terminal import echo, is_terminal, plural, print_json, say, table
from mcz.cli.verify import is_malformed
from mcz.errors import FormatError, MczError
from mcz.model.text_format import first_names
from mcz.model.types import JsonObject

if TYPE_CHECKING:
    from mcz.files.reading.faults import Problem
    from mcz.files.reading.file import File

CLIPS_IN_FULL = 4  # more clips are shown as a table
WIDEST = 200  # characters that are shown of a value of metadata
NOTES = ("source-note", "skeleton-note")
PARTS = ("payload", "overhead", "model", "source_chunk", "hash", "quality")
RATIOS = (  # of the bytes that a codec wrote, which alone restore no source
    ("cr_float32", "float32 a channel / payload and overhead"),
    ("cr_40B", "40 bytes a joint and frame / payload and overhead"),
)


@click.command(
    cls=StrictCommand, short_help="Show the contents and sizes of a file.", epilog=EXIT_CODES
)
@click.argument("file", metavar="FILE", type=click.Path(readable=False))
@shared_options.json
@click.option(
    "--layout", "show_layout", is_flag=True, help="Print the meaning of every byte range."
)
@click.option(
    "--validate",
    "check",
    is_flag=True,
    help="Check everything; print the offset and the SPEC.md heading of each fault.",
)
@shared_options.clips
@shared_options.where
@shared_options.salvage
@shared_options.skeleton("Use this ASF for an AMC.")
@click.option(
    "--preview/--no-preview",
    default=None,
    help="Draw motion over time as a line and bytes of joints as bars. Default: on a terminal, for "
    "clips that decode quickly.",
)
@shared_options.max_decoded
def info_command(
    file: str,
    as_json: bool,
    show_layout: bool,
    check: bool,
    clips: tuple[str, ...],
    where: str | None,
    salvage: bool,
    skeleton: str | None,
    preview: bool | None,
    max_decoded: int | None,
) -> Exit:
    """Show versions, skeletons, clips, codecs, bytes by part, ratios and hashes of FILE.mcz.

    For a source file of any format, show its skeleton and clip.
    """
    from mcz.files.reading.file import is_source
    from mcz.files.reading.report import info
    from mcz.files.reading.sizes import layout

    if is_source(file) and not (show_layout or check):
        if where is not None:
            raise Failure("--where selects clips of an .mcz, and this file is not one", Exit.USAGE)
        return _of_source(file, skeleton, as_json, bool(preview))
    if skeleton is not None:
        raise Failure("--skeleton applies only to an AMC", Exit.USAGE)
    if (clips or where is not None) and (show_layout or check):
        text = "--layout and --validate are of the whole file, without --clip and --where"
        raise Failure(text, Exit.USAGE)
    if check:
        return _validate(file, max_decoded, as_json)
    with open_input(file, salvage=salvage, max_decoded=max_decoded) as opened_file:
        if show_layout:
            parts = layout(opened_file)
        else:
            document = info(opened_file, clips or None, where)
            _add_previews(opened_file, document, as_json, preview)
        damage = list(opened_file.damage)
    if show_layout:
        _print_layout(parts, as_json)
    elif as_json:
        print_json(document)
    else:
        echo(*lines(file, document))
    return report_damage(file, damage)


def _add_previews(file: File, document: JsonObject, as_json: bool, preview: bool | None) -> None:
    if preview is False or (preview is None and (as_json or not is_terminal())):
        return
    if not as_json and len(document["clips"]) > CLIPS_IN_FULL:
        return
    from mcz.cli.info_lines import is_cheap

    for clip in document["clips"]:
        stored = file.clips[clip["name"]]
        if preview or is_cheap(stored):
            with suppress(MczError):  # damaged: the rest is shown
                clip["preview"] = preview_of(stored)


def _of_source(file: str, skeleton: str | None, as_json: bool, preview: bool) -> Exit:
    import mcz
    from mcz.cli.info_lines import motion_of, source_lines
    from mcz.files.reading.report import source_info

    require_file(file)
    with errors_about(file):
        document = source_info(file, skeleton)
        for clip in document["clips"] if preview else ():
            motion = mcz.read(file, skeleton=skeleton)
            clip["preview"] = {"motion": motion_of(motion)}
    if as_json:
        print_json(document)
    else:
        echo(*source_lines(file, document))
    return Exit.FINE


def _validate(file: str, max_decoded: int | None, as_json: bool) -> Exit:
    from mcz.files.reading.faults import Problem, validate

    size = 0
    try:
        with open_input(file, max_decoded=max_decoded) as opened_file:
            size, problems = opened_file.size, validate(opened_file)
    except FormatError as error:
        if not is_malformed(error):
            raise
        text = error.describe(OPTION_HINTS, with_path=False)
        problems = [Problem(error.offset or 0, "Strict reading", text)]
    return _say_problems(file, size, problems, as_json)


def _say_problems(file: str, size: int, problems: list[Problem], as_json: bool) -> Exit:
    if as_json:
        rows = [
            {"offset": p.offset, "heading": p.heading, "message": in_options(p.message)}
            for p in problems
        ]
        print_json({"valid": not problems, "problems": rows})
    elif not problems:
        echo(f"{file}: valid, {size:,} bytes")
    else:
        for p in problems:
            say(f'{file}: at {p.offset}: {in_options(p.message)} (SPEC.md, "{p.heading}")')
    return Exit.NOT_VERIFIED if problems else Exit.FINE


def _print_layout(parts: list[tuple[int, int, str]], as_json: bool) -> None:
    if as_json:
        print_json([{"offset": at, "bytes": n, "meaning": text} for at, n, text in parts])
        return
    rows = [[f"{at}", f"{n}", text] for at, n, text in parts]
    echo(*table([["offset", "bytes", "meaning"], *rows], "rrl"))


def lines(file: str, document: JsonObject) -> Iterator[str]:
    """The text that people read, without line ends."""
    counts = [
        plural(len(document["clips"]), "clip"),
        plural(len(document["skeletons"]), "skeleton"),
    ]
    if document["attachments"]:
        counts.append(plural(len(document["attachments"]), "attachment"))
    yield (
        f"{file}: MCZ {document['format_version']} (readers of {document['needs_version']} on), "
        f"{document['profile']} profile, {document['file_bytes']:,} bytes"
    )
    yield f"  {', '.join(counts)}"
    for skeleton in document["skeletons"][:CLIPS_IN_FULL]:
        yield from skeleton_lines(skeleton)
    if len(document["skeletons"]) > CLIPS_IN_FULL:
        yield ""
        yield f"{len(document['skeletons']) - CLIPS_IN_FULL:,} more skeletons; --json lists them"
    alone = bool(document["parts"]) and len(document["clips"]) == 1
    if len(document["clips"]) <= CLIPS_IN_FULL:
        for clip in document["clips"]:
            yield from _clip(clip, alone)
            if not alone:
                yield from _preview(clip)
    else:
        yield from ("", *_clips(document["clips"]))
        yield from _notes(document["clips"])
    for attachment in document["attachments"]:
        yield ""
        yield f"attachment {attachment['name']}: {attachment['bytes']:,} bytes, verbatim"
    if document["parts"]:
        yield from _file_parts(document)
    if alone:
        yield from _preview(document["clips"][0])


def _preview(clip: JsonObject) -> Iterator[str]:
    if "preview" in clip:
        yield from preview_lines(clip["preview"])


def _file_parts(document: JsonObject) -> Iterator[str]:
    """Each part of the file, their sum, and its ratio to the stored files."""
    yield ""
    size = document["file_bytes"]
    yield from _part_table({**document["parts"], "file": size}, size)
    if document["cr_file"] is not None:
        yield f"  {document['cr_file']:7.2f} : 1, the files stored / this file"


def _part_table(parts: Mapping[str, int], whole: int) -> Iterator[str]:
    rows = [[name, f"{n:,}", f"{100 * n / whole:.1f} %"] for name, n in parts.items() if n]
    for line in table([["part", "bytes", "share"], *rows], "lrr"):
        yield f"  {line}"


def _clip(clip: JsonObject, alone: bool) -> Iterator[str]:
    """Lines about a clip; if it is ``alone`` the parts of the file replace its own."""
    yield ""
    yield (
        f"clip {clip['name']}: {plural(clip['n_frames'], 'frame')} {rate_text(clip)}, "
        f"{plural(clip['n_channels'], 'channel')}, {plural(clip['n_joints'], 'joint')}"
    )
    yield from time_lines(clip["times"])
    yield f"  skeleton   {clip['skeleton'][:8]}"
    for signal in clip["codecs"]:
        yield _codec(clip["codec"], signal)
        if signal["exact_joints"]:
            yield f"  exact      {', '.join(signal['exact_joints'])}"
    for model in clip["models"]:
        known = f"{model['name']}, well known" if model["name"] else "in the file"
        yield f"  model      {model['id'][:8]} ({known})"
    yield from _source(clip)
    yield from recording_lines(clip["recording"])
    yield from array_lines(clip["arrays"])
    for key, value in clip["metadata"].items():
        yield f"  {key}  {value[:WIDEST]}"
    if clip["quality"]:
        yield "  quality"
        yield from (f"    {line}" for line in figure_lines(clip["quality"]))
    if not alone:
        own = {part.replace("_", " "): clip[f"{part}_bytes"] for part in PARTS}
        yield from _part_table(own, sum(own.values()))
    if clip["packets"]:
        framing = f"{clip['packet_bytes']:,} bytes of the overhead"
        yield f"  {plural(clip['packets'], 'packet')}, their framing {framing}"
    if clip["between_bytes"]:
        yield f"  {clip['between_bytes']:,} bytes of ancillary chunks (REPT) amid the frames"
    for key, against in RATIOS:
        if clip[key] is not None:
            yield f"  {clip[key]:7.2f} : 1, {against}"
    yield from (f"  damage: {line}" for line in clip["damage"])


def _codec(name: str, signal: JsonObject) -> str:
    header = f", header {signal['header']}" if signal["header"] else ""
    counts = ", ".join(
        plural(signal[key], key.removesuffix("s")) for key in ("segments", "groups", "resolutions")
    )
    of = signal["signal"]
    of += f" ({signal['role']})" if signal["role"] not in ("", of) else ""
    return f"  codec      {name} version {signal['version']}{header}, {of}: {counts}"


def _source(clip: JsonObject) -> Iterator[str]:
    if clip["source_mode"] == "none":
        yield "  source     none"
        return
    yield (
        f"  source     {clip['source_path']} ({clip['source_format']}, {clip['source_mode']}), "
        f"{clip['source_bytes']:,} bytes"
    )
    yield f"  sha256     {clip['source_sha256']}"
    share = 100 * clip["exceptions_share"]
    yield f"  exceptions {clip['n_exceptions']:,} numbers off their grid ({share:.3g} %)"


def _clips(clips: list[JsonObject]) -> list[str]:
    heading = ["clip", "codec", "frames", "rate", "channels", "source", "payload", "other", "ratio"]
    rows = [
        [
            clip["name"],
            clip["codec"],
            f"{clip['n_frames']:,}",
            "?" if clip["frame_rate"] is None else f"{clip['frame_rate']:g}",
            f"{clip['n_channels']}",
            f"{clip['source_bytes'] or 0:,}",
            f"{clip['payload_bytes']:,}",
            f"{sum(clip[f'{part}_bytes'] for part in PARTS[1:]):,}",
            _clip_ratio(clip),
        ]
        for clip in clips
    ]
    return table([heading, *rows], "llrrrrrrr")


def _clip_ratio(clip: JsonObject) -> str:
    """The ratio of the source to the payload and the other parts shown with it."""
    own = sum(clip[f"{part}_bytes"] for part in PARTS)
    return f"{clip['source_bytes'] / own:.2f}" if clip["source_bytes"] else ""


def _notes(clips: list[JsonObject]) -> Iterator[str]:
    clips_by_note: dict[str, list[str]] = {}
    for clip in clips:
        for key in NOTES:
            if text := clip["metadata"].get(key):
                clips_by_note.setdefault(f"{key}  {text[:WIDEST]}", []).append(clip["name"])
    if clips_by_note:
        yield ""
    for note, names in clips_by_note.items():
        yield f"{note}: {first_names(names, CLIPS_IN_FULL)}"


def main() -> None:
    sys.exit(run(shared_options.version(info_command), "mcz-info"))


if __name__ == "__main__":
    main()
