"""The tasks of Kwak and Bajic's tables, by name."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from mcz.bench.cases import Case, Variant
from tools.papers.kwak import coder, measure
from tools.papers.kwak import losses as loss
from tools.papers.kwak.clips import Clip

STUDIES = {
    "periods": coder.periods,
    "resets": coder.resets,
    "packets": coder.packets,
    "losses": loss.losses,
}


def perform(case: Case, variant: Variant, what: str, form: str, *arguments: Any) -> Any:
    """One of them; raises MotionError, OptionError or SourceError."""
    clip = Clip(case, form)
    if what == "rates":
        return measure.rates(clip, variant.params, *arguments)
    if what == "files":
        return measure.file_points(clip, variant, *arguments)
    (targets,) = arguments
    if what == "coders":
        return coder.coders(clip, targets)
    return STUDIES[what](clip, *targets)


def speeds(case: Case, form: str, given: Sequence[Any]) -> Any:
    """``given``: codec, its parameters, more of them."""
    variants = [(Variant(codec, params), more) for codec, params, more in given]
    return measure.speeds(Clip(case, form), variants)
