"""Every codec on the same clips: sizes, errors, speeds, memory.

The top layer, used by ``mcz bench`` alone; importing ``mcz`` leaves it out. ``measure.py`` computes
the figures and chooses the settings, ``tasks.py`` runs the work in processes and caches its
results, ``sweep.py`` makes the tables, ``report.py`` the whole report. A runner accepts more kinds
of work: tools/papers builds the papers' tables so.
"""
