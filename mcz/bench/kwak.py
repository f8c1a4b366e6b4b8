"""Kwak and Bajic: rate control, rate and distortion, their claims one by one, losses."""

from __future__ import annotations

from mcz.bench.kwak_clips import NAMES, find_clips
from mcz.bench.kwak_panels import panels
from mcz.bench.kwak_tables import tables
from mcz.bench.kwak_tasks import Found, measure, missing

__all__ = ["NAMES", "Found", "find_clips", "measure", "missing", "panels", "tables"]
