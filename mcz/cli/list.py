"""``mcz list``: the contents of a file, from its index unless other columns are requested."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import click

from mcz.cli import shared_options
from mcz.cli.common import Exit, JsonRefused, errors_about, open_input, report_damage
from mcz.cli.terminal import echo, plural, print_json, table
from mcz.model.text_format import spreadsheet_cell
from mcz.model.types import JsonObject

if TYPE_CHECKING:
    from mcz.files.reading.clip import Clip
    from mcz.files.reading.file import File

ALIAS = ("name", "of", "target")
USUAL = ("name", "codec", "n_frames", "n_channels", "frame_rate", "duration")
HEADS = {"name": "clip", "n_frames": "frames", "n_channels": "channels", "frame_rate": "rate"}


@click.command(short_help="List clips, from the index alone.")
@click.argument("file", metavar="FILE.mcz", type=click.Path(readable=False))
@shared_options.where
@click.option(
    "--columns",
    metavar="a,b",
    help="Print these fields and metadata keys, such as name,subject,duration,description; see "
    "docs/reference/queries.md. Default: those of the index.",
)
@click.option("--sort", metavar="KEY", help="Sort by a field or metadata key; -KEY: descending.")
@click.option("--csv", "as_csv", is_flag=True, help="Print only the clips, as a CSV table.")
@shared_options.salvage
@shared_options.json
def list_command(
    file: str,
    where: str | None,
    columns: str | None,
    sort: str | None,
    as_csv: bool,
    salvage: bool,
    as_json: bool,
) -> Exit:
    """List the clips and attachments of FILE.mcz.

    Only the index is read, unless --where, --columns or --sort need more.
    """
    if as_csv and as_json:
        raise JsonRefused("--csv and --json exclude each other", Exit.USAGE)
    names = None if columns is None else [name.strip() for name in columns.split(",")]
    with open_input(file, salvage=salvage) as opened_file, errors_about(file):
        clips = opened_file.chosen(where=where)
        if sort is not None:
            from mcz.files.editing.reorganize import in_order

            clips = in_order(opened_file, clips, sort)
        rows = _rows(opened_file, clips, names)
        totals = _totals(clips)
        whole = where is None and names is None
        attachments = [{"name": a.name, "bytes": a.size} for a in opened_file.attachments.values()]
        aliases = [(name, *opened_file.alias_of(name)) for name in sorted(opened_file.aliases)]
        damage = list(opened_file.damage)
    if as_csv:
        echo(*_as_csv(rows, names or USUAL).split("\n"))
    elif as_json:
        document: JsonObject = {"clips": rows, "totals": totals}
        document |= {
            "attachments": attachments if where is None else [],
            "aliases": [name for name, *_ in aliases] if where is None else [],
            "alias_targets": [
                dict(zip(ALIAS, alias, strict=True)) for alias in aliases if where is None
            ],
        }
        print_json(document | ({"damage": damage} if salvage else {}))
    else:
        _print(rows, names or USUAL, totals)
        if whole:
            _print_others(attachments, aliases)
    return report_damage(file, damage)


def _rows(file: File, clips: Sequence[Clip], names: list[str] | None) -> list[JsonObject]:
    """The values of each clip by column; without ``names`` those of the index, and its skeleton."""
    from mcz.files.reading.clips import getter_of

    every = file.clips.values()
    getters: dict[str, Callable[[Clip], object]] = {
        name: getter_of(name, every) for name in names or USUAL
    }
    if names is None:
        getters["skeleton"] = lambda clip: clip.skeleton_id.hex()
    return [{name: get(clip) for name, get in getters.items()} for clip in clips]


def _totals(clips: Sequence[Clip]) -> JsonObject:
    known = [clip for clip in clips if clip.frame_rate is not None]
    return {
        "clips": len(clips),
        "frames": sum(clip.n_frames for clip in clips),
        "duration": float(sum(clip.n_frames / (clip.frame_rate or 1) for clip in known)),
        "without_rate": len(clips) - len(known),
    }


def _text(name: str, value: object) -> str:
    """A value in the table; ? for an unknown rate of the index."""
    if value is None:
        return "?" if name in ("frame_rate", "duration") else ""
    if name == "duration":
        return f"{value:.2f}"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:g}"
    return f"{value:,}" if isinstance(value, int) and name != "n_channels" else str(value)


def _print(rows: list[JsonObject], names: Sequence[str], totals: JsonObject) -> None:
    if not rows:
        return
    heads = [HEADS.get(name, name) for name in names]
    cells = [[_text(name, row[name]) for name in names] for row in rows]
    numbers = [all(isinstance(row[n], int | float | None) for row in rows) for n in names]
    echo(*table([heads, *cells], "".join("r" if n else "l" for n in numbers)))
    if len(rows) > 1:
        echo(_summary(totals))


def _summary(totals: JsonObject) -> str:
    seconds = round(totals["duration"])
    time = f"{seconds // 3600}:{seconds // 60 % 60:02d}:{seconds % 60:02d}"
    unknown = totals["without_rate"]
    rest = f" and {plural(unknown, 'clip')} without a rate" if unknown else ""
    return f"{plural(totals['clips'], 'clip')}, {plural(totals['frames'], 'frame')}, {time}{rest}"


def _print_others(
    attachments: Sequence[JsonObject], aliases: Sequence[tuple[str, str, str]]
) -> None:
    for attachment in attachments:
        echo(f"{attachment['name']}  attachment, {attachment['bytes']:,} bytes")
    for name, of, target in aliases:
        same = f"same content as {of} {target}"
        echo(f"{name}  {f'the file of skeleton {target[:8]}' if of == 'skeleton' else same}")


def _as_csv(rows: list[JsonObject], names: Sequence[str]) -> str:
    """RFC 4180 except for its line ends: a head, then the values, none of them a formula."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    for row in ([*names], *([row[name] for name in names] for row in rows)):
        cells = ("" if value is None else value for value in row)
        writer.writerow(spreadsheet_cell(v) if isinstance(v, str) else v for v in cells)
    return out.getvalue().rstrip("\n")
