"""Which vectors show the rules of codec 13 and of what it is made of."""

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
    "ROWS-01": ("invalid/posewave/level-*",),
    "ROWS-02": ("valid/posewave/rows-of-zeros", "valid/posewave/refining-*"),
    "ROWS-03": (_ALL,),
    "ROWS-04": ("invalid/posewave/coefficient-*",),
    "ROWS-05": ("valid/posewave/fine", "valid/posewave/escapes*", "valid/posewave/start-*"),
    "ROWS-06": ("valid/posewave/kept-*", "valid/posewave/noise"),
    "PWAVE-01": ("invalid/posewave/groups*", "invalid/posewave/exact-none"),
    "PWAVE-02": ("invalid/posewave/samples",),
    "PWAVE-03": ("invalid/posewave/segment-lead", "invalid/posewave/segment-tail"),
    "PWAVE-05": ("invalid/posewave/levels-9",),
    "PWAVE-06": ("invalid/posewave/borrowing-*", "valid/posewave/borrowing-*"),
    "PWAVE-07": ("invalid/posewave/start-*",),
    "PWAVE-08": ("invalid/posewave/refining-2",),
    "PWAVE-09": ("invalid/posewave/step-*", "valid/posewave/step-*"),
    "PWAVE-10": ("invalid/posewave/radius-*", "valid/posewave/radius-*"),
    "PWAVE-11": ("invalid/posewave/shell-17", "valid/posewave/shell-*"),
    "PWAVE-12": ("invalid/posewave/first-25", "invalid/posewave/constant-25"),
    "PWAVE-13": ("invalid/posewave/plain-*",),
    "PWAVE-14": ("invalid/posewave/weights-*",),
    "PWAVE-15": ("invalid/posewave/orders-*", "invalid/posewave/order-7"),
    "PWAVE-16": ("invalid/posewave/*resolutions", "valid/posewave/resolutions-*"),
    "PWAVE-17": ("invalid/posewave/stream-*",),
    "PWAVE-18": ("valid/posewave/*-kept", "valid/posewave/numbers-*"),
    "PWAVE-19": ("invalid/posewave/number-*",),
    "PWAVE-20": ("invalid/posewave/none-kept-*", "valid/posewave/none-kept"),
    "PWAVE-21": ("valid/posewave/levels-*",),
    "PWAVE-22": ("valid/posewave/levels-*", "valid/posewave/borrowing-*"),
    "PWAVE-23": ("invalid/posewave/order-*",),
    "PWAVE-24": ("valid/posewave/notes-*", "invalid/posewave/notes-*"),
    "PWAVE-25": ("invalid/posewave/notes-beyond*", "invalid/posewave/notes-many"),
    "PWAVE-26": ("invalid/posewave/notes-turns-*",),
    "PWAVE-27": ("valid/posewave/order*", "valid/posewave/notes-*"),
    "PWAVE-28": (
        "invalid/posewave/segment-not-fresh",
        "invalid/posewave/on-orders",
        "invalid/posewave/on-exact",
    ),
    "PWAVE-29": ("valid/posewave/on*", "valid/posewave/live*", "invalid/posewave/on-b*"),
    "PWAVE-30": ("invalid/posewave/on-none-kept-*",),
    "PWAVE-32": ("invalid/posewave/exact-descending", "invalid/posewave/exact-twice"),
    "PWAVE-33": ("invalid/posewave/exact-*beyond",),
    "PWAVE-34": ("invalid/posewave/exact-*elsewhere", "valid/posewave/exact-apart"),
    "PWAVE-35": ("invalid/posewave/exact-detail",),
    "PWAVE-36": ("valid/posewave/exact-*",),
    "PWAVE-37": ("invalid/posewave/exact-copies",),
    "PWAVE-38": ("valid/posewave/exact-one", "valid/posewave/exact-order"),
    "CODEC-06": ("valid/posewave/exact-of-text",),
}

ARGUED: dict[str, str] = {
    "PWAVE-31": "A rule for who goes on after a loss; shown by tests/codecs/test_posewave_live.py::"
    "test_what_is_decoded_after_a_loss_is_right",
    "PWAVE-04": "no writer gives a lossy codec a signal with channels of its own",
}
