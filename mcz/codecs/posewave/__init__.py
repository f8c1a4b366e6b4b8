"""Codec 3, ``posewave``: wavelets in time, coded in the metric of the pose."""
