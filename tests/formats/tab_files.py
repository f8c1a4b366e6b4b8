"""TRC, MOT and STO files of many styles, made for tests."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st

ENDS = st.sampled_from(["\n", "\r\n"])
NUMBERS = {  # styles of one column: how a number is printed
    "%.3f": lambda x: f"{x:.3f}",
    "%.6f of 3": lambda x: f"{x:.3f}000",
    "%14.8f": lambda x: f"{x:14.8f}",
    "%g": lambda x: f"{x:g}",
    "%.16g": lambda x: f"{x:.16g}",
    "%.18e": lambda x: f"{x:.18e}",
    "%.2E": lambda x: f"{x:.2E}",
    "binary32": lambda x: f"{np.float32(x).item():.16g}",
    "17 digits": lambda x: f"{round(x, 4):.16e}",
    "%d": lambda x: f"{x:.0f}",
}
MISSING = st.sampled_from(["", "NaN", "nan", "NAN", " "])


@st.composite
def cells(draw: st.DrawFn, n_rows: int, n_columns: int) -> list[list[str]]:
    """Rows of cells, some missing, each column in a style of its own or all in one."""
    columns = []
    styles = draw(st.lists(st.sampled_from(sorted(NUMBERS)), min_size=1, max_size=2))
    for place in range(n_columns):
        style = NUMBERS[styles[place % len(styles)]]
        numbers = st.floats(-2000, 2000) | st.just(0.0) | st.floats(-1, 1, width=32)
        values = draw(st.lists(numbers, min_size=n_rows, max_size=n_rows))
        columns.append([style(value) for value in values])
    holes = st.sets(st.tuples(st.integers(0, n_rows - 1), st.integers(0, n_columns - 1)))
    for row, column in draw(holes | st.just(set())):
        columns[column][row] = draw(MISSING)
    return [list(row) for row in zip(*columns, strict=True)]


@st.composite
def trc_files(draw: st.DrawFn) -> bytes:
    n_rows, n_markers = draw(st.integers(1, 12)), draw(st.integers(1, 4))
    eol, rate = draw(ENDS), draw(st.sampled_from([60, 100, 119.88, 250, 2000]))
    first = draw(st.integers(0, 200))
    places = draw(st.integers(1, 7))
    tail = draw(st.sampled_from(["", "\t", " ", "\t\t"]))
    names = draw(st.lists(st.sampled_from(["R.ASIS", "C 7", "Ferse"]), max_size=n_markers))
    lines = [
        "PathFileType\t4\t(X/Y/Z)\ta b.trc",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate",
        f"{rate:.2f}\t{rate:.2f}\t{draw(st.sampled_from([n_rows, 900]))}\t{n_markers}\tmm\t{rate}",
        "Frame#\tTime\t" + "\t\t\t".join(names) + "\t\t",
        "\t\t" + "\t".join(f"X{k + 1}\tY{k + 1}\tZ{k + 1}" for k in range(len(names))),
        *draw(st.sampled_from([[], [""]])),
    ]
    for row, numbers in enumerate(draw(cells(n_rows, 3 * n_markers))):
        time = f"{(row + draw(st.sampled_from([0, 0, 0, 0.5]))) / rate:.{places}f}"
        kept = numbers[: draw(st.sampled_from([len(numbers)] * 4 + [3]))]
        lines.append("\t".join([str(first + row), time, *kept]) + tail)
    return (
        eol.join(lines) + draw(st.sampled_from(["", eol, eol + eol, eol + "\t\t" + eol]))
    ).encode()


@st.composite
def storage_files(draw: st.DrawFn) -> bytes:
    n_rows, n_columns = draw(st.integers(1, 12)), draw(st.integers(1, 5))
    eol, parts = draw(ENDS), draw(st.sampled_from([1, 1, 3, 4]))
    lines = draw(
        st.sampled_from(
            [
                ["Coordinates", "version=1", f"nRows={n_rows}", "inDegrees=yes"],
                ["name x.mot", f"datarows {n_rows}", "range 0 1"],
                ["", "DataRate=100.000000", "DataType=Quaternion", "version=3"],
                ["first\t\t", "nRows=7\t\t", "\x01"],
            ]
        )
    )
    names = [f"/jointset/knee_{k}/value" for k in range(n_columns)]
    lines = [*lines, "endheader", "\t".join(["time", *names])]
    step = draw(st.sampled_from([0.01, 0.0005, 1 / 60, 1.0]))
    style = NUMBERS[draw(st.sampled_from(["%g", "%.16g", "%14.8f"]))]
    table = draw(cells(n_rows, n_columns * parts))
    for row, numbers in enumerate(table):
        whole = [numbers[k : k + parts] for k in range(0, len(numbers), parts)]
        # What is missing from a cell of several numbers is a number that is none.
        joined = [
            ",".join(n.strip() or "nan" for n in cell) if parts > 1 else cell[0] for cell in whole
        ]
        lines.append("\t".join([style(row * step), *joined]))
    return (eol.join(lines) + draw(st.sampled_from(["", eol]))).encode()
