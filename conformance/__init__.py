"""Vectors, manifest and runner that tell an implementer where a decoder is wrong."""
