"""``mcz list`` and ``mcz meta``: the clips of an archive, and the metadata of files and clips."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from functools import partial
from typing import TYPE_CHECKING

import click

from mcz.cli import shared_options
from mcz.cli.common import (
    Exit,
    Failure,
    JsonRefused,
    errors_about,
    open_input,
    report_damage,
    require_file,
)
from mcz.cli.shared_options import to_rate
from mcz.cli.terminal import Progress, echo, plural, print_json, say, table
from mcz.model.text_format import spreadsheet_cell
from mcz.model.types import JsonObject

if TYPE_CHECKING:
    from mcz.files.editing.metadata_edit import Entries
    from mcz.files.reading.clip import Clip
    from mcz.files.reading.file import File

    Rows = Callable[[File], tuple[dict[str, dict[str, str]], list[str]]]


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
        clips = opened_file.select_clips(where=where)
        if sort is not None:
            from mcz.files.editing.reorganize import sort_clips

            clips = sort_clips(opened_file, clips, sort)
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
    """A table as in RFC 4180, but with LF: a header, then values, none of which is a formula."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    for row in ([*names], *([row[name] for name in names] for row in rows)):
        cells = ("" if value is None else value for value in row)
        writer.writerow(spreadsheet_cell(v) if isinstance(v, str) else v for v in cells)
    return out.getvalue().rstrip("\n")


def _to_pairs(
    ctx: click.Context, param: click.Parameter, values: tuple[str, ...]
) -> dict[str, str]:
    """Parse ``KEY=VALUE``; the value is kept as text."""
    from mcz.files.editing.metadata_edit import registered_key

    pairs = {}
    for value in values:
        key, equals, text = value.partition("=")
        if not equals or not key:
            raise click.BadParameter(f"{value!r} is not KEY=VALUE")
        key = registered_key(key)
        if key in pairs:
            raise click.BadParameter(f"{key!r} is set twice")
        pairs[key] = text
    return pairs


@click.command(short_help="Show and edit clip metadata.")
@click.argument("file", metavar="FILE.mcz", type=click.Path(readable=False))
@shared_options.clips
@shared_options.where
@click.option(
    "--file", "of_file", is_flag=True, help="Edit the metadata of the file, not of clips."
)
@click.option(
    "--set", "pairs", metavar="KEY=VALUE", multiple=True, callback=_to_pairs,
    help="Set a key (repeatable). Keys: see docs/guides/metadata.md; your own begin with x-."
)  # fmt: skip
@click.option(
    "--remove", "removed", metavar="KEY", multiple=True, help="Remove a key (repeatable)."
)
@click.option(
    "--from", "table", metavar="TABLE.csv", type=click.Path(readable=False),
    help="Import metadata from a table (CSV or TSV with a header): one row per clip, one column "
    "per key."
)  # fmt: skip
@click.option(
    "--match",
    metavar="TEXT",
    help="Build clip names from columns of the table: {subject:0>2}_{trial:0>2}. Default: the "
    "column clip, name, path or file.",
)
@click.option(
    "--take", metavar="a,b",
    help="Import only these columns; KEY=COLUMN if the names differ. Default: all."
)  # fmt: skip
@click.option("--skip-unknown", is_flag=True, help="Ignore rows that match no clip.")
@click.option(
    "--rate", metavar="R", callback=to_rate,
    help="Set the frame rate of clips whose source states none (AMC), by default of all whose rate "
    "is unknown; rewrites the file."
)  # fmt: skip
@click.option("--force", is_flag=True, help="Change a known rate.")
@click.option(
    "--purge", is_flag=True,
    help="Rewrite the file without any earlier metadata."
)  # fmt: skip
@click.option(
    "--to", "form", type=click.Choice(("datacite", "ro-crate")),
    help="Print a record for a repository, as JSON; required properties that the file does not "
    "state are named on standard error."
)  # fmt: skip
@shared_options.json
def meta_command(
    file: str,
    clips: tuple[str, ...],
    where: str | None,
    of_file: bool,
    pairs: dict[str, str],
    removed: tuple[str, ...],
    table: str | None,
    match: str | None,
    take: str | None,
    skip_unknown: bool,
    rate: Fraction | float | None,
    force: bool,
    purge: bool,
    form: str | None,
    as_json: bool,
) -> Exit:
    """Show or edit the metadata of clips in FILE.mcz, without rewriting their data.

    Changes are appended, and the last value wins. Earlier values stay in the file until
    --purge rewrites the file.
    """
    require_file(file)
    if of_file and (clips or where or table or rate):
        raise Failure("--file excludes --clip, --where, --from and --rate", Exit.USAGE)
    if set(pairs) & set(removed):
        raise Failure(f"{sorted(set(pairs) & set(removed))[0]} is both set and removed", Exit.USAGE)
    if form and (pairs or removed or table or rate or purge or of_file):
        raise Failure("--to prints a record, so it excludes changes", Exit.USAGE)
    if form:
        with open_input(file) as opened_file, errors_about(file):
            return _describe(opened_file, opened_file.select_clips(clips or None, where), form)
    if not (pairs or removed or table or rate or purge):
        with open_input(file) as opened_file:
            return _show(opened_file, _select_clips(opened_file, clips, where, of_file), as_json)
    rows = None
    if table is not None:
        from mcz.files.editing.metadata_edit import from_table

        columns = None if take is None else [name.strip() for name in take.split(",")]
        rows = partial(from_table, table, match=match, take=columns, skip_unknown=skip_unknown)
    edits = dict.fromkeys(removed) | pairs
    changes, unknown = _changes(file, clips, where, of_file, edits, rows)
    if unknown:
        from mcz.files.reading.clips import list_some

        say(f"{table}: {plural(len(unknown), 'row')} without a clip: {list_some(unknown)}")
    return _set(file, changes, rate, (clips, where, force), purge, as_json)


