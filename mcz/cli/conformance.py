"""``python -m mcz.cli.conformance``: this package as a decoder under test.

conformance/README.md is the contract: an .mcz on standard input; on standard output one line of
JSON that lists the arrays or the sources, then their bytes back to back. Exit 0 fine, 1 refused,
3 unsupported. The command ``mcz`` has other exit codes; do not mix them up. With ``--serve`` one
process answers many requests.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from typing import TYPE_CHECKING, BinaryIO

import numpy as np
from numpy.typing import NDArray

from mcz.errors import LimitError, MczError, OptionError, UnsupportedError
from mcz.model.types import JsonObject, Values

if TYPE_CHECKING:
    from mcz.files.reading.clip import Clip
    from mcz.files.reading.file import File
    from mcz.files.reading.signal_info import SignalInfo

OPTIONS = ("--clip", "--frames", "--joints", "--resolution", "--post-filter", "--serve")
MAX_LINE = 2**20
Part = tuple[JsonObject, bytes]  # a row of the listing, and its bytes


def main(arguments: list[str] | None = None) -> int:
    """Answer one request; return the exit code."""
    words = sys.argv[1:] if arguments is None else arguments
    namespace = _parser().parse_args(words)
    if namespace.capabilities:
        print(json.dumps({"options": OPTIONS}))  # noqa: T201
        return 0
    if namespace.serve:
        return serve(sys.stdin.buffer, sys.stdout.buffer)
    code, output = answer(sys.stdin.buffer.read(), words)
    sys.stdout.buffer.write(output)
    sys.stdout.buffer.flush()
    return code


def answer(data: bytes, arguments: Sequence[str]) -> tuple[int, bytes]:
    """Exit code and output of one request about the file ``data``."""
    try:
        return 0, b"".join(respond(data, _parser().parse_args(list(arguments))))
    except UnsupportedError as error:
        return _refuse(3, error), b""
    except MczError as error:
        return _refuse(1, error), b""


def serve(requests: BinaryIO, answers: BinaryIO) -> int:
    """Answer requests, each a line of JSON and a file, until they end."""
    while line := requests.readline():
        request = json.loads(line)
        data = requests.read(request["bytes"])
        code, output = answer(data, request["arguments"])
        answers.write(json.dumps({"exit": code, "bytes": len(output)}).encode() + b"\n" + output)
        answers.flush()
    return 0


@cache
def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="mcz.cli.conformance", description=__doc__)
    parser.add_argument("--capabilities", action="store_true")
    parser.add_argument("--serve", action="store_true")
    parser.add_argument("--source", action="store_true")
    parser.add_argument("--clip")
    parser.add_argument("--frames", type=_range)
    parser.add_argument("--joints", type=_integers)
    parser.add_argument("--resolution", type=int, default=0)
    parser.add_argument("--post-filter", action="store_true")
    return parser


def _range(text: str) -> tuple[int, int]:
    start, stop = map(int, text.split(":"))
    return start, stop


def _integers(text: str) -> list[int]:
    return [int(word) for word in text.split(",") if word]


def _refuse(code: int, error: Exception) -> int:
    print(f"{type(error).__name__}: {' '.join(str(error).split())}", file=sys.stderr)  # noqa: T201
    return code


def respond(data: bytes, namespace: argparse.Namespace) -> Iterator[bytes]:
    """The answer to a request about the file ``data``; raises MczError for any fault."""
    import mcz
    from mcz.container.scan import scan
    from mcz.container.source import open_source

    # HEAD-01, STRICT-03
    scan(open_source(data), whole=True)  # INDX may be useless if a part is unsupported
    with mcz.open(data, verify=True) as file:
        listing = "sources" if namespace.source else "arrays"
        parts = list(_sources(file) if namespace.source else _arrays(file, namespace))
    line = json.dumps({listing: [row for row, _ in parts]}, ensure_ascii=False).encode("utf-8")
    if len(line) >= MAX_LINE:
        raise LimitError(f"a listing of {len(line)} bytes, the contract allows {MAX_LINE}")
    yield line + b"\n"
    for _, content in parts:
        yield content


def _arrays(file: File, namespace: argparse.Namespace) -> Iterator[Part]:
    from mcz.files.reading.signal_info import read_segments

    for attachment in file.attachments.values():
        attachment.read()
    clips: Iterable[Clip] = file.clips.values()
    if namespace.clip is not None:  # by its name, and no other way
        if namespace.clip not in file.clips.rows:
            raise OptionError(f"no clip {namespace.clip!r}")
        clips = [file.only_clip(namespace.clip)]
    lacking: UnsupportedError | None = None
    for clip in clips:
        _ = clip.frame_numbers
        for signal in clip.signals:
            try:
                yield from _signal_arrays(clip, signal, namespace)
            except UnsupportedError as error:
                lacking = lacking or error  # STRICT-05
                read_segments(clip.container, signal)  # STRICT-05
    if lacking is not None:  # with no other fault, which would count for more
        raise lacking


def _signal_arrays(clip: Clip, signal: SignalInfo, namespace: argparse.Namespace) -> Iterator[Part]:
    """The canonical array of a signal, then its mask if any value is invalid."""
    if namespace.joints is not None and signal.channels is not None:
        return
    resolution = signal.coarser(namespace.resolution) if signal.index else namespace.resolution
    values, mask = _values(clip, namespace, resolution, signal.index)
    yield _part(clip.name, signal.name, "values", values)
    if mask is not None and not mask.all():
        yield _part(clip.name, signal.name, "mask", mask)


def _values(
    clip: Clip, namespace: argparse.Namespace, resolution: int, signal: int
) -> tuple[Values, NDArray[np.bool_] | None]:
    if namespace.post_filter and not signal:  # FILT-01
        from mcz.files.reading.post_filtering import FilteredClip

        clip = FilteredClip(clip)
    return clip.read_masked(namespace.frames, namespace.joints, resolution, signal=signal)


def _part(clip: str, signal: str, array: str, values: Values | NDArray[np.bool_]) -> Part:
    if values.dtype == np.bool_:
        dtype, data = "u1", values.astype("u1").tobytes()
    elif values.dtype == np.int64:
        dtype, data = "<i8", values.astype("<i8").tobytes()
    else:
        dtype, data = "<f8", np.where(np.isnan(values), np.nan, values).astype("<f8").tobytes()
    row = {
        "clip": clip,
        "signal": signal,
        "array": array,
        "dtype": dtype,
        "shape": list(values.shape),
        "bytes": len(data),
    }
    return row, data


def _sources(file: File) -> Iterator[Part]:
    """Every stored file by its name: sources of clips, attachments and aliases."""
    from mcz.files.editing.unpacking import named_files

    lacking: UnsupportedError | None = None
    for path, restore in named_files(file):
        try:
            data = restore()
        except UnsupportedError as error:
            lacking = lacking or error  # STRICT-05
            continue
        yield {"path": path, "bytes": len(data)}, data
    if lacking is not None:
        raise lacking


if __name__ == "__main__":
    sys.exit(main())
