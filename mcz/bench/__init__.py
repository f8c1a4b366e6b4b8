"""Every codec on the same clips: sizes, errors, speeds, memory, and the papers' tables.

A part of its own on top of all others, which ``mcz bench`` prints; importing ``mcz`` leaves it out.
``measure.py`` takes the figures, ``ladder.py`` finds the settings, ``tasks.py`` runs the work in
processes and keeps its results, ``sweep.py`` and the files named after papers make the tables.
"""
