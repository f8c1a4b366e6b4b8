"""Hou 2016: rate and distortion of its family, its claims one by one, and what goes with them."""
