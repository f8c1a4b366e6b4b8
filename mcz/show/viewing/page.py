"""The page: where it is, what it may do, and the place in it for files."""

from __future__ import annotations

import os
import re
from pathlib import Path

from mcz.errors import AccessError, FormatError, reason_of
from mcz.show.viewing.file_registry import Say
from mcz.show.viewing.page_build import built

PACKAGED = Path(__file__).with_name("viewer.html")  # in a wheel that was built with it
OTHER = "MCZ_VIEWER_PAGE"  # an environment variable: a page to be taken in place of ours
PLACE = "<!-- mcz:embedded -->"
END = "<!-- mcz:end -->"
POLICY = re.compile(r'<meta http-equiv="Content-Security-Policy" content="([^"<>]*)"')


class Page:
    """The text of the page, and ``policy``, what browsers let it do.

    What it holds at ``PLACE`` when it is opened by itself, the tables of all codecs, is no part of
    ``text``: a server has them, and pages that are written have what their files need.
    """

    def __init__(self, text: str, name: str = "the page") -> None:
        before, found, rest = text.partition(PLACE)
        _, end, after = rest.partition(END)
        policy = POLICY.search(before)
        if not found or not end or PLACE in after or policy is None:
            raise FormatError(f"{name}: it is no page of the viewer of this version")
        self.text = before + PLACE + END + after
        self.before, self.after, self.policy = before, after, policy[1]


def page(say: Say | None = None) -> Page:
    """The page of this installation; in a source checkout it is built where that is due.

    ``say`` is told what takes time. Raises AccessError where there is none; the message says how
    one is made.
    """
    if other := os.environ.get(OTHER):
        path = Path(other)
    else:
        path = PACKAGED if PACKAGED.is_file() else built(say or (lambda line: None))
    try:
        return Page(path.read_text("utf-8"), str(path))
    except OSError as error:
        raise AccessError(reason_of(error), path=path) from None
    except UnicodeDecodeError:
        raise FormatError("it is no page", path=path) from None
