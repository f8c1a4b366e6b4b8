"""A file on a web server, read a range at a time; whatever goes wrong there is an AccessError."""

from __future__ import annotations

import http.client
import io
import re
import urllib.error
import urllib.request
from typing import Any

from mcz.errors import AccessError

TIMEOUT = 30.0  # seconds that a server may be silent
RANGE = re.compile(r"bytes (?:([0-9]{1,18})-([0-9]{1,18})|\*)/([0-9]{1,18})")


class HttpFile(io.RawIOBase):
    """The file at an http or https address, which may seek; each read is a request.

    The server must give ranges of bytes (RFC 9110, section 14), of one and the same file. Raises
    AccessError, which names the address and what the server did.
    """

    is_remote = True  # as ByteSource asks

    def __init__(self, address: str) -> None:
        super().__init__()
        self.name = address
        self._at = 0
        self._tag: str | None = None
        self._size: int | None = None
        _, self._size, self._tag = self._answer(0, 1)

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        self._at = offset + {io.SEEK_SET: 0, io.SEEK_CUR: self._at}.get(whence, self._size or 0)
        return self._at

    def tell(self) -> int:
        return self._at

    def read(self, size: int = -1) -> bytes:
        left = max(0, (self._size or 0) - self._at)
        size = left if size < 0 else min(size, left)
        if not size:
            return b""
        data, _, _ = self._answer(self._at, size)
        self._at += size
        return data

    def _answer(self, at: int, size: int) -> tuple[bytes, int, str | None]:
        """The bytes of a range, the size of the whole file, and its tag."""
        wanted = {"Range": f"bytes={at}-{at + size - 1}", "Accept-Encoding": "identity"}
        request = urllib.request.Request(self.name, headers=wanted)
        try:
            with urllib.request.urlopen(request, timeout=TIMEOUT) as answer:
                whole = self._check(answer, at, size)
                return self._body(answer, min(size, whole - at)), whole, answer.headers.get("ETag")
        except urllib.error.HTTPError as error:
            error.close()
            empty = RANGE.fullmatch(error.headers.get("Content-Range") or "")
            if error.code == 416 and empty and empty[3] == "0":
                return b"", 0, None
            raise self._error(f"the server answers {error.code} {error.reason}") from None
        except (OSError, http.client.HTTPException, ValueError) as error:
            text = getattr(error, "reason", None) or str(error) or type(error).__name__
            raise self._error(str(text)) from None

    def _check(self, answer: Any, at: int, size: int) -> int:
        """The size of the whole file, where this is an answer to what was asked."""
        if answer.status != 206:
            raise self._error(
                f"the server answers {answer.status} to a range of bytes, so it gives no parts; "
                "download the file first"
            )
        found = RANGE.fullmatch(answer.headers.get("Content-Range") or "")
        if found is None or found[1] is None:
            raise self._error("the server does not say which range it gives")
        first, last, whole = (int(number) for number in found.groups())
        if (first, last) != (at, min(at + size, whole) - 1):
            raise self._error(f"bytes {at} to {at + size - 1} are asked for, it gives {found[0]}")
        if self._size not in (None, whole) or self._tag not in (None, answer.headers.get("ETag")):
            raise self._error("the file was replaced while it was read")
        return whole

    def _body(self, answer: Any, size: int) -> bytes:
        data: bytes = answer.read(size + 1)
        if len(data) != size:
            came = "more" if len(data) > size else f"{len(data)}"
            raise self._error(f"{size} bytes are announced, {came} came")
        return data

    def _error(self, text: str) -> AccessError:
        return AccessError(f"{self.name}: {text}")
