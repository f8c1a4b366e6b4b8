"""``mcz protect``: recovery data for an .mcz, from which a damaged one is made whole again."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING

import click

from mcz.cli.common import Exit, Failure, about, echo, existing, plural, print_json, say
from mcz.cli.options import json_option
from mcz.cli.progress import Progress

if TYPE_CHECKING:
    from mcz.files.editing.recovering import Recovery


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
    help=(
        "Set the share of bytes to add; a small file gets more, so that it survives some damage."
    ),
)
@click.option(
    "--anew",
    is_flag=True,
    help="Rewrite the file, with recovery data for all of it together.",
)
@click.option("--check", is_flag=True, help="Report the state of the file, and change nothing.")
@json_option
def command(file: str, redundancy: float, anew: bool, check: bool, as_json: bool) -> Exit:
    """Append recovery data to FILE.mcz: mcz repair then restores every byte of it.

    It does so as long as no more blocks are bad than there are recovery blocks, wherever they lie:
    single bytes, a burst, the beginning or the end of the file. What the file held stays readable
    at every moment. What was appended since has recovery data of its own, which a lost tail may
    take along; --anew makes one set for all.
    """
    existing(file)
    if anew and check:
        raise Failure("--check changes nothing, --anew does; choose one", Exit.USAGE)
    if check:
        return _check(file, as_json)
    import mcz

    with about(file), Progress() as progress:
        found = mcz.protect(
            file,
            redundancy,
            anew=anew,
            progress=lambda done, total: progress(done + 1, total, "recovery data"),
        )
    if as_json:
        print_json({"target": file, "protections": [asdict(one) for one in found]})
        return Exit.FINE
    for one in found:
        echo(
            f"{file}: bytes {one.start:,} to {one.stop:,} are protected: any "
            f"{plural(one.n_recovery, 'block')} of {one.n_blocks:,} may be bad, of "
            f"{one.block_size:,} bytes each, or {one.burst:,} bytes in a row; "
            f"that takes {one.cost:,} bytes"
        )
    if len(found) > 1:
        echo(
            f"{file}: these {len(found)} parts are protected apart; --anew does it for all together"
        )
    return Exit.FINE


def _check(file: str, as_json: bool) -> Exit:
    from mcz.files.editing.recovering import Recovery, check_recovery

    with about(file):
        found = check_recovery(file)
    if as_json:
        document = asdict(found or Recovery()) | {"protected": found is not None}
        print_json({"target": file} | document)
    elif found is None:
        echo(f"{file}: there are no recovery data")
    else:
        _tell(file, found)
    bad = found is None or found.bad_blocks or found.bad_recovery
    return Exit.NOT_VERIFIED if bad else Exit.FINE


def _tell(file: str, found: Recovery) -> None:
    told = found.told()
    if not told:
        echo(f"{file}: none of {found.n_blocks:,} blocks is bad")
    for line in told:
        say(f"{file}: {line}")
    if told:
        can = "can" if found.possible else "cannot"
        echo(f"{file}: mcz repair {can} restore every byte")
    if found.behind:
        echo(f"{file}: {found.behind:,} bytes at its end are not protected")
