"""The tables of ``requirements`` for codecs of points, the post filter, and what is computed."""

from __future__ import annotations

# What shows a rule beside the vectors that catch a decoder without it.
VECTORS: dict[str, tuple[str, ...]] = {
    "BASES-09": ("uncommon/container/frames-0-model-missing",),
}

LOST = "Every packet of a vector has come; what a reader does who misses some is shown by"
DECODERS = "No answer of a decoder depends on it; shown by"
ARGUED: dict[str, str] = {
    "BASES-08": "A rule for writers; shown by tests/codecs/test_lsdt.py::"
    "test_an_archive_has_the_well_known_models_too",
    "ONLINE-25": "A rule for writers; shown by "
    "tests/codecs/test_contract_live.py::test_a_file_of_the_packets_has_what_came_live",
    "ONLINE-26": f"{LOST} tests/codecs/test_contract_live.py::test_after_a_loss_no_frame_is_wrong",
    "ONLINE-27": f"{LOST} tests/codecs/test_online.py::"
    "test_a_predicted_ltr_is_not_decoded_from_the_wrong_one",
    "KIN-01": f"{DECODERS} tests/test_kinematics.py::test_positions_of_any_skeleton",
    "FILT-03": "A decoder is asked to filter only what can be; shown by "
    "tests/test_post_filter.py::test_what_cannot_be_filtered",
}
