"""Bone lengths of a body from the user's model file and the betas of the clip."""

from __future__ import annotations

import os
from dataclasses import replace
from functools import lru_cache
from io import BytesIO
from pathlib import Path

import numpy as np

from mcz.errors import (
    AccessError,
    OptionError,
    SourceError,
    reason_of,
)
from mcz.model.motion import Motion, Source
from mcz.sources.arrays.body_models import offsets_of_model
from mcz.sources.arrays.body_trees import has_tree, tree
from mcz.sources.arrays.facts import SHAPE
from mcz.sources.arrays.header import MAGIC
from mcz.sources.arrays.layout import parse_arrays
from mcz.sources.arrays.listing import members_of

BODY, GENDER = "{body}", "{gender}"  # in the name of a model file


def with_model(motion: Motion, model: str | os.PathLike[str]) -> Motion:
    """``motion``, that of a body of an NPZ, with the offsets that a model has for its betas.

    ``model`` is a file as of ``mcz.offsets_of_model``; "{gender}" in it stands for the gender that
    the take states, "{body}" for smpl, smplh or smplx. Numbers and source stay as they are. A
    motion of anything else is returned as it is. Raises what ``offsets_of_model`` does, and
    OptionError where no gender is stated.
    """
    skeleton, source = motion.skeleton, motion.source
    if source is None or source.format != "npz" or not has_tree(skeleton.n_joints):
        return motion
    body = tree(skeleton.n_joints)
    if skeleton.joint_names != body.names:
        return motion
    path = os.fspath(model).replace(BODY, body.name)
    if GENDER in path:
        gender = motion.metadata.get("x-gender", "")
        if not gender.isalnum():
            raise OptionError(f"the take states no gender, but {gender!r}", path=path)
        path = path.replace(GENDER, gender)
    offsets = _offsets(path, _modification_time(path), skeleton.n_joints, _betas(source))
    joints = tuple(
        replace(joint, offset=offset)
        for joint, offset in zip(skeleton.joints, offsets, strict=True)
    )
    return replace(motion, skeleton=replace(skeleton, joints=joints))


def _modification_time(path: str) -> int:
    try:
        return Path(path).stat().st_mtime_ns
    except OSError as error:
        raise AccessError(reason_of(error), path=path) from None


@lru_cache(maxsize=64)  # the takes of a subject have the same betas, and models are large
def _offsets(
    path: str, changed: int, n_joints: int, betas: tuple[float, ...] | None
) -> tuple[tuple[float, float, float], ...]:
    offsets = offsets_of_model(path, n_joints, None if betas is None else np.array(betas))
    return tuple((x, y, z) for x, y, z in offsets.tolist())


def _betas(source: Source) -> tuple[float, ...] | None:
    """The numbers of ``betas``, which a file keeps beside its signals; None where it has none."""
    members = dict(members_of(parse_arrays(source.template, source.detail)))
    data = b"".join(piece.text for piece in members.get(SHAPE, ()))
    if MAGIC not in data:
        return None  # none, or deflated
    try:
        betas = np.lib.format.read_array(BytesIO(data[data.index(MAGIC) :]), allow_pickle=False)
        rows = np.asarray(betas, np.float64).reshape(-1, betas.shape[-1] if betas.ndim else 1)
    except (ValueError, TypeError, EOFError, SyntaxError) as error:
        raise SourceError(f"{SHAPE}: {error}") from None
    if not len(rows) or (rows != rows[0]).any():
        raise SourceError(f"{SHAPE} of shape {betas.shape} say more than one shape of a body")
    return tuple(rows[0].tolist())
