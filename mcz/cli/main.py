"""``mcz``: the table of commands, each loaded when it is called; some small commands.

These are ``mcz completion``, ``mcz sample`` and ``mcz selftest``.
"""

from __future__ import annotations

import io
import os
import sys
import time
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import click

from mcz.cli import shared_options
from mcz.cli.command_groups import lazy_group
from mcz.cli.common import EXIT_CODES, Exit, Failure, errors_about, exists_error, run, write_output
from mcz.cli.terminal import echo, plural, print_json, table
from mcz.model.types import JsonObject

if TYPE_CHECKING:
    from mcz.model.motion import Motion


SHELLS = ("bash", "zsh", "fish")
COMMANDS = {  # name: module and function
    "sample": "main.sample_command",
    "encode": "encode.encode_command",
    "decode": "decode.decode_command",
    "convert": "decode.convert_command",
    "info": "info.info_command",
    "verify": "verify.verify_command",
    "bag": "preserve.bag_command",
    "protect": "preserve.protect_command",
    "repair": "preserve.repair_command",
    "pack": "archive.pack_command",
    "append": "archive.append_command",
    "merge": "reorganize.merge_command",
    "unpack": "archive.unpack_command",
    "export": "archive.export_command",
    "list": "metadata.list_command",
    "meta": "metadata.meta_command",
    "delete": "reorganize.delete_command",
    "rename": "reorganize.rename_command",
    "reorder": "reorganize.reorder_command",
    "split": "reorganize.split_command",
    "extract": "edit.extract_command",
    "replace": "edit.replace_command",
    "diff": "diff.diff_command",
    "view": "view.view_command",
    "render": "pictures.render_command",
    "plot": "pictures.plot_command",
    "stream": "stream.stream_command",
    "bench": "codecs.bench_command",
    "train": "codecs.train_command",
    "codecs": "codecs.codecs_command",
    "selftest": "main.selftest_command",
    "completion": "main.completion_command",
}


@click.command(
    cls=lazy_group(COMMANDS),
    help="Compress motion capture files (BVH, AMC, C3D, TRC, CSV, NPZ, ...) and restore them byte "
    "for byte.\n\n"
    "Every command has its own --help. Nothing is overwritten without --force.",
    epilog=EXIT_CODES,
)
@shared_options.version
def cli() -> None:
    pass


def main() -> None:
    for library in ("OMP", "OPENBLAS", "MKL"):  # sums in one order on any number of cores
        os.environ.setdefault(f"{library}_NUM_THREADS", "1")
    sys.exit(run(cli, "mcz"))


@click.command(short_help="Print completion for bash, zsh or fish.")
@click.argument("shell", metavar="|".join(SHELLS), type=click.Choice(SHELLS))
def completion_command(shell: str) -> Exit:
    """Print what a shell needs to complete mcz commands and options with the tab key.

    \b
    bash:  eval "$(mcz completion bash)"     in ~/.bashrc
    zsh:   eval "$(mcz completion zsh)"      in ~/.zshrc
    fish:  mcz completion fish | source      in ~/.config/fish/config.fish
    """
    from click.shell_completion import get_completion_class

    completes = get_completion_class(shell)
    if completes is None:
        raise Failure(f"no completion for {shell}", Exit.USAGE)
    # bash needs no check of its version: the script states its needs
    source = completes(cli, {}, "mcz", "_MCZ_COMPLETE")
    echo(*(source.source_template % source.source_vars()).splitlines())
    return Exit.FINE


@click.command(short_help="Write a generated walk (ASF/AMC, BVH and C3D).")
@click.argument("folder", metavar="DIR", type=click.Path(file_okay=False, path_type=Path))
@shared_options.force
@shared_options.json
def sample_command(folder: Path, force: bool, as_json: bool) -> Exit:
    """Write walk.asf, walk.amc, walk.bvh and walk.c3d into DIR: two seconds of walking at 120 Hz.

    The AMC and its ASF have 31 joints and 62 channels, and state no frame rate (use encode --rate
    120). The BVH is the same walk in centimeters (--unit cm). The C3D has its markers, some of them
    hidden for a while. The bytes are the same on every machine.
    """
    from mcz.sources.sample import sample_files

    files = sample_files()
    existing = [folder / name for name in files if (folder / name).exists()]
    if existing and not force:
        raise exists_error(existing[0])
    with errors_about(str(folder)):
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


CLIP = "walk"


@click.command(short_help="Test this installation in a few seconds.")
@shared_options.json
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
    import platform

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
    from tempfile import TemporaryDirectory

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
        except Exception as error:  # a faulty codec does not stop the test
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
