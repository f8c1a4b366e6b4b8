"""Content of the conformance vectors: valid/, uncommon/ and invalid/ hold a module per folder;
build/ holds shared generators, the rest the manifest's text about each file.
"""
