"""``python -m mcz.cli.conformance``: this package as a decoder under test.

conformance/README.md is the contract: an .mcz on standard input; on standard output one line of
JSON that lists the arrays or the sources, then their bytes back to back. Exit 0 fine, 1 refused,
3 unsupported. The command ``mcz`` has other exit codes; do not mix them up.
"""

from __future__ import annotations

import argparse
import json
import sys
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mcz.errors import FormatError, MczError, UnsupportedError

if TYPE_CHECKING:
    from mcz.clip import Clip
    from mcz.file import File

OPTIONS = ("--source", "--clip", "--frames", "--joints", "--resolution")
Part = tuple[dict[str, Any], bytes]  # a row of the listing, and its bytes


def main(arguments: list[str] | None = None) -> int:
    """Answer one request; return the exit code."""
    given = _parser().parse_args(arguments)
    if given.capabilities:
        print(json.dumps(OPTIONS))  # noqa: T201
        return 0
    try:
        listing, parts = _answer(sys.stdin.buffer.read(), given)
    except UnsupportedError as error:
        return _refuse(3, error)
    except MczError as error:
        return _refuse(1, error)
    line = json.dumps({listing: [row for row, _ in parts]}, ensure_ascii=False)
    sys.stdout.buffer.write(line.encode("utf-8") + b"\n")
    for _, data in parts:
        sys.stdout.buffer.write(data)
    sys.stdout.buffer.flush()
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="mcz.cli.conformance", description=__doc__)
    parser.add_argument("--capabilities", action="store_true")
    parser.add_argument("--source", action="store_true")
    parser.add_argument("--clip")
    parser.add_argument("--frames")
    parser.add_argument("--joints")
    parser.add_argument("--resolution", type=int, default=0)
    return parser


def _refuse(code: int, error: Exception) -> int:
    print(f"{type(error).__name__}: {' '.join(str(error).split())}", file=sys.stderr)  # noqa: T201
    return code


def _answer(data: bytes, given: argparse.Namespace) -> tuple[str, list[Part]]:
    import mcz
    from mcz.report import validate

    with mcz.open(data) as file:
        problems = validate(file)
        clips = [file.only_clip(given.clip)] if given.clip is not None else file.clips.values()
        # An unknown codec is no fault of the file, so it is told apart before the faults are.
        for clip in clips:
            for signal in clip.signals:
                _ = signal.codec
        if problems:
            raise FormatError(str(problems[0]))
        if given.source:
            return "sources", _sources(file, given.clip)
        return "arrays", [part for clip in clips for part in _arrays(clip, given)]


def _arrays(clip: Clip, given: argparse.Namespace) -> list[Part]:
    """The canonical arrays of a clip: each signal's values, then its mask where it has one."""
    frames = None
    if given.frames:
        start, _, stop = given.frames.partition(":")
        frames = int(start), int(stop)
    joints = [int(joint) for joint in given.joints.split(",")] if given.joints else None
    parts = []
    for signal in clip.signals[: 1 if joints else None]:
        values, mask = clip.read_masked(frames, joints, given.resolution, signal=signal.index)
        parts.append(_part(clip.name, signal.name, values))
        if mask is not None:
            parts.append(_part(clip.name, f"{signal.name}.mask", mask))
    return parts


def _part(clip: str, signal: str, values: NDArray[Any]) -> Part:
    if values.dtype == np.bool_:
        dtype, data = "u1", values.astype("u1").tobytes()
    elif values.dtype == np.int64:
        dtype, data = "<i8", values.astype("<i8").tobytes()
    else:
        dtype, data = "<f8", np.where(np.isnan(values), np.nan, values).astype("<f8").tobytes()
    row = {
        "clip": clip,
        "signal": signal,
        "dtype": dtype,
        "shape": list(values.shape),
        "bytes": len(data),
    }
    return row, data


def _sources(file: File, clip: str | None) -> list[Part]:
    """The restored files: of clips, of skeletons, then attachments."""
    found: list[tuple[str, bytes]] = []
    for name, held in file.clips.items():
        if held.source is not None and clip in (None, name):
            found.append((held.source.path, held.source_bytes()))
    if clip is None:
        for name, (_, target) in file.aliases.items():
            if target in dict(file.skeletons):
                found.append((name, file.skeleton_bytes(target)))
        found += [(name, held.read()) for name, held in file.attachments.items()]
    return [({"path": path, "bytes": len(data)}, data) for path, data in found]


if __name__ == "__main__":
    sys.exit(main())
