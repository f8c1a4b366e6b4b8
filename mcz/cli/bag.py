"""``mcz bag``: archives in a bag (BagIt, RFC 8493), whose checksums any tool can check."""

from __future__ import annotations

import click

from mcz.cli.common import Exit, Failure, about, echo, plural, print_json
from mcz.cli.options import json_option


@click.command(short_help="Put archives into a bag (BagIt) with their checksums.")
@click.argument(
    "files", metavar="FILE.mcz...", nargs=-1, required=True, type=click.Path(readable=False)
)
@click.argument("folder", metavar="DIR", type=click.Path(readable=False))
@click.option(
    "--info",
    metavar="NAME=TEXT",
    multiple=True,
    help="Add a line to bag-info.txt, such as Source-Organization=TEXT (repeatable).",
)
@json_option
def command(files: tuple[str, ...], folder: str, info: tuple[str, ...], as_json: bool) -> Exit:
    """Make DIR, a new folder, a bag that holds copies of the files.

    The checksums of each .mcz are checked first; a damaged one is refused. Other files, such as
    a report of mcz verify, may be among them. mcz verify DIR checks a bag.
    """
    import mcz
    from mcz.files.bags import check_bag

    lines = [_line(text) for text in info]
    if len({name.lower() for name, _ in lines}) < len(lines):
        raise Failure("--info: a name is given twice", Exit.USAGE)
    with about(folder):
        path = mcz.bag(files, folder, dict(lines), software=f"mcz {mcz.__version__}")
        found = check_bag(path)
    if found.problems:  # as of a disk that does not keep what it is given
        raise Failure(found.problems[0], Exit.NOT_VERIFIED, path=folder)
    if as_json:
        print_json({"output": folder, "files": found.files, "bytes": found.n_bytes})
    else:
        count = plural(len(found.files), "file")
        echo(f"{folder}: a bag of {count}, {found.n_bytes:,} bytes")
    return Exit.FINE


def _line(text: str) -> tuple[str, str]:
    name, is_pair, value = text.partition("=")
    if not is_pair:
        raise Failure(f"--info {text}: NAME=TEXT is wanted", Exit.USAGE)
    return name, value
