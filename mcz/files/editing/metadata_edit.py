"""Edits of metadata and frame rates, without re-encoding."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from fractions import Fraction
from pathlib import Path

from mcz.container.metadata import Record, applied
from mcz.container.metadata_keys import SPELLINGS, check_said
from mcz.container.writer import Writer
from mcz.errors import ChecksumError, OptionError
from mcz.files.editing.appending import growing
from mcz.files.editing.batch_report import Outcome, Report
from mcz.files.editing.chunk_copier import Change
from mcz.files.editing.protecting import redundancy_of, still_protect
from mcz.files.editing.rewriting import CLIP, rewriting, steps, whole
from mcz.files.reading.clip import Clip
from mcz.files.reading.fields import Where
from mcz.files.reading.file import File, open
from mcz.files.reading.rate_notes import states_rate
from mcz.model.motion import frame_rate_of
from mcz.model.text_format import shown
from mcz.model.types import Progress, Target
from mcz.sources import FORMATS

Said = Mapping[str, str | None]  # a key and its value; None: it is not there any more


def set_metadata(
    target: str | os.PathLike[str],
    changes: Mapping[str, Said],
    *,
    force: bool = False,
    purge: bool = False,
    progress: Progress | None = None,
) -> Report:
    """Say something of clips of an MCZ file, or of the file as a whole.

    ``changes``: of each clip by its name, "" for the file, keys of the registry (or ``x-...``) and
    their values; None removes a key. It is appended (SPEC.md, "META"), so that no byte of a clip is
    touched, and what was said before is still in the bytes until the file is rewritten: ``purge``
    rewrites it so that nothing of that is left. Otherwise nothing is written where nothing changes.
    Raises OptionError for a name, a key or a value that cannot be, and AccessError while another
    process is appending; ``force`` is that of ``mcz.append``.
    """
    changes = {name: _respelled(said) for name, said in changes.items()}
    for said in changes.values():
        for key, value in said.items():
            check_said(key, value)
    report = Report()
    with growing(Path(target), salvage=False, force=force) as growth:
        file = File(growth.container)
        records = [_record(file, name, said) for name, said in changes.items()]
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
    """Rewrite a file so that its metadata stand in CLIP; return what was left out."""
    with rewriting(target) as job:
        report, plan = Report(), whole(job.file)
        plan.purges = True  # META-09
        for clip in job.file:
            plan.things[CLIP, clip.name] = Change(metadata=clip.metadata)
        job.write(plan, report, steps(progress, len(job.file.clips)))
        return report.left_out


def registered_key(key: str) -> str:
    """A key as it is registered: ``license`` is ``licence``."""
    return SPELLINGS.get(key, key)


def _respelled(said: Said) -> Said:
    """``said`` under registered keys; raises OptionError where two of them are one."""
    found = {registered_key(key): value for key, value in said.items()}
    if len(found) < len(said):
        twice = next(key for key in SPELLINGS if key in said)
        raise OptionError(f"{twice!r} and {SPELLINGS[twice]!r} are one key")
    return found


def _record(file: File, name: str, said: Said) -> Record:
    """Record of the changes; empty if nothing changes."""
    clip = file.only_clip(name) if name else None
    before = file.metadata if clip is None else clip.metadata
    entries = {k: v for k, v in said.items() if v is not None and before.get(k) != v}
    removed = tuple(key for key, value in said.items() if value is None and key in before)
    record = Record(clip.name if clip is not None else "", entries, removed)
    return record if applied(before, [record]) != before else Record(record.name)


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
    """Say how many frames a second clips of an MCZ file have whose source does not say it (AMC).

    ``names``: of these clips, ``where``: of those that it takes, by default of all whose rate is
    unknown. The rate stands in CLIP, so the file is rewritten, see ``delete_clips`` for ``output``;
    the values stay what they are. Raises OptionError where the source of a clip states the rate,
    and for another rate than a clip has, unless ``force``.
    """
    exact = frame_rate_of(rate, "rate").limit_denominator(10**6)
    if exact <= 0:
        raise OptionError(f"rate is {rate}, not above 0")
    with rewriting(target, output, force=force) as job:
        file = job.file
        named = names is not None or where is not None
        clips = file.chosen(names, where) if named else [c for c in file if c.frame_rate is None]
        report, plan = Report(), whole(file)
        for clip in clips:
            _check_rate(clip, exact, force)
            plan.things[CLIP, clip.name] = Change(rate=exact)
            report.outcomes.append(Outcome(clip.name, "rate", 0, f"{float(exact):g}"))
        if not clips:
            return report
        job.write(plan, report, steps(progress, len(file.clips)))
    _check_sources(target if output is None else output, [clip.name for clip in clips])
    return report


def _check_rate(clip: Clip, rate: Fraction, force: bool) -> None:
    if states_rate(clip):
        stated = ", ".join(sorted(name for name, known in FORMATS.items() if known.states_rate))
        raise OptionError(
            f"its source states the rate, as {stated} do; encode it anew", clip=clip.name
        )
    if clip.frame_rate not in (None, rate) and not force:
        raise OptionError(
            f"clip {shown(clip.name)} has {float(clip.frame_rate or 0):g} frames a second; "
            "force changes that"
        )


def _check_sources(target: Target, names: Iterable[str]) -> None:
    """Raise ChecksumError where a source does not come back any more, which cannot be."""
    if not isinstance(target, (str, os.PathLike)):
        return
    with open(target) as file:
        for name in list(names)[:1]:
            clip = file.clips[name]
            if clip.source is not None and len(clip.source_bytes()) != clip.source.size:
                raise ChecksumError("its source is not restored", clip=name)
