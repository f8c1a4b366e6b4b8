"""Codec qbc, ``posewave``: wavelets in time, coded in the metric of the pose."""
