"""Rest offsets of a body: from a model file of the user's own, or from positions of a data set.

MCZ has no such offsets and ships none. A model file is an NPZ as the makers of SMPL give it out.
Nothing in it is ever unpickled: a pickle can run any program.
"""

from __future__ import annotations

import os
import zipfile
import zlib
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from io import BytesIO
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcz.errors import AccessError, OptionError, SourceError, reason_of
from mcz.model.checks import NUMBERS, PATH, check_arguments
from mcz.model.motion import Motion, Source
from mcz.model.types import Items
from mcz.sources.arrays.columns import MAGIC
from mcz.sources.arrays.interpretation import SHAPE
from mcz.sources.arrays.layout import members_of, parse_arrays
from mcz.sources.arrays.skeletons import has_tree, tree

Floats = NDArray[np.float64]

MOST_BYTES = 2**30  # of one array: shapes of SMPL-X have 100 MB
PICKLES = (".pkl", ".pickle")
UNREADABLE = (zipfile.BadZipFile, NotImplementedError, RuntimeError, EOFError, zlib.error)
UNPICKLED = (
    "a pickle can run any program, so it is never opened here; if you trust it, rewrite it "
    "in Python: m = pickle.load(open('model.pkl', 'rb'), encoding='latin1'); numpy.savez("
    "'model.npz', J_regressor=m['J_regressor'].toarray(), v_template=numpy.array(m['v_template']), "
    "shapedirs=numpy.array(m['shapedirs']), kintree_table=m['kintree_table']), without .toarray() "
    "if it is dense"
)
UNSHAPED = (
    "J has the joints without betas; to shape them, J_regressor, v_template and "
    "shapedirs of the model are needed as well"
)
NOT_DENSE = (
    "a pickled object, as of a sparse matrix, is never opened here; if you trust the file, "
    "write a dense one in Python: m = dict(numpy.load('model.npz', allow_pickle=True)); "
    "numpy.savez('dense.npz', J_regressor=m['J_regressor'].item().toarray(), v_template="
    "m['v_template'], shapedirs=m['shapedirs'], kintree_table=m['kintree_table'])"
)


class FoundOffsets(NamedTuple):
    """``offsets`` (n_joints, 3); ``rms`` and ``greatest`` are what the positions miss them by.

    Bones whose lengths change over time, as markers on skin do, are where the two are large.
    """

    offsets: Floats
    rms: float
    greatest: float


@check_arguments(path=PATH)
def offsets_of_model(
    path: str | os.PathLike[str], n_joints: int, betas: ArrayLike | None = None
) -> Floats:
    """Rest offsets from each parent to its joint, (n_joints, 3), in meters; of the root from 0.

    ``path`` is a model file of SMPL, SMPL-H or SMPL-X: an NPZ with ``kintree_table`` and either
    ``J``, where joints are, or ``J_regressor`` (dense) and ``v_template``. ``betas`` shape the
    body, which needs the latter and ``shapedirs``. A model of more joints will do if its first
    ``n_joints`` are those of the body tree of as many.

    Raises AccessError for a file that cannot be read, SourceError for one that is no such model
    or holds pickled arrays alone, OptionError for betas or joints that it does not have.
    """
    file = Path(path)
    if file.suffix.lower() in PICKLES:
        raise SourceError(UNPICKLED, path=file)
    try:
        with zipfile.ZipFile(file) as archive:
            model = _Model(file, archive)
            parents = model.parents()
            joints = model.joints(betas)
    except OSError as error:
        raise AccessError(reason_of(error), path=file) from None
    except UNREADABLE as error:
        raise SourceError(f"cannot read it as an NPZ: {error}", path=file) from None
    if joints.shape != (len(parents), 3) or not np.isfinite(joints).all():
        raise SourceError(
            f"joints have shape {joints.shape}, but kintree_table has {len(parents)} joints",
            path=file,
        )
    if n_joints > len(parents):
        raise OptionError(f"the model has {len(parents)} joints; expected {n_joints}", path=file)
    _check_tree(file, parents, n_joints)
    return offsets_of_joints(joints[:n_joints], parents[:n_joints])


