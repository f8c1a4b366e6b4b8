"""Motions from and to objects of other libraries; docs/guides/adapters.md has the table.

Each library is imported on first use. Its binary64 numbers are kept exactly; contents that it
cannot hold are refused, or left out by that table.
"""
