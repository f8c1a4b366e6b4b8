"""The version of the package, which files that others read name as their generator."""

VERSION = "1.0.0"
