"""Uncommon, a folder a codec: later versions of codecs, and models that the file has not."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from mcz.codecs.basis_models import model_of
from mcz.codecs.contract import Codec, id_of
from mcz.container.chunks import SIGNATURE, parse_header
from mcz.motion import Motion
from tools.vectors.build import (
    curve_clips,
    online_clips,
    online_units,
    pca_clips,
    spatial_clips,
    wavelet_clips,
)
from tools.vectors.build.curve_clips import PUPPET, paths
from tools.vectors.build.edits import swap
from tools.vectors.build.files import UNSUPPORTED, Crafter, Vector, Whole, file_of, finished
from tools.vectors.build.lossless_clips import codec_of
from tools.vectors.build.motions import dance
from tools.vectors.build.online_units import HEADING
from tools.vectors.build.pca_clips import part_of
from tools.vectors.build.spatial_clips import (
    CLIP,
    FRAME,
    HEADINGS,
    MDTT,
    PCA_RDO,
    Plan,
    basis_of,
    file_with,
    motion_of,
    still,
)
from tools.vectors.build.wavelet_clips import as_codec, dance_of, waves


def vectors() -> Iterable[Vector]:
    late = Whole("uncommon/lsdt-frame", exit=(UNSUPPORTED,))
    _late_model(late)
    return [*_lossless(), *_mrdwt(), *_qbc(), *_newer(), *_spatial(), *late.vectors, *_online()]


def _late_model(shelf: Whole) -> None:
    plan = Plan(FRAME, 4, (6,), bases=(basis_of(4, 2),), fill=still)
    data = file_with(plan, index=False)
    chunks, at = [], len(SIGNATURE)
    while data[at : at + 1].isalpha():
        chunk = parse_header(data[at : at + 16], at)
        chunks.append(data[at : at + chunk.size])
        at += chunk.size
    chunks.sort(key=lambda chunk: chunk[:4] == b"MODL")
    assert chunks[-1][:4] == b"MODL"
    purpose = "A model behind the CLIP that names it: it is not there for that clip."
    moved = SIGNATURE + b"".join(chunks) + data[at:]
    shelf.add("model-later", "Grammar; Bases", purpose, moved, exit=(UNSUPPORTED,))


def _lossless() -> Iterable[Vector]:
    shelf = Whole("uncommon/lossless")
    data = file_of(dance(), codec=codec_of(version=2))
    purpose = "Version 2 of lossless, which this format does not have."
    shelf.add("newer-version", "Codecs", purpose, data, exit=(UNSUPPORTED,))
    return shelf.vectors


def _mrdwt() -> Iterable[Vector]:
    shelf = Whole("uncommon/mrdwt")
    plan = wavelet_clips.Plan(8)
    made = waves(plan, 6)
    later = replace(wavelet_clips.codec_of(plan, made), version=1)
    data = file_of(dance_of(plan, made), grouping="channel", codec=later)
    purpose = "Version 1 of mrdwt, which this format does not have."
    shelf.add("newer-version", "Codecs", purpose, data, exit=(UNSUPPORTED,))
    return shelf.vectors


def _qbc() -> Iterable[Vector]:
    shelf = Whole("uncommon/qbc")
    plan = curve_clips.Plan(9)
    made = paths(plan, PUPPET)
    later = replace(curve_clips.codec_of(plan, made), version=1)
    data = file_of(curve_clips.dance_of(plan, made), codec=later)
    purpose = "Version 1 of qbc, which this format does not have."
    shelf.add("newer-version", "Codecs", purpose, data, exit=(UNSUPPORTED,))
    return shelf.vectors


def _spatial() -> Iterable[Vector]:
    found: list[Vector] = []
    for name in (FRAME, CLIP, MDTT, PCA_RDO):
        shelf = Whole(f"uncommon/{name}")
        plan = Plan(name, segments=(4,), bases=(basis_of(3, 2),))
        crafter = Crafter()
        later = replace(spatial_clips.codec_of(plan), version=1)
        crafter.clip(motion_of(plan), codec=later, grouping="all", segment_frames=0)
        purpose = f"Version 1 of {name}, which this format does not have."
        shelf.add("newer-version", "Codecs", purpose, finished(crafter), exit=(UNSUPPORTED,))
        other = swap(id_of(model_of(plan.bases)), bytes(range(16)))
        data = file_with(plan, CLIP=other)
        purpose = "A model that the file has not, and that is not well known."
        spec = f"{HEADINGS[name]}; Bases"
        shelf.add("model-missing", spec, purpose, data, exit=(UNSUPPORTED,))
        found += shelf.vectors
    return found


def _online() -> Iterable[Vector]:
    shelf = Whole("uncommon/online")
    plan = online_units.Plan(("I4",), bases=(basis_of(3, 2),))
    crafter = Crafter()
    later = replace(online_clips.codec_of(plan), version=1)
    crafter.clip(online_clips.motion_of(plan), codec=later, grouping="all", segment_frames=0)
    purpose = "Version 1 of online, which this format does not have."
    shelf.add("newer-version", "Codecs", purpose, finished(crafter), exit=(UNSUPPORTED,))
    other = swap(id_of(model_of(plan.bases)), bytes(range(16)))
    purpose = "A model that the file has not, and that is not well known."
    data = online_clips.file_with(plan, CLIP=other)
    shelf.add("model-missing", f"{HEADING}; Bases", purpose, data, exit=(UNSUPPORTED,))
    return shelf.vectors


def _newer() -> Iterable[Vector]:
    found: list[Vector] = []
    plans: Sequence[tuple[str, Codec, Motion, str]] = (
        ("pca", *_content_of_pca(), "all"),
        ("dwt", *_content_of_waves("dwt"), "channel"),
        ("awt", *_content_of_waves("awt"), "channel"),
    )
    for name, codec, motion, grouping in plans:
        shelf = Whole(f"uncommon/{name}")
        crafter = Crafter()
        later = replace(codec, version=1)
        crafter.clip(motion, codec=later, grouping=grouping, segment_frames=0)
        purpose = f"Version 1 of {name}, which this format does not have."
        shelf.add("newer-version", "Codecs", purpose, finished(crafter), exit=(UNSUPPORTED,))
        found += shelf.vectors
    return found


def _content_of_pca() -> tuple[Codec, Motion]:
    plan = pca_clips.Plan((part_of(4, 3, 1),))
    return pca_clips.codec_of(plan), pca_clips.motion_of(plan)


def _content_of_waves(name: str) -> tuple[Codec, Motion]:
    plan = wavelet_clips.Plan(8, wavelet_clips.DB2)
    made = wavelet_clips.waves(plan)
    return as_codec(name, wavelet_clips.codec_of(plan, made)), wavelet_clips.motion_of(plan, made)
