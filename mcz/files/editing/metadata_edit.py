"""Edits of metadata and frame rates without re-encoding, and tables of metadata: a row a clip."""

from __future__ import annotations

import csv
import io
import os
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from pathlib import Path

from mcz.container.metadata import (
    INTERPRETED,
    KEYS,
    PRIVATE,
    SPELLINGS,
    Record,
    apply_records,
    check_pair,
)
from mcz.container.writer import Writer
from mcz.errors import ChecksumError, OptionError, reason_of
from mcz.files.editing import Outcome, Report
from mcz.files.editing.appending import append_at_end, redundancy_of, still_protect
from mcz.files.editing.rewriting import CLIP, Change, plan_whole, rewriting
from mcz.files.reading.clip import Clip
from mcz.files.reading.clips import Where, list_some, names_of
from mcz.files.reading.differences import states_rate
from mcz.files.reading.file import File, open
from mcz.model.checks import MAPPING, PATH, check_arguments
from mcz.model.motion import frame_rate_of
from mcz.model.text_format import cell_text, quote_name, suggest_names
from mcz.model.types import Progress, Target
from mcz.sources import FORMATS

Entries = Mapping[str, str | None]  # a key and its value; None: removed


@check_arguments(target=PATH, changes=MAPPING)
def set_metadata(
    target: str | os.PathLike[str],
    changes: Mapping[str, Entries],
    *,
    force: bool = False,
    purge: bool = False,
    progress: Progress | None = None,
) -> Report:
    """Set metadata of clips of an MCZ file, or of the file as a whole.

    ``changes``: by clip name, or "" for the file, keys of the registry (or ``x-...``) and their
    values; None removes a key. They are appended (SPEC.md, "META"), so that no byte of a clip
    changes, and old values remain in the bytes until the file is rewritten: ``purge`` rewrites it
    without them. Otherwise nothing is written without a change. Raises OptionError for a bad name,
    key or value, and AccessError while another process is appending; ``force`` is as in
    ``mcz.append``.
    """
    changes = {name: _respell(entries) for name, entries in changes.items()}
    for entries in changes.values():
        for key, value in entries.items():
            check_pair(key, value)
    report = Report()
    with append_at_end(Path(target), salvage=False, force=force) as growth:
        file = File(growth.container)
        records = [_changes_record(file, name, entries) for name, entries in changes.items()]
        records = [record for record in records if record.entries or record.removed]
        for record in records:
            text = ", ".join([*record.entries, *(f"no {key}" for key in record.removed)])
            report.outcomes.append(Outcome(record.name, "said", 0, text))
        if records:
            directory = growth.container.directory
            writer = Writer(
                growth.added,
                profile=growth.container.profile,
                directory=directory,
                offset=directory.end,
            )
            writer.metadata(records)
            writer.finish()
        redundancy = redundancy_of(growth.container) if records else None
    still_protect(target, redundancy)
    if purge:
        report.left_out += _purge(target, progress)
    report.size = Path(target).stat().st_size
    return report


def _purge(target: str | os.PathLike[str], progress: Progress | None) -> list[str]:
    """Rewrite a file so that its metadata are in CLIP; return what was left out."""
    with rewriting(target, progress=progress) as job:
        plan = plan_whole(job.file)
        plan.drops_meta = True  # META-09
        for clip in job.file:
            plan.changes[CLIP, clip.name] = Change(metadata=clip.metadata)
        return job.write(plan, Report()).left_out


def registered_key(key: str) -> str:
    """The registered spelling of a key: ``license`` is ``licence``."""
    return SPELLINGS.get(key, key)


def _respell(entries: Entries) -> Entries:
    """``entries`` under registered keys; raises OptionError for two spellings of one."""
    if not isinstance(entries, Mapping):
        raise OptionError(f"the changes of a clip are {entries!r}; they must be a dict")
    respelled = {registered_key(key): value for key, value in entries.items()}
    if len(respelled) < len(entries):
        twice = next(key for key in SPELLINGS if key in entries)
        raise OptionError(f"{twice!r} and {SPELLINGS[twice]!r} are the same key")
    return respelled


