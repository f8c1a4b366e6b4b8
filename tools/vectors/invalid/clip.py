"""Invalid, one fault each: CLIP and CEND."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from mcz.codecs import raw
from mcz.container import payloads
from mcz.container.limits import ARCHIVE
from mcz.container.value_hash import value_hash
from mcz.motion import Channel, Motion, Signal
from mcz.schema import varint
from tools.records import built
from tools.vectors.build.edits import Made, both, indexed, put
from tools.vectors.build.files import Broken, Crafter, Vector, file_of, finished, rehash
from tools.vectors.build.motions import dance

BEYOND = b"\x80" * 7 + b"\x10"  # 2^53 as a varint


def vectors() -> Iterable[Vector]:
    shelf = Broken("invalid/clip")
    _clip(shelf)
    _metadata(shelf)
    _signal(shelf)
    _crafted_signals(shelf)
    _cend(shelf)
    _twice(shelf)
    _hashes(shelf)
    _lists(shelf)
    _hash_beside_unknown(shelf)
    return shelf.vectors


def _clip(shelf: Broken) -> None:
    source = {"template": b"t" * 16, "format": 3, "detail": b"", "path": "a.bvh", "size": 1}
    lost = b"\1" + built(payloads.ClipSource, source, "source")
    cases: tuple[tuple[str, str, str, bytes, dict[str, Any]], ...] = (
        ("name-empty", "A clip without a name.", "name", b"\0", {"name": ""}),
        ("flag", "A reserved flag of CLIP is set.", "flags", b"\4", {}),
        (
            "skeleton-missing",
            "A skeleton that is not in the file.",
            "skeleton",
            b"s" * 16,
            {"skeleton": b"s" * 16},
        ),
        ("rate-over-0", "A frame rate over 0.", "rate_denominator", b"\0", {}),
        ("no-signal", "A clip without a signal.", "signals", b"\0", {}),
        ("open-with-frames", "An open clip that states its frames.", "flags", b"\1", {}),
        ("template-missing", "A template that is not in the file.", "source", lost, {}),
    )
    for name, purpose, path, new, row in cases:
        edit = put(payloads.Clip, path, new)
        shelf.edited(
            name, "CLIP", purpose, CLIP=edit, row=indexed(**row), index=name != "rate-over-0"
        )
    unknown = both(
        put(payloads.Clip, "rate_numerator", b"\0"), put(payloads.Clip, "rate_denominator", b"\0")
    )
    purpose = "An unknown frame rate over 0."
    shelf.edited("rate-unknown-over-0", "CLIP", purpose, CLIP=unknown, index=False)


def _metadata(shelf: Broken) -> None:
    numbers = {
        "words": "one two",
        "order": "1 3:9 2:5",
        "beyond": "1 4:9",
        "row-0": "1 0:9",
        "no-row": "1 :9",
        "sign": "+1",
        "underscore": "1_0",
        "zeros": "01",
        "blanks": "1  2:9",
        "empty": "",
    }
    for name, text in numbers.items():
        pair = built(payloads.Metadata, {"key": "frame-numbers", "value": text}, name)
        edit = put(payloads.Clip, "metadata", b"\1" + pair)
        purpose = f"Frame numbers {text!r} of a clip of 4 frames."
        shelf.edited(f"frame-numbers-{name}", "Registry", purpose, CLIP=edit)
    pair = built(payloads.Metadata, {"key": "x-a", "value": ""}, "metadata")
    edit = put(payloads.Clip, "metadata", b"\2" + pair * 2)
    shelf.edited("metadata-twice", "CLIP", "A key of the metadata twice.", CLIP=edit)


def _signal(shelf: Broken) -> None:
    five, seven, empty = b"\1\5\1\2\0", b"\1\7\1\2\0", b"\2\0\1\2\0\6\1\2\0"
    cases: tuple[tuple[str, str, str, bytes, dict[str, int]], ...] = (
        ("signal-flag", "A reserved flag of a signal is set.", "flags", b"\2", {}),
        ("samples-0", "No rows a frame.", "samples_per_frame", b"\0", {"samples_per_frame": 0}),
        ("resolutions-0", "No resolutions.", "n_resolutions", b"\0", {}),
        ("grids-too-few", "Grids of 5 of 6 channels.", "grids", five, {"n_channels": 5}),
        ("grids-too-many", "Grids of 7 of 6 channels.", "grids", seven, {"n_channels": 7}),
        ("grids-empty-run", "A run of grids for no channel.", "grids", empty, {}),
        ("groups-kind", "A kind of groups beyond the table.", "groups", b"\4", {}),
        ("groups-too-few", "Groups of 5 of 6 channels.", "groups", b"\3\2\4\1", {}),
        ("groups-too-many", "Groups of 7 of 6 channels.", "groups", b"\3\2\4\3", {}),
        ("groups-empty", "A group of no channels.", "groups", b"\3\3\4\0\2", {}),
    )
    for name, purpose, path, new, changes in cases:
        edit = put(payloads.Clip, f"signals.0.{path}", new)

        def row(row: Any, changes: dict[str, int] = changes) -> Any:
            return replace(row, signals=(replace(row.signals[0], **changes),))

        shelf.edited(name, "CLIP", purpose, CLIP=edit, row=row)
    header = put(payloads.Clip, "signals.0.header", b"\1h")
    purpose = "A header for raw, which has none."
    shelf.edited("codec-header", "Codec 0: raw", purpose, CLIP=header)


def _crafted_signals(shelf: Broken) -> None:
    own = dance(signals=(replace(dance().signals[0], channels=dance().skeleton.channels),))
    data = file_of(own, CLIP=put(payloads.Clip, "signals.0.groups", b"\1"))
    purpose = "Groups per joint of channels without joints."
    shelf.add("groups-without-joints", "CLIP", purpose, data)

    def doubled(made: Made) -> Made:
        ((header, streams),) = made
        return [(header, [*streams, *streams])]

    shelf.edited(
        "resolutions-of-raw",
        "Codec 0: raw; Codecs",
        "Two resolutions of raw, which has one.",
        CLIP=put(payloads.Clip, "signals.0.n_resolutions", b"\2"),
        segments=doubled,
    )
    hips = replace(dance().skeleton.joints[0], channels=dance().skeleton.channels[:1] * 16385)
    wide = replace(dance().skeleton, joints=(hips,))
    crafter = Crafter()
    crafter.profile = ARCHIVE  # which HEAD, written already, does not say
    crafter.clip(Motion(wide, (Signal(np.zeros((0, 16385))),), name="wide"), grouping="all")
    purpose = "16,385 channels in the base profile."
    shelf.add("channel-limit", "Limits and profiles", purpose, finished(crafter))


def _cend(shelf: Broken) -> None:
    cases: tuple[tuple[str, str, str, bytes], ...] = (
        ("value-hash", "A hash of other values.", "value_sha256", b"\1" + b"v" * 32),
        ("value-hash-missing", "No value hash.", "value_sha256", b"\0"),
        ("value-hash-too-many", "Two of one signal.", "value_sha256", b"\2" + b"v" * 64),
        ("source-hash-of-nothing", "A source's hash.", "source_sha256", b"\1" + b"s" * 32),
    )
    for name, purpose, path, new in cases:
        edit = put(payloads.Cend, path, new)
        shelf.edited(name, "CEND", f"Hashes of a clip without a source: {purpose}", CEND=edit)
    opened = both(put(payloads.Clip, "flags", b"\1"), put(payloads.Clip, "n_frames", b"\0"))
    for name, purpose, n_frames, clip in (
        ("CEND-frames", "CEND has a frame more than the segments.", 5, None),
        ("CEND-frames-of-open", "A frame less than the segments of an open clip.", 3, opened),
    ):
        edits = {"CLIP": clip} if clip else {}
        cend = put(payloads.Cend, "n_frames", bytes((n_frames,)))
        shelf.edited(name, "CEND", purpose, CEND=cend, row=indexed(n_frames=n_frames), **edits)
    three = put(payloads.Clip, "n_frames", b"\3")
    shelf.edited("CLIP-frames", "CLIP; CEND", "CLIP has a frame less than CEND.", CLIP=three)


def _hash_beside_unknown(clips: Broken) -> None:
    """A fault in a clip whose motion is of an unknown codec, which is legal."""
    analog = Signal(np.arange(8.0).reshape(8, 1), name="analog", samples_per_frame=2)
    analog = replace(analog, channels=(Channel("", "force"),))
    both_signals = replace(dance(), signals=(*dance().signals, analog))
    hashes = varint(2) + value_hash(dance().signals[0].values, None) + b"v" * 32
    wrong = put(payloads.Cend, "value_sha256", hashes)
    unknown = put(payloads.Clip, "signals.0.codec", varint(2**20))
    made = file_of(both_signals, CEND=wrong, CLIP=unknown, index=False)
    purpose = "A wrong value hash of the second signal, where the codec of the first is unknown."
    clips.add("value-hash-beside-unknown-codec", "CEND; Strict reading", purpose, made)


def _twice(shelf: Broken) -> None:
    source = {"template": b"t" * 16, "format": 3, "detail": b"", "path": "a.bvh", "size": 1}
    two = b"\2" + built(payloads.ClipSource, source, "source") * 2
    purpose = "Two sources of one clip."
    shelf.edited(
        "sources-two", "CLIP; Conventions", purpose, CLIP=put(payloads.Clip, "source", two)
    )
    two = put(payloads.Cend, "source_sha256", b"\2" + b"s" * 64)
    shelf.edited("source-hashes-two", "CEND; Conventions", "Two hashes of a source.", CEND=two)


def _hashes(shelf: Broken) -> None:
    edit = put(payloads.Clip, "rate_numerator", BEYOND)
    purpose = "A frame rate of 2^53 over 1."
    shelf.edited("rate-2-53", "CLIP; Conventions", purpose, CLIP=edit, index=False)
    wrong = {"CEND": put(payloads.Cend, "value_sha256", b"\1" + b"v" * 32)}
    crafter = Crafter()
    crafter.clip(dance(), codec=replace(raw.CODEC, id=2**20))
    crafter.edits |= wrong
    data = finished(crafter, dance(3, name="encore"))
    purpose = "A clip of an unknown codec, which is legal, before one with a wrong value hash."
    shelf.add("value-hash-behind-unknown-codec", "HEAD; CEND", purpose, data)
    good = value_hash(dance().signals[0].values, None)
    more = put(payloads.Cend, "value_sha256", b"\2" + good + b"v" * 32)
    purpose = "A hash more than there are signals; the first is right."
    shelf.edited("value-hash-more", "CEND", purpose, CEND=more)
    _no_signals(shelf)


def _no_signals(shelf: Broken) -> None:
    """Clips that a reader could go on with."""
    none = {
        "CLIP": put(payloads.Clip, "signals", b"\0"),
        "CEND": put(payloads.Cend, "value_sha256", b"\0"),
        "segments": lambda made: [],
    }
    purpose = "A clip of 4 frames without a signal, a segment and a hash."
    shelf.edited("no-signal-at-all", "CLIP", purpose, index=False, **none)
    edit = put(payloads.Clip, "signals.0.samples_per_frame", b"\0")
    data = file_of(dance(0), CLIP=edit, index=False)
    shelf.add("samples-0-of-no-frames", "CLIP", "No rows a frame, of no frames.", data)
    joints = put(payloads.Clip, "signals.0.groups", b"\1")
    own = dance(signals=(replace(dance().signals[0], channels=dance().skeleton.channels),))

    def merged(made: Made) -> Made:
        ((header, streams),) = made
        return [(header, [b"".join(streams[:4]), b"".join(streams[4:])])]

    data = file_of(own, grouping="channel", CLIP=joints, segments=merged)
    purpose = "Groups as if its own channels were those of the skeleton's joints."
    shelf.add("groups-of-no-joints", "CLIP", purpose, data)
    five = put(payloads.Clip, "signals.0.groups", b"\3\2\4\1")

    def shorter(made: Made) -> Made:
        """The second group, of two channels, loses one, of 4 rows and width 1."""
        ((header, (first, second)),) = made
        return [(header, [first, second[:13]])]

    hashed = rehash(dance().signals[0].values[:, :5])
    purpose = "Groups of 5 of 6 channels; the hash is of these."
    shelf.edited("groups-of-fewer", "CLIP", purpose, CLIP=five, segments=shorter, CEND=hashed)


def _lists(shelf: Broken) -> None:
    """Counts of more than there are bytes, in places where a list may be empty."""
    many = varint(2**40)
    for name, path, purpose in (
        ("count-metadata", "metadata", "2^40 pairs of metadata."),
        ("count-signals", "signals", "2^40 signals."),
        ("count-grids", "signals.0.grids", "2^40 runs of grids."),
    ):
        edit = put(payloads.Clip, path, many)
        shelf.edited(name, "CLIP; Conventions", purpose, CLIP=edit)
    edit = put(payloads.Cend, "value_sha256", many)
    shelf.edited("count-hashes", "CEND; Conventions", "2^40 hashes.", CEND=edit)
