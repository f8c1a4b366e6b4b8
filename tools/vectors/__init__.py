"""What tools/make_vectors.py writes: one module a group or a part of the format."""
