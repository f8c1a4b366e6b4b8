"""The add-on as one zip that Blender installs: the same bytes from the same inputs.

    python tools/blender/build.py [--wheels DIR] [--out dist]

It holds the add-on's modules, and as wheels ``mcz`` and construct, which is pure Python, as it is
installed here: Blender has NumPy, and nothing else is needed.
``--wheels`` names a folder of wheels of this tree, each for a Python and a platform; their compiled
kernels are added to the one wheel. Of several wheels of one name and version Blender takes the last
by file name, 4.2 whatever their Python; so there is one wheel, in which Python finds the modules of
its own by their suffix, or none and runs kernels as plain Python.
"""

from __future__ import annotations

import argparse
import base64
import hashlib
import io
import re
import zipfile
from collections.abc import Iterable, Mapping
from importlib.metadata import distribution
from pathlib import Path

ROOT = Path(__file__).parents[2]
ADDON = Path(__file__).with_name("mcz_blender")
KERNELS = "mcz/kernels/compiled/"
BUILT_IN_PLACE = ("compiled", "checked", "sanitized")  # folders of mcz/kernels, of one machine
BEFORE_ALL = (1980, 1, 1, 0, 0, 0)  # the earliest time that a zip can state
WHEEL = b"Wheel-Version: 1.0\nGenerator: mcz\nRoot-Is-Purelib: true\nTag: py3-none-any\n"


class WheelError(Exception):
    """A wheel whose compiled kernels cannot be bundled."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--wheels", type=Path, help="a folder of wheels of mcz, for their kernels")
    parser.add_argument("--out", type=Path, default=ROOT / "dist", help="the folder of the zip")
    given = parser.parse_args()
    try:
        name, data = build_zip(wheels_in(given.wheels) if given.wheels else ())
    except WheelError as error:
        parser.error(str(error))
    given.out.mkdir(parents=True, exist_ok=True)
    path = given.out / name
    path.write_bytes(data)
    print(f"{path}: {len(data):,} bytes")


def wheels_in(folder: Path) -> list[Path]:
    """The wheels of mcz in a folder; raises WheelError where there are none."""
    wheels = sorted(folder.glob("mcz-*.whl"))
    if not wheels:
        raise WheelError(f"{folder} has no wheels of mcz")
    return wheels


def build_zip(wheels: Iterable[Path] = ()) -> tuple[str, bytes]:
    """Return the name of the zip and its bytes, with the compiled kernels of ``wheels``.

    Raises WheelError.
    """
    name, wheel = mcz_wheel(compiled_kernels(wheels))
    files = {path.relative_to(ADDON).as_posix(): path.read_bytes() for path in ADDON.rglob("*.py")}
    manifest = (ADDON / "blender_manifest.toml").read_text("utf-8")
    construct, construct_wheel = installed_wheel("construct")
    listed = f'\nwheels = ["./wheels/{construct}", "./wheels/{name}"]\n\n['
    files["blender_manifest.toml"] = manifest.replace("\n[", listed, 1).encode()
    files["LICENSE"] = (ROOT / "LICENSE").read_bytes()
    files |= {f"wheels/{name}": wheel, f"wheels/{construct}": construct_wheel}
    return f"mcz-blender-{version()}.zip", zip_files(files)


def compiled_kernels(wheels: Iterable[Path]) -> dict[str, bytes]:
    """Return the compiled kernels of wheels, by name in the package.

    Raises WheelError for a wheel without any, one whose sources are not those of this tree, and two
    wheels with modules of one name, as those of both processors of macOS have.
    """
    found: dict[str, bytes] = {}
    for path in wheels:
        with zipfile.ZipFile(path) as wheel:
            names = wheel.namelist()
            modules = [n for n in names if n.startswith(KERNELS) and not n.endswith("/")]
            if not modules:
                raise WheelError(f"{path.name} has no compiled kernels")
            for name in names:
                if name.startswith("mcz/") and name.endswith(".py"):
                    _check_source(path.name, name, wheel.read(name))
            twice = sorted(found.keys() & set(modules))
            if twice:
                raise WheelError(f"{path.name} and a wheel before it both have {twice[0]}")
            found |= {name: wheel.read(name) for name in modules}
    return found


def _check_source(wheel: str, name: str, data: bytes) -> None:
    own = ROOT / name
    if not own.is_file() or own.read_bytes() != data:
        raise WheelError(f"{wheel} was not built from this tree: {name} differs")


def version() -> str:
    """Version of the package and of the add-on."""
    text = (ROOT / "mcz/version.py").read_text("utf-8")
    found = re.search(r'VERSION = "(.+)"', text)
    assert found is not None
    return found[1]


def mcz_wheel(kernels: Mapping[str, bytes]) -> tuple[str, bytes]:
    """The package of this tree with compiled kernels; Blender has no use for the viewer's page."""
    package = ROOT / "mcz"
    left_out = {package / "kernels" / mode for mode in BUILT_IN_PLACE}
    paths = [
        path
        for path in package.rglob("*")
        if path.is_file() and "__pycache__" not in path.parts and path.parent not in left_out
    ]
    files = {path.relative_to(ROOT).as_posix(): path.read_bytes() for path in paths}
    files = {name: data for name, data in files.items() if not name.endswith((".pyc", ".html"))}
    files |= kernels
    about = f"Metadata-Version: 2.1\nName: mcz\nVersion: {version()}\nLicense: Apache-2.0\n"
    return wheel_of("mcz", version(), {**files, "METADATA": about.encode()})


def installed_wheel(name: str) -> tuple[str, bytes]:
    """The wheel of a pure Python package from its installed files."""
    package = distribution(name)
    kept = {
        path.as_posix(): Path(str(package.locate_file(path))).read_bytes()
        for path in package.files or ()
        if path.suffix == ".py" and ".." not in path.parts
    }
    files = kept | {
        about: text.encode()
        for about in ("METADATA", "LICENSE")
        if (text := package.read_text(about)) is not None
    }
    return wheel_of(name, package.version, files)


def wheel_of(name: str, version: str, files: Mapping[str, bytes]) -> tuple[str, bytes]:
    """A wheel of these files; those without a folder are about the package."""
    folder = f"{name}-{version}.dist-info"
    placed = {path if "/" in path else f"{folder}/{path}": data for path, data in files.items()}
    placed[f"{folder}/WHEEL"] = WHEEL
    rows = [f"{path},sha256={_digest(data)},{len(data)}" for path, data in sorted(placed.items())]
    placed[f"{folder}/RECORD"] = "\n".join([*rows, f"{folder}/RECORD,,", ""]).encode()
    return f"{name}-{version}-py3-none-any.whl", zip_files(placed)


def _digest(data: bytes) -> str:
    return base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()


def zip_files(files: Mapping[str, bytes]) -> bytes:
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
