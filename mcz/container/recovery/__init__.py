"""Recovery data: blocks computed from the bytes of a file, which restore lost ones.

``code`` is the erasure code, ``layout`` defines the places and packets of blocks, ``encoder``
computes them. SPEC.md, "RECV", is normative.
"""