def _select_clips(
    file: File, clips: tuple[str, ...], where: str | None, of_file: bool
) -> Mapping[str, Clip | None]:
    if of_file:
        return {"": None}
    chosen = file.select_clips(clips or None, where)
    every: dict[str, Clip | None] = {} if clips or where else {"": None}
    return every | {clip.name: clip for clip in chosen}


def _show(file: File, chosen: Mapping[str, Clip | None], as_json: bool) -> Exit:
    shown = {
        name: dict(file.metadata if clip is None else clip.metadata)
        for name, clip in chosen.items()
    }
    if as_json:
        clips = [{"name": name, "metadata": pairs} for name, pairs in shown.items() if name]
        whole = {"metadata": shown[""]} if "" in shown else {}
        print_json(whole | {"clips": clips})
        return Exit.FINE
    for name, pairs in shown.items():
        if pairs or len(shown) == 1:
            echo(f"{name}:" if name else "the file:")
            echo(*(f"  {key}: {value}" for key, value in pairs.items()))
    return Exit.FINE


def _describe(file: File, clips: Sequence[Clip], form: str) -> Exit:
    from mcz.exchange.descriptions import describe

    record, missing = describe(file, clips, form)
    print_json(record)
    for name, key in missing.items():
        say(f"{file.name}: {form} requires {name}; set it with --file --set {key}=...")
    return Exit.FINE


def _changes(
    file: str,
    clips: tuple[str, ...],
    where: str | None,
    of_file: bool,
    edits: Entries,
    rows: Rows | None,
) -> tuple[dict[str, dict[str, str | None]], list[str]]:
    """Metadata changes by clip, and the table rows that match no clip."""
    changes: dict[str, dict[str, str | None]] = {}
    unknown: list[str] = []
    with open_input(file) as opened_file, errors_about(file):
        if rows is not None:
            table_rows, unknown = rows(opened_file)
            clip_names = {clip.name for clip in opened_file.select_clips(clips or None, where)}
            changes = {name: dict(row) for name, row in table_rows.items() if name in clip_names}
        if edits:
            names: Iterable[str] = (
                [""] if of_file else _select_clips(opened_file, clips, where, False)
            )
            for name in names:
                if name or of_file:
                    changes[name] = changes.get(name, {}) | dict(edits)
    return changes, unknown


def _set(
    file: str,
    changes: Mapping[str, Entries],
    rate: Fraction | float | None,
    rated: tuple[tuple[str, ...], str | None, bool],
    purge: bool,
    as_json: bool,
) -> Exit:
    """Set metadata; ``rated``: the clips that get a rate, and whether by force."""
    import mcz

    outcomes = []
    clips, where, force = rated
    with errors_about(file), Progress() as progress:
        if rate is not None:
            report = mcz.set_rate(
                file, rate, clips or None, where=where, force=force, progress=progress
            )
            outcomes += report.outcomes
        if changes or purge:
            report = mcz.set_metadata(file, changes, purge=purge, progress=progress)
            outcomes += report.outcomes
            for text in report.left_out:
                say(f"{file}: left out: {text}")
    if as_json:
        rows = [{"name": o.path, "result": o.result, "message": o.message} for o in outcomes]
        print_json({"target": file, "changed": rows})
        return Exit.FINE
    of_rate = sum(outcome.result == "rate" for outcome in outcomes)
    names = {outcome.path for outcome in outcomes if outcome.result == "said"}
    n_clips = plural(len(names - {""}), "clip")
    rates = f", the rate of {plural(of_rate, 'clip')}" if rate is not None else ""
    whole = " and of the file" if "" in names else ""
    purged = ", and purged earlier values" if purge else ""
    echo(f"{file}: updated metadata of {n_clips}{whole}{rates}{purged}")
    return Exit.FINE
