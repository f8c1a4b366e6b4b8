"""The tables of ``requirements`` for codecs of points, the post filter, and what is computed."""

from __future__ import annotations

# What shows a rule beside the vectors that catch a decoder without it.
VECTORS: dict[str, tuple[str, ...]] = {
    "BITS-01": ("valid/*-prefix",),
    "BITS-02": ("invalid/*/byte-*-prefix", "invalid/lsdt-*/stream-empty"),
    "PREFIX-04": ("invalid/*/*-sum-*", "invalid/*/*-single-2"),
    "PREFIX-05": ("valid/*/codes-*",),
    "BASES-01": (
        "invalid/*/model-byte-missing",
        "invalid/lsdt-clip/frames-0-model",
        "invalid/lsdt-clip/bases-*-cut",
    ),
    "BASES-02": ("invalid/lsdt-clip/bases-0", "invalid/lsdt-clip/bases-17"),
    "BASES-03": ("invalid/lsdt-clip/bases-points-*",),
    "BASES-07": ("invalid/lsdt-clip/bases-*", "valid/lsdt-*/model-entries"),
    "BASES-09": ("uncommon/*/model-missing", "uncommon/container/frames-0-model-missing"),
    "SPACE-04": ("valid/*/cosines*",),
    "SPACE-05": ("valid/*/learned*", "valid/*/known*", "valid/*/model-shared"),
    "SPACE-06": ("invalid/*/model-bases-*", "invalid/pca-rdo/mean-*"),
    "SPACE-07": ("invalid/*/model-points-*", "invalid/*/model-third"),
    "SPACE-08": ("invalid/*/model-kind",),
    "SPACE-09": ("invalid/lsdt-*/step-*", "valid/lsdt-*/step-*"),
    "SPACE-10": ("valid/*/weights*",),
    "SPACE-11": ("invalid/*/weights-*",),
    "SPACE-12": ("invalid/*/first-*", "invalid/*/other-*"),
    "SPACE-13": ("invalid/*/*-length-16", "invalid/*/*-length-255"),
    "SPACE-14": ("invalid/*/*-lengths-91",),
    "WIND-07": ("invalid/lsdt-clip/window*",),
    "WIND-11": ("valid/lsdt-clip/*", "valid/mdtt/*", "valid/pca-rdo/*", "valid/*/longer*"),
    "WIND-13": ("invalid/lsdt-clip/hash-*",),
    "WIND-14": ("valid/pca-rdo/courses-*",),
    "FRAME-04": ("valid/lsdt-frame/segments-*", "valid/lsdt-frame/cut-*"),
    "FRAME-05": ("invalid/lsdt-frame/*",),
    "FRAME-08": ("valid/lsdt-frame/*",),
    "ONLINE-08": ("invalid/online/unit-*", "invalid/online/head-*", "invalid/online/size-*"),
    "ONLINE-09": ("invalid/online/kind-3-*",),
    "ONLINE-13": ("invalid/online/first-*tr", "invalid/online/live-fresh-*"),
    "ONLINE-14": ("invalid/online/distance-*",),
    "ONLINE-16": ("valid/online/*", "invalid/online/*"),
    "ONLINE-18": ("invalid/online/step-*",),
    "ONLINE-22": ("invalid/online/prefix-size-*",),
    "ONLINE-23": ("invalid/online/byte-*", "invalid/online/bytes-*"),
    "ONLINE-24": ("valid/online/step*", "invalid/online/hash-*"),
    "FILT-02": ("valid/filtered/*",),
}

LOST = "Every packet of a vector has come; what a reader does who misses some is shown by"
DECODERS = "No answer of a decoder depends on it; shown by"
ARGUED: dict[str, str] = {
    "BASES-08": "A rule for writers; shown by tests/codecs/test_lsdt.py::"
    "test_an_archive_has_the_well_known_models_too",
    "ONLINE-25": "A rule for writers; shown by "
    "tests/codecs/test_contract_live.py::test_a_file_of_the_packets_has_what_came_live",
    "ONLINE-26": f"{LOST} tests/codecs/test_online_losses.py::"
    "test_what_comes_is_decoded_where_it_may_be",
    "ONLINE-27": f"{LOST} tests/codecs/test_online.py::"
    "test_a_predicted_ltr_is_not_decoded_from_the_wrong_one",
    "KIN-01": f"{DECODERS} tests/test_kinematics.py::test_positions_of_any_skeleton",
    "FILT-03": "A decoder is asked to filter only what can be; shown by "
    "tests/test_post_filter.py::test_what_cannot_be_filtered",
}
