"""The tasks of Kwak and Bajic's tables, by name."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from mcz.bench import kwak_coder, kwak_losses, kwak_measure
from mcz.bench.cases import Case, Variant
from mcz.bench.kwak_clips import Clip

STUDIES = {
    "periods": kwak_coder.periods,
    "resets": kwak_coder.resets,
    "packets": kwak_coder.packets,
    "losses": kwak_losses.losses,
}


def perform(case: Case, variant: Variant, what: str, form: str, *arguments: Any) -> Any:
    """One of them; raises MotionError, OptionError or SourceError."""
    clip = Clip(case, form)
    if what == "rates":
        return kwak_measure.rates(clip, variant.params, *arguments)
    if what == "files":
        return kwak_measure.file_points(clip, variant, *arguments)
    (targets,) = arguments
    if what == "coders":
        return kwak_coder.coders(clip, targets)
    return STUDIES[what](clip, *targets)


def speeds(case: Case, form: str, given: Sequence[Any]) -> Any:
    """``given``: codec, its parameters, more of them."""
    variants = [(Variant(codec, params), more) for codec, params, more in given]
    return kwak_measure.speeds(Clip(case, form), variants)
