"""``mcz.view``: motions from Python, in a notebook or in the browser."""

from __future__ import annotations

import atexit
import os
import sys
from collections.abc import Sequence
from fractions import Fraction
from typing import BinaryIO

from mcz.errors import OptionError
from mcz.files.reading.clip import Clip
from mcz.model.motion import Motion
from mcz.model.types import JsonObject
from mcz.show.viewing.file_registry import FileRegistry, Stored, add_path
from mcz.show.viewing.player import player, viewer_page
from mcz.show.viewing.server import Server

_OPEN: set[View] = set()  # served views, also those without a reference


class View:
    """Result of ``view``: players in a notebook, or a server, whose page is at ``url``.

    ``url`` is None in a notebook. ``close``, the end of the context, and the end of the process end
    the server.
    """

    def __init__(self, server: Server | None, players: Sequence[str] = ()) -> None:
        self._server, self._players = server, players
        self.url = None if server is None else server.url
        if server is not None:
            _OPEN.add(self)

    def __repr__(self) -> str:
        return "<View in a notebook>" if self.url is None else f"<View at {self.url}>"

    def _repr_html_(self) -> str | None:
        """The players; None if a page is served."""
        return None if self.url is not None else "\n".join(self._players)

    def __enter__(self) -> View:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the server, unless it has ended."""
        if self in _OPEN and self._server is not None:
            _OPEN.discard(self)
            self._server.close()


Thing = Motion | Clip | str | os.PathLike[str]


def view(
    *things: Thing,
    skeleton: str | os.PathLike[str] | None = None,
    rate: Fraction | float | None = None,
    unit: str | None = None,
    up: str | None = None,
    arrays: str | None = None,
    model: str | os.PathLike[str] | None = None,
    salvage: bool = False,
    browser: bool = True,
    port: int = 0,
) -> View:
    """Show motions: each a Motion, a Clip, or a path or URL as for ``mcz view``.

    In a notebook the result displays as a small player of each. Elsewhere a server on this machine
    shows them on a page, which is opened in the browser unless ``browser`` is False, until the
    result is closed. ``skeleton``, ``rate``, ``unit``, ``up``, ``arrays`` and ``model`` state facts
    that files lack, as for ``mcz.read``; ``salvage``: files may be damaged. Raises MczError for
    unreadable files, and AccessError if this installation has no page or the ``port`` is not
    available.
    """
    if not things:
        raise OptionError("nothing to view: give a Motion, a Clip or a path")
    facts = {"rate": rate, "unit": unit, "up": up, "arrays": arrays, "model": model}
    options = {"skeleton": skeleton, **facts}
    if in_notebook():
        return View(None, [_player_of(thing, options, salvage) for thing in things])
    registry = FileRegistry(options, _print_line, salvage=salvage)
    try:
        for thing in things:
            _add(registry, thing)
        server = Server(viewer_page(registry), registry, port=port)
    except BaseException:
        registry.close()
        raise
    shown = View(server)
    if browser:
        show(server.url)
    return shown


def in_notebook() -> bool:
    """Return True in the kernel of a notebook."""
    module = sys.modules.get("IPython")
    shell = module.get_ipython() if module is not None else None
    return getattr(shell, "kernel", None) is not None


def _print_line(line: str) -> None:
    sys.stderr.write(f"mcz: {line}\n")


def _player_of(thing: Thing, options: JsonObject, salvage: bool) -> str:
    """A player of a Motion, a Clip or a file; it shows the first clip of an ``.mcz``."""
    from mcz.files.reading.file import open
    from mcz.files.reading.read import read

    if isinstance(thing, Motion | Clip):
        return player(thing)
    if not ("://" in str(thing) or str(thing).lower().endswith(".mcz")):
        return player(read(thing, **options))
    with open(thing, salvage=salvage) as file:
        for clip in file:
            return player(clip)
    raise OptionError("the file has no clip", path=thing)


def _add(registry: FileRegistry, thing: Thing) -> None:
    if isinstance(thing, Motion):
        registry.add_initial(Stored(thing.name, registry.write(lambda out: _write(thing, out))))
    elif isinstance(thing, Clip):
        registry.add_initial(Stored(thing.name, registry.write(lambda out: _copy(thing, out))))
    else:
        add_path(registry, os.fspath(thing))


def _write(motion: Motion, out: BinaryIO) -> None:
    from mcz.files.writing.file import write

    write(motion, out)


def _copy(clip: Clip, out: BinaryIO) -> None:
    """The clip as stored; decoded and encoded without loss if its file has no path."""
    from mcz.files.editing.extraction import extract

    target = clip.container.source.target
    if target is None:
        _write(clip.motion(), out)
    else:
        salvage = clip.container.salvage
        extract(target, out, clip=clip.name, salvage=salvage, max_decoded=2**53, copies=False)


@atexit.register
def _close_all() -> None:
    for shown in list(_OPEN):
        shown.close()


def show(url: str) -> bool:
    """Open ``url`` in the browser; False without a browser outside of the terminal."""
    import webbrowser

    graphic = ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER")
    if sys.platform.startswith("linux") and not any(os.environ.get(name) for name in graphic):
        return False
    try:
        return webbrowser.open(url)
    except webbrowser.Error:
        return False
