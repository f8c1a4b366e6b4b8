"""``mcz extract`` and ``mcz replace``: parts of an .mcz, cut out or replaced without the rest."""

from __future__ import annotations

import csv
import io
import zipfile
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import click
import numpy as np
from numpy.typing import NDArray

from mcz.cli import shared_options
from mcz.cli.common import (
    Exit,
    Failure,
    add_salvage_hint,
    errors_about,
    report_damage,
    require_file,
)
from mcz.cli.outputs import resolve_output
from mcz.cli.terminal import Progress, echo, plural, print_json, printable, say
from mcz.model.text_format import cell_text

if TYPE_CHECKING:
    from mcz.files.editing.extraction import ExtractedClip, Extraction
    from mcz.files.reading.clip import Clip


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
@shared_options.frames("Keep frames A <= f < B, counted from 0.")
@click.option(
    "--recode",
    is_flag=True,
    help="Re-encode if joints are coded together, or if other frames would stay stored; adds a "
    "small error if lossy. Default: refuse such joints.",
)
@shared_options.clips
@shared_options.where
@shared_options.salvage
@shared_options.copies("yes if IN.mcz has copies")
@shared_options.max_decoded
@shared_options.force
@shared_options.json
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
    """Write some frames or joints of IN.mcz, or fewer resolutions, without re-encoding.

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


@click.command(short_help="Replace the values of one joint.")
@click.argument("file", metavar="IN.mcz", type=click.Path(readable=False))
@click.argument("output", metavar="[OUT.mcz]", required=False, type=click.Path(readable=False))
@click.option("--joint", metavar="J", required=True, help="Name the joint, or give its index.")
@click.option(
    "--values",
    "table",
    metavar="FILE",
    required=True,
    type=click.Path(readable=False),
    help="Read the new values from a .csv or .npz as decode --to writes them.",
)
@click.option(
    "--clip", "name", metavar="NAME", help="Choose the clip. Required if there are several."
)
@click.option("--in-place", is_flag=True, help="Write to IN.mcz itself, without OUT.mcz.")
@click.option(
    "--on-grid", is_flag=True, help="Round to the digits of the source. Default: keep every digit."
)
@click.option(
    "--recode",
    is_flag=True,
    help="Re-encode a clip whose joints are coded together; other joints change a little. Default: "
    "refuse such a clip.",
)
@shared_options.copies("yes if IN.mcz has copies")
@shared_options.force
@shared_options.json
def replace_command(
    file: str,
    output: str | None,
    joint: str,
    table: str,
    name: str | None,
    in_place: bool,
    on_grid: bool,
    recode: bool,
    copies: bool | None,
    force: bool,
    as_json: bool,
) -> Exit:
    """Replace the values of one joint; all other streams are copied byte for byte.

    The table has a row for each frame. Its columns are those of the joint; other columns are
    ignored if the table has a header. Only --in-place changes IN.mcz.
    """
    import mcz
    from mcz.files.writing.atomic import refuse_inputs

    if in_place == (output is not None):
        raise Failure("name OUT.mcz, or use --in-place to change IN.mcz itself", Exit.USAGE)
    if "-" in (file, output, table):
        raise Failure("replace reads and writes files, not standard streams", Exit.USAGE)
    require_file(file)
    require_file(table)
    output = output and resolve_output(output, file)
    target = output or file
    with errors_about(file):
        if output is not None and Path(output).exists() and Path(output).samefile(file):
            raise Failure(
                "the output is IN.mcz itself; use --in-place to change it", Exit.USAGE, path=output
            )
        refuse_inputs(target, (table,))
        with mcz.open(file) as opened_file:
            values = read_values(table, opened_file.only_clip(name), joint)
        with Progress() as progress:
            result = mcz.replace(
                file,
                name,
                joint,
                values,
                output,
                on_grid=on_grid,
                copies=copies,
                recode=recode,
                force=force,
                progress=progress,
            )
    if as_json:
        print_json({"output": target, **asdict(result)})
        return Exit.FINE
    coded = f"{result.joint} of {result.clip}" + (", re-encoded" if result.is_recoded else "")
    line = f"{target}: {result.size:,} bytes; {coded}: {result.joint_bytes:,}"
    echo(f"{line} of {result.joint_bytes_before:,} bytes, {result.codec}")
    if result.is_recoded:
        errors = f"{result.max_error:.3g}, others {result.others_error:.3g}"
        echo(f"  greatest error, in units of the source: {result.joint} {errors}")
    if result.n_exceptions or result.n_exceptions_before:
        before = f"{result.n_exceptions_before:,} before"
        line = f"  {plural(result.n_exceptions, 'number')} of the joint off the grid, {before}"
        echo(f"{line}; use --on-grid to round them" if result.n_exceptions else line)
    for text in result.left_out:
        say(f"left out: {text}")
    return Exit.FINE


def read_values(path: str, clip: Clip, joint: str) -> NDArray[np.float64]:
    """The columns of the joint in a table, NaN where marked invalid; raises Failure."""
    from mcz.files.tables import channel_names

    is_npz = Path(path).suffix.lower() == ".npz"
    all_names = channel_names(clip.skeleton, clip.signals[0].channels)
    if not is_npz:  # as the CSV export writes them
        all_names = [*map(printable, all_names)]
    expected = [all_names[column] for column in clip.skeleton.columns(clip.skeleton.find(joint))]
    reading = _read_npz if is_npz else _read_csv
    try:
        names, values = reading(Path(path))
    except (ValueError, KeyError, OSError, EOFError, csv.Error, zipfile.BadZipFile) as error:
        raise Failure(
            f"not a table of numbers: {' '.join(str(error).split())}", path=path
        ) from None
    older = {f"{name}.value": name for name in expected}  # names of columns up to 0.9.0
    names = [older.get(name, name) for name in names]
    missing = [name for name in expected if name not in names]
    if not missing:
        return values[:, [names.index(name) for name in expected]]
    if any(name in names for name in all_names) or values.shape[1] != len(expected):
        raise Failure(
            f"there is no column {missing[0]}, and the table does not have exactly "
            f"{len(expected)} columns",
            path=path,
        )
    return values


def _read_npz(path: Path) -> tuple[list[str], NDArray[np.float64]]:
    with np.load(path, allow_pickle=False) as arrays:
        values = np.asarray(arrays["values"], np.float64)
        if values.ndim != 2:
            raise ValueError(f"values of shape {values.shape}")
        if "mask" in arrays:
            values = np.where(arrays["mask"], values, np.nan)
        return [str(name) for name in arrays["names"]] if "names" in arrays else [], values


def _read_csv(path: Path) -> tuple[list[str], NDArray[np.float64]]:
    rows = list(csv.reader(io.StringIO(path.read_text("utf-8-sig"))))
    names = rows.pop(0) if rows and not _is_number(rows[0][0] if rows[0] else "") else []
    values = [[float(cell) if cell.strip() else np.nan for cell in row] for row in rows if row]
    if len({len(row) for row in values}) > 1:
        raise ValueError("rows of different lengths")
    return [*map(cell_text, names)], np.array(values, np.float64).reshape(len(values), -1)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
