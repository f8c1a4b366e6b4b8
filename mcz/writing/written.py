"""What a file just written holds, told by its writer, so that nobody has to open it again."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from mcz.brief import brief
from mcz.container.chunks import ChunkType
from mcz.container.directory import ClipRow, Directory


@dataclass(frozen=True, slots=True)
class WrittenClip:
    """Of a clip its name, the shape of its motion, and of a lossy one its quality record."""

    name: str
    n_frames: int
    n_channels: int
    quality: Mapping[str, str] | None = None

    __repr__ = brief


@dataclass(frozen=True, slots=True)
class Written:
    """What ``write`` and ``encode`` have written.

    ``decoded_bytes``: what ``max_decoded`` must be at least to read every signal. ``notes``: what
    is odd about the source file. ``source_bytes``: what the file gives back, of ``encode`` the
    source and the ASF that it was read with; 0 where there is no source. ``inputs``: of ``encode``
    these files.
    """

    size: int
    clips: tuple[WrittenClip, ...]
    n_skeletons: int
    n_attachments: int
    decoded_bytes: int
    notes: tuple[str, ...] = ()
    source_bytes: int = 0
    inputs: tuple[str, ...] = ()

    __repr__ = brief


def written(
    directory: Directory,
    size: int,
    quality: Mapping[str, str] | None = None,
    notes: tuple[str, ...] = (),
    source_bytes: int = 0,
) -> Written:
    """What a file of one clip or none holds, with its size and the quality record of that clip."""
    return Written(
        size=size,
        clips=tuple(
            WrittenClip(row.name, row.n_frames, row.signals[0].n_channels, quality)
            for row in directory.clips.values()
        ),
        n_skeletons=sum(kind == ChunkType.SKEL for kind, _ in directory.shared),
        n_attachments=len(directory.attachments),
        decoded_bytes=max(map(_decoded_bytes, directory.clips.values()), default=0),
        notes=notes,
        source_bytes=source_bytes,
    )


def _decoded_bytes(row: ClipRow) -> int:
    """Bytes of the largest signal of a clip."""
    return max(
        8 * row.n_frames * signal.samples_per_frame * max(1, signal.n_channels)
        for signal in row.signals
    )
