"""Bytes <-> chunks <-> segments <-> streams, and the payloads that no codec is needed for.

``chunks`` frames them, ``payloads`` has their schemas, ``segments`` and ``packets`` are DATA,
``directory`` is INDX, ``scan`` and ``reader`` read files, ``writer`` writes them.
"""
