"""Which vectors show the rules of posewave and of what it is made of."""

from __future__ import annotations

_ALL = "valid/posewave/*"

VECTORS: dict[str, tuple[str, ...]] = {
    "LIFT-01": ("valid/posewave/levels-*", "valid/posewave/length-*"),
    "POSE-01": (
        "valid/posewave/fixed*",
        "valid/posewave/intrinsic*",
        "valid/posewave/angles-*",
        "valid/posewave/positions-*",
        "valid/posewave/no-extent*",
        "valid/posewave/re*",
        "valid/posewave/*-far",
    ),
    "POSE-02": ("valid/posewave/path-*",),
    "ROWS-02": ("valid/posewave/rows-of-zeros", "valid/posewave/refining-*"),
    "ROWS-03": (_ALL,),
    "ROWS-05": ("valid/posewave/fine", "valid/posewave/escapes*", "valid/posewave/start-*"),
    "ROWS-06": ("valid/posewave/kept-*", "valid/posewave/noise"),
    "PWAVE-06": ("valid/posewave/borrowing-*",),
    "PWAVE-09": ("valid/posewave/step-*",),
    "PWAVE-10": ("valid/posewave/radius-*",),
    "PWAVE-11": ("valid/posewave/shell-*",),
    "PWAVE-16": ("valid/posewave/resolutions-*",),
    "PWAVE-18": ("valid/posewave/*-kept", "valid/posewave/numbers-*"),
    "PWAVE-20": ("valid/posewave/none-kept",),
    "PWAVE-21": ("valid/posewave/levels-*",),
    "PWAVE-22": ("valid/posewave/levels-*", "valid/posewave/borrowing-*"),
    "PWAVE-24": ("valid/posewave/notes-*",),
    "PWAVE-27": ("valid/posewave/order*", "valid/posewave/notes-*"),
    "PWAVE-29": ("valid/posewave/on*", "valid/posewave/live*"),
    "PWAVE-34": ("valid/posewave/exact-apart",),
    "PWAVE-36": ("valid/posewave/exact-*",),
    "PWAVE-38": ("valid/posewave/exact-one", "valid/posewave/exact-order"),
    "CODEC-06": ("valid/posewave/exact-of-text",),
    "HOLD-01": ("valid/posewave/contacts-*",),
    "HOLD-04": ("valid/posewave/contacts-step-*",),
    "HOLD-07": (
        "valid/posewave/contacts-cut",
        "valid/posewave/contacts-segments",
        "valid/posewave/contacts-levels-*",
    ),
    "HOLD-09": ("valid/posewave/contacts-none",),
    "HOLD-12": ("valid/posewave/contacts-*",),
    "HOLD-14": (
        "valid/posewave/contacts-ramp-*",
        "valid/posewave/contacts-leaning",
        "valid/posewave/contacts-segments",
    ),
    "HOLD-15": ("valid/posewave/contacts-*",),
}

ARGUED: dict[str, str] = {
    "PWAVE-31": "A rule for who goes on after a loss; shown by "
    "tests/codecs/test_contract_live.py::test_after_a_loss_no_frame_is_wrong",
}
