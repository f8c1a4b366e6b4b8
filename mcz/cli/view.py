"""``mcz view``: motions in the browser, or in one page that can be sent around."""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mcz.cli import shared_options
from mcz.cli.common import OPTION_HINTS, Exit, Failure, check_new, errors_about
from mcz.cli.outputs import resolve_output
from mcz.cli.shared_options import EFFORTS, to_bytes
from mcz.cli.terminal import echo, plural, print_json, say, say_json
from mcz.model.extras import import_extra
from mcz.model.types import JsonObject, Settings

if TYPE_CHECKING:
    from mcz.files.reading.clip import Clip
    from mcz.model.motion import Motion
    from mcz.show.viewing.file_registry import FileRegistry
    from mcz.show.viewing.page import PageWritten


FACT_OPTIONS = ("skeleton", "rate", "unit", "up", "arrays", "model")  # facts that a file may lack
OF_PAGE = ("clips", "where", "codec", "effort", "params", "max_decoded", "most", "force")
PAGES = (".html", ".htm")
OF_SERVER = ("no_browser", "keep", "host", "port")
LOOPBACK = "127.0.0.1"


@click.command(short_help="Show motions in the browser, or write a page to mail.")
@click.argument(
    "files", metavar="FILE...", nargs=-1, required=True, type=click.Path(readable=False)
)
@click.option(
    "-o",
    "--output",
    metavar="OUT.html",
    help="Write one page that holds the files and the player; OUT.rrd: a file for rerun.",
)
@click.option("--rerun", is_flag=True, help="Start the rerun viewer and show the motion in it.")
@click.option("--no-browser", is_flag=True, help="Print the address, and open nothing.")
@click.option("--keep", is_flag=True, help="Run until Ctrl-C, even after the last page is closed.")
@click.option(
    "--host",
    metavar="NAME",
    default=LOOPBACK,
    help="Listen on this name of the local machine: 127.0.0.1, localhost or ::1.",
)
@click.option(
    "--port",
    metavar="N",
    type=click.IntRange(0, 65535),
    default=0,
    help="Listen on this port. Default: any free one.",
)
@shared_options.skeleton(f"{shared_options.SKELETON_HELP} Default: found as in mcz encode.")
@shared_options.rate()
@shared_options.unit("a file that states none")
@shared_options.up("Set the up axis of a file that states none.")
@shared_options.arrays
@shared_options.model
@shared_options.salvage
@shared_options.clips
@shared_options.where
@click.option(
    "--codec",
    metavar="NAME",
    help="Encode the clips with this codec (with -o). Default: as they are.",
)
@click.option("--effort", type=click.Choice(EFFORTS), help="Choose the lossless codec (with -o).")
@shared_options.params
@click.option(
    "--max-size",
    "most",
    metavar="BYTES",
    callback=to_bytes,
    help="Limit the size of the page: 80M or 2G (with -o). Default: 50M.",
)
@shared_options.max_decoded
@shared_options.force
@shared_options.threads
@shared_options.json
def view_command(files: tuple[str, ...], output: str | None, as_json: bool, **options: Any) -> Exit:
    """Show motions in the browser: files, folders, or URLs of an .mcz.

    FILE is an .mcz, a source file of any format, or a folder of them. A file without points appears
    as curves.

    A local server serves the page and the files to this machine only, at an unguessable address. It
    stops a few seconds after the last page is closed, or at Ctrl-C.

    With -o, write one page that needs neither a server nor a network. --clip and --where select
    clips of an archive; --codec re-encodes them. Several files are compared with the first, the
    original.

    With --rerun, or -o OUT.rrd, log every clip for rerun: points and bones, and other signals as
    time series.
    """
    if output is not None:
        output = resolve_output(output, files[0], ".rrd" if options["rerun"] else ".html")
    in_rerun = is_rerun(options.pop("rerun"), output)
    _check_use(output, options, in_rerun)
    from mcz.show.viewing.file_registry import FileRegistry, add_path

    def print_note(line: str) -> None:
        if as_json:
            say_json({"note": line})
        else:
            say(line)

    facts = {key: options[key] for key in FACT_OPTIONS}
    registry = FileRegistry(facts, print_note, salvage=options["salvage"], hints=OPTION_HINTS)
    try:
        for path in files:
            with errors_about(path):
                add_path(registry, path)
        if in_rerun:
            return show_in_rerun(registry, output, as_json, options)
        if output is not None:
            return _write_page(registry, output, as_json, {key: options[key] for key in OF_PAGE})
        return _serve(registry, as_json, **{key: options[key] for key in OF_SERVER})
    finally:
        registry.close()


