"""``mcz view``: motions in the browser, or in one page that can be sent around."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import click

from mcz.cli.common import (
    EXIT_CODES,
    Exit,
    Failure,
    about,
    check_new,
    echo,
    plural,
    print_json,
    say,
)
from mcz.cli.hints import OPTION_HINTS
from mcz.cli.options import (
    EFFORTS,
    arrays_option,
    clips_option,
    decoded_option,
    force_option,
    json_option,
    model_option,
    param_option,
    rate_option,
    salvage_option,
    skeleton_option,
    threads_option,
    to_bytes,
    unit_option,
    up_option,
    where_option,
)
from mcz.cli.suffixes import file_in
from mcz.cli.terminal import say_json
from mcz.cli.view_rerun import is_rerun, show_in_rerun
from mcz.model.types import Settings

if TYPE_CHECKING:
    from mcz.show.viewing.embedding import PageWritten
    from mcz.show.viewing.file_registry import Shelf

SAID = ("skeleton", "rate", "unit", "up", "arrays", "model")  # what a file may not say itself
OF_PAGE = ("clips", "where", "codec", "effort", "params", "max_decoded", "most", "force")
PAGES = (".html", ".htm")
OF_SERVER = ("no_browser", "keep", "host", "port")
LOOPBACK = "127.0.0.1"


@click.command(
    short_help="Show motions in the browser, or write a page to mail.", epilog=EXIT_CODES
)
@click.argument(
    "files", metavar="FILE...", nargs=-1, required=True, type=click.Path(readable=False)
)
@click.option(
    "-o",
    "--output",
    metavar="OUT.html",
    help="Write one page that holds the files and the player; OUT.rrd: a file for rerun.",
)
@click.option(
    "--rerun", is_flag=True, help="Show the motion in the viewer of rerun, which is started."
)
@click.option("--no-browser", is_flag=True, help="Print the address, and open nothing.")
@click.option("--keep", is_flag=True, help="Stay when the last page is closed, until Ctrl-C.")
@click.option(
    "--host",
    metavar="NAME",
    default=LOOPBACK,
    help="Listen on a name of this machine's own: 127.0.0.1, localhost or ::1.",
)
@click.option(
    "--port",
    metavar="N",
    type=click.IntRange(0, 65535),
    default=0,
    help="Listen on this port. Default: any free one.",
)
@skeleton_option("The ASF of an AMC, or none. Default: found as mcz encode finds it.")
@rate_option()
@unit_option("Length unit of a file that says none.")
@up_option("Axis that points up, of a file that does not say.")
@arrays_option
@model_option
@salvage_option
@clips_option
@where_option
@click.option(
    "--codec",
    metavar="NAME",
    help="Encode the clips with this codec (with -o). Default: as they are.",
)
@click.option("--effort", type=click.Choice(EFFORTS), help="Choose a lossless codec (with -o).")
@param_option
@click.option(
    "--max-size",
    "most",
    metavar="BYTES",
    callback=to_bytes,
    help="Set the greatest size of the page, 80M or 2G (with -o). Default: 50M.",
)
@decoded_option
@force_option
@threads_option
@json_option
def command(files: tuple[str, ...], output: str | None, as_json: bool, **options: Any) -> Exit:
    """Show motions in the browser: files, folders of them, URLs of an .mcz.

    Files are .mcz, .bvh, .amc, .c3d, .trc, .csv, .mot, .sto, .npy and .npz. What has no points is
    shown as curves.

    A server on this machine serves the page and the files to this machine alone, at an address
    that nobody can guess. It ends some seconds after its last page was closed, and at Ctrl-C.

    With -o one page is written, which needs neither a server nor a network: of an archive the clips
    that --clip and --where take, coded anew with --codec. Several files are compared, the first
    being the original.

    With --rerun, or -o OUT.rrd, every clip is logged for rerun: its points and bones, other signals
    as time series.
    """
    if output is not None:
        output = file_in(output, files[0], ".rrd" if options["rerun"] else ".html")
    in_rerun = is_rerun(options.pop("rerun"), output)
    _check_use(output, options, in_rerun)
    from mcz.show.viewing.file_registry import Shelf, put

    def told(line: str) -> None:
        if as_json:
            say_json({"note": line})
        else:
            say(line)

    said = {key: options[key] for key in SAID}
    shelf = Shelf(said, told, salvage=options["salvage"], hints=OPTION_HINTS)
    try:
        for path in files:
            with about(path):
                put(shelf, path)
        if in_rerun:
            return show_in_rerun(shelf, output, as_json, options)
        if output is not None:
            return _write(shelf, output, as_json, {key: options[key] for key in OF_PAGE})
        return _serve(shelf, as_json, **{key: options[key] for key in OF_SERVER})
    finally:
        shelf.close()


def _check_use(output: str | None, options: Settings, in_rerun: bool) -> None:
    """Raise Failure for options of a page without -o, and of a server with it."""
    if output not in (None, "-") and not in_rerun and not output.lower().endswith(PAGES):
        raise Failure("a page is a .html; mcz render draws films", Exit.USAGE, path=output)
    if output == "-":
        raise Failure("a page is written to a file, not to standard output", Exit.USAGE)
    usual = {"no_browser": False, "keep": False, "host": LOOPBACK, "port": 0}
    of_server = [key for key in OF_SERVER if options[key] != usual[key]]
    if in_rerun:
        wrong = ("codec", "effort", "params", "most", *(() if output else ("force",)))
        other, why = [*of_server, *(k for k in wrong if options[k])], "without rerun"
        why = "with -o" if other == ["force"] else why
    elif output is not None:
        other, why = of_server, "without -o"
    else:
        other, why = [key for key in OF_PAGE if options[key]], "with -o OUT.html"
    if other:
        shown = {"clips": "clip", "params": "param", "most": "max-size"}.get(other[0], other[0])
        raise Failure(f"--{shown.replace('_', '-')} is taken {why}", Exit.USAGE)


def _serve(shelf: Shelf, as_json: bool, no_browser: bool, keep: bool, host: str, port: int) -> Exit:
    from mcz.show.viewing.browser import show
    from mcz.show.viewing.server import Server
    from mcz.show.viewing.small_page import viewer_page

    with Server(viewer_page(shelf), shelf, host=host, port=port) as server:
        if as_json:
            print_json({"url": server.url, "files": server.site.work.files()})
        else:
            echo(server.url)
        if not no_browser and not show(server.url):
            shelf.say("there is no browser to open; the address above is for one on this machine")
        try:
            server.site.visitors.wait(for_ever=keep)
        except KeyboardInterrupt:
            return Exit.FINE  # that is how it is ended
    return Exit.FINE


def _write(shelf: Shelf, output: str, as_json: bool, options: Settings) -> Exit:
    from pathlib import Path

    from mcz.show.viewing.embedding import MOST_BYTES, Wanted, write_page
    from mcz.show.viewing.page import page

    force, most = options.pop("force"), options.pop("most") or MOST_BYTES
    if "://" not in output:
        check_new(Path(output), force)
    with about(output):
        found = write_page(
            page(shelf.say), shelf, output, Wanted(**options), most=most, force=force
        )
    if as_json:
        print_json({"output": output, **asdict(found)})
    else:
        echo(*_lines(output, found))
    return Exit.FINE


def _lines(output: str, found: PageWritten) -> list[str]:
    files = (f"  {f.name}: {plural(f.n_clips, 'clip')}, {f.size:,} bytes" for f in found.files)
    return [f"{output}: {found.size:,} bytes, the player {found.player_size:,} of them", *files]
