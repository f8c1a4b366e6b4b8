"""The doors to schemas: bytes to fields, and fields to bytes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from mcz.errors import FormatError, MczError
from mcz.schema.fields import Field, Struct
from mcz.schema.source import Fields, Source


def parse(
    schema: Struct, data: bytes, where: str, limits: Mapping[str, int] | None = None
) -> Fields:
    """The fields of ``data``, all of which ``schema`` must consume.

    ``limits`` says how many items of some kinds, see ``counted``, there may be in all. Raises
    TruncatedError, LimitError or FormatError; ``where`` opens the message.
    """
    source = Source(bytes(data), dict(limits or {}))
    try:
        fields = schema.read(source, Fields())
        if source.at < len(source.data):  # CONV-12
            raise FormatError(f"{len(source.data) - source.at} bytes behind its end")
    except MczError as error:
        _in_one_line(error, where)
        raise
    return fields


def build(schema: Field, fields: Any, where: str) -> bytes:
    """The bytes of ``fields``; raises FormatError where ``schema`` does not admit them.

    A schema that is no ``Struct`` takes its value in their place.
    """
    out = bytearray()
    try:
        schema.write(fields, out, Fields())
    except MczError as error:
        _in_one_line(error, where)
        raise
    return bytes(out)


def _in_one_line(error: MczError, where: str) -> None:
    *places, message = error.args
    error.args = (": ".join(filter(None, (where, ".".join(places), message))),)
