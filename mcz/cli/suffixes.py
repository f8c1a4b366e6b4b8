"""What the suffix of an output says: as what the clip is wanted where ``--to`` does not say it."""

from __future__ import annotations

import os
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING

from mcz.cli.common import Exit, Failure

if TYPE_CHECKING:
    from mcz.reading.clip import Clip

CONVERSIONS = ("bvh", "amc", "c3d", "trc", "sto", "mot")
SCENES = ("glb", "usda")  # animated nodes; mcz.conversion.scenes writes them
CSV = ("csv", "motive", "vicon")  # source formats whose files are called .csv
TARGETS = ("csv", "npz", *CONVERSIONS, *SCENES)
# Formats that decode does not write; a file of that name would hold something else.
OTHERS = {
    "mcz": "mcz extract takes clips out of an .mcz",
    "asf": "--with-skeleton writes the ASF beside it",
    **dict.fromkeys(("usd", "usdc", "usdz"), "--to usda writes USD as text"),
    "gltf": "--to glb writes the same as one file",
    **dict.fromkeys(("tsv", "fbx", "npy", "json"), ""),
}


def suffix_of(output: str | None) -> str:
    """The suffix of an output in lower case, without its dot; "" of a folder or standard output."""
    if output is None or output == "-" or is_folder(output):
        return ""
    return Path(output).suffix.lower().removeprefix(".")


def is_folder(output: str) -> bool:
    """Whether an output is, or is to be, a folder."""
    return output[-1:] in (os.sep, os.altsep) or Path(output).is_dir()


def target_of(clip: Clip, output: str | None, *, plain: bool) -> str | None:
    """As what ``output`` wants the clip, None for its source file.

    ``plain``: the source file itself will do where the suffix is its own. Raises Failure for a
    format that cannot be written.
    """
    suffix = suffix_of(output)
    source = clip.source.format if clip.source is not None else ""
    source = "csv" if source in CSV else source
    if suffix in TARGETS:
        return None if plain and suffix == source else suffix
    if suffix in OTHERS and not _is_own(suffix, clip):
        hint = OTHERS[suffix] or f"--to has {', '.join(TARGETS)}"
        raise Failure(f"{output}: a clip cannot be written as .{suffix}; {hint}", Exit.USAGE)
    return None


def _is_own(suffix: str, clip: Clip) -> bool:
    path = clip.source.path if clip.source is not None else ""
    return PurePosixPath(path).suffix.lower() == f".{suffix}"


def check_kept(output: str | None, name: str) -> None:
    """Raise Failure where the suffix of an output is that of another format than the file's."""
    suffix, own = suffix_of(output), PurePosixPath(name).suffix.lower().removeprefix(".")
    if suffix != own and (suffix in TARGETS or suffix in OTHERS):
        raise Failure(
            f"{output}: what is kept is {name}, which is not converted to .{suffix}", Exit.USAGE
        )