def offsets_of_joints(joints: ArrayLike, parents: Sequence[int]) -> Floats:
    """From each parent to its joint at rest, (n_joints, 3); for a root, its position."""
    places = np.asarray(joints, np.float64)
    offsets = places.copy()
    for joint, parent in enumerate(parents):
        if parent >= 0:
            offsets[joint] -= places[parent]
    return offsets


@check_arguments(positions=NUMBERS, rotations=NUMBERS, parents=NUMBERS)
def offsets_from_positions(
    positions: ArrayLike,
    rotations: ArrayLike,
    parents: Sequence[int] | NDArray[np.integer],
    translations: ArrayLike | None = None,
) -> FoundOffsets:
    """The offsets that fit positions of joints best, in the sense of least squares.

    ``positions`` (n_frames, n_joints, 3); ``rotations`` (n_frames, n_joints, 3, 3), matrices of
    each joint's turn from its parent; ``parents`` of each joint, -1 of a root. Offsets are in the
    unit of the positions. That of a root is from ``translations`` (n_frames, 3) to it, or 0 if
    there are none: then the root's positions are its translations. Frames in which a number is
    not finite do not count. Raises OptionError if shapes do not match, or nothing is known.
    """
    places, turns = np.asarray(positions, np.float64), np.asarray(rotations, np.float64)
    shape = len(places), len(parents), 3
    if places.shape != shape or turns.shape != (*shape, 3):
        raise OptionError(
            f"positions of shape {places.shape} and rotations of shape {turns.shape} do not "
            f"fit {len(parents)} joints: (n_frames, n_joints, 3) and (n_frames, n_joints, 3, "
            "3)"
        )
    moves = places[:, 0] if translations is None else np.asarray(translations, np.float64)
    if moves.shape != (len(places), 3):
        raise OptionError(f"translations of shape {moves.shape} do not fit {len(places)} frames")
    offsets, squares, greatest, count = np.zeros((len(parents), 3)), 0.0, 0.0, 0
    worlds: list[Floats] = []
    for joint, parent in enumerate(parents):
        if not -1 <= parent < joint:
            raise OptionError(f"joint {joint}: its parent {parent} must precede it")
        above = np.broadcast_to(np.eye(3), (len(places), 3, 3)) if parent < 0 else worlds[parent]
        worlds.append(above @ turns[:, joint])
        if parent < 0 and translations is None:
            continue
        step = places[:, joint] - (moves if parent < 0 else places[:, parent])
        # Rotations keep lengths: the best offset is the mean of what the parent sees.
        seen = np.einsum("fji,fj->fi", above, step)
        seen = seen[np.isfinite(seen).all(axis=1)]
        if not len(seen):
            raise OptionError(f"joint {joint}: no frame shows its offset from its parent")
        offsets[joint] = seen.mean(axis=0)
        away = np.square(seen - offsets[joint]).sum(axis=1)
        squares, count = squares + float(away.sum()), count + len(away)
        greatest = max(greatest, float(np.sqrt(away.max())))
    return FoundOffsets(offsets, float(np.sqrt(squares / max(1, count))), greatest)


def _check_tree(file: Path, parents: list[int], n_joints: int) -> None:
    """Raise OptionError if the model's joints are not those of the body tree."""
    if not has_tree(n_joints):
        return
    body = tree(n_joints)
    for joint, (parent, body_parent) in enumerate(zip(parents, body.parents, strict=False)):
        if parent != body_parent:
            raise OptionError(
                f"joint {joint} is a child of joint {parent}, but {body.names[joint]!r} of "
                f"{body.title} is a child of {body_parent}: the model has other joints",
                path=file,
            )


