"""Wavelets in time, channel by channel: mrdwt, dwt and awt."""
