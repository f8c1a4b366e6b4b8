"""The clips of a run, and what of them is coded how."""

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
)  # presets that follow a paper, looked for in every codec
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
class Loaded:
    """A case in memory; ``digest`` is that of all that its figures depend on."""

    motion: Motion
    data: bytes
    digest: str


@lru_cache(maxsize=2)
def load(case: Case) -> Loaded:
    """The motion of a case; raises SourceError or OptionError."""
    motion = mcz.read(case.path, unit=case.unit)
    data = Path(case.path).read_bytes()
    seed = hashlib.sha256(data)
    seed.update(repr((motion.skeleton.joints, motion.skeleton.unit_cm, case.unit)).encode())
    return Loaded(motion, data, seed.hexdigest())


@dataclass(frozen=True, slots=True)
class Variant:
    """A codec with the parameters that set it apart, its dial left free."""

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
    def published(self) -> bool:
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
    """Each codec as it is and with each published preset; all codecs where none is named.

    A name may be narrower: ``qbc:khan2014``, ``qbc:breaks=fewest`` is that alone. Raises
    OptionError for what no codec has.
    """
    found: list[Variant] = []
    for name in names or [codec.name for codec in CODECS.values()]:
        word, *settings = name.split(":")
        codec = codec_by_name(word)
        if settings:
            params = {k: _value(v) for k, v in (_pair(setting) for setting in settings)}
            codec.options(params)
            found.append(Variant(word, tuple(params.items())))
        else:
            found.append(Variant(word))
            found += [preset_of(word, preset) for preset in PUBLISHED if has_preset(codec, preset)]
    return list(dict.fromkeys(found))


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
    """The cases that files and folders stand for, each once.

    Of a folder everything below it counts, .amc before .bvh before .c3d. Raises OptionError where
    nothing is found.
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


def named(cases: Sequence[Case]) -> dict[str, Case]:
    """Cases by name; of cases of one name all but the first by their path."""
    found: dict[str, Case] = {}
    for case in cases:
        found[case.path if case.name in found else case.name] = case
    return found


def why(error: MczError) -> str:
    return " ".join(str(error).split())
