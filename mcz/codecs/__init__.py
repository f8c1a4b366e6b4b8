"""The codec table: one row a codec, SPEC.md's registry."""

from __future__ import annotations

from collections.abc import Iterator, MutableMapping
from dataclasses import replace
from importlib import import_module

from mcz.brief import among
from mcz.codecs.contract import Codec
from mcz.errors import OptionError, UnsupportedError

# Where each codec lives. A module is called as its codec is, and imported when that is asked for:
# importing all takes longer than most commands work.
HOMES = {
    0: "raw",
    1: "lossless.lossless",
    2: "wavelet.mrdwt",
    3: "curves.qbc",
    4: "pca.pca",
    5: "wavelet.dwt",
    6: "wavelet.awt",
    7: "spatial.lsdt_frame",
    8: "spatial.lsdt_clip",
    9: "spatial.mdtt",
    10: "spatial.pca_rdo",
    11: "online.online",
    12: "lossless.best",
    13: "posewave.posewave",
    14: "lossless.fast",
}


class Codecs(MutableMapping[int, Codec]):
    """The codecs by their ids."""

    def __init__(self) -> None:
        self._homes = dict(HOMES)
        self._loaded: dict[int, Codec] = {}

    def __getitem__(self, id_: int) -> Codec:
        if id_ not in self._loaded:
            codec: Codec = import_module(f"{__name__}.{self._homes[id_]}").CODEC
            self._loaded[id_] = codec
        return self._loaded[id_]

    def __setitem__(self, id_: int, codec: Codec) -> None:
        self._loaded[id_] = codec

    def __delitem__(self, id_: int) -> None:
        del self._loaded[id_]
        self._homes.pop(id_, None)

    def __iter__(self) -> Iterator[int]:
        return iter({**self._homes, **self._loaded})

    def __len__(self) -> int:
        return len({**self._homes, **self._loaded})

    def names(self) -> dict[str, int]:
        """The id of each codec by its name; none of them is imported for it."""
        named = {
            home.rpartition(".")[2].replace("_", "-"): id_ for id_, home in self._homes.items()
        }
        return named | {codec.name: id_ for id_, codec in self._loaded.items()}


CODECS = Codecs()
DEFAULT = "fast"
EFFORTS = {"fast": "fast", "normal": "lossless", "best": "best"}  # by what they cost
ALIASES = {"lossy": "posewave"}  # the best lossy one there is


def by_name(name: str) -> Codec:
    """The codec called ``name``, or by a name of ``ALIASES``; raises OptionError for another."""
    names = CODECS.names()
    if ALIASES.get(name, name) not in names:
        raise OptionError(
            f"no codec is called {name!r}; there are: {among([*ALIASES, *names], name)}"
        )
    return CODECS[names[ALIASES.get(name, name)]]


def chosen(codec: str | None, effort: str | None) -> str:
    """The codec of that name or of that effort, by default ``DEFAULT``; raises OptionError."""
    if codec is not None and effort is not None:
        raise OptionError(f"codec {codec!r} and effort {effort!r}: one of them, not both")
    if effort is not None and effort not in EFFORTS:
        raise OptionError(f"no effort is called {effort!r}; there are: {', '.join(EFFORTS)}")
    return codec or EFFORTS.get(effort or "", DEFAULT)


def by_id(id_: int, version: int) -> Codec:
    """The codec with this id; raises UnsupportedError where it or its version is not known."""
    codec = CODECS.get(id_)
    if codec is None:
        raise UnsupportedError(f"codec {id_} is unknown")  # CODEC-03, CONV-16
    if version > codec.version:  # CODEC-04, HEAD-05
        raise UnsupportedError(f"codec {codec.name}: version {version}, known is {codec.version}")
    if version < codec.version:
        return replace(codec, version=version, decode=codec.earlier.get(version, codec.decode))
    return codec
