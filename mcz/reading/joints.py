"""Joints as callers name them: one or several, by index or by name."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

Chosen = Sequence[int | str] | int | str
Joints = Chosen | None  # None: all


def joint_list(joints: Chosen) -> Sequence[int | str]:
    """Joints as a sequence; a single one may be given by itself."""
    return (joints,) if isinstance(joints, (int, np.integer, str)) else joints
