"""Motion on a screen: the viewer's server, players, pictures and plots.

``viewing`` serves and builds the page of ``tools/viewer``, ``pictures`` draws with matplotlib,
``rerun`` logs to Rerun.

Imports ``mcz.files`` and the folders below it.
"""
