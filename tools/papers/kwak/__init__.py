"""Kwak and Bajic: rate control, rate and distortion, their claims one by one, losses."""
