"""Streams of the codec ``fast``: linear prediction and adaptive Rice codes in integers.

SPEC.md, "Codec 1: fast", is normative. A lane is a coded channel: its leads follow one another.
"""
