"""Curves through the channels of a joint: qbc."""
