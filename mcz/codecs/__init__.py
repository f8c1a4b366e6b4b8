"""The codec table: one row a codec, SPEC.md's registry."""

from __future__ import annotations

from mcz.codecs import (
    awt,
    dwt,
    lossless,
    lsdt_clip,
    lsdt_frame,
    mdtt,
    mrdwt,
    online,
    pca,
    pca_rdo,
    qbc,
    raw,
)
from mcz.codecs.base import Codec
from mcz.errors import OptionError, UnsupportedError

CODECS: dict[int, Codec] = {
    codec.id: codec
    for codec in (
        raw.CODEC,
        lossless.CODEC,
        mrdwt.CODEC,
        qbc.CODEC,
        pca.CODEC,
        dwt.CODEC,
        awt.CODEC,
        lsdt_frame.CODEC,
        lsdt_clip.CODEC,
        mdtt.CODEC,
        pca_rdo.CODEC,
        online.CODEC,
    )
}
DEFAULT = lossless.CODEC.name  # the best lossless one there is


def by_name(name: str) -> Codec:
    """The codec called ``name``; raises OptionError where there is none."""
    for codec in CODECS.values():
        if codec.name == name:
            return codec
    names = ", ".join(codec.name for codec in CODECS.values())
    raise OptionError(f"no codec is called {name!r}; there are: {names}")


def by_id(id_: int, version: int) -> Codec:
    """The codec with this id; raises UnsupportedError where it or its version is not known."""
    codec = CODECS.get(id_)
    if codec is None:
        raise UnsupportedError(f"codec {id_} is unknown")
    if version > codec.version:
        raise UnsupportedError(f"codec {codec.name}: version {version}, known is {codec.version}")
    return codec
