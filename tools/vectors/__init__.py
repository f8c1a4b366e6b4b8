"""What tools/make_vectors.py writes: valid/, uncommon/ and invalid/ have a module a folder of
conformance/vectors, build/ what they share; the rest says what the manifest says of each file.
"""
