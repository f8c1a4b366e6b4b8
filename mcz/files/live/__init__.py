"""Frames that come one by one -> a live clip, and back, whatever gets lost on the way."""
