"""The tables and plots of the papers that codecs follow, with ours beside them, printed anew.

    python -m tools.papers khan2014|khan2016|hou2016|kwak CLIP-OR-FOLDER... --out DIR --jobs N

A folder a paper: ``printed.py`` is what the paper says, ``tables.py``, ``claims.py`` and
``panels.py`` set ours beside it, ``run.py`` goes from clips to figures.
All of it stands upon ``mcz.bench``, whose runner is given the kinds of work of ``kinds.py``.
"""
