"""The add-on as one zip that Blender installs: the same bytes from the same tree.

    python tools/blender/build.py [--wheels DIR] [--platform linux-x64] [--out dist]

It holds the add-on's modules, and ``mcz`` as a wheel, which needs nothing but Blender's NumPy.
``--wheels`` adds those of a folder, such as llvmlite, with which loops are compiled; they are of
one platform, which ``--platform`` names.
"""

from __future__ import annotations

import argparse
import base64
import hashlib
import io
import re
import zipfile
from collections.abc import Mapping
from pathlib import Path

ROOT = Path(__file__).parents[2]
ADDON = Path(__file__).with_name("mcz_blender")
PLATFORMS = ("linux-x64", "macos-arm64", "macos-x64", "windows-arm64", "windows-x64")
BEFORE_ALL = (1980, 1, 1, 0, 0, 0)  # the earliest time that a zip can state
WHEEL = b"Wheel-Version: 1.0\nGenerator: mcz\nRoot-Is-Purelib: true\nTag: py3-none-any\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--wheels", type=Path, help="a folder of further wheels")
    parser.add_argument("--platform", choices=PLATFORMS, help="the one that those are for")
    parser.add_argument("--out", type=Path, default=ROOT / "dist", help="the folder of the zip")
    asked = parser.parse_args()
    more = {path.name: path.read_bytes() for path in sorted((asked.wheels or Path()).glob("*.whl"))}
    name, data = built(more if asked.wheels else {}, asked.platform)
    asked.out.mkdir(parents=True, exist_ok=True)
    path = asked.out / name
    path.write_bytes(data)
    print(f"{path}: {len(data):,} bytes")


def built(more: Mapping[str, bytes], platform: str | None = None) -> tuple[str, bytes]:
    """The name of the zip and its bytes."""
    wheels = dict([mcz_wheel(), *more.items()])
    files = {path.relative_to(ADDON).as_posix(): path.read_bytes() for path in ADDON.rglob("*.py")}
    manifest = (ADDON / "blender_manifest.toml").read_text("utf-8")
    files["blender_manifest.toml"] = completed(manifest, sorted(wheels), platform).encode()
    files["LICENSE"] = (ROOT / "LICENSE").read_bytes()
    files |= {f"wheels/{name}": data for name, data in wheels.items()}
    end = f"-{platform}" if platform else ""
    return f"mcz-blender-{version()}{end}.zip", zipped(files)


def completed(manifest: str, wheels: list[str], platform: str | None) -> str:
    """The manifest, with what this zip holds, before its first table."""
    listed = "".join(f'  "./wheels/{name}",\n' for name in wheels)
    lines = f"wheels = [\n{listed}]\n"
    if platform:
        lines += f'platforms = ["{platform}"]\n'
    return manifest.replace("\n[", f"\n{lines}\n[", 1)


def version() -> str:
    """That of the package, which is that of the add-on."""
    text = (ROOT / "mcz/version.py").read_text("utf-8")
    found = re.search(r'VERSION = "(.+)"', text)
    assert found is not None
    return found[1]


def mcz_wheel() -> tuple[str, bytes]:
    """The package of this tree; without the page of ``mcz view``, which Blender has no use for."""
    package = ROOT / "mcz"
    paths = [
        path for path in package.rglob("*") if path.is_file() and "__pycache__" not in path.parts
    ]
    files = {path.relative_to(ROOT).as_posix(): path.read_bytes() for path in paths}
    files = {name: data for name, data in files.items() if not name.endswith((".pyc", ".html"))}
    about = f"Metadata-Version: 2.1\nName: mcz\nVersion: {version()}\nLicense: Apache-2.0\n"
    folder = f"mcz-{version()}.dist-info"
    files |= {f"{folder}/METADATA": about.encode(), f"{folder}/WHEEL": WHEEL}
    rows = [f"{name},sha256={_digest(data)},{len(data)}" for name, data in sorted(files.items())]
    files[f"{folder}/RECORD"] = "\n".join([*rows, f"{folder}/RECORD,,", ""]).encode()
    return f"mcz-{version()}-py3-none-any.whl", zipped(files)


def _digest(data: bytes) -> str:
    return base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()


def zipped(files: Mapping[str, bytes]) -> bytes:
    """A zip of these files, in order of their names, without a time."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name, data in sorted(files.items()):
            entry = zipfile.ZipInfo(name, BEFORE_ALL)
            entry.external_attr = 0o644 << 16
            entry.create_system = 3  # Unix, on every machine
            packed = zipfile.ZIP_STORED if name.endswith(".whl") else zipfile.ZIP_DEFLATED
            archive.writestr(entry, data, packed, 9)
    return stream.getvalue()


if __name__ == "__main__":
    main()
