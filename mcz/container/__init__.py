"""Bytes <-> chunks <-> segments <-> streams, and the payloads that need no codec.

``parser`` is the one parser of files: bytes in, events out. ``chunks`` frames chunks, ``payloads``
defines their records, ``model_records`` converts those of skeletons and times; ``segments`` is
DATA, ``directory`` INDX. ``scanner``, ``scan`` and ``reader`` read files, ``writer`` writes them;
``http`` reads them from a server. ``recovery`` computes and applies RECV.

Imports ``mcz.model``. Codecs are numbers here.
"""
