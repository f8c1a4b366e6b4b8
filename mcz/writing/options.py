"""Options of writing: how values are encoded, and how the file is written."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from mcz import jobs, threads
from mcz.codecs import DEFAULT, by_name, chosen
from mcz.codecs.contract import Codec
from mcz.container.limits import BASE, Profile
from mcz.types import Params, Progress


@dataclass(frozen=True, slots=True)
class EncodingOptions:
    """How values are encoded: the name of a codec and its parameters.

    Raises OptionError for an unknown codec.
    """

    codec: str = DEFAULT
    params: Params = field(default_factory=dict)

    def __post_init__(self) -> None:
        by_name(self.codec)

    @property
    def found(self) -> Codec:
        """The codec of that name."""
        return by_name(self.codec)


def encoding_options(
    codec: str | None, effort: str | None, params: Params | None
) -> EncodingOptions:
    """Options of a codec, or of an ``effort`` in its place; raises OptionError for both."""
    return EncodingOptions(chosen(codec, effort), dict(params or {}))


@dataclass(frozen=True, slots=True)
class WritingOptions:
    """How a file is written.

    ``force`` replaces a file that is there. ``copies``: what holds clips together stands in the
    file a second time. ``threads`` may code at once, by default one a processor, and ``jobs``
    processes, by default one; the bytes are the same.
    """

    force: bool = False
    profile: Profile = BASE
    copies: bool = False
    threads: int | None = None
    jobs: int | None = None
    progress: Progress | None = None

    @contextmanager
    def in_force(self) -> Iterator[None]:
        """Let what is called meanwhile use so many threads and processes."""
        with threads.limited(self.threads), jobs.limited(self.jobs):
            yield
