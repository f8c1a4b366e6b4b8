"""Motion for other formats and libraries.

``conversion`` turns a motion into one for another source format, or into a scene (glTF, USD);
``exporting`` does so for the clips of an archive. ``adapters`` hand over to other libraries,
``datasets`` cuts windows for training.

Imports ``mcz.files`` and the rooms below it.
"""
