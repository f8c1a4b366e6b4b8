"""Every codec on the same clips: sizes, errors, speeds, memory.

A part of its own on top of all others, which ``mcz bench`` prints; importing ``mcz`` leaves it out.
``measure.py`` takes the figures, ``ladder.py`` finds the settings, ``tasks.py`` runs the work in
processes and keeps its results, ``sweep.py`` makes the tables, ``report.py`` the whole. More kinds
of work can be given to a runner: tools/papers builds the papers' tables that way.
"""
