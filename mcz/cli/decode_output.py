"""Write the outputs of ``mcz decode``, all or none."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from mcz.cli.common import (
    Exit,
    Failure,
    about,
    binary_output,
    check_new,
    echo,
    print_json,
    text_output,
    write_output,
)
from mcz.cli.suffixes import is_folder
from mcz.model.types import JsonObject


class Output(NamedTuple):
    """A file to write; ``result`` is a word for how it was made: "restored", "converted", ..."""

    kind: str
    name: str
    data: bytes
    result: str


def check_count(output: str | None, count: int) -> None:
    """Raise Failure where an output names one file, and several clips are wanted."""
    if count > 1 and output is not None and not is_folder(output):
        raise Failure(f"-o {output} is one file, for {count} clips; name a folder", Exit.USAGE)


def deliver(
    given: Sequence[str],
    output: str | None,
    outputs: Sequence[Output],
    force: bool,
    as_json: bool,
    facts: JsonObject,
) -> None:
    """Write the outputs of the files that were ``given``, the first above all, and say so.

    What stands in the way of one of them is found before the first is written.
    """
    from mcz.files.writing.atomic import refuse_inputs

    file = given[0]
    inputs = [sys.stdin if path == "-" else path for path in given]
    if output == "-":
        refuse_inputs(sys.stdout, inputs)
        data = outputs[0].data
        (binary_output if b"\0" in data else text_output)().write(data)
        return
    paths = _paths(file, output, outputs)
    for path in paths:
        refuse_inputs(path, inputs)
        if paths.count(path) > 1:
            raise Failure(f"{paths.count(path)} outputs have this name", Exit.USAGE, path=path)
    for path in paths:
        check_new(path, force)
    if output is not None and is_folder(output):
        with about(output):
            Path(output).mkdir(parents=True, exist_ok=True)
    rows = []
    for path, made in zip(paths, outputs, strict=True):
        write_output(path, made.data, force)
        row = {"path": str(path), "kind": made.kind, "bytes": len(made.data)}
        rows.append(row | {"result": made.result})
    if as_json:
        print_json({"outputs": rows, **facts})
        return
    for row in rows:
        echo(f"{row['path']}  {row['bytes']:,} bytes, {row['result']}")


def _paths(file: str, output: str | None, outputs: Sequence[Output]) -> list[Path]:
    """The path of each output; an output name given by the user is that of the first."""
    named = output is not None and not is_folder(output)
    folder = Path() if file == "-" else Path(file).parent
    if output is not None:
        folder = Path(output).parent if named else Path(output)
    paths = [folder / plain_name(made.name) for made in outputs]
    return [Path(str(output)), *paths[1:]] if named else paths


def plain_name(name: str) -> str:
    r"""A name from a file as one that every system can hold, below any folder.

    >>> plain_name("walk.bvh"), plain_name(".."), plain_name("a\0b"), plain_name("con.bvh")
    ('walk.bvh', '__', 'a_b', 'con_.bvh')
    """
    from mcz.files.editing.safe_names import PortableNames

    return PortableNames()(name.replace("/", "_")) or "_"
