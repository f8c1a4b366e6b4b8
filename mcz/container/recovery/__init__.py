"""Recovery data: blocks computed from the bytes of a file, from which lost ones are found again.

``field`` is the arithmetic, ``code`` the erasure code, ``shape`` what lies where, ``packets`` how
it is written. SPEC.md, "RECV", is normative.
"""
