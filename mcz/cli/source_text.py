"""Text output of ``mcz info`` about a source file."""

from __future__ import annotations

from collections.abc import Iterator

from mcz.cli.common import plural
from mcz.cli.previews import preview_lines
from mcz.cli.recording_lines import array_lines, recording_lines
from mcz.cli.skeleton_lines import rate_text, skeleton_lines, time_lines
from mcz.model.types import JsonObject


def source_lines(file: str, document: JsonObject) -> Iterator[str]:
    """The text of a source file's document, without line ends; the rest as of an MCZ file."""
    kind = document["format"].upper()
    yield f"{file}: {kind}, {document['file_bytes']:,} bytes; not yet an .mcz (mcz encode)"
    for skeleton in document["skeletons"]:
        yield from skeleton_lines(skeleton)
    for clip in document["clips"]:
        yield ""
        yield (
            f"clip {clip['name']}: {plural(clip['n_frames'], 'frame')} {rate_text(clip)}, "
            f"{plural(clip['n_channels'], 'channel')}, {plural(clip['n_joints'], 'joint')}"
        )
        yield from time_lines(clip["times"])
        if clip["skeleton_file"]:
            yield f"  skeleton   {clip['skeleton_file']}"
        for signal in clip["signals"][1:]:
            rows = plural(signal["samples_per_frame"], "row")
            held = f"{plural(signal['n_channels'], 'channel')}, {rows} a frame"
            yield f"  signal     {signal['name']}: {held}"
        if clip["n_invalid"]:
            yield f"  invalid    {plural(clip['n_invalid'], 'value')}"
        yield f"  sha256     {clip['source_sha256']}"
        share = 100 * clip["exceptions_share"]
        yield f"  exceptions {clip['n_exceptions']:,} numbers off their grid ({share:.3g} %)"
        yield from recording_lines(clip["recording"])
        yield from array_lines(clip["arrays"])
        for key, value in clip["metadata"].items():
            yield f"  {key}  {value[:80]}"
        if "preview" in clip:
            yield from preview_lines(clip["preview"])
