"""The tables of ``requirements`` for the container, texts and source files."""

from __future__ import annotations

# What shows a rule beside the vectors that catch a decoder without it.
VECTORS: dict[str, tuple[str, ...]] = {
    "DATA-11": ("uncommon/container/not-fresh",),
    "DATA-09": ("uncommon/container/lead-and-tail",),
    "CLIP-16": ("uncommon/container/open-clip",),
    "CONV-09": ("uncommon/container/stored-blocks",),
    "CONV-16": ("uncommon/container/unknown-source-beside",),
    "GRAM-10": (
        "uncommon/container/model-behind",
        "uncommon/container/unused-model",
    ),
    "CONV-02": ("invalid/*-varint", "invalid/shared/varint-endless"),
    "CONV-06": ("invalid/shared/text-*",),
    "CONV-10": ("uncommon/container/extension-*",),
    "CONV-12": ("invalid/sources/*-tail", "invalid/*/*-and-byte"),
    "CONV-13": ("invalid/chunks/cut-*", "invalid/sources/*-cut", "invalid/data/cut-*"),
    "CONV-14": ("invalid/*/*-flag", "invalid/data/flag"),
    "CONV-15": (
        "invalid/shared/angle-unit",
        "invalid/shared/up-axis",
        "invalid/shared/axis-order",
        "invalid/shared/ALIA-of",
        "invalid/clip/groups-kind",
    ),
    "CHUNK-03": ("invalid/parts/*",),
    "CHUNK-05": ("invalid/chunks/length-*", "invalid/grammar/truncated*"),
    "CHUNK-11": ("uncommon/container/unknown-critical*",),
    "CHUNK-12": ("uncommon/container/unknown-ancillary*", "valid/*/ancillary"),
    "FOOT-04": ("invalid/grammar/FOOT-*",),
    "GRAM-01": (
        "valid/random/*",
        "uncommon/container/no-index",
        "invalid/grammar/*",
        "valid/container/*",
        "valid/skeletons/*",
    ),
    "GRAM-04": ("invalid/shared/ALIA-no-*",),
    "GRAM-09": ("uncommon/container/appended-*", "valid/*/appended"),
    "STRICT-01": (
        "invalid/grammar/truncated*",
        "invalid/grammar/byte-after-FOOT",
        "invalid/grammar/append-cut",
        "invalid/grammar/*-alone",
        "invalid/chunks/no-bytes",
    ),
    "STRICT-03": ("invalid/*",),
    "STRICT-04": ("invalid/index/*", "invalid/cut/index-*", "invalid/packets/*-index*"),
    "LIMIT-02": ("invalid/*bomb*", "invalid/shared/count-of-joints"),
    "LIMIT-14": ("invalid/shared/SRCE-size-ratio", "invalid/shared/SRCE-size-huge"),
    "HEAD-01": ("uncommon/container/newer-major*",),
    "HEAD-05": ("uncommon/container/unknown-codec",),
    "SKEL-08": ("invalid/shared/axis-*",),
    "ATTA-01": ("invalid/shared/ATTA-*", "valid/container/attachments"),
    "ALIA-01": ("valid/sources/asf",),
    "ALIA-02": ("valid/sources/bvh-shared-template",),
    "CLIP-15": ("invalid/*/frames-0-resolutions",),
    "PATH-01": ("invalid/sources/path-*", "invalid/shared/path-absolute"),
    "CLIP-18": ("valid/cut/*", "invalid/cut/*", "valid/*/cut-*"),
    "CLIP-20": ("invalid/cut/*-2-53",),
    "DATA-01": ("invalid/data/streams-*", "invalid/data/length-of-stream"),
    "DATA-03": ("valid/raw/*",),
    "DATA-08": ("invalid/data/*",),
    "NOTES-06": ("valid/*/grid-changes",),
    "MASK-01": ("valid/*/mask*", "invalid/notes/mask-*"),
    "PACK-01": ("uncommon/container/*packets*", "uncommon/container/open-data*"),
    "PACK-12": ("valid/*/packets-*", "valid/online/live*", "valid/online/numbered*"),
    "REPT-03": ("valid/online/repeat-*",),
    "CEND-02": ("invalid/clip/value-hash-missing", "invalid/clip/value-hash-too-many"),
    "CEND-05": ("invalid/*/another-value", "invalid/*/hash-*"),
    "QUAL-02": ("valid/container/quality", "valid/mrdwt/quality-odd"),
    "GRID-01": ("invalid/notes/change-kind",),
    "GRID-02": ("invalid/numbers/*-digits",),
    "GRID-04": ("invalid/numbers/scale-*",),
    "GRID-05": ("invalid/numbers/ordinal-of-*",),
    "GRID-09": ("valid/numbers/*",),
    "GRID-11": ("valid/sources/*-lossy-*",),
    "TEXT-01": (
        "uncommon/container/grids-without-text-lossy",
        "valid/sources/bvh-style-*",
    ),
    "TEXT-05": ("invalid/notes/spelling-*",),
    "SRC-01": ("valid/sources/*", "valid/cut/source-*"),
    "SRC-03": ("invalid/sources/template-header", "invalid/sources/template-no-header"),
    "SRC-09": ("invalid/sources/template-no-columns", "invalid/sources/template-number-twice"),
    "AMC-05": ("invalid/sources/notes-text-*",),
    "AMC-06": ("valid/sources/bvh-*", "valid/sources/amc*"),
    "C3D-05": ("invalid/sources/c3d-template-*-many",),
    "C3D-12": ("invalid/sources/c3d-detail-values-*",),
    "C3D-14": ("invalid/sources/c3d-signals-*", "invalid/sources/c3d-outputs-*"),
    "C3D-17": ("invalid/sources/c3d-outputs-run-of-none-last",),
    "C3D-18": ("invalid/sources/c3d-outputs-many",),
    "C3D-15": ("valid/sources/c3d-*",),
    "REG-01": ("invalid/clip/frame-numbers-*", "valid/container/frame-numbers"),
}

