"""Streams that SPEC.md shows step by step, decoded by its pseudo-code, word for word.

``tools/spec_tables.py`` puts the lines into SPEC.md. Nothing here is shared with the package.
"""
