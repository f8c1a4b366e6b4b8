"""``replace``: other values for one joint of a clip; all other streams are unchanged.

SPEC.md, "Replacing a joint", is normative. ``recoding.py`` encodes the joint, this file writes its
streams. Where one group has all joints and the caller allows it, the clip is encoded again.
"""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mcz.container import payloads
from mcz.container.directory import SegmentRow
from mcz.container.model_records import value_hash
from mcz.container.segments import GROUP_NOTES, MASKS, GroupNotes, SegmentHeader
from mcz.container.source import locked_file
from mcz.files.editing.cutting import ClipCut, SignalCut, Unchanged, cut_segment, plan_cut
from mcz.files.editing.extraction import Copier, Copying, check_values
from mcz.files.editing.recoding import (
    Edited,
    Recoded,
    check_recodable,
    edit,
    is_coded_with_others,
    recode_joint,
    settings_of,
)
from mcz.files.editing.rewriting import disk_path
from mcz.files.reading.clip import Clip
from mcz.files.reading.file import File, open
from mcz.files.reading.stored_clip import with_indices
from mcz.files.writing.atomic import replacing_file
from mcz.files.writing.clip_writer import figures, texts_of
from mcz.model.schema import parse
from mcz.model.text_format import fields_text
from mcz.model.types import Progress, Target, Values

RECODED = "edit-recoded"


@dataclass(frozen=True, slots=True)
class Replacement:
    """Result of ``replace``.

    The two numbers of bytes are those of the joint's streams, its masks and its exceptions: numbers
    off the grid, which are counted too. ``max_error``: greatest difference of a decoded value from
    the given one, in source units.

    ``is_recoded``: the whole clip was encoded again, and other joints are off by at most
    ``others_error``; the numbers of bytes are those of the clip then.
    """

    clip: str
    joint: str
    codec: str
    joint_bytes: int
    joint_bytes_before: int
    n_exceptions: int
    n_exceptions_before: int
    max_error: float
    left_out: tuple[str, ...]
    size: int
    is_recoded: bool = False
    others_error: float = 0.0

    __repr__ = fields_text


def replace(
    source: Target,
    clip: str | None,
    joint: int | str,
    values: ArrayLike,
    target: Target | None = None,
    *,
    on_grid: bool = False,
    force: bool = False,
    copies: bool | None = None,
    recode: bool = False,
    progress: Progress | None = None,
) -> Replacement:
    """Replace the values of one joint of a clip; write the file to ``target``, by default in place.

    ``source`` is as in ``mcz.open``, or an open File, which does not change and needs a ``target``.
    ``clip`` may be None if there is only one. ``values``, of shape (n_frames, channels of the
    joint), are in source units; a clip without a source file takes NaN for invalid. The joint is
    encoded with the clip's own codec and settings, all other streams are copied byte for byte. A
    lossless clip stores every number exactly, or, ``on_grid``, the nearest that its source would
    print. ``copies``: as in ``mcz.write``; None: if the file has some. ``recode``: a clip whose
    codec codes all joints together is decoded and encoded again, so that other joints change a
    little too; by default it is refused.

    Raises OptionError if the codec cannot encode a joint alone, or if ``target`` is the
    source, MotionError for values that it cannot store; the file is unchanged then.
    """
    with ExitStack() as stack:
        inputs = [source.name if isinstance(source, File) else source]
        if target is None:
            target, force, inputs = disk_path(source), True, []
            if os.name == "posix":  # elsewhere an open file cannot be replaced
                stack.enter_context(locked_file(target))
        stream = stack.enter_context(replacing_file(target, force=force, inputs=inputs))
        file = source if isinstance(source, File) else stack.enter_context(open(source))
        chosen = file.only_clip(clip)
        copying = Copying(file, stream, progress, copies)
        editor: _Editor
        if recode and is_coded_with_others(chosen, joint):
            check_recodable(chosen)
            edited = edit(chosen, joint, values, on_grid)
            editor = _RecodingEditor(copying, chosen, edited)
        else:
            recoded = recode_joint(chosen, joint, values, on_grid)
            editor = _StreamEditor(copying, chosen, recoded)
        cuts = [plan_cut(one, None, None, 0) for one in file.clips.values()]
        editor.run(cuts, alone=False)
        check_values(stream, [chosen.name])
        return editor.replacement()


@dataclass(slots=True)
class _Sizes:
    """Bytes of a joint, and how many exceptions are in them."""

    size: int = 0
    n_exceptions: int = 0

    def add(self, flag: int, stream: bytes) -> None:
        """Count group notes or a mask, by ``flag``."""
        self.size += len(stream)
        if flag == GROUP_NOTES and stream:
            notes = parse(GroupNotes, stream, "group notes")
            self.n_exceptions += len(notes.exceptions)


class _Editor(Copier):
    joint: int
    is_recoded = False

    def __init__(self, copying: Copying, clip: Clip) -> None:
        super().__init__(copying)
        self.edited = clip
        self.before, self.after = _Sizes(), _Sizes()
        self.max_error = self.others_error = 0.0

    def is_same(self, cut: ClipCut) -> bool:
        return cut.clip.name != self.edited.name

    def replacement(self) -> Replacement:
        addresses = self.edited.skeleton.addresses()
        return Replacement(
            clip=self.edited.name,
            joint=addresses[self.joint],
            codec=self.edited.codec,
            joint_bytes=self.after.size,
            joint_bytes_before=self.before.size,
            n_exceptions=self.after.n_exceptions,
            n_exceptions_before=self.before.n_exceptions,
            max_error=self.max_error,
            left_out=tuple(self.left_out),
            size=self.writer.offset,
            is_recoded=self.is_recoded,
            others_error=self.others_error,
        )


