"""A file of today's format of what ``read_old.py`` found, and the proof that nothing is missing."""

from __future__ import annotations

import hashlib
import json
import warnings
from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

import mcz
from mcz.codecs import codec_by_name
from mcz.container import payloads
from mcz.container.chunks import ChunkType
from mcz.container.limits import BASE, LARGE
from mcz.container.metadata import Record
from mcz.container.model_records import value_hash
from mcz.container.writer import Writer
from mcz.files.editing.unpacking import named_files
from mcz.files.writing.clip_writer import quality_payload, write_clip, write_skeleton
from mcz.model.clock import TOLERANCE, Timeline, check_numbers, numbers_or_rows
from mcz.model.motion import Channel, Exceptions, Joint, Motion, Signal, Skeleton
from mcz.model.numbers import Grid, GridKind

START = "start-time"  # a key of 0.9: the time base of a clip says it now
NUMBERS = "x-frame-numbers-0-9"  # what `frame-numbers` of 0.9 said, where no clip can have such now
KEPT = ("raw", "fast", "best")  # codecs of 0.9 that clips keep; all others become fast
Content = dict[str, Any]


class Old:
    """The content of the old file, as today's objects."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.content: Content = json.loads((folder / "content.json").read_text("utf-8"))

    def data(self, name: str) -> bytes:
        return (self.folder / name).read_bytes()

    def skeleton(self, held: Content) -> Skeleton:
        """A skeleton, its own file with it; its base is not set."""
        joints = tuple(
            Joint(
                **{k: _tuples(v) for k, v in joint.items() if k != "channels"},
                channels=_channels(joint["channels"]),
            )
            for joint in held["joints"]
        )
        found = Skeleton(joints, **held["facts"])
        if held["file"] is not None:
            own = mcz.read_skeleton(self.on_disk(held["file"], "skeleton.asf"))
            assert own.source is not None
            found = replace(found, source=replace(own.source, path=held["file"]["path"]))
        return found

    def on_disk(self, held: Content, name: str) -> Path:
        """The bytes of a file under a name that readers know."""
        path = self.folder / name
        path.write_bytes(self.data(held["data"]))
        return path

    def signal(self, held: Content, index: int) -> Signal:
        """A signal of the stored numbers."""
        rows, columns, texts = (
            zip(*held["exceptions"], strict=True) if held["exceptions"] else ((),) * 3
        )
        shape, (role, of) = tuple(held["shape"]), _role(held, index)
        mask = None if held["mask"] is None else self.data(held["mask"])
        return Signal(
            np.frombuffer(self.data(held["values"]), held["type"]).reshape(shape),
            tuple(map(_grid, held["grids"])),
            held["name"],
            held["samples_per_frame"],
            None if mask is None else np.frombuffer(mask, np.bool_).reshape(shape),
            Exceptions(
                np.array(rows, np.int64),
                np.array(columns, np.int64),
                tuple(map(bytes.fromhex, texts)),
            ),
            tuple((row, column, _grid(grid)) for row, column, grid in held["grid_changes"]),
            None if held["channels"] is None else _channels(held["channels"]),
            role=role,
            of=of,
        )

    def frame_numbers(self, clip: Content) -> np.ndarray[Any, np.dtype[np.int64]]:
        """Frame numbers of the clip; without any they count from the first, or from 1."""
        numbers = np.frombuffer(self.data(clip["frame_numbers"]), "<i8")
        rows = np.arange(len(numbers))
        possible = (known for known in (numbers, numbers[:1] + rows) if not _numbers_fault(known))
        return next(possible, 1 + rows)

    def metadata(self, clip: Content) -> dict[str, str]:
        """The metadata of the clip, with the frame numbers that it cannot have."""
        kept = {key: value for key, value in clip["metadata"].items() if key != START}
        if _numbers_fault(np.frombuffer(self.data(clip["frame_numbers"]), "<i8")):
            kept[NUMBERS] = clip["numbers_text"]
        return kept

    def times(self, clip: Content) -> Timeline | None:
        if clip["times"] is None:
            return None
        rate = None if clip["rate"] is None else Fraction(*clip["rate"])
        return Timeline(np.frombuffer(self.data(clip["times"]), "<f8"), rate, clip["rounding"])

    def motion(self, clip: Content, skeleton: Skeleton) -> Motion:
        """A clip by its numbers alone, without a source."""
        rate, numbers = clip["rate"], self.frame_numbers(clip)
        counted = np.array_equal(numbers, np.arange(1, len(numbers) + 1))
        signals = tuple(self.signal(held, index) for index, held in enumerate(clip["signals"]))
        if not clip["is_lossless"]:  # what was decoded lies on no grid of the source
            signals = (
                replace(signals[0], grids=(), exceptions=Exceptions(), grid_changes=()),
                *signals[1:],
            )
        return Motion(
            skeleton,
            signals,
            None if rate is None else Fraction(*rate),
            clip["is_rate_exact"],
            clip["name"],
            self.metadata(clip),
            frame_numbers=None if counted else numbers,
        )


def _numbers_fault(numbers: np.ndarray[Any, np.dtype[np.int64]]) -> str:
    """The fault in frame numbers that no clip can have, "" where there is none."""
    try:
        check_numbers(numbers, "")
    except mcz.MotionError as error:
        return str(error)
    return ""


def _tuples(value: Any) -> Any:
    return tuple(map(_tuples, value)) if isinstance(value, list) else value


def _channels(held: list[list[str]]) -> tuple[Channel, ...]:
    return tuple(Channel(*channel) for channel in held)


def _grid(held: list[Any]) -> Grid:
    return Grid(GridKind(held[0]), *held[1:])


class Migration:
    """The old content on its way into a new file; ``notes`` say what is kept otherwise."""

    def __init__(self, old: Old, stream: BinaryIO, codec: str | None = None) -> None:
        self.old, self.codec, self.notes = old, codec, list[str]()
        profile = BASE if old.content["header"]["profile"] == "base" else LARGE
        self.writer = Writer(stream, profile=profile, copies=old.content["has_copies"])
        self._skeletons: dict[str, tuple[bytes, Skeleton]] = {}  # by their old ids
        self.split = set[str]()  # clips whose column of times is a signal of its own now
        self.untimed = set[str]()  # clips whose times were not those of their frame numbers
        self._as_files: dict[str, str] = {}  # clips whose file is an attachment now

    def write(self) -> None:
        content = self.old.content
        for held in content["skeletons"]:
            self._skeleton(held)
        for clip in content["clips"]:
            self._clip(clip)
        for held in content["attachments"]:
            self.writer.attachment(held["path"], self.old.data(held["data"]))
        for name, kind, target in content["aliases"]:
            self.writer.alias(name, *self._target(kind, target))
        if content["metadata"]:
            self.writer.metadata([Record("", content["metadata"])])
        self.writer.finish()

    def _skeleton(self, held: Content) -> None:
        skeleton = self.old.skeleton(held)
        if held["base"] is not None:
            skeleton = replace(skeleton, base=self._skeletons[held["base"]][0])
        self._skeletons[held["id"]] = write_skeleton(self.writer, skeleton), skeleton

    def _clip(self, clip: Content) -> None:
        skeleton = self._skeletons[clip["skeleton"]][1]
        motion = self.old.motion(clip, skeleton)
        if NUMBERS in motion.metadata:
            self.notes.append(f"clip {clip['name']}: frame numbers of 0.9 are its {NUMBERS}")
        if clip["file"] is not None:
            motion = self._add_source(clip, motion)
        if not motion.signals_of("times"):
            motion = self._add_times(clip, motion)
        kept = clip["codec"] if clip["codec"] in KEPT else "fast"
        write_clip(self.writer, motion, codec_by_name(self.codec or kept), {})
        if clip["quality"] is not None:
            self.writer.ancillary(ChunkType.QUAL, quality_payload(clip["quality"]))
        if clip["file"] is not None and motion.source is None:
            self._as_attachment(clip)

    def _add_times(self, clip: Content, motion: Motion) -> Motion:
        """The clip at the times that it had, where its frame numbers give them."""
        timed = motion.at_times(self.old.times(clip))
        kept = numbers_or_rows(timed.frame_numbers, timed.n_frames)
        is_same = np.array_equal(kept, self.old.frame_numbers(clip))
        if is_same and len(timed.signals) == len(motion.signals):
            return timed
        self.notes.append(f"clip {clip['name']}: its times are those of its frame numbers")
        self.untimed.add(clip["name"])
        return motion

    def _add_source(self, clip: Content, motion: Motion) -> Motion:
        """The clip with its source, read again from restored bytes; without where it differs."""
        if not clip["is_lossless"]:
            return motion
        found = self._read(clip)
        if found is None or found.source is None:
            return motion
        source = replace(found.source, path=clip["file"]["path"])
        wanted = [held["sha256"] for held in clip["signals"]]
        if [_hash(signal) for signal in found.signals] == wanted:
            return replace(motion, signals=found.signals, source=source)
        if len(found.signals) == len(wanted) + 1 and _joined_hashes(found.signals) == wanted:
            self.split.add(clip["name"])
            own = motion.skeleton
            skeleton = replace(found.skeleton, unit_cm=own.unit_cm, up_axis=own.up_axis)
            return replace(motion, skeleton=skeleton, signals=found.signals, source=source)
        return motion

    def _read(self, clip: Content) -> Motion | None:
        suffix = Path(clip["file"]["path"] or f"x.{clip['file']['format']}").suffix
        path = self.old.on_disk(clip["file"], f"source{suffix}")
        by_id = {held["id"]: held for held in self.old.content["skeletons"]}
        held = by_id[clip["skeleton"]]
        own = held["file"] or (by_id[held["base"]]["file"] if held["base"] else None)
        asf = "none" if own is None else self.old.on_disk(own, "skeleton.asf")
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                return mcz.read(path, skeleton=asf)
        except mcz.MczError:
            return None

    def _as_attachment(self, clip: Content) -> None:
        path = clip["file"]["path"]
        why = (
            "decoded values are kept exactly"
            if not clip["is_lossless"]
            else "it is read otherwise today"
        )
        if not path:
            self.notes.append(
                f"clip {clip['name']}: its file, which has no name, is not kept: {why}"
            )
            return
        self.notes.append(f"clip {clip['name']}: {path} is an attachment: {why}")
        self.writer.attachment(path, self.old.data(clip["file"]["data"]))
        self._as_files[clip["name"]] = path

    def _target(self, kind: str, name: str) -> tuple[int, bytes]:
        if kind == "skeleton":
            return payloads.OF_SKELETON, self._skeletons[name][0]
        if kind == "clip" and name not in self._as_files:
            return payloads.OF_CLIP, name.encode()
        return payloads.OF_ATTACHMENT, self._as_files.get(name, name).encode()


def _hash(signal: Signal) -> str:
    return value_hash(signal.stored, signal.mask).hex()


def _joined_hashes(signals: Sequence[Signal]) -> list[str]:
    """Hashes where the times stand before the channels of the motion, as 0.9 has them in tables."""
    times = [signal for signal in signals if signal.role == "times"]
    motion, *others = (signal for signal in signals if signal.role != "times")
    if len(times) != 1 or len(times[0].values) != len(motion.values):
        return []
    parts = (times[0], motion)
    values = np.concatenate([part.stored for part in parts], axis=1)
    masks = [np.ones(p.values.shape, np.bool_) if p.mask is None else p.mask for p in parts]
    return [value_hash(values, np.concatenate(masks, axis=1)).hex(), *map(_hash, others)]


def _role(held: Content, index: int) -> tuple[str, int | None]:
    """The role of a signal, by which readers know it now, from the name by which they did."""
    name = held["name"]
    if not index:
        return "motion", None
    if name == "residuals":
        return "residuals", 0
    if name in ("time", "times", "timestamp", "timestamps"):
        return ("times" if held["is_times"] else ""), None
    return (name if name in ("analog", "outputs", "rotations") else ""), None


def differences(
    old: Old, path: Path, split: Collection[str], untimed: Collection[str] = ()
) -> Iterator[str]:
    """List what the new file does not give back of the old one; ``split``: whose times moved.

    ``untimed``: whose times are not to be compared.
    """
    content = old.content
    for problem in mcz.verify(path, max_decoded=2**53):
        yield problem.message
    with mcz.open(path, max_decoded=2**53, verify=True) as file:
        if [clip.name for clip in file] != [clip["name"] for clip in content["clips"]]:
            yield "names of clips"
        if dict(file.metadata) != content["metadata"]:
            yield "metadata of the file"
        for clip in content["clips"]:
            moved = clip["name"] in split
            found = _of_clip(old, file.clips[clip["name"]], clip, moved)
            yield from (f"clip {clip['name']}: {what}" for what in found)
            new, was = file.clips[clip["name"]].timeline, old.times(clip)
            if was is not None and clip["name"] not in untimed and not _is_near(new, was):
                yield f"clip {clip['name']}: times"
        restored = {name: data() for name, data in named_files(file)}
        for name, sha256 in _old_files(content):
            if hashlib.sha256(restored.get(name, b"")).hexdigest() != sha256:
                yield f"file {name}"


def _is_near(new: Timeline | None, was: Timeline) -> bool:
    if new is None:
        return False
    return new.is_near(was) or bool(np.abs(new.times - was.times).max() <= was.rounding + TOLERANCE)


def _of_clip(old: Old, clip: mcz.Clip, was: Content, moved: bool) -> Iterator[str]:
    held = {one["id"]: one for one in old.content["skeletons"]}[was["skeleton"]]
    rate, wanted = clip.frame_rate, [one["sha256"] for one in was["signals"]]
    found = [sha256.hex() for sha256 in clip.value_hashes]
    if (_joined_hashes(clip.motion().signals) if moved else found) != wanted:
        yield "values"
    if was["rate"] != (None if rate is None else [rate.numerator, rate.denominator]):
        yield "frame rate"
    if not np.array_equal(clip.frame_numbers, old.frame_numbers(was)):
        yield "frame numbers"
    if dict(clip.metadata) != old.metadata(was):
        yield "metadata"
    if was["quality"] != clip.quality:
        yield "quality record"
    if not moved:
        if [one.name for one in clip.signals] != [one["name"] for one in was["signals"]]:
            yield "names of signals"
        if replace(clip.skeleton, base=None) != replace(old.skeleton(held), source=None):
            yield "skeleton"
        if (clip.base_skeleton is None) != (held["base"] is None):
            yield "base of the skeleton"


def _old_files(content: Content) -> Iterator[tuple[str, str]]:
    """Name and hash of every file that the old one gives back."""
    clips = {clip["name"]: clip["file"] for clip in content["clips"]}
    skeletons = {held["id"]: held["file"] for held in content["skeletons"]}
    attachments = {held["path"]: held for held in content["attachments"]}
    for held in (*clips.values(), *attachments.values()):
        if held is not None and held["path"]:
            yield held["path"], held["sha256"]
    tables = {"clip": clips, "skeleton": skeletons, "attachment": attachments}
    for name, kind, target in content["aliases"]:
        yield name, tables[kind][target]["sha256"]
