"""``mcz sample``: write the clips that the package generates."""

from __future__ import annotations

from pathlib import Path

import click

from mcz.cli.common import Exit, about, echo, exists, print_json, write_output
from mcz.cli.options import force_option, json_option


@click.command(short_help="Write a generated walk (ASF/AMC, BVH and C3D).")
@click.argument("folder", metavar="DIR", type=click.Path(file_okay=False, path_type=Path))
@force_option
@json_option
def command(folder: Path, force: bool, as_json: bool) -> Exit:
    """Write walk.asf, walk.amc, walk.bvh and walk.c3d into DIR: two seconds of walking at 120 Hz.

    The AMC and its ASF have 31 joints and 62 channels and say nothing of a rate (encode takes
    --rate 120); the BVH is the same walk in centimeters (--unit cm), the C3D its markers, some of
    them out of sight for a while. The bytes are the same on every machine.
    """
    from mcz.sources.sample import sample_files

    files = sample_files()
    taken = [folder / name for name in files if (folder / name).exists()]
    if taken and not force:
        raise exists(taken[0])
    with about(str(folder)):
        folder.mkdir(parents=True, exist_ok=True)
    for name, data in files.items():
        write_output(folder / name, data, force)
    outputs = [{"path": str(folder / name), "bytes": len(data)} for name, data in files.items()]
    if as_json:
        print_json({"outputs": outputs})
    else:
        for output in outputs:
            echo(f"{output['path']}  {output['bytes']:,} bytes")
    return Exit.FINE
