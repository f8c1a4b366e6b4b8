"""Hou 2016: rate and distortion of its family, its claims one by one, and what goes with them."""

from __future__ import annotations

from mcz.bench.hou2016_tables import panels, tables
from mcz.bench.hou2016_tasks import NAMES, Found, measure, missing, others

__all__ = ["NAMES", "Found", "measure", "missing", "others", "panels", "tables"]
