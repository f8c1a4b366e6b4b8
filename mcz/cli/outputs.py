"""Outputs: formats by suffix, and writing of several files, all or none."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from pathlib import Path, PurePath, PurePosixPath
from typing import TYPE_CHECKING, NamedTuple

from mcz.cli.common import Exit, Failure, check_new, errors_about, write_output
from mcz.cli.terminal import binary_output, echo, print_json, text_output
from mcz.model.types import JsonObject

if TYPE_CHECKING:
    from mcz.files.reading.clip import Clip


CONVERSIONS = ("bvh", "amc", "c3d", "trc", "sto", "mot")
SCENES = ("glb", "usda")  # animated nodes; mcz.exchange.conversion.scenes writes them
NUMBERS = ("csv", "npz")  # tables; mcz.files.tables writes them
TARGETS = (*NUMBERS, *CONVERSIONS, *SCENES)
# Suffixes that decode does not write; a file of that name would hold something else.
OTHERS = {
    ".mcz": "use mcz extract for clips of an .mcz",
    ".asf": "--with-skeleton writes the ASF beside it",
    **dict.fromkeys((".usd", ".usdc", ".usdz"), "--to usda writes USD as text"),
    ".gltf": "--to glb writes the same as one file",
    **dict.fromkeys((".tsv", ".fbx", ".npy", ".json"), f"--to has {', '.join(TARGETS)}"),
}


def suffix_of(output: str | None) -> str:
    """The suffix of an output in lower case; "" of a folder or standard output."""
    if output is None or output == "-" or is_folder(output):
        return ""
    return Path(output).suffix.lower()


def is_folder(output: str) -> bool:
    """Return whether an output is a folder or ends in a path separator."""
    return output[-1:] in (os.sep, os.altsep) or Path(output).is_dir()


def resolve_output(output: str, source: str, suffix: str = "") -> str:
    """``output``, or a file in it if it is a folder, with the name of ``source``.

    ``suffix`` replaces the suffix of ``source``. A folder with a slash at the end is created.
    Raises Failure for standard input, which has no name.
    """
    if output == "-" or not is_folder(output):
        return output
    if source == "-":
        text = f"{output} is a folder; standard input has no name, so name a file in it"
        raise Failure(text, Exit.USAGE)
    with errors_about(output):
        Path(output).mkdir(parents=True, exist_ok=True)
    name = PurePath(source).name
    return str(Path(output, PurePath(name).with_suffix(suffix) if suffix else name))


def target_of(suffix: str) -> str | None:
    """The target whose files have a suffix, None if there is none."""
    from mcz.files.reading.file import suffixes_of

    return next((name for name in TARGETS if suffix in suffixes_of(name)), None)


def target_of_clip(clip: Clip, output: str | None, *, plain: bool) -> str | None:
    """The target for ``output``, None for the source file.

    ``plain``: the source file itself is acceptable if the suffix is one of its own. Raises Failure
    for a suffix without a writable format.
    """
    suffix = suffix_of(output)
    own = () if clip.source is None else clip.source.suffixes
    target = target_of(suffix)
    if not suffix or (suffix in own and (plain or target is None)):
        return None
    if target is None:
        raise _unknown(str(output), suffix, "a clip cannot be written as", own)
    return target


def check_suffix(output: str | None, name: str, *, is_skeleton: bool) -> None:
    """Raise Failure unless an output has the suffix of the file ``name`` itself.

    A skeleton's file is an ASF under any name.
    """
    suffix, own = suffix_of(output), PurePosixPath(name).suffix.lower()
    if suffix in ("", own) or (is_skeleton and suffix == ".asf"):
        return
    if target_of(suffix) is not None or suffix in OTHERS:
        reason = f"the stored file is {name}, which cannot be converted to {suffix}"
        raise Failure(reason, Exit.USAGE, path=output)
    raise _unknown(str(output), suffix, f"the stored file is {name}, not", (own,))


def _unknown(output: str, suffix: str, text: str, own: tuple[str, ...]) -> Failure:
    """The error for an unknown suffix, which suggests the nearest known one."""
    from mcz.model.text_format import nearest_names

    known = list(dict.fromkeys((*filter(None, own), *(f".{name}" for name in TARGETS))))
    near = nearest_names(suffix, known).replace("'", "")
    hint = OTHERS.get(suffix) or (f"did you mean {near}?" if near else f"known: {' '.join(known)}")
    return Failure(f"{text} {suffix}; {hint}", Exit.USAGE, path=output)


class Output(NamedTuple):
    """A file to write; ``result`` is a word for how it was made: "restored", "converted", ..."""

    kind: str
    name: str
    data: bytes
    result: str


def check_count(output: str | None, count: int) -> None:
    """Raise Failure if an output names one file, and several clips are requested."""
    if count > 1 and output is not None and not is_folder(output):
        raise Failure(f"-o {output} is one file, for {count} clips; name a folder", Exit.USAGE)


def write_outputs(
    files: Sequence[str],
    output: str | None,
    outputs: Sequence[Output],
    force: bool,
    as_json: bool,
    facts: JsonObject,
) -> None:
    """Write the outputs of the ``files`` files, the first as the main one, and print a summary.

    Obstacles of any output are found before the first is written.
    """
    from mcz.files.writing.atomic import refuse_inputs

    file = files[0]
    inputs = [sys.stdin if path == "-" else path for path in files]
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
        with errors_about(output):
            Path(output).mkdir(parents=True, exist_ok=True)
    rows = []
    for path, output_file in zip(paths, outputs, strict=True):
        write_output(path, output_file.data, force)
        row = {"path": str(path), "kind": output_file.kind, "bytes": len(output_file.data)}
        rows.append(row | {"result": output_file.result})
    if as_json:
        print_json({"outputs": rows, **facts})
        return
    for row in rows:
        echo(f"{row['path']}  {row['bytes']:,} bytes, {row['result']}")


def _paths(file: str, output: str | None, outputs: Sequence[Output]) -> list[Path]:
    """The path of each output; a name given by the user is the first output's."""
    is_named = output is not None and not is_folder(output)
    folder = Path() if file == "-" else Path(file).parent
    if output is not None:
        folder = Path(output).parent if is_named else Path(output)
    paths = [folder / plain_name(each.name) for each in outputs]
    return [Path(str(output)), *paths[1:]] if is_named else paths


def plain_name(name: str) -> str:
    r"""Make a name from a file valid on every system, and below any folder.

    >>> plain_name("walk.bvh"), plain_name(".."), plain_name("a\0b"), plain_name("con.bvh")
    ('walk.bvh', '__', 'a_b', 'con_.bvh')
    """
    from mcz.files.editing.folders import PortableNames

    return PortableNames()(name.replace("/", "_")) or "_"
