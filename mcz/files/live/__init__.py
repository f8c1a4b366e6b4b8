"""Frames that come one by one -> a live clip, and back, with or without losses."""
