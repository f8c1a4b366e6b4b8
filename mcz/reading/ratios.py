"""Compression ratios: docs/measures.md, "Sizes and ratios", is normative."""

from __future__ import annotations

from mcz.container import payloads
from mcz.errors import FormatError, UnsupportedError
from mcz.reading.clip import Clip
from mcz.reading.file import File
from mcz.reading.sizes import Sizes, clip_sizes


def clip_ratios(file: File, clip: Clip) -> dict[str, float | None]:
    """``cr_source cr_float32 cr_40B cr_file`` of one clip."""
    return ratios_of(file, clip, clip_sizes(file.container, clip))


def ratios_of(file: File, clip: Clip, sizes: Sizes) -> dict[str, float | None]:
    """The compression ratios of SPEC.md's registry; None where the numerator is unknown."""
    coded = sizes.payload + sizes.overhead + sizes.models
    try:
        lossless = all(signal.codec.lossless for signal in clip.signals)
    except UnsupportedError:
        lossless = False
    restored = coded + sizes.source + sizes.hashes if lossless else coded
    source = clip.source.size if clip.source else 0
    rows = sum(
        clip.n_frames * s.layout.samples_per_frame * s.layout.n_channels for s in clip.signals
    )
    return {
        "cr_source": source / restored if source else None,
        "cr_float32": 4 * rows / coded if rows else None,
        "cr_40B": 40 * clip.n_frames * clip.skeleton.n_joints / coded if rows else None,
        "cr_file": file_ratio(file) if source and len(file.clips) == 1 else None,
    }


def _stored_bytes(file: File) -> int:
    """The bytes of all files that ``file`` gives back: sources, skeletons and attachments."""
    own = [clip.source.size for clip in file.clips.values() if clip.source is not None]
    own += [attachment.size for attachment in file.attachments.values()]
    return sum(own) + sum(_alias_bytes(file, name) for name in file.aliases)


def _alias_bytes(file: File, name: str) -> int:
    of, target = file.aliases[name]
    if of == payloads.OF_SKELETON:
        source = file.skeleton(target, with_source=True).source
        return source.size if source is not None else 0
    called = target.decode("utf-8", "replace")
    if of == payloads.OF_ATTACHMENT:
        return file.attachments[called].size
    clip_source = file.clips[called].source
    return clip_source.size if clip_source is not None else 0


def file_ratio(file: File) -> float | None:
    """Bytes of the stored files for a byte of the file, None where nothing says them."""
    try:
        return _stored_bytes(file) / file.size or None
    except (FormatError, KeyError):  # salvaged: what they name is lost
        return None
