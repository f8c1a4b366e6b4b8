"""``mcz``: the table of commands, each loaded when it is called; ``mcz completion``, ``sample``."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import click

from mcz.cli.common import (
    EXIT_CODES,
    Exit,
    Failure,
    echo,
    errors_about,
    exists_error,
    print_json,
    run,
    write_output,
)
from mcz.cli.lazy import lazy_group
from mcz.cli.options import force_option, json_option, version_option

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
    "list": "list.list_command",
    "meta": "meta.meta_command",
    "delete": "reorganize.delete_command",
    "rename": "reorganize.rename_command",
    "reorder": "reorganize.reorder_command",
    "split": "reorganize.split_command",
    "extract": "extract.extract_command",
    "replace": "replace.replace_command",
    "diff": "diff.diff_command",
    "view": "view.view_command",
    "render": "pictures.render_command",
    "plot": "pictures.plot_command",
    "stream": "stream.stream_command",
    "bench": "bench.bench_command",
    "train": "codecs.train_command",
    "codecs": "codecs.codecs_command",
    "selftest": "selftest.selftest_command",
    "completion": "main.completion_command",
}


@click.command(
    cls=lazy_group(COMMANDS),
    help="Compress motion capture files (BVH, ASF, AMC, C3D, TRC, MOT, STO) and restore them byte "
    "for byte.\n\n"
    "Every command has its own --help. Nothing is overwritten without --force.",
    epilog=EXIT_CODES,
)
@version_option
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
@force_option
@json_option
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
