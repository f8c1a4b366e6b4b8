"""Which vectors show the rules of codec 13 and of what only it has."""

from __future__ import annotations

VECTORS: dict[str, tuple[str, ...]] = {
    "LIFT-01": ("valid/posewave/levels-*", "valid/posewave/length-*"),
    "POSE-01": ("valid/posewave/*axes*", "valid/posewave/intrinsic*", "valid/posewave/positions-*"),
    "POSE-02": ("valid/posewave/path-*",),
    "ROWS-01": ("invalid/posewave/level-*",),
    "ROWS-02": (
        "valid/posewave/rows-of-zeros",
        "valid/posewave/pauses",
        "valid/posewave/refining-*",
    ),
    "ROWS-03": ("valid/posewave/noise", "valid/posewave/kept-*"),
    "ROWS-04": ("invalid/posewave/coefficient-*",),
    "ROWS-05": ("valid/posewave/escapes*",),
    "ROWS-06": ("valid/posewave/noise", "valid/posewave/kept-*"),
    "PWAVE-01": ("invalid/posewave/groups*",),
    "PWAVE-02": ("invalid/posewave/samples",),
    "PWAVE-03": ("invalid/posewave/segment-*",),
    "PWAVE-05": ("invalid/posewave/levels-9",),
    "PWAVE-06": ("invalid/posewave/borrowing-*",),
    "PWAVE-07": ("invalid/posewave/start-*",),
    "PWAVE-08": ("invalid/posewave/refining-2",),
    "PWAVE-09": ("invalid/posewave/step-*",),
    "PWAVE-10": ("invalid/posewave/radius-*",),
    "PWAVE-11": ("invalid/posewave/shell-17",),
    "PWAVE-12": ("invalid/posewave/first-25", "invalid/posewave/constant-25"),
    "PWAVE-13": ("invalid/posewave/plain-*",),
    "PWAVE-14": ("invalid/posewave/weights-*",),
    "PWAVE-15": ("invalid/posewave/orders-*",),
    "PWAVE-16": ("invalid/posewave/resolutions",),
    "PWAVE-17": ("invalid/posewave/stream-*-not-empty",),
    "PWAVE-18": ("valid/posewave/some-kept", "valid/posewave/one-kept", "valid/posewave/fixed"),
    "PWAVE-19": ("invalid/posewave/number-*",),
    "PWAVE-20": ("invalid/posewave/none-kept-*",),
    "PWAVE-21": ("valid/posewave/levels-0-*",),
    "PWAVE-22": ("valid/posewave/borrowing-*", "valid/posewave/levels-*"),
    "PWAVE-23": ("invalid/posewave/order-*",),
    "PWAVE-24": ("invalid/posewave/notes-*", "valid/posewave/notes-*"),
    "PWAVE-25": ("invalid/posewave/notes-beyond*",),
    "PWAVE-26": ("invalid/posewave/notes-turns-*",),
    "PWAVE-27": ("valid/posewave/orders-*", "valid/posewave/notes-*"),
}

ARGUED: dict[str, str] = {
    "PWAVE-04": (
        "a lossy codec is of the motion signal, and one with channels of its own is refused where "
        "its groups or its header do not fit"
    ),
}