class _StreamEditor(_Editor):
    def __init__(self, copying: Copying, clip: Clip, recoded: Recoded) -> None:
        super().__init__(copying, clip)
        self.recoded, self.joint = recoded, recoded.joint
        self.before, self.after = _Sizes(recoded.size_before), _Sizes(recoded.size)
        self.max_error = recoded.max_error
        self._numbers = {row.offset: number for number, row in enumerate(recoded.info.rows)}

    def finish_record(self, cut: ClipCut, new: payloads.Clip) -> tuple[bytes, list[bytes]]:
        if self.is_same(cut):
            return super().finish_record(cut, new)
        source, motion = b"", self.recoded.decoded
        if new.source is not None and motion.source is not None:
            motion = dataclasses.replace(motion, source=motion.source.without_file())
            source = self.put_source(cut, new, motion)
        _, hashes = super().finish_record(cut, new)
        signal = motion.signals[0]
        return source, [value_hash(signal.values, signal.mask), *hashes[1:]]

    def segment(
        self, cut: ClipCut, part: SignalCut, row: SegmentRow, *, noted: bool
    ) -> tuple[SegmentHeader, list[bytes], bytes]:
        if self.is_same(cut) or part.info.index:
            return super().segment(cut, part, row, noted=noted)
        edit = _SegmentEdit(self, row, self._numbers[row.offset])
        return cut_segment(self.container, part, row, noted=noted, edit=edit)

    def entries(self, cut: ClipCut, old: Mapping[str, str] | None) -> dict[str, str] | None:
        given, codec = self.recoded.given, self.recoded.info.codec
        if old is None and codec.lossless:
            return None
        new_figures = {} if codec.lossless else texts_of(figures(given, self.recoded.decoded))
        return edited_quality(
            old or {}, codec.name, self.joint, with_indices(new_figures, given.skeleton)
        )


class _SegmentEdit(Unchanged):
    def __init__(self, editor: _StreamEditor, row: SegmentRow, number: int) -> None:
        self._editor, self._number = editor, number
        notes, masks = editor.recoded.side_data(row.header.first, row.header.stop)
        self._beside = {GROUP_NOTES: notes, MASKS: masks}

    def group_data(self, flag: int, group: int, old: bytes) -> bytes:
        if group not in self._beside[flag]:
            return old
        new = self._beside[flag][group]
        self._editor.before.add(flag, old)
        self._editor.after.add(flag, new)
        return new

    def coded(self, resolution: int, group: int, old: bytes) -> bytes:
        streams = self._editor.recoded.streams.get((self._number, group))
        return old if streams is None else streams[resolution]


class _RecodingEditor(_Editor):
    """Decodes the clip and encodes it again after its edit."""

    is_recoded = True

    def __init__(self, copying: Copying, clip: Clip, edit: Edited) -> None:
        super().__init__(copying, clip)
        self.edit, self.joint = edit, edit.joint

    def write(self, cut: ClipCut) -> None:
        if self.is_same(cut):
            super().write(cut)
            return
        self.before.size = sum(row.size for info in cut.clip.signals for row in info.rows)
        self.recode(cut.clip, self.edit.motion, settings_of(cut.clip), self._amend_record)
        segments = self.writer.directory.clips[cut.clip.name].segments
        self.after.size = sum(row.size for row in segments)

    def _amend_record(self, now: dict[str, str], decoded: Sequence[Values]) -> dict[str, str]:
        masked_values = self.edit.motion.signals[0].masked()
        with np.errstate(invalid="ignore"):  # infinities
            difference = np.abs(decoded[0] - masked_values)
        own = np.zeros(difference.shape[1], np.bool_)
        own[list(self.edited.skeleton.columns(self.joint))] = True
        self.max_error = float(np.nanmax(difference[:, own], initial=0.0))
        self.others_error = float(np.nanmax(difference[:, ~own], initial=0.0))
        settings = {key: value for key, value in now.items() if key.startswith("param.")}
        kept_entries = {k: v for k, v in now.items() if k != "codec" and k not in settings}
        old = self.edited.stored_quality or {}
        record = edited_quality(old, now["codec"], self.joint, kept_entries)
        record = {k: v for k, v in record.items() if not k.startswith("param.")}
        return record | settings | {RECODED: "yes"}


def edited_quality(
    old: Mapping[str, str], codec: str, joint: int, new_figures: Mapping[str, str]
) -> dict[str, str]:
    """The entries of the quality record of a clip in which a ``joint`` was edited, as stored.

    ``old`` are the previous ones, ``new_figures`` those of this edit.
    """
    now = {"codec": codec}
    for key, value in old.items():
        if key == "codec" or key.startswith(("param.", "cut-", "uncut_", "unedited_")):
            now[key] = value
        elif not key.startswith(("edit-", "edit_")):
            now[f"unedited_{key}"] = value
    edited = [name for name in old.get("edit-joints", "").split(",") if name]
    now["edit-joints"] = ",".join(dict.fromkeys([*edited, str(joint)]))
    if RECODED in old:
        now[RECODED] = old[RECODED]
    return now | {f"edit_{key}": value for key, value in new_figures.items()}
