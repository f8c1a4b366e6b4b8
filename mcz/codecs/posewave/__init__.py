"""Codec 13, ``posewave``: wavelets in time, coded in the metric of the pose."""
