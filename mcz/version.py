"""The version of the package, which files that others read name as their generator."""

VERSION = "0.99.0"