def _changes_record(file: File, name: str, changes: Entries) -> Record:
    clip = file.only_clip(name) if name else None
    before = file.metadata if clip is None else clip.metadata
    entries = {k: v for k, v in changes.items() if v is not None and before.get(k) != v}
    removed = tuple(key for key, value in changes.items() if value is None and key in before)
    record = Record(clip.name if clip is not None else "", entries, removed)
    return record if apply_records(before, [record]) != before else Record(record.name)


@check_arguments()
def set_rate(
    target: Target,
    rate: Fraction | float,
    names: Iterable[str] | None = None,
    *,
    where: Where | None = None,
    output: Target | None = None,
    force: bool = False,
    progress: Progress | None = None,
) -> Report:
    """Set the frame rate of clips of an MCZ file whose source states none (AMC).

    ``names`` and ``where`` select clips, by default all with an unknown rate. The rate is in CLIP,
    so the file is rewritten, see ``delete_clips`` for ``output``; the values are unchanged. Raises
    OptionError if the source of a clip states the rate, and for a change of a rate, unless
    ``force``.
    """
    exact = frame_rate_of(rate, "rate").limit_denominator(10**6)
    if exact <= 0:
        raise OptionError(f"rate is {rate}; it must be above 0")
    with rewriting(target, output, force=force, progress=progress) as job:
        file = job.file
        is_filtered = names is not None or where is not None
        clips = (
            file.select_clips(names, where)
            if is_filtered
            else [c for c in file if c.frame_rate is None]
        )
        report, plan = Report(), plan_whole(file)
        for clip in clips:
            _check_rate(clip, exact, force)
            plan.changes[CLIP, clip.name] = Change(rate=exact)
            report.outcomes.append(Outcome(clip.name, "rate", 0, f"{float(exact):g}"))
        if not clips:
            return report
        job.write(plan, report)
    _check_sources(target if output is None else output, [clip.name for clip in clips])
    return report


def _check_rate(clip: Clip, rate: Fraction, force: bool) -> None:
    if states_rate(clip):
        stated = ", ".join(sorted(name for name, known in FORMATS.items() if known.states_rate))
        raise OptionError(
            f"its source format states the frame rate (as do {stated}), so the rate cannot be "
            "changed here; encode the source again",
            clip=clip.name,
        )
    if clip.frame_rate not in (None, rate) and not force:
        raise OptionError(
            f"clip {quote_name(clip.name)} already has {float(clip.frame_rate or 0):g} frames a "
            "second; use force to change it"
        )


def _check_sources(target: Target, names: Iterable[str]) -> None:
    """Raise ChecksumError for a source that is no longer restored, which cannot happen."""
    if not isinstance(target, (str, os.PathLike)):
        return
    with open(target) as file:
        for name in list(names)[:1]:
            clip = file.clips[name]
            if clip.source is not None and len(clip.source_bytes()) != clip.source.size:
                raise ChecksumError("its source can no longer be restored", clip=name)


