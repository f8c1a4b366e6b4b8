"""Contents of a server, as the answers to requests need them."""

from __future__ import annotations

from dataclasses import dataclass

from mcz.show.viewing.file_registry import Shelf
from mcz.show.viewing.open_pages import Visitors
from mcz.show.viewing.page import Page
from mcz.show.viewing.server_tasks import Work


@dataclass(slots=True)
class Site:
    """The page, files and tasks below ``token``; ``port`` is that of the server."""

    page: Page
    shelf: Shelf
    work: Work
    visitors: Visitors
    token: str
    port: int = 0
