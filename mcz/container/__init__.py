"""Bytes <-> chunks <-> segments <-> streams, and the payloads that no codec is needed for.

``parser`` is the one parser of files: bytes in, events out. ``chunks`` frames chunks, ``payloads``
has their records, ``segments`` and ``packets`` are DATA, ``directory`` is INDX. ``scan``,
``strict`` and ``reader`` read files, ``writer`` writes them; ``http`` reads them from far away.
``recovery`` computes and applies RECV.

Imports ``mcz.model``. Codecs are numbers here.
"""
