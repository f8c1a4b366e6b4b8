"""Faults of clips of more than one codec: functions that add them to the shelf of any."""
