"""``python -m tools.migrate_0_9 --python-0-9 PYTHON OLD.mcz NEW.mcz``; docs/guides/migration.md."""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import mcz
from mcz.files.writing.atomic import replacing
from tools.migrate_0_9 import write_new

READER = Path(__file__).with_name("read_old.py")


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(prog="migrate_0_9", description=__doc__)
    parser.add_argument("--python-0-9", required=True, help="a Python with the package mcz 0.9")
    parser.add_argument("--path-0-9", help="where that finds mcz, if it is not installed")
    parser.add_argument("--codec", help="a lossless codec for all clips (raw, fast, best)")
    parser.add_argument("--force", action="store_true", help="overwrite NEW.mcz")
    parser.add_argument("old")
    parser.add_argument("new")
    given = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as folder:
        read(given.python_0_9, given.path_0_9, given.old, folder)
        for note in migrate(Path(folder), given.new, given.codec, force=given.force, old=given.old):
            print(f"{given.new}: {note}", file=sys.stderr)


def read(python: str, path: str | None, old: str, folder: str) -> None:
    """Verify and decode the file with package 0.9; exit with its message on failure."""
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
    if path is not None:
        environment["PYTHONPATH"] = path
    version = [python, "-c", "from importlib.metadata import version; print(version('mcz'))"]
    found = subprocess.run(version, env=environment, check=False, capture_output=True, text=True)
    if path is None and not found.stdout.startswith("0.9."):
        sys.exit(f"{python}: package 0.9 is not installed there")
    words = [python, str(READER), str(Path(old).resolve()), folder]
    if subprocess.run(words, env=environment, check=False).returncode:
        sys.exit(f"{old}: package 0.9 does not read it; mend it there first (mcz repair)")


def migrate(
    folder: Path, new: str, codec: str | None = None, *, force: bool = False, old: str = ""
) -> list[str]:
    """Write the new file, which gets its name when all is proved; what is kept otherwise."""
    held, made = write_new.Old(folder), folder / "new.mcz"
    with replacing(new, force=force, inputs=(old,)) as stream:
        with made.open("w+b") as own:
            migration = write_new.Migration(held, own, codec)
            migration.write()
        if held.content["redundancy"] is not None:
            mcz.protect(made, held.content["redundancy"])
        if lost := list(write_new.differences(held, made, migration.split, migration.untimed)):
            sys.exit(f"{old}: not the same in the new file: {'; '.join(lost)}")
        with made.open("rb") as own:
            shutil.copyfileobj(own, stream)
    content = held.content
    print(
        f"{new}: {len(content['clips'])} clips and {len(content['attachments'])} attachments, "
        "every value, mask and file with the SHA-256 that it had"
    )
    return migration.notes


if __name__ == "__main__":
    main()
