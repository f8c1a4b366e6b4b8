"""Ordinals coded to be read quickly: columns one after the other, one table look-up a value."""
