"""Motions, skeletons and signals as values; time, units and number grids.

``motion``, ``skeleton`` and ``signal`` are the values that all folders share; ``clock`` has rates
and times, ``units`` lengths, ``numbers`` the grids of printed numbers. ``schema`` has records,
varints and deflate, and is the only module that calls construct. The rest checks arguments, formats
text, counts threads and finds annexes.

Imports ``mcz.errors`` and ``mcz.hints`` alone.
"""
