"""``mcz repair``: a sound file of all that is whole in a damaged one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from typing import TYPE_CHECKING

import click

from mcz.cli.common import Exit, Failure, about, echo, existing, plural, print_json, say
from mcz.cli.options import decoded_option, force_option, json_option
from mcz.cli.progress import Progress
from mcz.cli.suffixes import file_in

if TYPE_CHECKING:
    from mcz.files.editing.repair import Repair


@click.command(short_help="Write the intact parts of a damaged .mcz to a sound one.")
@click.argument("file", metavar="FILE.mcz", type=click.Path(readable=False))
@click.option("-o", "--output", metavar="OUT.mcz", required=True, help="Write to this file.")
@decoded_option
@force_option
@json_option
def command(file: str, output: str, max_decoded: int | None, force: bool, as_json: bool) -> Exit:
    """Write all that is whole in FILE.mcz to OUT.mcz, a sound file; FILE.mcz stays as it is.

    With recovery data (mcz protect) OUT.mcz is what was protected, byte for byte, as long as they
    can give that back. Otherwise, of a clip that has lost frames, each run of frames that is whole
    becomes a clip called NAME.A-B. Nothing is coded anew and nothing is made up: what is lost is
    named, and the exit code is 4; it is 0 where nothing is lost.
    """
    import mcz

    if "-" in (file, output):
        raise Failure("repair reads and writes files, not standard streams", Exit.USAGE)
    existing(file)
    output = file_in(output, file)
    with about(file), Progress() as progress:
        found = mcz.repair(file, output, force=force, max_decoded=max_decoded, progress=progress)
    if as_json:
        print_json({"output": output, **asdict(found)})
    elif found.restored:
        echo(f"{output}: every byte is as it was protected, {found.size:,} bytes")
    else:
        echo(*_lines(output, found))
    for text in found.damage:
        say(f"{file}: {text}")
    for text in found.lost:
        say(f"lost: {text}")
    return Exit.SALVAGED if found.lost else Exit.FINE


def _lines(output: str, found: Repair) -> Iterator[str]:
    counts = [plural(len(found.clips), "whole clip"), plural(len(found.attachments), "attachment")]
    if found.runs:
        counts.insert(1, f"parts of {plural(len(found.runs), 'clip')}")
    if not (found.clips or found.runs):
        counts.insert(1, plural(len(found.skeletons), "skeleton"))
    yield f"{output}: {', '.join(counts)}, {found.size:,} bytes"
    for name, runs in found.runs.items():
        spans = ", ".join(f"{start}:{stop}" for start, stop in runs)
        yield f"  {name}: frames {spans}"
    yield "something was lost" if found.lost else "nothing was lost"