NAMES = ("clip", "name", "path", "file")  # columns that may name the clip, in order of preference
DELIMITERS = ",;\t"
FIELD = re.compile(r"\{([^{}:!.\[\]]+)(:[^{}]*)?\}")  # a column, and its format


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
    text with columns in braces: "{subject:0>2}_{trial:0>2}". Names are as in ``File.only_clip``.
    ``take``: the columns to use, by default all except the one with the name; each must be a key of
    the registry or begin with ``x-``, or follow one: "description=What they do". Empty cells are
    ignored. Also returns the names of rows without a clip, if ``skip_unknown``; otherwise those are
    an OptionError, as are a clip that two rows name and a column that is not a key.
    """
    rows = _read_rows(Path(path))
    head = list(rows[0]) if rows else []
    name_of = _namer(path, head, match)
    columns = _chosen_columns(path, head, match, take)
    known = names_of(file.clips)
    entries_by_clip: dict[str, dict[str, str]] = {}
    unknown: list[str] = []
    for number, row in enumerate(rows, 2):
        name = name_of(row)
        clip_names = known.get(name, ())
        if len(clip_names) > 1:
            raise OptionError(
                f"row {number}: {name!r} is ambiguous: {list_some(sorted(clip_names))}; write "
                "one of these names, or build it from more columns with match, such as "
                f"{{folder}}/{{trial}}",
                path=path,
            )
        if not clip_names:
            unknown.append(name)
            continue
        clip = next(iter(clip_names))
        if clip in entries_by_clip:
            raise OptionError(f"two rows match clip {clip!r}", path=path)
        cells = {key: row[column].strip() for key, column in columns.items()}
        entries_by_clip[clip] = {key: text for key, text in cells.items() if text}
    if unknown and not skip_unknown:
        raise OptionError(
            f"{len(unknown)} of {len(rows)} rows match no clip: {list_some(unknown)}", path=path
        )
    return entries_by_clip, unknown


def _read_rows(path: Path) -> list[dict[str, str]]:
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
    if not rows:
        empty = "has no row below its header" if text.strip() else "is empty"
        raise OptionError(f"the table {empty}", path=path)
    if len(set(head)) != len(head):
        raise OptionError("two columns have the same name", path=path)
    for number, row in enumerate(rows, 2):
        if None in row or None in row.values():
            raise OptionError(
                f"row {number} does not have the {len(head)} columns of the header", path=path
            )
    return [{cell_text(key): cell_text(value) for key, value in row.items()} for row in rows]


def _match_columns(match: str) -> list[str]:
    text = match.replace("{{", "").replace("}}", "")
    if set("{}") & set(FIELD.sub("", text)):
        raise OptionError(f"match {match!r}: unbalanced braces; write columns like {{subject:0>2}}")
    return [name for name, _ in FIELD.findall(text)]


def _namer(
    path: str | os.PathLike[str], head: Sequence[str], match: str | None
) -> Callable[[Mapping[str, str]], str]:
    if match is not None:
        form = match
        for name in _match_columns(form):
            if name not in head:
                raise OptionError(
                    f"no column {name!r}; the columns are {suggest_names(head, name)}", path=path
                )

        def formatted(row: Mapping[str, str]) -> str:
            try:
                return form.format_map({key: cell.strip() for key, cell in row.items()})
            except ValueError as error:
                raise OptionError(f"match {form!r}: {error}") from None

        return formatted
    column = next((name for name in NAMES if name in head), None)
    if column is None:
        raise OptionError(
            f"no column is called {', '.join(NAMES)}; build clip names with match, such as "
            f"{{subject}}_{{trial}}",
            path=path,
        )
    return lambda row: row[column].strip()


def _chosen_columns(
    path: str | os.PathLike[str], head: Sequence[str], match: str | None, take: Sequence[str] | None
) -> dict[str, str]:
    if take is not None:
        return dict(_parse_take(path, head, text) for text in take)
    own = next((name for name in NAMES if name in head), None) if match is None else None
    used = _match_columns(match or "")
    columns = [name for name in head if name != own]
    unknown = [name for name in columns if not _is_key(name) and name not in used]
    if unknown:
        raise OptionError(
            f"{suggest_names(unknown, None)}: not metadata keys; choose columns with take, such as "
            f"description={unknown[0]}",
            path=path,
        )
    return {name: name for name in columns if _is_key(name)}


def _parse_take(path: str | os.PathLike[str], head: Sequence[str], text: str) -> tuple[str, str]:
    """Key and column of ``key=column``, or of a column with the name of the key."""
    key, equals, column = text.partition("=")
    if text in head:
        key, column = text, text
    elif not equals:
        column = text
    if column not in head:
        raise OptionError(f"no column {column!r}; the columns are {', '.join(head)}", path=path)
    return key, column


def _is_key(name: str) -> bool:
    is_said = SPELLINGS.get(name, name) in KEYS and name not in INTERPRETED
    return is_said or name.startswith(PRIVATE)
