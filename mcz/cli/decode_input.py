"""The input of ``mcz decode`` and ``mcz convert``: an .mcz, or a source file coded in memory."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from mcz.cli.common import about, existing, opened, say
from mcz.cli.decode_options import DecodeOptions, refuse
from mcz.cli.hints import in_options
from mcz.model.types import Params

if TYPE_CHECKING:
    from mcz.files.reading.file import File

SOURCE_GIVEN = "a source file, no .mcz; -o or --to says what it becomes, mcz encode compresses it"
NO_LIMIT = 2**53  # of what is decoded: it was made here


@dataclass(frozen=True, slots=True)
class Input:
    """A file, and how it is read; ``facts`` are arguments of ``mcz.encode`` for a source file."""

    file: str
    salvage: bool = False
    unverified: bool = False
    max_decoded: int | None = None
    facts: Params = field(default_factory=dict)

    @property
    def is_source(self) -> bool:
        from mcz.files.reading.file import is_source

        return is_source(self.file)

    def with_facts(self, wanted: DecodeOptions) -> tuple[Input, DecodeOptions]:
        """The same with the facts among what is wanted of a source file, and the rest of that."""
        refuse(self.salvage or self.unverified, "--salvage and --unverified need an .mcz")
        facts = {"unit": wanted.unit, "up": wanted.up, "rate": wanted.rate}
        given = replace(self, facts=dict(self.facts) | facts)
        return given, wanted._replace(unit=None, up=None, rate=None)

    @contextmanager
    def opened(self) -> Iterator[tuple[File, tuple[str, ...]]]:
        """The open .mcz, of a source file one in memory; and the files that were read for it."""
        if not self.is_source:
            options = {"salvage": self.salvage, "unverified": self.unverified, "verify": True}
            with opened(self.file, max_decoded=self.max_decoded, **options) as file:  # CEND-06
                yield file, (self.file,)
            return
        import mcz

        existing(self.file)
        coded = io.BytesIO()
        with about(self.file):
            written = mcz.encode(self.file, coded, profile="large", **self.facts)
            for note in written.notes:
                say(f"{self.file}: {in_options(note)}")
            with mcz.open(coded.getvalue(), max_decoded=NO_LIMIT) as file:
                yield file, written.inputs
