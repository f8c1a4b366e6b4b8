"""Tables of metadata: a row a clip, a column a key."""

from __future__ import annotations

import csv
import io
import os
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from mcz.container.metadata_keys import INTERPRETED, KEYS, PRIVATE, SPELLINGS
from mcz.errors import OptionError, reason_of
from mcz.files.reading.clips import listed, names_of
from mcz.files.reading.file import File
from mcz.model.text_format import among, cell_text

NAMES = ("clip", "name", "path", "file")  # columns that name the clip, the first that there is
DELIMITERS = ",;\t"
FIELD = re.compile(r"\{([^{}:!.\[\]]+)(:[^{}]*)?\}")  # a column, and how wide it is


def from_table(
    path: str | os.PathLike[str],
    file: File,
    *,
    match: str | None = None,
    take: Sequence[str] | None = None,
    skip_unknown: bool = False,
) -> tuple[dict[str, dict[str, str]], list[str]]:
    """Read the metadata of the clips of ``file`` from a table (CSV or TSV, UTF-8, with a head).

    A row names its clip in a column ``clip``, ``name``, ``path`` or ``file``, or by ``match``, a
    text with columns in braces: "{subject:0>2}_{trial:0>2}". That is a name as ``File.only_clip``
    takes it. ``take``: the columns to take, by default all but the one with the name; each must be
    a key of the registry or begin with ``x-``, or stand behind one: "description=What they do".
    Empty cells say nothing. Also returns the names of rows without a clip, where ``skip_unknown``;
    otherwise those are an OptionError, as are a clip that two rows name and a column that is no
    key.
    """
    rows = _rows(Path(path))
    head = list(rows[0]) if rows else []
    name_of = _namer(path, head, match)
    columns = _columns(path, head, match, take)
    known = names_of(file.clips)
    said: dict[str, dict[str, str]] = {}
    unknown: list[str] = []
    for number, row in enumerate(rows, 2):
        name = name_of(row)
        found = known.get(name, ())
        if len(found) > 1:
            raise OptionError(
                f"row {number}: {name!r} may be {listed(sorted(found))}; write one of "
                "these, or make it of more columns with match, such as {folder}/{trial}",
                path=path,
            )
        if not found:
            unknown.append(name)
            continue
        clip = next(iter(found))
        if clip in said:
            raise OptionError(f"two rows are about clip {clip!r}", path=path)
        cells = {key: row[column].strip() for key, column in columns.items()}
        said[clip] = {key: text for key, text in cells.items() if text}
    if unknown and not skip_unknown:
        raise OptionError(
            f"no clip for {len(unknown)} of {len(rows)} rows: {listed(unknown)}", path=path
        )
    return said, unknown


def _rows(path: Path) -> list[dict[str, str]]:
    try:
        text = path.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise OptionError(f"not UTF-8: {error}", path=path) from None
    except OSError as error:
        raise OptionError(reason_of(error), path=path) from None
    first = text.partition("\n")[0]
    delimiter = max(DELIMITERS, key=first.count)
    reader = csv.DictReader(io.StringIO(text, newline=""), delimiter=delimiter, strict=True)
    try:
        rows = list(reader)
    except csv.Error as error:
        raise OptionError(str(error), path=path, line=reader.line_num) from None
    head = reader.fieldnames or []
    if len(set(head)) != len(head):
        raise OptionError("two columns have the same name", path=path)
    for number, row in enumerate(rows, 2):
        if None in row or None in row.values():
            raise OptionError(
                f"row {number} has not the {len(head)} columns of the head", path=path
            )
    return [{cell_text(key): cell_text(value) for key, value in row.items()} for row in rows]


def _fields(match: str) -> list[str]:
    """The columns in ``match``; raises OptionError for a text that is no such format."""
    text = match.replace("{{", "").replace("}}", "")
    if set("{}") & set(FIELD.sub("", text)):
        raise OptionError(f"match {match!r}: columns stand in braces, such as {{subject:0>2}}")
    return [name for name, _ in FIELD.findall(text)]


def _namer(
    path: str | os.PathLike[str], head: Sequence[str], match: str | None
) -> Callable[[Mapping[str, str]], str]:
    """Return a function that names the clip of a row."""
    if match is not None:
        form = match
        for name in _fields(form):
            if name not in head:
                raise OptionError(f"no column {name!r}; there are {among(head, name)}", path=path)

        def formatted(row: Mapping[str, str]) -> str:
            try:
                return form.format_map({key: cell.strip() for key, cell in row.items()})
            except ValueError as error:
                raise OptionError(f"match {form!r}: {error}") from None

        return formatted
    column = next((name for name in NAMES if name in head), None)
    if column is None:
        raise OptionError(
            f"no column {', '.join(NAMES)} names the clips; say how by match, such as "
            "{subject}_{trial}",
            path=path,
        )
    return lambda row: row[column].strip()


def _columns(
    path: str | os.PathLike[str], head: Sequence[str], match: str | None, take: Sequence[str] | None
) -> dict[str, str]:
    """The columns that are taken, by the key that each is."""
    if take is not None:
        return dict(_taken(path, head, text) for text in take)
    own = next((name for name in NAMES if name in head), None) if match is None else None
    used = _fields(match or "")
    columns = [name for name in head if name != own]
    odd = [name for name in columns if not _is_key(name) and name not in used]
    if odd:
        raise OptionError(
            f"{among(odd, None)}: no key of the metadata; name the columns to take, such "
            f"as description={odd[0]}",
            path=path,
        )
    return {name: name for name in columns if _is_key(name)}


def _taken(path: str | os.PathLike[str], head: Sequence[str], text: str) -> tuple[str, str]:
    """Key and column of ``key=column``, or of a column that is called as the key."""
    key, equals, column = text.partition("=")
    if text in head:
        key, column = text, text
    elif not equals:
        column = text
    if column not in head:
        raise OptionError(f"no column {column!r}; there are {', '.join(head)}", path=path)
    return key, column


def _is_key(name: str) -> bool:
    is_said = SPELLINGS.get(name, name) in KEYS and name not in INTERPRETED
    return is_said or name.startswith(PRIVATE)