_REWRITER = "of rewriters, and a decoder writes no file: shown by tests/"
_SALVAGE = "of salvaging readers, and the contract asks for strict ones: shown by tests/"
_LIVE = (
    "of tolerant readers of live streams, and the contract asks for strict ones of files: shown by "
)
_LIVE_TESTS = {
    "01": "test_stream.py::test_what_is_shown_for_a_lost_frame",
    "02": "test_stream.py::test_no_frame_in_the_wrong_place_is_said_to_be_decoded",
    "03": "test_stream.py::test_every_flipped_bit",
    "05": "test_stream.py::test_packets_lost_at_random",
    "06": "test_stream.py::test_behind_a_gap_among_several_signals_numbers_are_not_known",
    "07": "test_stream.py::test_packets_of_another_data_are_not_taken_for_those_that_are_due",
    "08": "test_stream.py::test_packets_lost_at_random",
    "09": "test_stream.py::test_a_clip_that_is_said_to_be_longer",
    "10": "test_stream.py::test_packets_lost_at_random",
    "11": "test_stream.py::test_cut_at_every_byte",
    "12": "test_stream.py::test_many_gaps_are_paid_for_by_bytes",
    "13": "test_live.py::test_a_hundred_thousand_frames",
}

ARGUED: dict[str, str] = {
    "CONV-11": _REWRITER + "test_extract.py::test_listed_groups_and_extensions",
    "CHUNK-04": "a file that breaks it has more than 2 GiB, or ends before the chunk (CHUNK-05)",
    "CHUNK-07": "of what a reader tells its caller where that asked for unverified parts: shown by "
    "tests/test_parts.py::test_the_command_says_what_is_unverified",
    "CHUNK-13": _REWRITER + "test_extract.py::test_all_clips_are_cut_alike_and_the_rest_is_kept",
    "CHUNK-14": _REWRITER + "test_stream.py::test_rewriting_drops_it",
    "SALV-01": _SALVAGE + "test_container.py::test_one_bad_byte_costs_one_segment",
    "SALV-02": _SALVAGE + "test_container.py::test_salvage_goes_on_behind_garbage",
    "SALV-03": _SALVAGE + "test_container.py::test_salvage_goes_on_behind_garbage",
    "SALV-04": _SALVAGE + "test_container.py::test_open_data_cut_anywhere_salvages_whole_packets",
    "SALV-05": _SALVAGE + "test_live.py::test_a_lost_frame_costs_those_up_to_the_next_fresh_one",
    "LIMIT-06": "a file that breaks it has more than 64 MiB, and raw deflate does not shorten MODL",
    "LIMIT-07": "a file that breaks it has more than 2 GiB, or ends before the chunk (CHUNK-05)",
    "LIMIT-11": "raw deflate makes at most 1032 times its bytes, less than the 4096 times the file "
    "that is allowed: whatever states more is refused by LIMIT-14, ATTA-03 or ATTA-04",
    "PATH-06": "of readers that write files, which a decoder under test does not: shown by tests/"
    "test_archive.py::test_no_file_overwrites_another",
    "CLIP-13": "every codec has one resolution or more, so that CLIP-15 refuses 0 as well",
    "PACK-19": "of readers that follow a file while it is written; of whole files it is CEND-05: "
    "shown by tests/test_live.py::test_the_hash_is_compared_at_the_end",
    "REPT-01": "of writers, and a reader must not look: shown by tests/test_stream.py::"
    "test_what_is_repeated",
    "REPT-04": "of readers that join streams: shown by tests/test_stream.py::test_joining_anywhere",
    "LIVE-14": "of transports of packets; what comes of one that does not keep to it: "
    "tests/test_stream.py::test_no_frame_in_the_wrong_place_is_said_to_be_decoded",
    "CUT-01": _REWRITER + "test_extract.py::test_streams_are_copied_byte_for_byte",
    "CUT-02": _REWRITER + "test_extract.py::test_any_cut_shows_what_was_asked_for",
    "CUT-03": "a reader may decode what is stored and not shown, and refuse what is wrong in it: "
    "both answers are right",
    "EDIT-01": _REWRITER + "test_replace.py::test_the_joint_changes_and_nothing_else",
    "TEXT-02": "of writers: shown by tests/test_numbers.py::test_printed_means_the_same_text",
    **{f"LIVE-{number}": f"{_LIVE}tests/{test}" for number, test in _LIVE_TESTS.items()},
}
