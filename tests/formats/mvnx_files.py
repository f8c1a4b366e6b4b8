"""MVNX files at random: labels, counts, elements, line ends, blanks, attributes and endings."""

from __future__ import annotations

from hypothesis import strategies as st

from tools.vectors.build.mvnx_files import CALIBRATION, SIZES, MvnxFile

LABELS = st.text(st.characters(exclude_categories=("C", "Z")), min_size=1, max_size=6)
ENDINGS = (
    "</frames></subject></mvnx>",
    "</frames>",
    "",
    "</frames>\n</subject>\n<!-- end -->\n</mvnx>",
)
OTHERS = [name for name in SIZES if name not in ("orientation", "position")]
MOTIONS = (
    ("orientation", "position"),
    ("position", "orientation"),
    ("position",),
    ("orientation",),
)


@st.composite
def mvnx_files(draw: st.DrawFn) -> bytes:
    """The bytes of an MVNX file."""
    n_frames = draw(st.integers(1, 6))
    others = draw(st.lists(st.sampled_from(OTHERS), unique=True, max_size=4))
    left_out = draw(st.lists(st.tuples(st.integers(1, 5), st.sampled_from(OTHERS)), max_size=3))
    attributes = draw(st.lists(st.sampled_from(("time", "index", "tc", "ms")), unique=True))
    return MvnxFile(
        segments=draw(st.lists(LABELS, min_size=1, max_size=4)),
        n_frames=n_frames,
        rate=draw(st.sampled_from((60, 100, 240))),
        elements=(*draw(st.sampled_from(MOTIONS)), *others),
        attributes=attributes,
        calibration=CALIBRATION[: draw(st.integers(0, 3))],
        left_out=left_out,
        first=draw(st.integers(0, 10**6)),
        decimals=draw(st.integers(0, 9)),
        version=draw(st.sampled_from((3, 4))),
        quote=draw(st.sampled_from("\"'")),
        line=draw(st.sampled_from(("\n", "\r\n", " "))),
        indent=draw(st.sampled_from(("\t", "    ", ""))),
        ending=draw(st.sampled_from(ENDINGS)),
    ).text()
