"""``mcz list``: the names in a file, from its index alone."""

from __future__ import annotations

import click

from mcz.cli.common import Exit, damage_of, echo, opened, print_json, table
from mcz.cli.options import json_option, salvage_option, where_option

ALIAS = ("name", "of", "target")


@click.command(short_help="Names of clips, from the index alone.")
@click.argument("file", metavar="FILE.mcz", type=click.Path(readable=False))
@where_option
@salvage_option
@json_option
def command(file: str, where: str | None, salvage: bool, as_json: bool) -> Exit:
    """List the clips and attachments of FILE.mcz; only its index is read.

    With --where the clips alone that it takes, and as much is read as it asks for.
    """
    with opened(file, salvage=salvage) as held:
        clips = [
            {
                "name": clip.name,
                "codec": clip.codec,
                "n_frames": clip.n_frames,
                "n_channels": clip.n_channels,
                "frame_rate": None if clip.frame_rate is None else float(clip.frame_rate),
                "skeleton": clip.skeleton_id.hex(),
            }
            for clip in held.chosen(where=where)
        ]
        others = held.attachments.values() if where is None else ()
        attachments = [{"name": a.name, "bytes": a.size} for a in others]
        names = sorted(held.aliases) if where is None else ()
        aliases = [(name, *held.alias_of(name)) for name in names]
        damage = list(held.damage)
    if as_json:
        document = {
            "clips": clips,
            "attachments": attachments,
            "aliases": [name for name, *_ in aliases],
            "alias_targets": [dict(zip(ALIAS, alias, strict=True)) for alias in aliases],
        }
        print_json(document | ({"damage": damage} if salvage else {}))
        return damage_of(file, damage)
    rows = [
        [
            str(clip["name"]),
            str(clip["codec"]),
            f"{clip['n_frames']:,}",
            f"{clip['n_channels']}",
            "?" if clip["frame_rate"] is None else f"{clip['frame_rate']:g}",
        ]
        for clip in clips
    ]
    if rows:
        echo(*table([["clip", "codec", "frames", "channels", "rate"], *rows], "llrrr").split("\n"))
    for attachment in attachments:
        echo(f"{attachment['name']}  attachment, {attachment['bytes']:,} bytes")
    for name, of, target in aliases:
        same = f"same content as {of} {target}"
        echo(f"{name}  {f'the file of skeleton {target[:8]}' if of == 'skeleton' else same}")
    return damage_of(file, damage)
