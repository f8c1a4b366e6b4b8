"""The build of kernels: Python functions of numbers and arrays, compiled by Cython.

``python -m tools.kernels`` builds them in place, for a checkout that is not installed.
"""
