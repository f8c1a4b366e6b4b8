"""Pictures of motions: films, stills and contact sheets, plots of numbers, lines for a terminal.

``rendering`` and ``plotting`` are the entry points. matplotlib draws everything, without a screen
and without a graphics card; it is imported when the first picture is drawn.
"""
