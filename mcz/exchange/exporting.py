"""``export``: every clip of a file in another format, a file a clip."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from fractions import Fraction
from pathlib import Path, PurePosixPath

from mcz.errors import FormatError, MczError, OptionError
from mcz.exchange.bids import clip_files, data_set_files
from mcz.exchange.conversion import TARGETS, converted_files, left_out
from mcz.exchange.conversion.scenes import WRITERS, to_scene
from mcz.files.editing import Outcome, Report, failure_outcome
from mcz.files.editing.folders import Folder, PortableNames
from mcz.files.editing.unpacking import safe_path
from mcz.files.jobs import limit_jobs, share_clips
from mcz.files.reading.clip import Clip
from mcz.files.reading.clips import Where
from mcz.files.reading.file import File, open, suffixes_of
from mcz.files.reading.source_files import SourceOptions
from mcz.files.tables import EXPORTS, table_of
from mcz.model.motion import Motion
from mcz.model.types import JsonObject, Target
from mcz.sources.tables.motion_bids import MOTION_SUFFIX

Progress = Callable[[int, int, str], None]
BIDS = "bids"
FORMS = (*EXPORTS, *TARGETS, *WRITERS, BIDS)


def export(
    target: Target,
    directory: str | os.PathLike[str],
    to: str,
    *,
    clips: Sequence[str] | None = None,
    where: Where | None = None,
    rate: Fraction | float | None = None,
    unit: str | None = None,
    key_error_mm: float | None = None,
    force: bool = False,
    max_decoded: int | None = None,
    threads: int | None = None,
    jobs: int | None = None,
    progress: Progress | None = None,
) -> Report:
    """Write every clip of an MCZ file below ``directory`` as another format.

    ``to`` is "npz", "csv", "glb", "usda", "bids" or a format of ``mcz.convert``. A clip "day1/walk"
    becomes "day1/walk.npz"; an AMC comes with its ASF; "bids" makes a data set of Motion-BIDS.
    ``clips`` and ``where`` select clips, as in ``unpack``. ``rate`` and ``unit`` apply to clips
    that state none; ``key_error_mm`` is as in ``to_glb``. A clip that the format cannot hold, or
    whose file exists and not ``force``, is reported as failed and the others are written. Files
    appear when they are complete; no link below ``directory`` is followed. ``jobs`` processes work
    in parallel, by default one. Raises OptionError and as ``mcz.open``.
    """
    if to not in FORMS:
        raise OptionError(f"unknown format {to!r}; the formats are {', '.join(FORMS)}")
    folder, report, written = Folder(Path(directory)), Report(), set[str]()
    portable = PortableNames()

    def write(name: str, files: Callable[[], Iterable[Exported]]) -> None:
        """Write files, or report ``name`` as failed."""
        try:
            for own, data, notes in files():
                path = portable(str(safe_path(own)))
                if path in written:
                    raise FormatError(f"another clip is also written to {path}")
                folder.write(path, data, target, force=force)
                written.add(path)
                report.outcomes.append(Outcome(path, "written", len(data), notes=notes))
        except (MczError, OSError) as error:
            report.outcomes.append(failure_outcome(name, error))

    options: JsonObject = {"max_decoded": max_decoded, "threads": threads, "verify": True}
    with limit_jobs(jobs), open(target, **options) as file:
        chosen = file.chosen(clips, where)
        called = [clip.name for clip in chosen]
        with share_clips(_converted, file, called, (to, rate, unit, key_error_mm)) as converting:
            for done, (name, converted) in enumerate(zip(called, converting, strict=True)):
                write(name, converted)
                if progress is not None:
                    progress(done + 1, len(called), name)
        if to == BIDS and written:
            root = data_set_files(Path(directory).name, sorted(written))
            write("dataset_description.json", lambda: [(path, d, ()) for path, d in root.items()])
    return report


Exported = tuple[str, bytes, tuple[str, ...]]  # name of the file, its content, remarks


def _converted(
    shared: tuple[File, tuple[str, Fraction | float | None, str | None, float | None]], name: str
) -> list[Exported]:
    """The files that the clip ``name`` becomes."""
    file, (to, rate, unit, key_error) = shared
    clip = file.clips[name]
    motion = SourceOptions(rate=rate, unit=unit).completing(clip.motion())
    return list(_files(clip, to, motion, key_error))


def _files(clip: Clip, to: str, motion: Motion, key_error: float | None) -> Iterator[Exported]:
    """The files that a clip becomes: an ASF before the AMC that needs it."""
    if to in EXPORTS:
        yield _named(clip, to), EXPORTS[to](table_of(motion)), left_out(motion, to)
        return
    if to in WRITERS:
        scene = to_scene(motion, to, key_error_mm=key_error)
        yield _named(clip, to), scene.data, scene.notes
        return
    if to == BIDS:
        for path, data in clip_files(motion).items():
            yield path, data, left_out(motion, to) if path.endswith(MOTION_SUFFIX) else ()
        return
    files = converted_files(motion, to, None, True)
    for suffix in sorted(files, reverse=True):
        notes = left_out(motion, to) if suffix == to else ()
        yield _named(clip, suffix), files[suffix], notes


def _named(clip: Clip, to: str) -> str:
    """The clip's name with the suffix of the format ``to``, unless it has one."""
    suffixes = suffixes_of(to)
    own = PurePosixPath(clip.name).suffix.lower()
    return clip.name if own in suffixes else f"{clip.name}{suffixes[0]}"
