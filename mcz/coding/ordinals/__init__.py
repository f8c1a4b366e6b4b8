"""Ordinals of channels to the stream of a group, and back.

SPEC.md, "Codec 128: lossless", is normative; other codecs have such streams, too.
"""
