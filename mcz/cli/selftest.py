"""``mcz selftest``: what is installed, and whether each codec restores a clip here."""

from __future__ import annotations

import io
import platform
import time
import warnings
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import click

from mcz.cli.common import Exit, echo, plural, print_json, table
from mcz.cli.options import json_option
from mcz.model.types import JsonObject

if TYPE_CHECKING:
    from mcz.model.motion import Motion

CLIP = "walk"


@click.command(short_help="Test this installation in a few seconds.")
@json_option
def selftest_command(as_json: bool) -> Exit:
    """Show what is installed, and encode, decode and verify a generated walk with each codec.

    Speeds are frames per second of a clip of 240 frames and 96 channels, on one processor. They
    show whether compiled kernels are used; longer clips are faster. Exit code 1: a codec failed.
    """
    document = _installation()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of plain kernels, which the document has
        document["codecs"] = codecs = list(_try_codecs(_sample_walk()))
    failed = [row["name"] for row in codecs if row["fault"]]
    if as_json:
        print_json(document)
    else:
        echo(*_lines(document, failed))
    return Exit.BAD_INPUT if failed else Exit.FINE


def _installation() -> JsonObject:
    """Versions, the state of the kernels, and whether the viewer's page is there."""
    import numpy as np

    import mcz
    from mcz import kernels
    from mcz.show.viewing.page import has_page

    compiled = kernels.MODE != kernels.INTERPRETED and not kernels.lacks_compiled_kernels()
    return {
        "version": mcz.__version__,
        "python": platform.python_version(),
        "numpy": np.__version__,
        "machine": f"{platform.system()} {platform.machine()}",
        "kernels": kernels.MODE if compiled else kernels.INTERPRETED,
        "viewer": has_page(),
    }


def _sample_walk() -> Motion:
    from mcz import read
    from mcz.sources.sample import sample_files

    with TemporaryDirectory() as folder:
        path = Path(folder) / f"{CLIP}.bvh"
        path.write_bytes(sample_files()[path.name])
        return read(path, unit="cm")


def _try_codecs(walk: Motion) -> Iterator[JsonObject]:
    """Encode, decode and verify the walk with each codec."""
    from mcz.codecs import CODECS

    for name in CODECS:
        row = {"name": name, "bytes": None, "encode": None, "decode": None, "fault": None}
        try:
            row |= _try_codec(walk, name)
        except Exception as error:  # the test goes on, whatever is wrong with one codec
            row["fault"] = str(error) or type(error).__name__
        yield row


def _try_codec(walk: Motion, codec: str) -> JsonObject:
    """The size of a file, frames encoded and decoded a second, and a fault if there is one."""
    import mcz
    from mcz.codecs import CODECS

    file = io.BytesIO()
    started = time.process_time()
    mcz.write(walk, file, codec)
    encoded = time.process_time()
    data = file.getvalue()
    decoding = time.process_time()
    with mcz.open(data) as stored:
        decoded = stored[CLIP].motion()
    done = time.process_time()
    faults = [problem.message for problem in mcz.verify(data)]
    if CODECS[codec].lossless and decoded.values.tobytes() != walk.values.tobytes():
        faults.append("the decoded values differ from the encoded ones")
    return {
        "bytes": len(data),
        "encode": round(walk.n_frames / max(encoded - started, 1e-9)),
        "decode": round(walk.n_frames / max(done - decoding, 1e-9)),
        "fault": faults[0] if faults else None,
    }


def _lines(document: JsonObject, failed: list[str]) -> Iterator[str]:
    versions = "MCZ {version}, Python {python}, NumPy {numpy}, {machine}"
    yield versions.format_map(document)
    slow = "plain Python, 50 to 500 times slower: install a wheel, or a C compiler and MCZ again"
    is_compiled = document["kernels"] != "interpreted"
    yield f"kernels: {document['kernels'] if is_compiled else slow}"
    smaller = "mcz view shows a smaller player"
    yield f"viewer: {'its page is there' if document['viewer'] else f'no page; {smaller}'}"
    rows = [["codec", "bytes", "encode", "decode", ""]]
    for row in document["codecs"]:
        speeds = [f"{row[key]:,}/s" if row[key] else "" for key in ("encode", "decode")]
        size = f"{row['bytes']:,}" if row["bytes"] else ""
        rows.append([row["name"], size, *speeds, row["fault"] or "verified"])
    yield from table(rows, "lrrrl")
    yield (
        f"{plural(len(failed), 'codec')} failed: {', '.join(failed)}"
        if failed
        else "everything works"
    )
