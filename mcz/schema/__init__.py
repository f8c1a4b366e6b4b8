"""Schemas: every structure of the format, declared once, with its bounds and its meaning.

A module that has structures takes from here what they are made of (``fields``), ``parse`` and
``build``::

    HEAD = Struct(
        "major" / Int8ul * "format version of the writer, major",
        "extension" / EXTENSION * "ignored, kept",
    )
    parse(HEAD, payload, "HEAD").major

The spelling is that of construct, a library for structures of bytes, but neither reading nor
writing needs a library: a field reads and writes itself. ``twins`` makes of a schema the same one
in construct's own classes. Tests give both the same bytes and values, whole, cut and changed: what
they make of them and what they refuse is the same. SPEC.md, "Conventions", is normative.
"""

from __future__ import annotations

from mcz.schema.conditions import this as this
from mcz.schema.deflating import MAX_RATIO as MAX_RATIO
from mcz.schema.deflating import deflate as deflate
from mcz.schema.deflating import inflate as inflate
from mcz.schema.doors import build as build
from mcz.schema.doors import parse as parse
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
from mcz.schema.source import Fields as Fields
from mcz.schema.varints import MAX_COUNT as MAX_COUNT
from mcz.schema.varints import read_varint as read_varint
from mcz.schema.varints import take_varint as take_varint
from mcz.schema.varints import varint as varint
