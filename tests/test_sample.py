"""The generated walk, to the byte."""

from __future__ import annotations

import hashlib
from pathlib import Path

# A change here changes what every newcomer sees first: make it on purpose.
SHA256 = {
    "walk.asf": "a5b003043808847baa715e5fa81004882edc8f81ed5154d8e02a0160b7de584a",
    "walk.amc": "2d49b636d6f50ff1a170d403eaa665938e4b88950f3bf27e566312e164201da3",
    "walk.bvh": "a6e486a9c552992490e6bd9c5e2df769acc04ccfefdf1e86a4dc3fb35cfd913e",
    "walk.c3d": "998a58d890556986e9b0bd96728f8f94df6d014af3cc08888f818178a20bc865",
}


def test_files_are_the_same_everywhere(samples: Path) -> None:
    data = {name: hashlib.sha256((samples / name).read_bytes()).hexdigest() for name in SHA256}
    assert data == SHA256
