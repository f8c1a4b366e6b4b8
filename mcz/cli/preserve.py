"""``mcz protect``, ``repair`` and ``bag``: recovery data, salvage, and bags (BagIt, RFC 8493)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from typing import TYPE_CHECKING

import click

from mcz.cli import shared_options
from mcz.cli.common import Exit, Failure, errors_about, require_file
from mcz.cli.outputs import resolve_output
from mcz.cli.terminal import Progress, echo, plural, print_json, say

if TYPE_CHECKING:
    from mcz.files.editing.recovering import Recovery
    from mcz.files.editing.repair import Repair


def _to_share(ctx: click.Context, param: click.Parameter, value: str) -> float:
    """Callback of a share: ``5%`` or ``0.05``."""
    try:
        share = float(value.removesuffix("%")) / (100 if value.endswith("%") else 1)
    except ValueError:
        share = 0.0
    if not 0 < share <= 1:
        raise click.BadParameter(f"{value!r} is not a share such as 5% or 0.05, at most 100%")
    return share


@click.command(short_help="Add recovery data, with which repair restores a damaged .mcz.")
@click.argument("file", metavar="FILE.mcz", type=click.Path(readable=False))
@click.option(
    "--redundancy",
    metavar="5%",
    default="5%",
    show_default=True,
    callback=_to_share,
    help="Set the share of bytes to add; a small file gets more, so that it survives some damage.",
)
@click.option(
    "--rebuild", is_flag=True, help="Rewrite the file, with one set of recovery data for all of it."
)
@click.option(
    "--check",
    is_flag=True,
    help="Report whether the file is intact or can be repaired; change nothing.",
)
@shared_options.json
def protect_command(
    file: str, redundancy: float, rebuild: bool, check: bool, as_json: bool
) -> Exit:
    """Append recovery data to FILE.mcz, with which mcz repair can restore every byte.

    Repair succeeds if there are at least as many recovery blocks as bad blocks, anywhere: single
    bytes, a burst, the beginning or the end of the file. The file stays readable at every moment.
    Parts appended later have their own recovery data, which may be lost with the tail; --rebuild
    makes one set for the whole file.
    """
    require_file(file)
    if rebuild and check:
        raise Failure(
            "--check and --rebuild exclude each other: --check changes nothing", Exit.USAGE
        )
    if check:
        return _check_protection(file, as_json)
    import mcz

    with errors_about(file), Progress() as progress:
        protections = mcz.protect(
            file,
            redundancy,
            rebuild=rebuild,
            progress=lambda done, total: progress(done + 1, total, "recovery data"),
        )
    if as_json:
        print_json({"target": file, "protections": [asdict(one) for one in protections]})
        return Exit.FINE
    for one in protections:
        echo(
            f"{file}: bytes {one.start:,} to {one.stop:,} are protected against the loss of any "
            f"{plural(one.n_recovery, 'block')} of {one.n_blocks:,} ({one.block_size:,} bytes "
            f"each), or of {one.burst:,} bytes in a row, at a cost of {one.cost:,} bytes"
        )
    if len(protections) > 1:
        parts = f"these {len(protections)} parts are protected separately"
        echo(f"{file}: {parts}; --rebuild protects them together")
    return Exit.FINE


def _check_protection(file: str, as_json: bool) -> Exit:
    from mcz.files.editing.recovering import Recovery, check_recovery

    with errors_about(file):
        recovery = check_recovery(file)
    if as_json:
        document = asdict(recovery or Recovery()) | {"protected": recovery is not None}
        print_json({"target": file} | document)
    elif recovery is None:
        echo(f"{file}: no recovery data")
    else:
        _print_protection(file, recovery)
    bad = recovery is None or recovery.bad_blocks or recovery.bad_recovery
    return Exit.NOT_VERIFIED if bad else Exit.FINE


def _print_protection(file: str, recovery: Recovery) -> None:
    problems = recovery.lines()
    if not problems:
        echo(f"{file}: none of {recovery.n_blocks:,} blocks is bad")
    for line in problems:
        say(f"{file}: {line}")
    if problems:
        can = "can" if recovery.possible else "cannot"
        echo(f"{file}: mcz repair {can} restore every byte")
    if recovery.behind:
        echo(f"{file}: {recovery.behind:,} bytes at its end are not protected")


@click.command(short_help="Write the intact parts of a damaged .mcz to a valid one.")
@click.argument("file", metavar="FILE.mcz", type=click.Path(readable=False))
@click.option("-o", "--output", metavar="OUT.mcz", required=True, help="Write to this file.")
@shared_options.max_decoded
@shared_options.force
@shared_options.json
def repair_command(
    file: str, output: str, max_decoded: int | None, force: bool, as_json: bool
) -> Exit:
    """Write the intact parts of FILE.mcz to OUT.mcz, a valid file; FILE.mcz does not change.

    With enough recovery data (mcz protect), OUT.mcz is the protected file, byte for byte. Otherwise
    each intact run of frames in a damaged clip becomes a clip NAME.A-B. Stored bytes are copied
    without re-encoding. Losses are listed, with exit code 4; without losses the exit code is 0.
    """
    import mcz

    if "-" in (file, output):
        raise Failure("repair reads and writes files, not standard streams", Exit.USAGE)
    require_file(file)
    output = resolve_output(output, file)
    with errors_about(file), Progress() as progress:
        result = mcz.repair(file, output, force=force, max_decoded=max_decoded, progress=progress)
    if as_json:
        print_json({"output": output, **asdict(result)})
    elif result.restored:
        echo(f"{output}: every byte is as it was protected, {result.size:,} bytes")
    else:
        echo(*_repair_lines(output, result))
    for text in result.damage:
        say(f"{file}: {text}")
    for text in result.lost:
        say(f"lost: {text}")
    return Exit.SALVAGED if result.lost else Exit.FINE


def _repair_lines(output: str, result: Repair) -> Iterator[str]:
    counts = [
        plural(len(result.clips), "whole clip"),
        plural(len(result.attachments), "attachment"),
    ]
    if result.runs:
        counts.insert(1, f"parts of {plural(len(result.runs), 'clip')}")
    if not (result.clips or result.runs):
        counts.insert(1, plural(len(result.skeletons), "skeleton"))
    yield f"{output}: {', '.join(counts)}, {result.size:,} bytes"
    for name, runs in result.runs.items():
        spans = ", ".join(f"{start}:{stop}" for start, stop in runs)
        yield f"  {name}: frames {spans}"
    yield "something was lost" if result.lost else "nothing was lost"


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
@shared_options.json
def bag_command(files: tuple[str, ...], folder: str, info: tuple[str, ...], as_json: bool) -> Exit:
    """Copy the files into DIR, a new folder, as a bag (BagIt).

    The checksums of each .mcz are checked first; a damaged one is refused. You may add other files,
    such as a report of mcz verify. To check a bag, run mcz verify DIR.
    """
    import mcz
    from mcz.files.bags import check_bag

    lines = [_info_line(text) for text in info]
    if len({name.lower() for name, _ in lines}) < len(lines):
        raise Failure("--info: a name occurs twice", Exit.USAGE)
    with errors_about(folder):
        path = mcz.bag(files, folder, dict(lines), software=f"mcz {mcz.__version__}")
        check = check_bag(path)
    if check.problems:  # a disk may not keep the written bytes
        raise Failure(check.problems[0], Exit.NOT_VERIFIED, path=folder)
    if as_json:
        print_json({"output": folder, "files": check.files, "bytes": check.n_bytes})
    else:
        count = plural(len(check.files), "file")
        echo(f"{folder}: a bag of {count}, {check.n_bytes:,} bytes")
    return Exit.FINE


def _info_line(text: str) -> tuple[str, str]:
    name, is_pair, value = text.partition("=")
    if not is_pair:
        raise Failure(f"--info {text} is not NAME=TEXT", Exit.USAGE)
    return name, value
