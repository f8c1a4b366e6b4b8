"""What a Clip shows of its poses: the functions of ``mcz.poses``, of which it decodes a part."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import DTypeLike

from mcz.displays import html_of
from mcz.skeleton import Joints, joint_list
from mcz.types import Reals

if TYPE_CHECKING:
    from mcz.kinematics.contacts import ContactRule, Contacts
    from mcz.motion import Motion
    from mcz.poses import Root
    from mcz.poses.moving import Decoded, Frames


class Posed:
    """What a Clip has of ``mcz.poses``, which has the conventions and is imported on use."""

    _repr_html_ = html_of

    @property
    def _clip(self) -> Decoded:
        return cast("Decoded", self)

    @property
    def _whole(self) -> Motion:
        return cast("Motion", cast(Any, self).motion())

    @property
    def joint_names(self) -> tuple[str, ...]:
        """The names of the joints, ``name#n`` where one repeats."""
        return tuple(self._clip.skeleton.addresses())

    @property
    def point_names(self) -> tuple[str, ...]:
        """The names of the points of ``positions``, in their order."""
        from mcz.poses import places

        return places.point_names(self._clip)

    def positions(
        self,
        joints: Joints = None,
        frames: Frames = None,
        *,
        unit: str | None = None,
        dtype: DTypeLike = np.float64,
    ) -> Reals:
        """Where the points are, (n_frames, n_points, 3): see ``mcz.positions``."""
        from mcz.poses import places

        return places.positions(self._clip, joints, frames, unit=unit, dtype=dtype)

    def rotations(
        self,
        form: str = "quat",
        *,
        space: str = "local",
        joints: Joints = None,
        frames: Frames = None,
        order: str = "XYZ",
        degrees: bool = False,
        dtype: DTypeLike = np.float64,
    ) -> Reals:
        """How the joints are turned, (n_frames, n_joints, ...): see ``mcz.rotations``."""
        from mcz.poses import turns

        return turns.rotations(
            self._clip,
            form,
            space=space,
            joints=joints,
            frames=frames,
            order=order,
            degrees=degrees,
            dtype=dtype,
        )

    def root(
        self,
        frames: Frames = None,
        *,
        joint: int | str | None = None,
        unit: str | None = None,
        dtype: DTypeLike = np.float64,
    ) -> Root:
        """Where the root is and how it is turned: see ``mcz.root``."""
        from mcz.poses import places

        return places.root(self._clip, frames, joint=joint, unit=unit, dtype=dtype)

    def velocities(
        self,
        joints: Joints = None,
        frames: Frames = None,
        *,
        unit: str | None = None,
        dtype: DTypeLike = np.float64,
    ) -> Reals:
        """How fast the points move, (n_frames, n_points, 3): see ``mcz.velocities``."""
        from mcz.poses import places

        return places.velocities(self._clip, joints, frames, unit=unit, dtype=dtype)

    def accelerations(
        self,
        joints: Joints = None,
        frames: Frames = None,
        *,
        unit: str | None = None,
        dtype: DTypeLike = np.float64,
    ) -> Reals:
        """How velocities change, (n_frames, n_points, 3): see ``mcz.accelerations``."""
        from mcz.poses import places

        return places.accelerations(self._clip, joints, frames, unit=unit, dtype=dtype)

    def to_xarray(
        self, *, form: str = "quat", unit: str | None = None, dtype: DTypeLike = np.float64
    ) -> Any:
        """The whole clip as an ``xarray.Dataset``: see ``mcz.to_xarray``."""
        from mcz.tables.labelled import to_xarray

        return to_xarray(self._whole, form=form, unit=unit, dtype=dtype)

    def to_pandas(
        self,
        what: str = "positions",
        *,
        joints: Joints = None,
        unit: str | None = None,
        flat: bool = False,
    ) -> Any:
        """A table of the whole clip as a ``pandas.DataFrame``: see ``mcz.to_pandas``."""
        from mcz.tables.frames import to_pandas

        return to_pandas(self._whole, what, joints=joints, unit=unit, flat=flat)

    def contacts(self, joints: Joints = None, rule: ContactRule | None = None) -> Contacts:
        """In which frames feet stand, of the whole clip: see ``mcz.contacts``."""
        from mcz.kinematics.contacts import RULE, contacts

        feet = None if joints is None else joint_list(joints)
        return contacts(self._whole, feet, rule or RULE)
