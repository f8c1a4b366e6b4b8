"""``mcz codecs``: which codecs there are, and the parameters of each."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import click

from mcz.cli.common import Exit, echo, print_json, table
from mcz.cli.options import json_option

if TYPE_CHECKING:
    from mcz.codecs.contract import Codec

WIDEST = 44  # characters of a line of the meaning


@click.command(short_help="List codecs and their parameters.")
@click.argument("names", metavar="[NAME]...", nargs=-1)
@json_option
def command(names: tuple[str, ...], as_json: bool) -> Exit:
    """List the codecs, or of each NAME its parameters: default, range and meaning.

    mcz encode --codec NAME --param KEY=VALUE sets one.
    """
    from mcz.codecs import CODECS, DEFAULT, codec_by_name
    from mcz.codecs.listing import codec_document

    codecs = [codec_by_name(name) for name in names] or list(CODECS.values())
    if as_json:
        print_json({"default": DEFAULT, "codecs": [codec_document(codec) for codec in codecs]})
        return Exit.FINE
    if names:
        for number, codec in enumerate(codecs):
            echo(*([""] if number else []), *_lines(codec))
    else:
        echo(*_overview(codecs, DEFAULT))
    return Exit.FINE


def _overview(codecs: list[Codec], default: str) -> Iterator[str]:
    rows = [["codec", "id", "keeps", "codes", "quality by"]]
    for codec in codecs:
        keeps = "every byte" if codec.lossless else "what matters"
        codes = "positions" if codec.positions else "channels"
        codes += ", live" if codec.live else ""
        name = f"{codec.name} (default)" if codec.name == default else codec.name
        rows.append([name, str(codec.id), keeps, codes, codec.dial.parameter if codec.dial else ""])
    yield from table(rows, "lrlll").split("\n")
    yield "mcz codecs NAME lists the parameters of one."


def _lines(codec: Codec) -> Iterator[str]:
    from mcz.codecs.listing import parameter_document, parameters_of

    kind = "lossless" if codec.lossless else "lossy"
    dial = f"; {codec.dial.parameter} trades quality for size" if codec.dial else ""
    yield f"{codec.name} (codec {codec.id}, {kind}){dial}"
    rows = [["parameter", "default", "range", "meaning"]]
    for facts in map(parameter_document, parameters_of(codec)):
        default = "none" if facts["default"] is None else text_of(facts["default"])
        first, *rest = _wrapped(facts["meaning"])
        rows.append([facts["name"], default, facts["range"], first])
        rows += [["", "", "", line] for line in rest]
    yield from (f"  {line}" for line in table(rows).split("\n"))


def text_of(value: object) -> str:
    """
    >>> text_of(False), text_of(0.5), text_of("64 KiB")
    ('false', '0.5', '64 KiB')
    """
    return str(value).lower() if isinstance(value, bool) else str(value)


def _wrapped(text: str) -> list[str]:
    from textwrap import wrap

    return wrap(text, WIDEST) or [""]
