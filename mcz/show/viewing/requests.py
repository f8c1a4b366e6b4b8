"""Requests: permission, ranges of bytes, and posted data."""

from __future__ import annotations

import json
import re
from email.message import Message

from mcz.model.types import JsonObject, Params

LONGEST_JSON = 2**16  # bytes that a request may post as JSON
MOST_PARAMS = 64

Headers = Message  # of a request, as http.server parses it


class Refused(Exception):
    """A request that is not answered as asked: an HTTP status, and a sentence that says why."""

    def __init__(self, status: int, why: str) -> None:
        super().__init__(why)
        self.status = status


def check_sender(headers: Headers, port: int) -> None:
    """Raise Refused unless a request came to this server by its own name, and from its own page.

    A name that was made to mean this machine (DNS rebinding) stands in Host; a page of another
    origin in Origin, or in what browsers say of themselves (Sec-Fetch-Site).
    """
    hosts = [f"{name}:{port}" for name in ("127.0.0.1", "localhost", "[::1]")]
    host = headers.get_all("Host", [])
    if len(host) != 1 or host[0].lower() not in hosts:
        raise Refused(421, "the Host of the request is not this server")
    for origin in headers.get_all("Origin", []):
        if origin != f"http://{host[0].lower()}":
            raise Refused(403, "the request comes from another page")
    fetched = {key: headers.get(f"Sec-Fetch-{key}") for key in ("Site", "Mode", "Dest")}
    opened = (fetched["Mode"], fetched["Dest"]) == ("navigate", "document")  # a link, in its window
    if fetched["Site"] not in (None, "same-origin", "none") and not opened:
        raise Refused(403, "the request comes from another page")


def range_of(headers: Headers, size: int, tag: str) -> tuple[int, int] | None:
    """The one range of bytes, start and stop, that a GET asks for of ``size``; None: all.

    What is no range of bytes, and several at once, are no reason not to answer: RFC 9110 has all
    sent then. So it does where ``If-Range`` names other bytes. Raises Refused (416) for one that
    begins behind the end.
    """
    if headers.get("If-Range", tag) != tag:
        return None
    match = re.fullmatch(r"bytes=[ \t]*(\d{0,18})-(\d{0,18})[ \t]*", headers.get("Range", ""))
    if not match or not (match[1] or match[2]):
        return None
    if not match[1]:
        start, stop = max(0, size - int(match[2])), size
    else:
        start, stop = int(match[1]), size
        if match[2]:
            if int(match[2]) < start:
                return None
            stop = min(size, int(match[2]) + 1)
    if start >= stop:
        raise Refused(416, f"the range begins behind the end, at {size}")
    return start, stop


def is_known(headers: Headers, tag: str) -> bool:
    """Return True if the sender has these bytes already (If-None-Match)."""
    return tag in _tags(headers.get("If-None-Match", "")) or headers.get("If-None-Match") == "*"


def check_same(headers: Headers, tag: str) -> None:
    """Raise Refused (412) where the sender wants other bytes than these (If-Match)."""
    wanted = headers.get("If-Match")
    if wanted is not None and wanted != "*" and tag not in _tags(wanted):
        raise Refused(412, "the file has changed meanwhile")


def _tags(text: str) -> list[str]:
    """
    >>> _tags('"a-1", W/"b"')
    ['"a-1"', '"b"']
    """
    return re.findall(r'"[^"]*"', text)


def length_of(headers: Headers, most: int) -> int:
    """The bytes that a request posts; raises Refused where that is not said, or is too much."""
    said = headers.get_all("Content-Length", [])
    if headers.get("Transfer-Encoding") is not None or len(said) != 1:
        raise Refused(411, "the request must say its Content-Length")
    if not re.fullmatch(r"[0-9]{1,15}", said[0]):
        raise Refused(400, "Content-Length is no number")
    if int(said[0]) > most:
        raise Refused(413, f"the request has {int(said[0]):,} bytes, at most {most:,} are taken")
    return int(said[0])


def json_of(data: bytes) -> JsonObject:
    """An object of JSON; raises Refused for anything else."""
    try:
        document = json.loads(data)
    except (ValueError, RecursionError):
        raise Refused(400, "the request is no JSON") from None
    if not isinstance(document, dict):
        raise Refused(400, "the request is no object of JSON")
    return document


def text_of(document: Params, key: str) -> str:
    """A text of an object; raises Refused where it is none."""
    value = document.get(key)
    if not isinstance(value, str) or not value:
        raise Refused(400, f"{key} is no text")
    return value


def object_of(document: Params, key: str) -> JsonObject:
    """An object in an object; raises Refused where it is none."""
    value = document.get(key)
    if not isinstance(value, dict):
        raise Refused(400, f"{key} is no object")
    return value


def params_of(document: Params) -> JsonObject:
    """The parameters of a codec by name: texts, numbers and truths, no null; raises Refused."""
    given = document.get("params") or {}
    if not isinstance(given, dict) or len(given) > MOST_PARAMS:
        raise Refused(400, "params is no object of parameters")
    params = {key: value for key, value in given.items() if value is not None}
    for key, value in params.items():
        if not isinstance(value, str | int | float | bool):
            raise Refused(400, f"the parameter {key[:40]!r} is neither a text nor a number")
    return params
