"""The forms of channels: what of their ordinals is coded as integers, and back.

SPEC.md, "Codec 1: fast", is normative.
"""
