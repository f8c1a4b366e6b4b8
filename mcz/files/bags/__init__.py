"""Bags: folders of files with the checksums of each, by RFC 8493 (BagIt)."""

from mcz.files.bags.manifests import BagCheck, check_bag, is_bag
from mcz.files.bags.writer import bag

__all__ = ["BagCheck", "bag", "check_bag", "is_bag"]