class _Model:
    """The arrays of an NPZ, each read when it is asked for, never unpickled."""

    def __init__(self, file: Path, archive: zipfile.ZipFile) -> None:
        self.file, self.archive = file, archive
        self.names = set(archive.namelist())

    def has(self, name: str) -> bool:
        return f"{name}.npy" in self.names

    def array(self, name: str) -> Items:
        """The numbers of a member; raises SourceError for one that is not there or is no such."""
        where = f"{self.file}: {name}"
        if not self.has(name):
            names = ", ".join(sorted(n.removesuffix(".npy") for n in self.names)[:12])
            raise SourceError(f"{where} is missing among {names}: not a body model")
        info = self.archive.getinfo(f"{name}.npy")
        with self.archive.open(info) as member:
            try:
                version = np.lib.format.read_magic(member)
                read = {
                    (1, 0): np.lib.format.read_array_header_1_0,
                    (2, 0): np.lib.format.read_array_header_2_0,
                }[version]
                shape, is_fortran, dtype = read(member)
            except (ValueError, KeyError, SyntaxError) as error:
                raise SourceError(f"not an NPY array: {error}", where=where) from None
            if dtype.hasobject:
                raise SourceError(NOT_DENSE, where=where)
            if dtype.kind not in "fiu":
                raise SourceError(f"the type is {dtype}, not a number", where=where)
            size = int(np.prod(shape, dtype=object)) * dtype.itemsize
            if size > min(MOST_BYTES, info.file_size):
                raise SourceError(f"{size} bytes of shape {shape} are missing", where=where)
            data = member.read(size)
        if len(data) != size:
            raise SourceError(f"only {len(data)} of {size} bytes are present", where=where)
        return np.frombuffer(data, dtype).reshape(shape, order="F" if is_fortran else "C")

    def parents(self) -> list[int]:
        table = self.array("kintree_table")
        if table.ndim != 2 or len(table) < 1 or not table.shape[1]:
            raise SourceError(f"kintree_table of shape {table.shape}, not (2, n)", path=self.file)
        parents = [int(parent) for parent in table[0]]
        parents[0] = -1  # files have 2^32 - 1, or -1
        for joint, parent in enumerate(parents[1:], 1):
            if not 0 <= parent < joint:
                raise SourceError(
                    f"joint {joint}: its parent {parent} must precede it", path=self.file
                )
        return parents

    def joints(self, betas: ArrayLike | None) -> Floats:
        """Positions of the joints at rest, (n_joints, 3)."""
        if betas is None and self.has("J"):
            return np.asarray(self.array("J"), np.float64)
        if self.has("J") and not self.has("J_regressor"):
            if np.any(betas):
                raise SourceError(UNSHAPED, path=self.file)
            return np.asarray(self.array("J"), np.float64)
        regressor, vertices = self.array("J_regressor"), self.array("v_template")
        if regressor.ndim != 2 or vertices.shape != (regressor.shape[1], 3):
            raise SourceError(
                f"J_regressor of shape {regressor.shape} does not fit v_template of shape "
                f"{vertices.shape}",
                path=self.file,
            )
        shaped = np.asarray(vertices, np.float64)
        if betas is not None:
            shaped = shaped + self._shape(np.asarray(betas, np.float64), len(vertices))
        joints: Floats = np.asarray(regressor, np.float64) @ shaped
        return joints

    def _shape(self, betas: Floats, n_vertices: int) -> Floats:
        directions = self.array("shapedirs")
        if directions.ndim != 3 or directions.shape[:2] != (n_vertices, 3):
            raise SourceError(f"shapedirs cannot have shape {directions.shape}", path=self.file)
        if betas.ndim != 1 or not np.isfinite(betas).all():
            raise OptionError(f"betas of shape {betas.shape} are not a row of finite numbers")
        n_shapes = directions.shape[2]
        if betas[n_shapes:].any():
            raise OptionError(
                f"{len(betas)} betas are given, but the model has {n_shapes}", path=self.file
            )
        betas = betas[:n_shapes]
        shape: Floats = directions[:, :, : len(betas)].astype(np.float64) @ betas
        return shape


BODY, GENDER = "{body}", "{gender}"  # in the name of a model file


def with_model(motion: Motion, model: str | os.PathLike[str]) -> Motion:
    """``motion``, that of a body of an NPZ, with the offsets that a model has for its betas.

    ``model`` is a file as of ``mcz.offsets_of_model``; "{gender}" in it stands for the gender that
    the take states, "{body}" for smpl, smplh or smplx. Numbers and source stay as they are. A
    motion of anything else is returned as it is. Raises what ``offsets_of_model`` does, and
    OptionError if no gender is stated.
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
            raise OptionError(
                f"{GENDER} needs the gender of the take, which is {gender!r}",
                path=path,
            )
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
    """The numbers of ``betas``, which a file keeps beside its signals; None if it has none."""
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
        raise SourceError(f"{SHAPE} of shape {betas.shape} holds more than one body shape")
    return tuple(rows[0].tolist())
