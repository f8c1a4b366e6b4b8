"""Shared parts of generators: files, motions, source files and streams to order."""
