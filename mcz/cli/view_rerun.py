"""``mcz view --rerun``: clips in the viewer of rerun, or in a file for it."""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mcz.cli.common import Exit, Failure, about, check_new, echo, plural, print_json
from mcz.cli.hints import OPTION_HINTS
from mcz.model.extras import import_extra
from mcz.model.types import JsonObject, Settings

if TYPE_CHECKING:
    from mcz.files.reading.clip import Clip
    from mcz.model.motion import Motion
    from mcz.show.viewing.file_registry import Shelf

SUFFIX = ".rrd"
FACTS = ("rate", "unit", "up")
MOST_BESIDE, MOST_VIEWS = 4, 64  # clips that are shown beside each other, and one at a time
SCREENS = ("DISPLAY", "WAYLAND_DISPLAY")


def is_rerun(rerun: bool, output: str | None) -> bool:
    """Return whether ``--rerun`` or the output suffix selects rerun; raises Failure."""
    is_file = output is not None and output.lower().endswith(SUFFIX)
    if rerun and output is not None and not is_file:
        raise Failure(f"with --rerun a file is called OUT{SUFFIX}", Exit.USAGE, path=output)
    return rerun or is_file


def show_in_rerun(shelf: Shelf, output: str | None, as_json: bool, options: Settings) -> Exit:
    """Log every clip that is wanted, to ``output`` or to a viewer that is started."""
    if output is None:
        recording = _recording()
        _check_screen()
        try:
            recording.spawn()
        except RuntimeError as error:  # its viewer is not on the path
            raise Failure(f"rerun: {str(error).strip().splitlines()[0]}") from error
        rows, failed = _log(shelf, recording, options)
        recording.flush()
        if as_json:
            print_json({"output": None, "clips": rows})
        else:
            echo(f"rerun: {plural(len(rows), 'clip')}")
    else:
        rows, failed = _write(shelf, output, options)
        size = Path(output).stat().st_size
        if as_json:
            print_json({"output": output, "size": size, "clips": rows})
        else:
            echo(f"{output}: {plural(len(rows), 'clip')}, {size:,} bytes")
    return Exit.BAD_INPUT if failed else Exit.FINE


def _recording() -> Any:
    import uuid

    from mcz.show.rerun import APPLICATION

    rerun = import_extra("rerun", "rerun")
    return rerun.RecordingStream(APPLICATION, recording_id=str(uuid.uuid4()))


def _check_screen() -> None:
    if sys.platform.startswith("linux") and not any(map(os.environ.get, SCREENS)):
        raise Failure(
            f"there is no screen for the viewer of rerun; -o OUT{SUFFIX} writes a file for one "
            "elsewhere"
        )


def _write(shelf: Shelf, output: str, options: Settings) -> tuple[list[JsonObject], int]:
    """Log to a file, which appears when it is whole."""
    from mcz.files.writing.atomic import replacing

    check_new(Path(output), options["force"])
    inputs = [file.source for _, file in shelf.given()]
    with (
        about(output),
        tempfile.TemporaryDirectory() as folder,
        replacing(output, force=options["force"], inputs=inputs) as stream,
    ):
        path, recording = Path(folder, "take.rrd"), _recording()
        recording.save(path)
        rows, failed = _log(shelf, recording, options)
        recording.disconnect()
        if not rows:
            raise Failure("no clip could be logged", path=output)
        with path.open("rb") as written:
            shutil.copyfileobj(written, stream)
    return rows, failed


def _log(shelf: Shelf, recording: Any, options: Settings) -> tuple[list[JsonObject], int]:
    """Log the clips; return their rows and the number of failures."""
    from mcz.errors import MczError
    from mcz.show.rerun import to_rerun, view_of

    rows: list[JsonObject] = []
    views: list[Any] = []
    failed = unknown = 0
    several = len(shelf.given()) > 1
    for file, clip in _clips(shelf, options):
        entity = f"{file}/{clip.name}" if several else clip.name
        try:
            moving = _told(clip, options)
            to_rerun(moving, recording, entity=entity)
            unknown += not moving.skeleton.up_axis
            if len(views) < MOST_VIEWS:
                views.append(view_of(moving, entity))
        except MczError as error:
            shelf.say(f"{file}: {clip.name}: {error.describe(OPTION_HINTS)}")
            failed += 1
            continue
        rows.append({"file": file, "name": clip.name, "entity": entity, "n_frames": clip.n_frames})
    if unknown:
        shelf.say(f"{plural(unknown, 'clip')}: which axis points up is unknown; --up says it")
    if views:
        blueprint = import_extra("rerun.blueprint", "rerun")
        arranged = blueprint.Grid if len(views) <= MOST_BESIDE else blueprint.Tabs
        recording.send_blueprint(blueprint.Blueprint(arranged(*views), collapse_panels=True))
    return rows, failed


def _clips(shelf: Shelf, options: Settings) -> Iterator[tuple[str, Clip]]:
    from mcz.files.reading.file import open

    for _, given in shelf.given():
        with (
            about(given.source),
            open(
                given.target(), salvage=options["salvage"], max_decoded=options["max_decoded"]
            ) as file,
        ):
            for clip in file.chosen(options["clips"] or None, options["where"]):
                yield given.name, clip


def _told(clip: Clip, options: Settings) -> Clip | Motion:
    """The clip; decoded as a whole where options say what its file does not."""
    skeleton = clip.skeleton
    unknown = (clip.frame_rate is None, skeleton.unit_cm is None, not skeleton.up_axis)
    said = [options[fact] for fact in FACTS]
    if not any(there and fact is not None for there, fact in zip(unknown, said, strict=True)):
        return clip
    from mcz.files.reading.source_files import SourceOptions

    return SourceOptions(**{fact: options[fact] for fact in FACTS}).completing(clip.motion())
