"""The clips of a run, and the variants of codecs."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import mcz
from mcz.codecs import CODECS, codec_by_name
from mcz.codecs.contract import Codec
from mcz.errors import MczError, OptionError
from mcz.model.motion import Motion
from mcz.model.types import JsonObject, Params

PUBLISHED = (
    "khan2014",
    "khan2016",
    "hou2016",
)  # presets that follow a paper, searched in every codec
SUFFIXES = (".amc", ".bvh", ".c3d")


@dataclass(frozen=True, slots=True)
class Case:
    """A source file on disk."""

    path: str
    unit: str | None = None

    @property
    def name(self) -> str:
        return Path(self.path).stem


@dataclass(frozen=True, slots=True)
class LoadedCase:
    """A case in memory; ``digest`` covers all inputs of its figures."""

    motion: Motion
    data: bytes
    digest: str


@lru_cache(maxsize=2)
def load(case: Case) -> LoadedCase:
    """The motion of a case; raises SourceError or OptionError."""
    motion = mcz.read(case.path, unit=case.unit)
    data = Path(case.path).read_bytes()
    digest = hashlib.sha256(data)
    digest.update(repr((motion.skeleton.joints, motion.skeleton.unit_cm, case.unit)).encode())
    return LoadedCase(motion, data, digest.hexdigest())


@dataclass(frozen=True, slots=True)
class Variant:
    """A codec with the parameters that define it, without its dial."""

    codec: str
    params: tuple[tuple[str, Any], ...] = ()

    @property
    def label(self) -> str:
        """
        >>> Variant("qbc", (("preset", "khan2014"),)).label
        'qbc khan2014'
        """
        words = [str(v) if k == "preset" else f"{k}={v}" for k, v in self.params]
        return " ".join([self.codec, *words])

    @property
    def is_published(self) -> bool:
        return dict(self.params).get("preset") in PUBLISHED

    def options(self, more: Params | None = None) -> JsonObject:
        return dict(self.params) | dict(more or {})


def has_preset(codec: Codec, preset: str) -> bool:
    try:
        codec.options({"preset": preset})
    except OptionError:
        return False
    return True


def preset_of(codec: str, preset: str) -> Variant:
    return Variant(codec, (("preset", preset),))


def variants_of(names: Sequence[str]) -> list[Variant]:
    """Each codec with its defaults and with each published preset; all codecs if none is named.

    A narrower name selects one variant: ``qbc:khan2014``, ``qbc:breaks=fewest``. Raises OptionError
    for an unknown name.
    """
    variants: list[Variant] = []
    for name in names or [codec.name for codec in CODECS.values()]:
        word, *settings = name.split(":")
        codec = codec_by_name(word)
        if settings:
            params = {k: _value(v) for k, v in (_pair(setting) for setting in settings)}
            codec.options(params)
            variants.append(Variant(word, tuple(params.items())))
        else:
            variants.append(Variant(word))
            variants += [
                preset_of(word, preset) for preset in PUBLISHED if has_preset(codec, preset)
            ]
    return list(dict.fromkeys(variants))


def _pair(setting: str) -> tuple[str, str]:
    key, equals, value = setting.partition("=")
    return (key, value) if equals else ("preset", key)


def _value(text: str) -> Any:
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def find_cases(paths: Sequence[str], unit: str | None) -> list[Case]:
    """The cases of files and folders, each once.

    A folder stands for all files below it, .amc before .bvh before .c3d. Raises OptionError if
    there is none.
    """
    cases: list[Case] = []
    for path in map(Path, paths):
        files = [path]
        if path.is_dir():
            files = [f for suffix in SUFFIXES for f in sorted(path.rglob(f"*{suffix}"))]
        cases += [Case(str(file), unit) for file in files]
    if not cases:
        raise OptionError(f"no clip in {', '.join(paths) or 'nothing'}")
    return list(dict.fromkeys(cases))


def cases_by_names(cases: Sequence[Case]) -> dict[str, Case]:
    """Cases by name; the second and later ones of a name by their path."""
    by_name: dict[str, Case] = {}
    for case in cases:
        by_name[case.path if case.name in by_name else case.name] = case
    return by_name


def reason_of_failure(error: MczError) -> str:
    return " ".join(str(error).split())
