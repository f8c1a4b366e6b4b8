"""Recovery data: blocks computed from the bytes of a file, which restore lost ones.

``code`` is the erasure code, ``blocks`` defines the places and packets of blocks and computes them.
SPEC.md, "RECV", is normative.
"""
