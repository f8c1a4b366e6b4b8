"""``mcz view``: motions in the browser, or in a page that can be sent around."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from mcz.cli.common import EXIT_CODES, Exit, echo, print_json, say, to_rate
from mcz.cli.options import UNITS, json_option, salvage_option, up_option

if TYPE_CHECKING:
    pass


@click.command(short_help="Motions in the browser.", epilog=EXIT_CODES)
@click.argument(
    "files", metavar="FILE...", nargs=-1, required=True, type=click.Path(readable=False)
)
@click.option("--no-browser", is_flag=True, help="Print the address, and open nothing.")
@click.option("--keep", is_flag=True, help="Stay when the last page is closed, until Ctrl-C.")
@click.option(
    "--host",
    default="127.0.0.1",
    metavar="NAME",
    help="Of this machine alone: 127.0.0.1, localhost or ::1.",
)
@click.option("--port", default=0, type=click.IntRange(0, 65535), help="Default: one that is free.")
@click.option(
    "--skeleton",
    metavar="FILE.asf",
    type=click.Path(readable=False),
    help="The ASF of an AMC, or none.",
)
@click.option(
    "--rate", metavar="R", callback=to_rate, help="Frames a second of a file that does not say."
)
@click.option("--unit", type=click.Choice(UNITS), help="Length unit of the source.")
@up_option("Axis of the source that points up.")
@salvage_option
@json_option
def command(files: tuple[str, ...], **options: Any) -> Exit:
    """Show motions in the browser."""
    return _serve(files, **options)


def _serve(
    files: tuple[str, ...],
    no_browser: bool,
    keep: bool,
    host: str,
    port: int,
    salvage: bool,
    as_json: bool,
    **said: Any,
) -> Exit:
    from mcz.viewing.page import page
    from mcz.viewing.server import Server
    from mcz.viewing.shelf import Shelf, put

    shelf = Shelf(said, say, salvage=salvage)
    for path in files:
        put(shelf, path)
    with Server(page(say), shelf, host=host, port=port) as server:
        if as_json:
            print_json({"url": server.url})
        else:
            echo(server.url)
        if not no_browser:
            import webbrowser

            webbrowser.open(server.url)
        try:
            server.site.visitors.wait(for_ever=keep)
        except KeyboardInterrupt:
            say("closed")
    return Exit.FINE
