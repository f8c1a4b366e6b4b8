"""Motions from and for what other libraries hold in memory; docs/guides/adapters.md has the table.

Each library is imported when a motion is wanted for it. What it holds in binary64 is kept exactly;
what it cannot hold is refused, or left out as the table says.
"""