def _check_use(output: str | None, options: Settings, in_rerun: bool) -> None:
    """Raise Failure for options of a page without -o, and of a server with it."""
    if output not in (None, "-") and not in_rerun and not output.lower().endswith(PAGES):
        raise Failure("a page must be an .html; for films, use mcz render", Exit.USAGE, path=output)
    if output == "-":
        raise Failure("a page must be written to a file, not to standard output", Exit.USAGE)
    defaults = {"no_browser": False, "keep": False, "host": LOOPBACK, "port": 0}
    of_server = [key for key in OF_SERVER if options[key] != defaults[key]]
    if in_rerun:
        wrong = ("codec", "effort", "params", "most", *(() if output else ("force",)))
        other, why = [*of_server, *(k for k in wrong if options[k])], "without rerun"
        why = "with -o" if other == ["force"] else why
    elif output is not None:
        other, why = of_server, "without -o"
    else:
        other, why = [key for key in OF_PAGE if options[key]], "with -o OUT.html"
    if other:
        option = {"clips": "clip", "params": "param", "most": "max-size"}.get(other[0], other[0])
        raise Failure(f"--{option.replace('_', '-')} applies only {why}", Exit.USAGE)


def _serve(
    registry: FileRegistry, as_json: bool, no_browser: bool, keep: bool, host: str, port: int
) -> Exit:
    from mcz.show.viewing.player import viewer_page
    from mcz.show.viewing.server import Server
    from mcz.show.viewing.view import show

    with Server(viewer_page(registry), registry, host=host, port=port) as server:
        if as_json:
            print_json({"url": server.url, "files": server.site.tasks.files()})
        else:
            echo(server.url)
        if not no_browser and not show(server.url):
            registry.report("no browser found; open the address above on this machine")
        try:
            server.site.open_pages.wait(for_ever=keep)
        except KeyboardInterrupt:
            return Exit.FINE  # the usual way to end it
    return Exit.FINE


def _write_page(registry: FileRegistry, output: str, as_json: bool, options: Settings) -> Exit:
    from pathlib import Path

    from mcz.show.viewing.page import MOST_BYTES, PageOptions, page, write_page

    force, most = options.pop("force"), options.pop("most") or MOST_BYTES
    if "://" not in output:
        check_new(Path(output), force)
    with errors_about(output):
        written = write_page(
            page(registry.report), registry, output, PageOptions(**options), most=most, force=force
        )
    if as_json:
        print_json({"output": output, **asdict(written)})
    else:
        echo(*_page_lines(output, written))
    return Exit.FINE


def _page_lines(output: str, written: PageWritten) -> list[str]:
    files = (f"  {f.name}: {plural(f.n_clips, 'clip')}, {f.size:,} bytes" for f in written.files)
    return [f"{output}: {written.size:,} bytes, the player {written.player_size:,} of them", *files]


RERUN_SUFFIX = ".rrd"
FACTS = ("rate", "unit", "up")
MOST_BESIDE, MOST_VIEWS = 4, 64  # clips shown side by side, and one at a time
SCREENS = ("DISPLAY", "WAYLAND_DISPLAY")


def is_rerun(rerun: bool, output: str | None) -> bool:
    """Return whether ``--rerun`` or the output suffix selects rerun; raises Failure."""
    is_file = output is not None and output.lower().endswith(RERUN_SUFFIX)
    if rerun and output is not None and not is_file:
        raise Failure(
            f"with --rerun the output must be called OUT{RERUN_SUFFIX}", Exit.USAGE, path=output
        )
    return rerun or is_file


