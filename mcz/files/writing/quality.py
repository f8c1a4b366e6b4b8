"""The quality record: what a lossy codec changed, and how it was asked to.

SPEC.md, "QUAL", is normative; docs/reference/measures.md defines the figures.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from mcz.container import payloads
from mcz.container.chunks import ChunkType
from mcz.kinematics.joint_groups import find_feet
from mcz.kinematics.metrics import compare
from mcz.kinematics.metrics.sums import channel_errors
from mcz.model.motion import Exceptions, Motion, Signal
from mcz.model.schema import build
from mcz.model.types import JsonObject, Params, Values

CHUNK = ChunkType.QUAL
# What a record does without, for its bytes: the radius is 3 cm where it is not stated.
NOT_STORED = ("max_channel_error", "max_channel_error_frame", "max_channel_error_channel")
LEFT_OUT = (
    *("shell_radius_cm", "shell_max_frame", "shell_max_joint"),
    *("contact_frames", "slide_max_frame", "slide_max_joint"),
    *("slide_path_mm", "slide_path_original_mm"),
)


def quality_record(
    original: Motion,
    decoded: Sequence[Values],
    codec_name: str,
    options: Params,
    remarks: Mapping[str, str],
) -> dict[str, str]:
    """The entries of the record; ``decoded`` are the values of every signal as a reader has them.

    Where no point has a place, the entries ``NOT_STORED``, which are no metrics of the format, say
    what the greatest error of a channel is.
    """
    signals = tuple(map(with_values, original.signals, decoded))
    entries = quality_entries(original, replace(original, signals=signals), codec_name, options)
    if "max_position_error" not in entries:
        entries |= texts_of(_greatest_error(original, signals[0]))
    return entries | dict(remarks)


def _greatest_error(original: Motion, decoded: Signal) -> JsonObject:
    """The greatest error of a channel, less whole turns, and its frame and channel."""
    skeleton, signal = original.skeleton, original.signals[0]
    given, found = (np.asarray(one.masked(), np.float64) for one in (signal, decoded))
    with np.errstate(all="ignore"):  # what overflows is no figure
        errors = channel_errors(skeleton, signal, given, found)
    errors[~np.isfinite(errors)] = -1.0
    if not errors.size or errors.max() < 0:
        return {}
    row, column = divmod(int(errors.argmax()), errors.shape[1])
    found_at = row // signal.samples_per_frame
    own = signal.channels
    name = skeleton.channel_addresses()[column] if own is None else own[column].label
    figures = (float(errors[row, column]), found_at, name)
    return dict(zip(NOT_STORED, figures, strict=True))


def quality_payload(entries: Mapping[str, str]) -> bytes:
    """The payload of QUAL that says this."""
    stored = {key: value for key, value in entries.items() if key not in NOT_STORED}
    return build(payloads.Qual(entries=payloads.metadata_records(stored)), "quality record")


def quality_entries(
    original: Motion, decoded: Motion, codec_name: str, options: Params
) -> dict[str, str]:
    """Settings, then figures, as text; what there is no figure of is left out.

    Numbers are the shortest decimals that read back as the same binary64.
    """
    settings = {f"param.{name}": value for name, value in options.items()}
    return texts_of({"codec": codec_name, **settings, **figures(original, decoded)})


def figures(original: Motion, decoded: Motion) -> JsonObject:
    """The figures of a record by their metric ids, rounded; None where there is none."""
    contacts = bool(find_feet(original.skeleton))
    found = compare(original, decoded, contacts=contacts).entries()
    return {key: _rounded(value) for key, value in found.items() if key not in LEFT_OUT}


def _rounded(value: object) -> object:
    """Ten significant digits of a float: more than measures agree on, in fewer bytes."""
    return float(f"{value:.10g}") if isinstance(value, float) else value


def texts_of(entries: Params) -> dict[str, str]:
    """Settings or figures as text, without those that are None."""
    return {key: _text(value) for key, value in entries.items() if value is not None}


def with_values(signal: Signal, values: Values) -> Signal:
    """``signal`` with decoded values, which need not lie on its grids."""
    return replace(
        signal,
        values=np.asarray(values, np.float64),
        grids=(),
        grid_changes=(),
        exceptions=Exceptions(),
        ordinals=None,
    )


def _text(value: object) -> str:
    """
    >>> _text(0.1), _text(3), _text(True), _text((1.0, -0.5))
    ('0.1', '3', 'true', '1.0,-0.5')
    """
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return repr(float(value))
    if isinstance(value, (tuple, list)):
        return ",".join(map(_text, value))
    return str(value)
