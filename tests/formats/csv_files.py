"""CSV files of many styles, made for tests: Motive, Vicon and plain ones."""

from __future__ import annotations

from collections.abc import Sequence

from hypothesis import strategies as st

NUMBERS = {
    "%.6f": lambda x: f"{x:.6f}",
    "%.3f": lambda x: f"{x:.3f}",
    "%g": lambda x: f"{x:g}",
    "repr": repr,
    "%.2e": lambda x: f"{x:.2e}",
    "%d": lambda x: f"{x:.0f}",
}
NAMES = st.sampled_from(["Hip", "Ann:L Knee", "a, b", 'say "x"', "Ferse\u00e4", "LASI", "1"])


def quote(text: str, *, always: bool = False) -> str:
    if always or any(sign in text for sign in ',;"\t'):
        return '"' + text.replace('"', '""') + '"'
    return text


@st.composite
def tables(
    draw: st.DrawFn, n_rows: int, n_columns: int, holes: Sequence[str] = ("",)
) -> list[list[str]]:
    """Rows of cells, each column in a style of its own or all in one; some are missing."""
    styles = draw(st.lists(st.sampled_from(sorted(NUMBERS)), min_size=1, max_size=2))
    columns = []
    for place in range(n_columns):
        style = NUMBERS[styles[place % len(styles)]]
        numbers = st.floats(-2000, 2000) | st.just(0.0) | st.integers(-9, 9).map(float)
        columns.append(
            [style(x) for x in draw(st.lists(numbers, min_size=n_rows, max_size=n_rows))]
        )
    places = st.sets(st.tuples(st.integers(0, n_rows - 1), st.integers(0, max(0, n_columns - 1))))
    for row, column in draw(places | st.just(set())) if n_columns else ():
        columns[column][row] = draw(st.sampled_from(holes))
    return [list(row) for row in zip(*columns, strict=True)] if columns else [[]] * n_rows


def join_lines(draw: st.DrawFn, lines: Sequence[str]) -> bytes:
    eol = draw(st.sampled_from(["\n", "\r\n"]))
    bom = draw(st.sampled_from(["", "", "\ufeff"]))
    return (bom + eol.join(lines) + draw(st.sampled_from(["", eol, eol]))).encode()


OBJECTS = {
    "Rigid Body": ("Rotation", "Position", "Mean Marker Error"),
    "Bone": ("Rotation", "Position"),
    "Rigid Body Marker": ("Position", "Marker Quality"),
    "Bone Marker": ("Position",),
    "Marker": ("Position",),
}


@st.composite
def motive_files(draw: st.DrawFn) -> bytes:
    n_rows = draw(st.integers(1, 8))
    turns = draw(st.sampled_from(["Quaternion", "XYZ", "ZYX", "YXZ"]))
    rotation = "XYZW" if turns == "Quaternion" else "XYZ"
    heads: list[list[str]] = [[], [], [], [], [], []]  # type, name, id, parent, kind, axis
    for number in range(draw(st.integers(1, 4))):
        kind, name = draw(st.sampled_from(sorted(OBJECTS))), draw(NAMES)
        for what in OBJECTS[kind]:
            axes = {"Rotation": rotation, "Position": "XYZ"}.get(what, " ")
            for axis in axes:
                entry = (kind, name, f'"A{number}"', f'"A{max(0, number - 1)}"', what, axis.strip())
                for row, text in zip(heads, entry, strict=True):
                    row.append(text if text[:1] == '"' else quote(text))
    labeled, parents = draw(st.booleans()), draw(st.booleans())
    labels = ("Type", "Name", "ID", "Parent", "", "") if labeled else ("",) * 6
    rate, first = draw(st.sampled_from([60, 120, 119.88, 240])), draw(st.integers(0, 500))
    said = [
        *("Format Version", draw(st.sampled_from(["1.20", "1.21", "1.22", "1.23", "1.25"]))),
        *("Take Name", quote(draw(NAMES)), "Capture Frame Rate", f"{rate:.6f}"),
        *("Export Frame Rate", f"{rate:.6f}", "Capture Start Time", "2016-01-05 03.49.50.755 PM"),
        *(
            "Total Exported Frames",
            str(draw(st.sampled_from([n_rows, 900]))),
            "Rotation Type",
            turns,
        ),
        *("Length Units", draw(st.sampled_from(["Meters", "Centimeters", "Millimeters"]))),
        *("Coordinate Space", draw(st.sampled_from(["Global", "Local"]))),
    ]
    lines = [",".join(said), *draw(st.sampled_from([[""], []]))]
    for k, (label, row) in enumerate(zip(labels[:5], heads[:5], strict=True)):
        if k != 3 or parents:
            lines.append(",".join(["", label, *row]))
    time = draw(st.sampled_from(["Time", "Time (Seconds)"]))
    lines.append(",".join(["Frame", time, *heads[5]]))
    for row, cells in enumerate(draw(tables(n_rows, len(heads[5])))):
        moved = draw(st.sampled_from([0, 0, 0, 0.25]))
        lines.append(",".join([str(first + row), f"{(first + row + moved) / rate:.6f}", *cells]))
    return join_lines(draw, lines)


