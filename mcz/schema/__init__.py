"""Schemas: every structure of the format, declared once, with its bounds and its meaning.

A module that has structures takes from here what they are made of (``fields``), ``parse`` and
``build``::

    HEAD = Struct(
        "major" / Int8ul * "format version of the writer, major",
        "extension" / EXTENSION * "ignored, kept",
    )
    parse(HEAD, payload, "HEAD").major

The spelling is that of construct, a library for structures of bytes. Reading takes no library:
``fields`` read by plain Python, quicker than construct does. Writing goes through construct itself:
``twins`` makes the same schema in its classes. A test feeds both the same bytes, whole, cut and
changed: their values and refusals are the same. SPEC.md, "Conventions", is normative.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from mcz.schema.deflating import MAX_RATIO as MAX_RATIO
from mcz.schema.deflating import deflate as deflate
from mcz.schema.deflating import inflate as inflate
from mcz.schema.fields import EXTENSION as EXTENSION
from mcz.schema.fields import FINITE as FINITE
from mcz.schema.fields import SIZED as SIZED
from mcz.schema.fields import SVARINT as SVARINT
from mcz.schema.fields import TEXT as TEXT
from mcz.schema.fields import UVARINT as UVARINT
from mcz.schema.fields import Adapter as Adapter
from mcz.schema.fields import Bytes as Bytes
from mcz.schema.fields import ExprValidator as ExprValidator
from mcz.schema.fields import Field as Field
from mcz.schema.fields import Fields as Fields
from mcz.schema.fields import Float32l as Float32l
from mcz.schema.fields import Float64l as Float64l
from mcz.schema.fields import GreedyBytes as GreedyBytes
from mcz.schema.fields import If as If
from mcz.schema.fields import IfThenElse as IfThenElse
from mcz.schema.fields import Int8ul as Int8ul
from mcz.schema.fields import OneOf as OneOf
from mcz.schema.fields import Pass as Pass
from mcz.schema.fields import Struct as Struct
from mcz.schema.fields import counted as counted
from mcz.schema.fields import optional as optional
from mcz.schema.fields import parse as parse
from mcz.schema.fields import this as this
from mcz.schema.varints import MAX_COUNT as MAX_COUNT
from mcz.schema.varints import read_varint as read_varint
from mcz.schema.varints import take_varint as take_varint
from mcz.schema.varints import varint as varint


def build(schema: Struct, fields: Mapping[str, Any], where: str) -> bytes:
    """The bytes of ``fields``; raises FormatError where ``schema`` does not admit them.

    This alone imports construct.
    """
    from mcz.schema import twins

    return twins.build(schema, fields, where)
