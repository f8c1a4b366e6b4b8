"""Forward and inverse kinematics: the points of a skeleton and the channels that move them.

SPEC.md, "Kinematics", has the conventions and the point sets. Distances are in the length unit of
the skeleton. Everything is vectorized over frames and works in blocks of them.

``chain`` places joints, ``points`` the points of a skeleton, ``frames`` both for motions and clips;
``inverse`` fits channels to given points. ``metrics`` compares two motions, ``poses`` resamples and
differentiates, ``retargeting`` moves motions between skeletons.

Imports ``mcz.model``.
"""
