"""The codec table: one row a codec, SPEC.md's registry.

A codec is a module with a ``CODEC`` (``contract``); a family of them is a folder. ``coding`` has
entropy coders, ``transforms`` wavelets and bases, ``training`` fits bases to clips. Families never
import each other, the container or sources.

Imports ``mcz.model`` and ``mcz.kinematics``.
"""

from __future__ import annotations

from collections.abc import Iterator, MutableMapping
from dataclasses import replace
from importlib import import_module
from typing import NamedTuple

from mcz.codecs.contract import Codec
from mcz.errors import OptionError, UnsupportedError
from mcz.model.text_format import suggest_names


class CodecEntry(NamedTuple):
    """Ids of a codec, its module, and the name that it has there."""

    id: int
    preset: int
    module: str
    constant: str = "CODEC"


# Modules are imported on first use: importing all takes longer than most commands run.
ENTRIES = {
    "raw": CodecEntry(0, 0, "raw"),
    "fast": CodecEntry(1, 0, "lossless.fast"),
    "best": CodecEntry(2, 0, "lossless.best"),
    "posewave": CodecEntry(3, 0, "posewave.posewave"),
    "mrdwt": CodecEntry(16, 1, "wavelet.threshold_codecs", "MRDWT"),
    "dwt": CodecEntry(16, 2, "wavelet.threshold_codecs", "DWT"),
    "awt": CodecEntry(16, 3, "wavelet.awt"),
    "qbc": CodecEntry(17, 0, "curves.qbc"),
    "pca": CodecEntry(18, 0, "pca.pca"),
    "lsdt-frame": CodecEntry(19, 0, "spatial.lsdt_frame"),
    "lsdt-clip": CodecEntry(20, 1, "spatial.window_codecs", "LSDT_CLIP"),
    "mdtt": CodecEntry(20, 2, "spatial.window_codecs", "MDTT"),
    "pca-rdo": CodecEntry(20, 3, "spatial.window_codecs", "PCA_RDO"),
    "online": CodecEntry(21, 0, "online.online"),
}
SHARED = {16: "wavelet"}  # ids whose bitstream has the name of no codec
PRIVATE = range(128, 256)  # ids without a meaning in SPEC.md


class Codecs(MutableMapping[str, Codec]):
    """The codecs by name, imported on first use."""

    def __init__(self) -> None:
        self._homes = dict(ENTRIES)
        self._loaded: dict[str, Codec] = {}

    def __getitem__(self, name: str) -> Codec:
        if name not in self._loaded:
            home = self._homes[name]
            module = import_module(f"{__name__}.{home.module}")
            codec: Codec = getattr(module, home.constant)
            self._loaded[name] = codec
        return self._loaded[name]

    def __setitem__(self, name: str, codec: Codec) -> None:
        self._homes[name] = CodecEntry(codec.id, codec.preset, codec.encode.__module__)
        self._loaded[name] = codec

    def __delitem__(self, name: str) -> None:
        del self._homes[name]
        self._loaded.pop(name, None)

    def __iter__(self) -> Iterator[str]:
        return iter(self._homes)

    def __len__(self) -> int:
        return len(self._homes)

    def find(self, id_: int, preset: int) -> str | None:
        """Return the name of the codec with these ids, or of the first that decodes ``id_``."""
        return self._first(id_, preset) or self._first(id_)  # CODEC-07

    def _first(self, id_: int, preset: int | None = None) -> str | None:
        for name, home in self._homes.items():
            if home.id == id_ and preset in (home.preset, None):
                return name
        return None


CODECS = Codecs()
DEFAULT = "fast"
EFFORTS = {"fast": "fast", "best": "best"}  # by cost
ALIASES = {"lossy": "posewave"}  # the best lossy codec


def codec_by_name(name: str) -> Codec:
    """Return the codec of a name or alias; raises OptionError if there is none."""
    if ALIASES.get(name, name) not in CODECS:
        codecs = suggest_names([*ALIASES, *CODECS], name)
        raise OptionError(f"no codec is called {name!r}; the codecs are {codecs}")
    return CODECS[ALIASES.get(name, name)]


def choose_name(codec: str | None, effort: str | None) -> str:
    """Return the name for a codec or an effort, ``DEFAULT`` for neither; raises OptionError."""
    if codec is not None and effort is not None:
        raise OptionError(
            f"codec {codec!r} and effort {effort!r} exclude each other; give one of them"
        )
    if effort is not None and effort not in EFFORTS:
        raise OptionError(f"no effort is called {effort!r}; the efforts are {', '.join(EFFORTS)}")
    return codec or EFFORTS.get(effort or "", DEFAULT)


def bitstream_name(id_: int) -> str | None:
    """Return the name of the bitstream of a codec id, None if unknown."""
    return SHARED.get(id_) or CODECS.find(id_, 0)


def codec_by_id(id_: int, version: int, preset: int) -> Codec:
    """Return the codec with this id; raises UnsupportedError if it or its version is unknown.

    An unknown ``preset`` gives a codec of the bitstream with that preset.
    """
    name = CODECS.find(id_, preset)
    if name is None:
        raise UnsupportedError(f"codec {id_} is unknown")  # CODEC-03, CONV-16
    codec = CODECS[name]
    if version > codec.version:  # CODEC-04, HEAD-05
        raise UnsupportedError(
            f"codec {codec.name}: version {version} is unknown; this reader knows version "
            f"{codec.version}"
        )
    if preset != codec.preset:
        codec = replace(codec, preset=preset, name=bitstream_name(id_) or codec.name)
    if version < codec.version:
        return replace(codec, version=version, decode=codec.earlier.get(version, codec.decode))
    return codec
