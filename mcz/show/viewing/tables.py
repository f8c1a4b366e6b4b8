"""The annexes that a decoder needs for a file, so that a page carries these alone."""

from __future__ import annotations

import base64
import zlib
from collections.abc import Iterable

from mcz.codecs.basis_models import known_model_name
from mcz.errors import MczError
from mcz.files.reading.file import File
from mcz.files.reading.sizes import models_used
from mcz.model.annexes import annex_bytes

ALWAYS = ("words.bin",)  # the names of joints are packed with them
BASES = "pca_start.json"  # how models of bases are coded
TABLES = {
    "raw": (),
    "mrdwt": ("wavelet_start.json",),
    "qbc": ("qbc_start.json",),
    "pca": (BASES,),
    "dwt": ("wavelet_start.json",),
    "awt": ("wavelet_start.json",),
    "lsdt-frame": ("frame_start.json", BASES),
    "lsdt-clip": ("window_start.json", BASES),
    "mdtt": ("window_start.json", BASES),
    "pca-rdo": ("window_start.json", BASES),
    "online": ("online_start.json", BASES),
    "best": ("best_start.json",),
    "posewave": ("posewave_start.json", "posewave_priors.json"),
    "fast": (),
}


def tables_for(file: File) -> set[str]:
    """The names of the annexes that decoding any clip of ``file`` may need."""
    from mcz.codecs import CODECS

    found = set(ALWAYS)
    for row in file.container.directory.clips.values():
        for signal in row.signals:
            found.update(TABLES.get(CODECS.find(signal.codec, signal.preset) or "", ()))
    for clip in file:
        try:
            models = {id_ for signal in clip.signals for id_ in models_used(signal)}
        except MczError:  # a damaged clip, which the decoder cannot read either
            continue
        found.update(f"bases_{name}.bin" for id_ in models if (name := known_model_name(id_)))
    return found


def deflated(names: Iterable[str]) -> dict[str, str]:
    """These annexes by name, each raw deflate in base64."""
    found = {}
    for name in sorted(names):
        packer = zlib.compressobj(9, zlib.DEFLATED, -15)
        data = packer.compress(annex_bytes(name)) + packer.flush()
        found[name] = base64.b64encode(data).decode()
    return found
