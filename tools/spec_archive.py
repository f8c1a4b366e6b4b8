"""Everything that a reader of MCZ files needs, as one file that is the same on every machine.

    python tools/spec_archive.py FOLDER

FOLDER gets ``mcz-VERSION-spec.zip``: SPEC.md, its annexes, the conformance suite, the decoders in
JavaScript and C, and SHA256SUMS of them. Members are stored, sorted, and dated 1980, so that no
version of a compressor or clock changes a byte.
"""

from __future__ import annotations

import argparse
import hashlib
import subprocess
import tomllib
import zipfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
VERSION = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["version"]
PATHS = "SPEC.md LICENSE CHANGELOG.md mcz/annex conformance tools/js tools/c".split()
BEFORE_ALL = (1980, 1, 1, 0, 0, 0)  # the earliest time that a zip can state
README = """\
MCZ {version}: the specification, and what it takes to read files by it.

SPEC.md              the format; with conformance/annex it is complete
conformance/         vectors, their expected results, and a runner for decoders (README.md)
tools/js, tools/c    decoders: all of the format in JavaScript, its core in C (README.md of each)
SHA256SUMS           of every other file: sha256sum -c SHA256SUMS

SPEC.md, conformance/annex, conformance/vectors and conformance/manifest.json: CC0 1.0.
The rest: Apache-2.0 (LICENSE).
"""


def members() -> dict[str, bytes]:
    """Contents of the files under version control by name, without the list of hashes."""
    listing = subprocess.run(
        ["git", "ls-files", "-z", *PATHS], cwd=ROOT, check=True, capture_output=True, text=True
    )
    files = {"README.txt": README.format(version=VERSION).encode()}
    for name in listing.stdout.split("\0")[:-1]:
        path = ROOT / name
        if not path.is_dir():  # a link
            files[name.replace("mcz/annex", "conformance/annex")] = path.read_bytes()
    return files


def write(folder: Path) -> Path:
    """Write the archive into a folder, and give its path."""
    files = members()
    sums = (f"{hashlib.sha256(data).hexdigest()}  {name}\n" for name, data in sorted(files.items()))
    files["SHA256SUMS"] = "".join(sums).encode()
    folder.mkdir(parents=True, exist_ok=True)
    target = folder / f"mcz-{VERSION}-spec.zip"
    with zipfile.ZipFile(target, "w", zipfile.ZIP_STORED) as archive:
        for name, data in sorted(files.items()):
            entry = zipfile.ZipInfo(f"mcz-{VERSION}-spec/{name}", BEFORE_ALL)
            entry.create_system, entry.external_attr = 3, 0o100644 << 16
            archive.writestr(entry, data)
    return target


def main() -> None:
    assert __doc__
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("folder", type=Path)
    target = write(parser.parse_args().folder)
    data = target.read_bytes()
    print(f"{target}  {len(data):,} bytes  sha256 {hashlib.sha256(data).hexdigest()}")


if __name__ == "__main__":
    main()
