"""``repair``: a damaged file made what it was, or a sound file of all that is whole in it.

``recovering.py`` undoes damage by recovery data, ``salvaging.py`` takes out what is whole. What
recovery data give counts only where it opens, and holds all that the damaged file still does.
"""

from __future__ import annotations

import os
import shutil
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO

from mcz.container.chunks import CRC, Chunk, ChunkType
from mcz.container.reader import Container
from mcz.container.scan import scan
from mcz.container.source import ByteSource
from mcz.errors import FormatError, MczError, OptionError
from mcz.files.editing.recovering import recover
from mcz.files.editing.salvage_copier import Repair as Repair
from mcz.files.editing.salvaging import write_whole
from mcz.files.reading.faults import validate
from mcz.files.reading.file import File, file_of, open_bytes
from mcz.files.writing.atomic import replacing, rereadable
from mcz.model.types import Progress, Target

Content = set[tuple[object, ...]]


def repair(
    source: Target,
    target: Target,
    *,
    force: bool = False,
    max_decoded: int | None = None,
    progress: Progress | None = None,
) -> Repair:
    """Write a sound MCZ file of all that is whole in the damaged file ``source`` to ``target``.

    Whole clips, skeletons and attachments are copied as they are. Of another clip the runs of
    frames that can be decoded are clips called ``NAME.A-B``, with sources of these frames, or keep
    its name where no frame is lost. What was written is read again, strictly, before it gets its
    name. Raises FormatError where nothing is whole.

    A file with recovery data (``mcz.protect``) is first made what it was, byte for byte: what is
    above happens only where more of it is bad than they can restore, and to what was put behind it.
    """
    data = open_bytes(source)
    try:
        _refuse_same(data, target)
        with replacing(target, force=force, inputs=(source,)) as stream, rereadable(stream) as own:
            return _repaired(data, own, max_decoded, progress)
    except FormatError as error:
        error.add(path=data.name)
        raise
    finally:
        data.close()


def _refuse_same(source: ByteSource, target: Target) -> None:
    if isinstance(source.target, str) and isinstance(target, (str, os.PathLike)):
        with suppress(OSError):
            if Path(source.target).samefile(target):
                raise OptionError(
                    "the damaged file is not overwritten; name another", path=source.name
                )


def _repaired(
    source: ByteSource, out: BinaryIO, max_decoded: int | None, progress: Progress | None
) -> Repair:
    """Write the file to ``out``, which can be read again."""
    found = Repair()
    found.recovery, stop = recover(source, out, progress)
    if found.recovery is not None:
        found.damage += found.recovery.told()
    wanted = _content(source) if stop else Content()
    if stop and found.recovery is not None and found.recovery.possible:
        size = _size_of_whole(out, stop, wanted, found)
        if size:
            out.truncate(size)
            return _as_it_was(out, found, max_decoded)
    with tempfile.TemporaryFile() as spool:
        better = _moved(out, spool, source.name) if stop else source
        if not wanted <= _content(better):  # it was made of another file
            better = source
        file = file_of(Container(better, salvage=True, max_decoded=max_decoded))
        return write_whole(file, out, found, progress)


def _size_of_whole(out: BinaryIO, stop: int, wanted: Content, found: Repair) -> int:
    """The number of bytes in ``out`` that are a sound file with all that is ``wanted``.

    Those behind ``stop``, where what was protected ends, count where they belong to it. Zero where
    there is no such file.
    """
    size = out.seek(0, os.SEEK_END)
    for end in dict.fromkeys((size, stop)):
        whole = ByteSource(out, size=end)
        try:
            Container(whole)
            scan(whole, whole=True)
        except FormatError:
            continue
        if not (wanted | _content(ByteSource(out, size=size))) <= _content(whole):
            return 0
        if end < size:
            found.damage.append(f"{size - end:,} bytes behind its end are no part of the file")
        return end
    return 0


def _content(source: ByteSource) -> Content:
    """The whole content of a file, so that two files can be compared."""
    try:
        container = Container(source, salvage=True)
    except MczError:
        return set()
    directory = container.directory

    def mark(chunk: Chunk) -> bytes:
        return container.source.read(chunk.offset + chunk.size - CRC.size, CRC.size)

    found: Content = {("skeleton", id_) for kind, id_ in directory.shared if kind == ChunkType.SKEL}
    found |= {("alias", name, *alias) for name, alias in directory.aliases.items()}
    for name, row in directory.clips.items():
        found.add(("clip", name, mark(row.clip)))
        if row.cend is not None:
            found.add(("end", name, mark(row.cend)))
    for name, held in directory.attachments.items():
        found |= {("attachment", name, mark(part)) for part in held.parts}
    return found


def _moved(out: BinaryIO, spool: BinaryIO, name: str) -> ByteSource:
    """Move the content of ``out`` to ``spool``."""
    out.seek(0)
    shutil.copyfileobj(out, spool)
    spool.flush()
    out.seek(0)
    out.truncate()
    return ByteSource(spool, name=name)


def _as_it_was(out: BinaryIO, found: Repair, max_decoded: int | None) -> Repair:
    file = File(Container(ByteSource(out), max_decoded=max_decoded))
    found.damage += [f"{problem.heading}: {problem.message}" for problem in validate(file)]
    found.clips, found.attachments = list(file.clips), list(file.attachments)
    found.size, found.restored = file.size, True
    out.seek(0, os.SEEK_END)
    return found
