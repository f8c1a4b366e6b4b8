"""Motion for other formats and libraries.

``conversion`` converts a motion for another source format, or to a scene (glTF, USD); ``exporting``
does so for the clips of an archive. ``adapters`` convert to objects of other libraries,
``datasets`` cuts windows for training.

Imports ``mcz.files`` and the folders below it.
"""
