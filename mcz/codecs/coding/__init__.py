"""Entropy coding: integers only, coder state in u32. SPEC.md, "Entropy coding", is normative."""
