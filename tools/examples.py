"""The Python of README and the manual as modules, and whether mypy --strict likes them.

    python tools/examples.py

The blocks of a page make one module, for they share their names.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def module_of(page: Path) -> str:
    """Lines where they stand in the page, those of other blocks and of prose empty."""
    lines, inside = [], False
    for line in page.read_text("utf-8").splitlines():
        fence = line.startswith("```")
        lines.append(line if inside and not fence else "")
        inside = line == "```python" if fence else inside
    return "\n".join(lines) + "\n"


def main() -> int:
    with tempfile.TemporaryDirectory() as folder:
        package = Path(folder) / "manual_pages"  # pyproject.toml has the options of its modules
        package.mkdir()
        (package / "__init__.py").touch()
        for page in PAGES:
            path = package / f"{page.stem.replace('-', '_').lower()}_md.py"
            path.write_text(module_of(page), "utf-8")
        command = [sys.executable, "-m", "mypy", "--config-file", "pyproject.toml", folder]
        return subprocess.run(command, cwd=ROOT, check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
