"""``mcz encode``: a source file to an .mcz file."""

from __future__ import annotations

import io
import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mcz.cli import shared_options
from mcz.cli.common import (
    Exit,
    Failure,
    JsonRefused,
    errors_about,
    in_options,
    open_input,
    require_file,
)
from mcz.cli.figures import error_summary
from mcz.cli.outputs import resolve_output
from mcz.cli.shared_options import ITS_RATE_HELP
from mcz.cli.terminal import Progress, binary_output, echo, plural, print_json, say

if TYPE_CHECKING:
    from mcz.files.writing.file import Written

INPUT_FORMATS = "bvh amc c3d asf trc mot sto csv mvnx npy npz pickle torch".split()


@click.command(short_help="Encode a motion file: .bvh, .amc, .c3d, .trc, .csv, .npz, ...")
@click.argument("source", metavar="SRC", type=click.Path(readable=False))
@click.argument("more", metavar="", nargs=-1, type=click.Path(readable=False))
@click.option(
    "-o",
    "--output",
    metavar="OUT.mcz",
    help="Write to a file, a folder, or - for standard output. Default: SRC with the suffix .mcz.",
)
@shared_options.skeleton(
    f"{shared_options.SKELETON_HELP} Default: an ASF beside the AMC or in a sibling folder asf/ "
    "with the name of the take or the subject, or the only one whose bones fit."
)
@click.option(
    "--format",
    "format_name",
    type=click.Choice(INPUT_FORMATS),
    help="Set the format of standard input. Default: detect it from the content; for live input "
    "BVH, or AMC with --skeleton.",
)
@shared_options.copies("no")
@shared_options.encoding
@shared_options.rate(ITS_RATE_HELP)
@shared_options.force
@shared_options.threads
@shared_options.json
def encode_command(
    source: str,
    more: tuple[str, ...],
    output: str | None,
    skeleton: str | None,
    force: bool,
    as_json: bool,
    format_name: str | None,
    **options: Any,
) -> Exit:
    """Encode SRC into OUT.mcz.

    SRC is a .bvh, .amc, .asf, .c3d, .trc, .mot, .sto, .csv, .tsv, .mvnx, .npy, .npz, .pkl or .pt.
    An ASF gives an .mcz with only a skeleton.

    Use - as SRC to read standard input. Codecs that work frame by frame (lsdt-frame, or posewave
    with levels=0) then write each frame of a BVH or AMC before reading the next. Their default
    output is standard output.
    """
    if more:
        text = "encode takes one file; mcz pack takes a folder of them, mcz append several"
        raise Failure(text, Exit.USAGE)
    if source == "-":
        return _encode_piped(output, skeleton, force, as_json, format_name, **options)
    if format_name is not None:
        raise Failure("--format applies only to standard input; SRC has a suffix", Exit.USAGE)
    require_file(source, f": mcz pack {shlex.quote(source)} OUT.mcz")
    if source.lower().endswith(".mcz"):
        raise Failure(_reason_against_mcz(source), path=source)
    return _encode_file(source, output, skeleton, force, as_json, **options)


def _reason_against_mcz(path: str) -> str:
    """The reason why encode refuses a file with the suffix .mcz: mostly it is an MCZ file."""
    from mcz.container.chunks import SIGNATURE
    from mcz.sources import FORMATS, likely_formats

    with errors_about(path), Path(path).open("rb") as file:
        start = file.read(4096)
    names = [] if start.startswith(SIGNATURE) else likely_formats(start)
    if not names:
        return "it is an .mcz already; to add it to another, use mcz append"
    suffix = FORMATS[names[0]].suffix
    return f"its content is {suffix[1:].upper()}, but its suffix is .mcz; rename it to {suffix}"


def _encode_piped(
    output: str | None,
    skeleton: str | None,
    force: bool,
    as_json: bool,
    format_name: str | None,
    **options: Any,
) -> Exit:
    from mcz.cli.standard_input import encode_lines, spool_input
    from mcz.files.live.generators import codes_live
    from mcz.files.writing.atomic import refuse_inputs

    refuse_inputs(sys.stdout if output in (None, "-") else output, (sys.stdin, skeleton))
    if options["codec"] is not None and codes_live(options["codec"], options["params"] or {}):
        if as_json:
            raise JsonRefused("--json is not available for encoding frame by frame", Exit.USAGE)
        encode_lines(output, force, format_name, skeleton, **options)
        return Exit.FINE
    if output is None:
        raise Failure("standard input has no name; set the output with -o", Exit.USAGE)
    output = resolve_output(output, "-")
    with spool_input(format_name) as path:
        return _encode_file(path, output, skeleton, force, as_json, **options)


def _encode_file(
    source: str,
    output: str | None,
    skeleton: str | None,
    force: bool,
    as_json: bool,
    copies: bool | None,
    **options: Any,
) -> Exit:
    """Encode one file, or standard input, and print a summary."""
    import mcz
    from mcz.files.writing.atomic import refuse_inputs

    if output == "-":
        refuse_inputs(sys.stdout, (source, skeleton))
    target = resolve_output(output or str(Path(source).with_suffix(".mcz")), source, ".mcz")
    unread = output == "-" or _is_special(target)
    if unread and as_json:
        raise JsonRefused(
            f"-o {target} writes to standard output, so it excludes --json", Exit.USAGE
        )
    sink = binary_output() if output == "-" else None
    piped = io.BytesIO()
    with errors_about(source), Progress() as progress:
        written = mcz.encode(
            source,
            piped if sink is not None else target,
            skeleton=skeleton,
            force=force,
            copies=bool(copies),
            progress=progress,
            **options,
        )
    for note in written.notes:
        say(f"{source}: {in_options(note)}")
    if sink is not None:
        sink.write(piped.getvalue())
    if not unread:
        _print_result(target, written, as_json)
    return Exit.FINE


def _print_result(target: str, written: Written, as_json: bool) -> None:
    from mcz.container.limits import output_limit

    needed, allowed = max(written.decoded_bytes, written.source_bytes), output_limit(written.size)
    if needed > allowed:
        say(f"{target}: to read it, set --max-decoded {needed}; the default is {allowed}")
    if not as_json:
        echo(summary(target, written))
        for clip in written.clips:
            if clip.quality is not None:
                echo(f"  {error_summary(clip.quality)}")
        return
    from mcz.files.reading.report import info

    with open_input(target) as file:
        print_json({"output": target, **info(file)})


def _is_special(target: str) -> bool:
    """Return whether the target is a device or a pipe, which cannot be read again."""
    path = Path(target)
    return "://" not in target and path.exists() and not (path.is_file() or path.is_dir())


def summary(target: str, written: Written) -> str:
    """One line about a file just written."""
    source_size = written.source_bytes
    contents = [
        f"{plural(clip.n_frames, 'frame')} of {plural(clip.n_channels, 'channel')}"
        for clip in written.clips
    ]
    contents += ["a skeleton"] * (0 if written.clips else written.n_skeletons)
    contents += ["verbatim"] * written.n_attachments
    ratio = f", {source_size / written.size:.2f} : 1" if source_size else ""
    sizes = f"{source_size:,} -> {written.size:,} bytes{ratio}"
    return f"{target}: {', '.join(contents)}; {sizes}"
