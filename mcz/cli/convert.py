"""``mcz convert``: a motion file to one of another format, in one step."""

from __future__ import annotations

from typing import Any

import click

from mcz.cli.common import Exit
from mcz.cli.decode import decode
from mcz.cli.decode_input import Input
from mcz.cli.decode_options import DecodeOptions, refuse
from mcz.cli.options import (
    ITS_RATE_HELP,
    arrays_option,
    decoded_option,
    force_option,
    frames_option,
    json_option,
    key_error_option,
    model_option,
    rate_option,
    skeleton_option,
    threads_option,
    unit_option,
    up_option,
    where_option,
)
from mcz.cli.suffixes import TARGETS, suffix_of
from mcz.model.types import JsonObject, Params, Settings

MCZ = ".mcz"
OF_SOURCES = ("skeleton", "arrays", "model")


@click.command(short_help="Convert a motion file to another format, in one step.")
@click.argument("file", metavar="IN", type=click.Path(readable=False))
@click.argument("output", metavar="OUT")
@click.option(
    "--to",
    "target",
    type=click.Choice(TARGETS),
    help="Set the format. Default: by the suffix of OUT.",
)
@click.option("--clip", "names", metavar="NAME", multiple=True, help="Choose the clip of an .mcz.")
@where_option
@frames_option("Frames A <= f < B, counted from 0.")
@click.option(
    "--joints", metavar="a,b", help="Write these joints alone, by name or index (to csv or npz)."
)
@skeleton_option("The ASF of an AMC, or none. Default: the one beside it, as in mcz encode.")
@rate_option(ITS_RATE_HELP)
@unit_option("Length unit of a file that says none.")
@up_option("Axis that points up, of a file that does not say.")
@arrays_option
@model_option
@key_error_option
@click.option("--with-skeleton", is_flag=True, help="Write the skeleton's own file (ASF), too.")
@decoded_option
@force_option
@threads_option
@json_option
def command(
    file: str,
    output: str,
    names: tuple[str, ...],
    where: str | None,
    max_decoded: int | None,
    force: bool,
    as_json: bool,
    **options: Any,
) -> Exit:
    """Write the motion of IN as OUT, whose suffix says the format: any two that mcz knows.

    It is mcz encode and mcz decode in one step. What OUT has no place for is named. A copy in IN's
    own format has the same bytes; with --frames it is a part.
    """
    facts = {name: options.pop(name) for name in OF_SOURCES}
    wanted = DecodeOptions(**options)
    given = Input(file, max_decoded=max_decoded, facts=facts)
    suffix = suffix_of(output)
    refuse(not suffix and wanted.target is None, f"{output}: it has no suffix; --to says a format")
    if suffix != MCZ or wanted.target is not None:
        refuse(
            not given.is_source and any(facts.values()),
            f"{' '.join(f'--{name}' for name in OF_SOURCES)} are of source files, {file} is none",
        )
        return decode(given, wanted, output, names=names, where=where, force=force, as_json=as_json)
    refuse(not given.is_source, f"{output}: mcz extract takes clips out of an .mcz")
    has_parts = bool(names or where or wanted.frames or wanted.joints)
    refuse(has_parts, f"{output}: an .mcz is made of a whole file; mcz extract takes parts")
    return _encode(file, output, facts | _facts(wanted), force=force, as_json=as_json)


def _facts(wanted: DecodeOptions) -> JsonObject:
    return {"rate": wanted.rate, "unit": wanted.unit, "up": wanted.up}


def _encode(file: str, output: str, facts: Params, *, force: bool, as_json: bool) -> Exit:
    """The same as ``mcz encode`` does by default."""
    from mcz.cli.encode import command as encode

    options: Settings = {"source": file, "output": output, "force": force}
    options |= {"as_json": as_json, "params": None}  # invoke calls no callbacks
    code: Exit = click.get_current_context().invoke(encode, **options, **facts)
    return code
