"""Fuzzing of every reader and decoder: ``python -m tools.fuzz --list`` says what there is.

Each target is a property that must hold for any bytes; ``guard.py`` adds that no input may take
more time or memory than it has earned. Seeds come from conformance/vectors and samples.
"""
