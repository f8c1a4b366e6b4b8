"""What is said of a skeleton that was fitted to positions: as JSON, and in words."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mcz.conversion import Fit


def facts_of(fit: Fit) -> dict[str, Any]:
    """What ``--json`` says of a fit."""
    keys = ("mean_error", "max_error", "marker_mean_error", "marker_max_error")
    distances = {name: getattr(fit, name) for key in keys for name in (key, f"{key}_cm")}
    return {
        "n_points": fit.n_points,
        "n_markers": fit.n_markers,
        **distances,
        "frame": fit.frame,
        "point": fit.point,
        "unsolved": list(fit.unsolved),
    }


def told(fit: Fit) -> str:
    """A fit in words."""
    scale, unit = (1.0, "units") if fit.unit_cm is None else (fit.unit_cm, "cm")
    if fit.mean_error is None or fit.max_error is None:
        text = "inverse kinematics: no position is known"
    else:
        text = (
            f"inverse kinematics: {fit.n_points} points {fit.mean_error * scale:.3g} {unit} off on "
            f"average, at most {fit.max_error * scale:.3g} {unit} (frame {fit.frame}, {fit.point})"
        )
    if fit.marker_mean_error is not None and fit.marker_max_error is not None:
        text += (
            f"; {fit.n_markers} virtual markers {fit.marker_mean_error * scale:.3g}, at most "
            f"{fit.marker_max_error * scale:.3g} {unit}"
        )
    if fit.unsolved:
        text += f"; left at 0: {', '.join(fit.unsolved)}"
    return text
