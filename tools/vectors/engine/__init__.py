"""The engine of the tables of vectors: base files, edits, repair, rows. See ../README.md."""
