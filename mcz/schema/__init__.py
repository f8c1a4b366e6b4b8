"""The layer of structures: records over construct, and the types that the format adds.

``records`` declares, parses and builds them, ``types`` has what construct lacks; ``varints`` and
``deflating`` serve bulk data too. SPEC.md, "Conventions", is normative.
"""

from __future__ import annotations

from mcz.schema.columns import Table as Table
from mcz.schema.columns import columns as columns
from mcz.schema.deflating import MAX_RATIO as MAX_RATIO
from mcz.schema.deflating import deflate as deflate
from mcz.schema.deflating import inflate as inflate
from mcz.schema.records import Record as Record
from mcz.schema.records import build as build
from mcz.schema.records import field as field
from mcz.schema.records import parse as parse
from mcz.schema.records import parse_all as parse_all
from mcz.schema.records import parse_until as parse_until
from mcz.schema.types import EXTENDED as EXTENDED
from mcz.schema.types import EXTENSION as EXTENSION
from mcz.schema.types import FINITE as FINITE
from mcz.schema.types import POSITIVE as POSITIVE
from mcz.schema.types import SIZED as SIZED
from mcz.schema.types import SIZED_EXTENSION as SIZED_EXTENSION
from mcz.schema.types import SVARINT as SVARINT
from mcz.schema.types import TEXT as TEXT
from mcz.schema.types import UVARINT as UVARINT
from mcz.schema.types import Adapted as Adapted
from mcz.schema.types import Checked as Checked
from mcz.schema.types import CheckedBeside as CheckedBeside
from mcz.schema.types import Exactly as Exactly
from mcz.schema.types import bounded as bounded
from mcz.schema.types import counted as counted
from mcz.schema.types import flags as flags
from mcz.schema.types import one_of as one_of
from mcz.schema.types import only_if as only_if
from mcz.schema.types import optional as optional
from mcz.schema.varints import MAX_COUNT as MAX_COUNT
from mcz.schema.varints import read_varint as read_varint
from mcz.schema.varints import take_varint as take_varint
from mcz.schema.varints import varint as varint