@st.composite
def vicon_files(draw: st.DrawFn) -> bytes:
    n_frames, first = draw(st.integers(1, 6)), draw(st.integers(1, 300))
    titles = draw(
        st.lists(
            st.sampled_from(["Devices", "Joints", "Model Outputs", "Segments", "Trajectories"]),
            min_size=1,
            max_size=4,
            unique=True,
        )
    )
    lines: list[str] = []
    if draw(st.booleans()):
        lines += [
            "Events",
            "100",
            "Subject,Context,Name,Time (s),Description",
            "Ann,Left,Off,1,-",
            "",
        ]
    for title in titles:
        n_each = draw(st.integers(1, 4)) if title == "Devices" else 1
        axes = {"Segments": ["RX", "RY", "RZ", "TX", "TY", "TZ"], "Devices": ["Fx"]}
        mine = axes.get(title, ["X", "Y", "Z"])
        names = [quote(draw(NAMES)) for _ in range(draw(st.integers(1, 3)))]
        row = [name for one in names for name in [one, *[""] * (len(mine) - 1)]]
        lines += [title, str(100 * n_each), ",".join(["", "", *row])]
        lines.append(",".join(["Frame", "Sub Frame", *mine * len(names)]))
        if draw(st.sampled_from([True, True, False])):
            lines.append(",".join(["", "", *["mm"] * len(row)]))
        table = draw(tables(n_frames * n_each, len(row)))
        odd = draw(st.sampled_from([0, 0, 1]))
        for k, cells in enumerate(table):
            lines.append(",".join([str(first + k // n_each), str(k % n_each + odd), *cells]))
        lines.append("")
    return join_lines(draw, lines[:-1])


@st.composite
def column_files(draw: st.DrawFn) -> bytes:
    n_rows, n_columns = draw(st.integers(1, 8)), draw(st.integers(1, 5))
    separator = draw(st.sampled_from([",", ";", "\t", ", "]))
    holes = (
        draw(st.sampled_from([[""], ["NaN"], ["nan", ""], ["NA"]])) if n_columns > 1 else ["nan"]
    )
    rows = draw(tables(n_rows, n_columns, holes))
    if all(cell in holes for row in rows for cell in row):
        rows[0][0] = "0"
    names = [quote(draw(NAMES)) for _ in range(n_columns)]
    if draw(st.booleans()):
        names.insert(0, draw(st.sampled_from(["time", "t", "Time (s)", "timestamp_ms"])))
        step = draw(st.sampled_from([0.01, 1 / 60, 5.0]))
        for k, row in enumerate(rows):
            row.insert(0, f"{k * step + draw(st.sampled_from([0, 0, 0, 0.1])):.4f}")
    if draw(st.booleans()):
        names.insert(0, draw(st.sampled_from(["frame", "", "Frame#", "index"])))
        for k, row in enumerate(rows):
            row.insert(0, str(k))
    above = [[], [separator.join(names)], ["made by a program", separator.join(names)]]
    lines = draw(st.sampled_from(above))
    if lines and draw(st.booleans()):
        units = draw(st.lists(st.sampled_from(["mm", "[s]", "deg"]), min_size=1))
        lines = [*lines, separator.join((units * len(names))[: len(names)])]
    return join_lines(draw, [*lines, *(separator.join(row) for row in rows)])
