"""Recovery data: blocks computed from the bytes of a file, from which lost ones are found again.

``code`` is the erasure code, ``layout`` the places and the packets of blocks, ``encoder`` makes
them. SPEC.md, "RECV", is normative.
"""
