"""The layer of structures: records over construct, and the types that the format adds.

``records`` declares, parses and builds them, ``types`` adds types that construct lacks, varints and
raw deflate. SPEC.md, "Conventions", is normative.
"""

from __future__ import annotations

from mcz.model.schema.columns import Table as Table
from mcz.model.schema.columns import columns as columns
from mcz.model.schema.records import Record as Record
from mcz.model.schema.records import build as build
from mcz.model.schema.records import field as field
from mcz.model.schema.records import parse as parse
from mcz.model.schema.records import parse_all as parse_all
from mcz.model.schema.records import parse_shared as parse_shared
from mcz.model.schema.records import parse_until as parse_until
from mcz.model.schema.types import EXTENDED as EXTENDED
from mcz.model.schema.types import EXTENSION as EXTENSION
from mcz.model.schema.types import FINITE as FINITE
from mcz.model.schema.types import MAX_COUNT as MAX_COUNT
from mcz.model.schema.types import MAX_RATIO as MAX_RATIO
from mcz.model.schema.types import POSITIVE as POSITIVE
from mcz.model.schema.types import SIZED as SIZED
from mcz.model.schema.types import SIZED_EXTENSION as SIZED_EXTENSION
from mcz.model.schema.types import SVARINT as SVARINT
from mcz.model.schema.types import TEXT as TEXT
from mcz.model.schema.types import UVARINT as UVARINT
from mcz.model.schema.types import Adapted as Adapted
from mcz.model.schema.types import Checked as Checked
from mcz.model.schema.types import CheckedInRecord as CheckedInRecord
from mcz.model.schema.types import Exactly as Exactly
from mcz.model.schema.types import bounded as bounded
from mcz.model.schema.types import counted as counted
from mcz.model.schema.types import deflate as deflate
from mcz.model.schema.types import flags as flags
from mcz.model.schema.types import inflate as inflate
from mcz.model.schema.types import one_of as one_of
from mcz.model.schema.types import only_if as only_if
from mcz.model.schema.types import optional as optional
from mcz.model.schema.types import read_varint as read_varint
from mcz.model.schema.types import take_varint as take_varint
from mcz.model.schema.types import varint as varint
