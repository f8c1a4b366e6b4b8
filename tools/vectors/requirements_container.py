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
    "CONV-10": ("uncommon/container/extension-*",),
    "CHUNK-11": ("uncommon/container/unknown-critical*",),
    "CHUNK-12": ("uncommon/container/unknown-ancillary*",),
    "GRAM-01": (
        "valid/random/*",
        "valid/recovery/*",
        "uncommon/container/no-index",
    ),
    "GRAM-09": ("uncommon/container/appended-*", "valid/*/appended"),
    "HEAD-01": ("uncommon/container/newer-major*",),
    "HEAD-05": ("uncommon/container/unknown-codec",),
    "PACK-01": ("uncommon/container/*packets*", "uncommon/container/open-data*"),
    "PACK-20": ("uncommon/container/frame-packets-gap*",),
    "TEXT-01": ("uncommon/container/grids-without-text-lossy",),
}

_REWRITER = "of rewriters, and a decoder writes no file: shown by tests/"
_SALVAGE = "of salvaging readers, and the contract asks for strict ones: shown by tests/"
_REPAIR = "of writers and repairers of RECV, which decoders skip: shown by tests/"
_LIVE = (
    "of tolerant readers of live streams, and the contract asks for strict ones of files: shown by "
)
_LIVE_TESTS = {
    "01": "test_stream.py::test_what_is_shown_for_a_lost_frame",
    "02": "test_stream.py::test_no_frame_in_the_wrong_place_is_said_to_be_decoded",
    "03": "test_stream.py::test_a_damaged_packet_is_one_that_did_not_come",
    "05": "test_stream.py::test_packets_lost_at_random",
    "06": "test_stream.py::test_behind_a_gap_among_several_signals_numbers_are_not_known",
    "07": "test_stream.py::test_packets_of_another_data_are_not_taken_for_those_that_are_due",
    "08": "test_stream.py::test_packets_lost_at_random",
    "09": "test_stream.py::test_a_clip_that_is_said_to_be_longer",
    "10": "test_stream.py::test_packets_lost_at_random",
    "11": "test_stream.py::test_cut_at_every_byte",
    "12": "test_stream.py::test_many_gaps_are_paid_for_by_bytes",
    "13": "test_live.py::test_many_frames",
}

ARGUED: dict[str, str] = {
    "CONV-11": _REWRITER + "test_extract.py::test_extensions_are_kept_in_what_is_cut",
    "CHUNK-04": "a file that breaks it has more than 2 GiB, or ends before the chunk (CHUNK-05)",
    "CHUNK-07": "of what a reader tells its caller where that asked for unverified parts: shown by "
    "tests/test_parts.py::test_the_command_says_what_is_unverified",
    "CHUNK-13": _REWRITER + "test_extract.py::test_all_clips_are_cut_alike_and_the_rest_is_kept",
    "CHUNK-14": _REWRITER + "test_stream.py::test_rewriting_drops_it",
    "SALV-01": _SALVAGE + "test_regressions.py::test_salvage_of_integers",
    "SALV-02": _SALVAGE + "test_container.py::test_salvage_goes_on_behind_garbage",
    "SALV-03": _SALVAGE + "test_container.py::test_salvage_goes_on_behind_garbage",
    "SALV-04": _SALVAGE + "test_live.py::test_salvage_of_a_clip_that_was_cut_off",
    "SALV-05": _SALVAGE + "codecs/test_contract_live.py::"
    "test_a_damaged_packet_costs_the_frames_up_to_a_fresh_one",
    "ARRAY-12": "a file that breaks it has more than 4 GiB",
    "LIMIT-06": "a file that breaks it has more than 64 MiB, and raw deflate does not shorten MODL",
    "SALV-06": _SALVAGE + "test_copies.py::test_a_bad_byte_costs_nothing_that_has_a_copy",
    "SALV-07": _SALVAGE + "test_copies.py::test_a_bad_byte_costs_nothing_that_has_a_copy",
    "SALV-08": _SALVAGE + "test_copies.py::test_what_is_sound_is_kept",
    "SALV-09": _SALVAGE + "test_copies.py::test_a_skeleton_is_made_again_from_its_asf",
    "SALV-10": _SALVAGE + "test_repair.py::test_no_clip_gets_frames_of_the_next_one",
    "LIMIT-16": "copies of chunks that are there, each once, are shorter than the file: whatever "
    "states more is refused by LIMIT-14, COPY-02 or COPY-03",
    "QUAL-03": _REWRITER + "test_quality_joints.py::test_joints_stay_themselves_in_a_cut",
    "META-05": _REWRITER + "test_metadata.py::test_it_goes_along",
    "META-06": _REWRITER + "test_metadata.py::test_what_is_said_of_a_deleted_clip_is_gone",
    "META-09": _REWRITER + "test_metadata.py::test_nothing_of_what_was_withdrawn_is_left",
    "RECV-01": _REPAIR + "test_recovery.py::test_the_vectors_are_repaired",
    "RECV-02": _REPAIR + "test_recovery.py::test_any_damage_is_repaired_or_salvaged_or_refused",
    "RECV-03": _REWRITER + "test_recovery.py::test_what_follows_a_protected_file_is_protected",
    "LIMIT-11": "raw deflate makes at most 1032 times its bytes, less than the 4096 times the file "
    "that is allowed: whatever states more is refused by LIMIT-14, ATTA-03 or ATTA-04",
    "PATH-06": "of readers that write files, which a decoder under test does not: shown by tests/"
    "test_archive.py::test_no_file_overwrites_another",
    "CLIP-13": "every codec has one resolution or more, so that CLIP-15 refuses 0 as well",
    "CEND-06": "of programs that write files: shown by tests/test_value_hashes.py::"
    "test_no_command_writes_values_that_are_not_those_hashed",
    "CEND-07": "of writers: shown by tests/test_value_hashes.py::test_a_faulty_encoder_is_found",
    "PACK-19": "of readers that follow a file while it is written; of whole files it is CEND-05: "
    "shown by tests/test_live.py::test_the_hash_is_compared_at_the_end",
    "REPT-01": "of writers, and a reader must not look: shown by tests/test_stream.py::"
    "test_what_is_repeated",
    "REPT-04": "of readers that join streams: shown by tests/test_stream.py::test_joining_anywhere",
    "CUT-01": _REWRITER + "test_extract.py::test_streams_are_copied_byte_for_byte",
    "CUT-02": _REWRITER + "test_extract.py::test_any_cut_shows_what_was_asked_for",
    "CUT-03": "a reader may decode what is stored and not shown, and refuse what is wrong in it: "
    "both answers are right",
    "EDIT-01": _REWRITER + "test_replace.py::test_the_joint_changes_and_nothing_else",
    "TEXT-02": "of writers: shown by tests/test_numbers.py::test_printed_means_the_same_text",
    **{f"LIVE-{number}": f"{_LIVE}tests/{test}" for number, test in _LIVE_TESTS.items()},
}
