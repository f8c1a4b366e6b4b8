"""The page of ``mcz view`` where the viewer was not built: the notebook player of each clip."""

from __future__ import annotations

import html
import os
from collections.abc import Iterator

from mcz.errors import AccessError, MczError
from mcz.files.reading.file import open as mcz_open
from mcz.show.viewing.file_registry import Shelf, Shelved
from mcz.show.viewing.page import OTHER, Page, page
from mcz.show.viewing.player import player

MOST_CLIPS = 12  # players on a page, of at most 300 kB each
TEMPLATE = """<!doctype html>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; script-src \
'unsafe-inline'; style-src 'unsafe-inline'; connect-src 'self'">
<title>MCZ</title>
<style>:root{{color-scheme:light dark}}body{{font:14px system-ui,sans-serif;margin:1em}}</style>
<!-- mcz:embedded --><!-- mcz:end -->
<p>{notice}</p>
{players}
<script>new EventSource("alive");</script>
"""


def viewer_page(shelf: Shelf) -> Page:
    """Return the viewer's page, or a small one where this installation has none.

    The reason is told to ``shelf.say``. Raises AccessError where the environment names a page that
    is not there.
    """
    try:
        return page(shelf.say)
    except AccessError as error:
        if os.environ.get(OTHER):
            raise
        reason = error.describe(shelf.hints)
        shelf.say(f"{reason}; the small player is shown instead")
        return small_page(shelf, reason)


def small_page(shelf: Shelf, reason: str) -> Page:
    """Return a page with a player of each clip, ``MOST_CLIPS`` of them at most."""
    notice = f"This is the small player: it only plays. {reason[:1].upper()}{reason[1:]}."
    players: list[str] = []
    for _, file in shelf.given():
        for shown in _players(file, shelf):
            if len(players) == MOST_CLIPS:
                notice += f" The first {MOST_CLIPS} clips are shown."
                return _page(notice, players)
            players.append(f"<h2>{html.escape(file.name)}</h2>\n{shown}")
    return _page(notice, players)


def _page(notice: str, players: list[str]) -> Page:
    return Page(TEMPLATE.format(notice=html.escape(notice), players="\n".join(players)))


def _players(file: Shelved, shelf: Shelf) -> Iterator[str]:
    """Yield the player of each clip of a file, or the reason why it has none."""
    try:
        with mcz_open(file.target(), salvage=shelf.salvage) as opened:
            yield from map(player, opened)
    except MczError as error:
        yield f"<pre>{html.escape(error.describe(shelf.hints))}</pre>"