def show_in_rerun(
    registry: FileRegistry, output: str | None, as_json: bool, options: Settings
) -> Exit:
    """Log every requested clip, to ``output`` or to a new viewer."""
    if output is None:
        recording = _recording()
        _check_screen()
        try:
            recording.spawn()
        except RuntimeError as error:  # its viewer is not on the path
            raise Failure(f"rerun: {str(error).strip().splitlines()[0]}") from error
        rows, failed = _log_clips(registry, recording, options)
        recording.flush()
        if as_json:
            print_json({"output": None, "clips": rows})
        else:
            echo(f"rerun: {plural(len(rows), 'clip')}")
    else:
        rows, failed = _write_rerun(registry, output, options)
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
            f"the rerun viewer needs a screen; -o OUT{RERUN_SUFFIX} writes a file for one elsewhere"
        )


def _write_rerun(
    registry: FileRegistry, output: str, options: Settings
) -> tuple[list[JsonObject], int]:
    """Log to a file, which appears when it is complete."""
    from mcz.files.writing.atomic import replacing

    check_new(Path(output), options["force"])
    inputs = [file.source for _, file in registry.initial_files()]
    with (
        errors_about(output),
        tempfile.TemporaryDirectory() as folder,
        replacing(output, force=options["force"], inputs=inputs) as stream,
    ):
        path, recording = Path(folder, "take.rrd"), _recording()
        recording.save(path)
        rows, failed = _log_clips(registry, recording, options)
        recording.disconnect()
        if not rows:
            raise Failure("no clip could be logged", path=output)
        with path.open("rb") as written:
            shutil.copyfileobj(written, stream)
    return rows, failed


def _log_clips(
    registry: FileRegistry, recording: Any, options: Settings
) -> tuple[list[JsonObject], int]:
    """Log all clips; return a row of facts for each, and the number of failures."""
    from mcz.errors import MczError
    from mcz.show.rerun import to_rerun, view_of

    rows: list[JsonObject] = []
    views: list[Any] = []
    failed = unknown = 0
    several = len(registry.initial_files()) > 1
    for file, clip in _clips(registry, options):
        entity = f"{file}/{clip.name}" if several else clip.name
        try:
            motion = _complete(clip, options)
            to_rerun(motion, recording, entity=entity)
            unknown += not motion.skeleton.up_axis
            if len(views) < MOST_VIEWS:
                views.append(view_of(motion, entity))
        except MczError as error:
            registry.report(f"{file}: {clip.name}: {error.describe(OPTION_HINTS)}")
            failed += 1
            continue
        rows.append({"file": file, "name": clip.name, "entity": entity, "n_frames": clip.n_frames})
    if unknown:
        registry.report(f"{plural(unknown, 'clip')}: the up axis is unknown; set it with --up")
    if views:
        blueprint = import_extra("rerun.blueprint", "rerun")
        arranged = blueprint.Grid if len(views) <= MOST_BESIDE else blueprint.Tabs
        recording.send_blueprint(blueprint.Blueprint(arranged(*views), collapse_panels=True))
    return rows, failed


def _clips(registry: FileRegistry, options: Settings) -> Iterator[tuple[str, Clip]]:
    from mcz.files.reading.file import open

    for _, registered in registry.initial_files():
        with (
            errors_about(registered.source),
            open(
                registered.target(), salvage=options["salvage"], max_decoded=options["max_decoded"]
            ) as file,
        ):
            for clip in file.select_clips(options["clips"] or None, options["where"]):
                yield registered.name, clip


def _complete(clip: Clip, options: Settings) -> Clip | Motion:
    """The clip; decoded completely if options state facts that its file lacks."""
    skeleton = clip.skeleton
    unknown = (clip.frame_rate is None, skeleton.unit_cm is None, not skeleton.up_axis)
    facts = [options[fact] for fact in FACTS]
    if not any(
        is_unknown and fact is not None for is_unknown, fact in zip(unknown, facts, strict=True)
    ):
        return clip
    from mcz.files.reading.source_files import SourceOptions

    return SourceOptions(**{fact: options[fact] for fact in FACTS}).complete(clip.motion())
