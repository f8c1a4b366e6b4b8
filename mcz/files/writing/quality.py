"""The quality record: the errors of a lossy codec, and its settings.

SPEC.md, "QUAL", is normative; docs/reference/measures.md defines the figures. ``RunningFigures``
are those of a live clip.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from mcz.container import payloads
from mcz.container.chunks import ChunkType
from mcz.kinematics import point_names, point_set
from mcz.kinematics.joint_names import find_feet
from mcz.kinematics.metrics import compare
from mcz.kinematics.metrics.sums import channel_errors
from mcz.model.motion import Exceptions, Motion, Signal, Skeleton
from mcz.model.schema import build
from mcz.model.types import Floats, JsonObject, Params, Settings, Values

CHUNK = ChunkType.QUAL
# Figures that a record omits to save bytes: the radius is 3 cm unless stated.
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

    If no point has a position, the entries ``NOT_STORED``, which are not metrics of the format,
    have the greatest error of a channel.
    """
    signals = tuple(map(with_values, original.signals, decoded))
    entries = quality_entries(original, replace(original, signals=signals), codec_name, options)
    if "max_position_error" not in entries:
        entries |= texts_of(_greatest_error(original, signals[0]))
    return entries | dict(remarks)


def _greatest_error(original: Motion, decoded: Signal) -> JsonObject:
    """The greatest error of a channel, without whole turns, and its frame and channel."""
    skeleton, signal = original.skeleton, original.signals[0]
    given, decoded_values = (np.asarray(one.masked(), np.float64) for one in (signal, decoded))
    with np.errstate(all="ignore"):  # overflow is no figure
        errors = channel_errors(skeleton, signal, given, decoded_values)
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
    stored = {key: value for key, value in entries.items() if key not in NOT_STORED}
    return build(payloads.Qual(entries=payloads.metadata_records(stored)), "quality record")


def quality_entries(
    original: Motion, decoded: Motion, codec_name: str, options: Params
) -> dict[str, str]:
    """Settings, then figures, as text; None is left out.

    Numbers are the shortest decimals that read back as the same binary64.
    """
    settings = {f"param.{name}": value for name, value in options.items()}
    return texts_of({"codec": codec_name, **settings, **figures(original, decoded)})


def figures(original: Motion, decoded: Motion) -> JsonObject:
    """The figures of a record by their metric ids, rounded; None where there is none."""
    contacts = bool(find_feet(original.skeleton))
    entries = compare(original, decoded, contacts=contacts).entries()
    # Ten significant digits are more than measures agree on, in fewer bytes.
    return {
        key: float(f"{value:.10g}") if isinstance(value, float) else value
        for key, value in entries.items()
        if key not in LEFT_OUT
    }


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


class RunningFigures:
    """The errors of a quality record, frame by frame: of values and, of markers, of positions."""

    def __init__(self, skeleton: Skeleton) -> None:
        self.skeleton = skeleton
        self._positions = bool(skeleton.joints) and point_set(skeleton) == "markers"
        self._frames = self._values = self._points = 0
        self._squares = self._sum = 0.0
        self._most = -1.0
        self._where: tuple[int, int] | None = None

    def add(self, given: Floats, decoded: Floats) -> None:
        """Add a frame; NaN in ``given`` does not count."""
        with np.errstate(all="ignore"):  # overflow is no figure
            squares = np.square(decoded - given)
            self._squares, self._values = _add_valid(self._squares, self._values, squares)
            if self._positions:
                distances = np.sqrt(squares.reshape(-1, 3).sum(axis=1))
                self._sum, self._points = _add_valid(self._sum, self._points, distances)
                distances[np.isnan(distances)] = -1.0
                point = int(distances.argmax())
                if distances[point] > self._most:
                    self._most, self._where = float(distances[point]), (self._frames, point)
        self._frames += 1

    def entries(self) -> Settings:
        """The figures by their metric ids, None where there is none."""
        unit = self.skeleton.unit_cm
        figures: Settings = {"frames": self._frames, "channels": self.skeleton.n_channels}
        figures["mse_raw"] = self._squares / self._values if self._values else None
        if self._positions and self._where is not None:
            mean, (frame, point) = self._sum / self._points, self._where
            figures |= {
                "point_set": point_set(self.skeleton),
                "points": self.skeleton.n_joints,
                "unit_cm": unit,
                "mean_position_error": mean,
                "mean_position_error_cm": mean * unit if unit is not None else None,
                "max_position_error": self._most,
                "max_position_error_cm": self._most * unit if unit is not None else None,
                "max_position_error_frame": frame,
                "max_position_error_point": point_names(self.skeleton)[point],
            }
        return {k: v for k, v in figures.items() if not isinstance(v, float) or np.isfinite(v)}


def _add_valid(total: float, count: int, more: Floats) -> tuple[float, int]:
    """Add the values of ``more`` that are not NaN to a sum and a count."""
    added = float(more.sum())
    if added == added:
        return total + added, count + more.size
    valid = ~np.isnan(more)
    return total + float(more[valid].sum()), count + int(np.count_nonzero(valid))
