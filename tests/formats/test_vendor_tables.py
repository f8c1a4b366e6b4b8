"""Tables as programs and spreadsheets leave them: filled up, quoted, with columns of text."""

from __future__ import annotations

import csv
import io
import itertools
import tracemalloc

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import mcz
from mcz import Motion, SourceError
from mcz.sources import FORMATS
from mcz.sources.tables.csv_files import is_motion
from mcz.sources.tables.csv_text import first_row
from mcz.sources.tables.rows import lines_from
from tests.formats.csv_files import column_files, motive_files, vicon_files
from tools.vectors.build.table_files import COLUMNS, DEVICES, MOTIVE, VICON

TABLES = motive_files() | vicon_files() | column_files()


def back(data: bytes) -> Motion:
    """The motion, which is written as the same bytes."""
    motion: Motion = FORMATS["csv"].read(data, "table")
    assert FORMATS["csv"].write(motion) == data
    return motion


def table_facts(motion: Motion) -> list[object]:
    """A table's content beside its bytes and its metadata texts."""
    numbers = motion.frame_numbers
    return [
        motion.skeleton.joints,
        motion.skeleton.unit_cm,
        motion.frame_rate,
        None if numbers is None else numbers.tolist(),
        [
            (
                s.name,
                s.channels,
                s.samples_per_frame,
                s.values.shape,
                np.nan_to_num(s.masked(), nan=-7e99).tolist(),
            )
            for s in motion.signals
            if not s.name.endswith("text")
        ],
    ]


def cells_of(data: bytes) -> tuple[list[list[str]], str]:
    """The cells of each line, and what separates them."""
    found = first_row(lines_from(data, 0))
    separator = (found[1] if found and found[1] else b",").decode()
    if data.lstrip(b"\xef\xbb\xbf").startswith(b"Format Version") or b"Sub Frame" in data:
        separator = ","
    text = data.decode("utf-8-sig")
    blank = text.startswith(" ") or f"{separator} " in text
    lines = text.splitlines()
    rows = list(csv.reader(lines, delimiter=separator, skipinitialspace=blank))
    return rows, separator


def table_of(rows: list[list[str]], separator: str, quoting: int, eol: str) -> bytes:
    out = io.StringIO()
    csv.writer(out, delimiter=separator, quoting=quoting, lineterminator=eol).writerows(rows)
    return out.getvalue().encode()


HELICAL = (
    b"Objects\n100\n,,Global Angle Wand:Wand,,,,,,\nFrame,Sub Frame,RX,RY,RZ,TX,TY,TZ\n"
    b",,rad,rad,rad,mm,mm,mm\n1,0,0,0,0.5,100,5.5,900\n2,0,0,0,0.6,101,5.5,900\n"
)
QUATERNION = (
    b"Objects\n200\n,,Global Angle (Quaternion) Wand:Wand,,,,,,,Global Angle (Quaternion) Car:Car\n"
    b"Frame,Sub Frame,RX,RY,RZ,RW,TX,TY,TZ,RX,RY,RZ,RW,TX,TY,TZ\n"
    b",,,,,,mm,mm,mm,,,,,mm,mm,mm\n1,0,0,0,0,1,100,20.5,900,0,0,0.6,0.8,-100,5,800\n"
    b"2,0,0,0,0.6,0.8,101,20.5,902,,,,,,,\n"
)


def take(n_frames: int) -> bytes:
    """A take of Motive with a time code of 30 frames a second and a marker."""
    lines = [
        "Format Version,1.24,Capture Frame Rate,120,Length Units,Millimeters",
        *("", ",Type,,Marker,Marker,Marker", ",Name,,Toe,Toe,Toe", ",,,Position,Position,Position"),
        "Frame,Time (Seconds),TimeCode,X,Y,Z",
    ]
    for k in range(n_frames):
        code = f"15:{k // 7200:02d}:{k // 120 % 60:02d}:{k // 4 % 30:02d}.{k % 4:02d}"
        lines.append(f"{k},{k / 120:.6f},{code},{k / 8:.3f},{np.sin(k / 40):.3f},{k % 3}.250")
    return ("\r\n".join(lines) + "\r\n").encode()


@given(TABLES, st.data())
def test_a_spreadsheet_that_saves_a_table_changes_nothing(
    data: bytes, choice: st.DataObject
) -> None:
    rows, separator = cells_of(data)
    if choice.draw(st.booleans(), "padded"):
        width = max(map(len, rows)) + choice.draw(st.integers(0, 2), "more")
        rows = [[*row, *[""] * (width - len(row))] for row in rows]
    quoting = choice.draw(st.sampled_from([csv.QUOTE_MINIMAL, csv.QUOTE_ALL, csv.QUOTE_NONNUMERIC]))
    eol = choice.draw(st.sampled_from(["\n", "\r\n"]), "end of line")
    mark = choice.draw(st.sampled_from([b"", b"\xef\xbb\xbf"]), "mark")
    saved = mark + table_of(rows, separator, quoting, eol)
    assert table_facts(back(saved)) == table_facts(back(data))


TEXTS = {
    "time code": lambda k: f"15:26:{k // 30:02d}:{k % 30:02d}.00",
    "flag": lambda k: "True" if k % 3 else "False",
    "label": lambda k: ["walk", "", "turn, left", 'say "x"', "N/A"][k % 5],
    "date": lambda k: f"2026-01-04 03.25.{k % 60:02d}.{7 * k:03d} PM",
    "counter": lambda k: f"image_{9 * k}.png",
    "one of many": lambda k: f"{k * 7919 % 97:x}h{'abcdefgh'[k % 8]}",
}


TITLES = [["Frame", "Time"], ["Frame", "Time (Seconds)"], ["Frame", "Sub Frame"]]


def with_texts(data: bytes, kind: str, at: int, n_texts: int) -> bytes:
    """A table with columns of text in front of column ``at`` of all rows that have it."""
    rows, separator = cells_of(data)
    axes = [k for k, row in enumerate(rows) if row[:2] in TITLES] or [0]
    for k, row in enumerate(rows):
        if len(row) <= at or row[0] == "Format Version":
            continue
        is_row = row[0] != "" and row[0].lstrip("-").replace(".", "", 1).isdigit()
        texts = [TEXTS[kind](k + n) for n in range(n_texts)]
        names = [f"Clock{n}" if k in axes else "" for n in range(n_texts)]
        row[at:at] = texts if is_row else names
    return table_of(rows, separator, csv.QUOTE_MINIMAL, "\n")


@pytest.mark.parametrize("kind", TEXTS)
@pytest.mark.parametrize("data", [MOTIVE, VICON, DEVICES, COLUMNS])
def test_columns_of_text_stay_beside_the_numbers(data: bytes, kind: str) -> None:
    usual = back(with_texts(data, kind, 2, 0))
    for n_texts in (1, 2):
        motion = back(with_texts(data, kind, 2, n_texts))
        assert table_facts(motion) == table_facts(usual)
        assert " text: " in motion.metadata["source-note"]
        assert "Clock0" in motion.metadata["source-note"]


@pytest.mark.parametrize("codec", ["fast", "best", "mrdwt"])
def test_a_time_code_is_cut_and_outlives_loss(codec: str) -> None:
    data, target, part = take(600), io.BytesIO(), io.BytesIO()
    motion = back(data)
    mcz.write(motion, target, codec=codec, segment_frames=128)
    mcz.extract(target.getvalue(), part, frames=(130, 410))
    header, rows = data.split(b"\r\n")[:6], data.split(b"\r\n")[6:]
    for blob, frames in ((target.getvalue(), (130, 410)), (part.getvalue(), None)):
        with mcz.open(blob) as file:
            lines = file.only_clip().source_bytes(frames).split(b"\r\n")
        assert len(lines) == 6 + 280 + 1 and lines[1:6] == header[1:]
        codes = [line.split(b",")[:3] for line in lines[6:-1]]
        assert codes == [line.split(b",")[:3] for line in rows[130:410]]
        assert codec == "mrdwt" or lines[6:-1] == rows[130:410]


def test_a_time_code_costs_little() -> None:
    data = take(3000)
    without = b"\r\n".join(
        b",".join(cells[:2] + cells[3:]) if len(cells := line.split(b",")) > 4 else line
        for line in data.split(b"\r\n")
    )
    assert back(without).n_frames == 3000
    sizes = []
    for text in (without, data):
        target = io.BytesIO()
        mcz.write(back(text), target, codec="best")
        sizes.append(len(target.getvalue()))
    assert sizes[1] - sizes[0] < 3000 * 2 / 8  # two bits a row, of 15 bytes


def test_texts_that_have_no_pattern_are_refused() -> None:
    words = (f"{''.join(chr(97 + k // 26**n % 26) for n in range(3))}" for k in range(1200))
    text = "time,x,word\n" + "".join(f"{k},{k},{word}\n" for k, word in enumerate(words))
    with pytest.raises(SourceError, match="the texts of column 3 follow more than 1024 patterns"):
        FORMATS["csv"].read(text.encode(), "table")


def test_long_digits_do_not_take_columns_of_every_row() -> None:
    rows = [f"{k},{k},a{k:05d}" for k in range(5000)]
    rows[7] = f"7,7,a{'07' * 50_000}"
    tracemalloc.start()
    try:
        with pytest.raises(SourceError, match="more than 1024 patterns"):
            FORMATS["csv"].read("\n".join(["time,x,id", *rows]).encode(), "table")
        assert tracemalloc.get_traced_memory()[1] < 2**27
    finally:
        tracemalloc.stop()


def test_rows_above_the_first_without_text_are_rows() -> None:
    motion = back(b"time,x,event\n0,1,start\n1,2,\n2,3,\n3,4,stop\n")
    assert [joint.name for joint in motion.skeleton.joints] == ["x"]
    assert motion.values.ravel().tolist() == [1, 2, 3, 4]


def test_a_time_in_words_is_kept_as_text() -> None:
    motion = back(b"timestamp,x\n2020-01-02 10:00:00.5,1\n2020-01-02 10:00:01.5,2\n")
    assert (motion.frame_rate, motion.values.ravel().tolist()) == (None, [1, 2])
    assert motion.metadata["source-note"] == "1 column is text: timestamp"


def test_angles_whose_order_is_not_said_are_scalars() -> None:
    """A take of 1.22 as a spreadsheet left it: no row says Rotation Type, and W is missing."""
    motion = back(
        b"Format Version,1.22,Take Name,a,Capture Frame Rate,60,,\n,,,,,,,\n"
        b",,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body\n"
        b",,Shank,Shank,Shank,Shank,Shank,Shank\n,,1,1,1,1,1,1\n"
        b",,Rotation,Rotation,Rotation,Position,Position,Position\n"
        b"Frame,Time (Seconds),X,Y,Z,X,Y,Z\n0,0,-5.9,29.5,2.25,1,2,3\n"
        b"1,0.016667,-5.8,29.5,2,1,2,3\n"
    )
    (shank,) = motion.skeleton.joints
    assert shank.name == "Shank"
    assert [channel.kind for channel in shank.channels] == ["", "", "", "tx", "ty", "tz"]
    assert [channel.name for channel in shank.channels[:3]] == [
        f"Rotation {axis}" for axis in "XYZ"
    ]


def test_objects_of_vicon_tracker_are_joints() -> None:
    motion = back(QUATERNION)
    assert [joint.name for joint in motion.skeleton.joints] == ["Wand:Wand", "Car:Car"]
    kinds = ["qx", "qy", "qz", "qw", "tx", "ty", "tz"]
    assert [channel.kind for channel in motion.skeleton.channels] == 2 * kinds
    assert (motion.frame_rate, motion.skeleton.unit_cm) == (200, 0.1)
    assert mcz.positions(motion)[0].tolist() == [[100, 20.5, 900], [-100, 5, 800]]
    assert np.isnan(mcz.positions(motion)[1, 1]).all()


def test_helical_angles_of_vicon_tracker_are_rotation_vectors() -> None:
    motion = back(HELICAL)
    assert [joint.name for joint in motion.skeleton.joints] == ["Wand:Wand"]
    kinds = ["vx", "vy", "vz", "tx", "ty", "tz"]
    assert [channel.kind for channel in motion.skeleton.channels] == kinds
    assert (motion.skeleton.angle_unit, motion.skeleton.unit_cm) == ("rad", 0.1)
    assert mcz.positions(motion)[:, 0].tolist() == [[100, 5.5, 900], [101, 5.5, 900]]
    unsaid = HELICAL.replace(b"Angle Wand", b"Angle (EulerXYZ) Wand").replace(b"\n1,0,", b"\n01,0,")
    assert [c.kind for c in back(unsaid).skeleton.channels] == ["", "", "", "tx", "ty", "tz"]


@pytest.mark.parametrize(
    ("header", "unit_cm"),
    [
        ("time,LASI.x,LASI.y,LASI.z,R_ASI.x,R_ASI.y,R_ASI.z", None),
        ("frame,LASI_X,LASI_Y,LASI_Z,R_ASI_X,R_ASI_Y,R_ASI_Z", None),
        ("Frame,LASI:X,LASI:Y,LASI:Z,R_ASI:X,R_ASI:Y,R_ASI:Z\n,mm,mm,mm,mm,mm,mm", 0.1),
        ("t,LASI_x_m,LASI_y_m,LASI_z_m,R_ASI_x_m,R_ASI_y_m,R_ASI_z_m", 100),
        ("t,LASI x [cm],LASI y [cm],LASI z [cm],R_ASI x [cm],R_ASI y [cm],R_ASI z [cm]", 1),
    ],
)
def test_coordinates_in_columns_are_markers(header: str, unit_cm: float | None) -> None:
    motion = back(f"{header}\n0,1,2,3,4,5,6\n1,1,2,3,4,5,7\n2,1,2,3,,,\n".encode())
    assert [joint.name for joint in motion.skeleton.joints] == ["LASI", "R_ASI"]
    assert [c.kind for c in motion.skeleton.channels] == ["tx", "ty", "tz"] * 2
    assert motion.skeleton.unit_cm == unit_cm
    assert mcz.positions(motion)[1].tolist() == [[1, 2, 3], [4, 5, 7]]


@pytest.mark.parametrize(
    "header",
    [
        "time,acc_x,acc_y,acc_z",
        "time,LASI.x,LASI.y,LASI.z,Angle.x,Angle.y,Angle.z",
        "time,LHipAngles_X,LHipAngles_Y,LHipAngles_Z",
        "time,linAcc.x,linAcc.y,linAcc.z",
        "time,gyro.x,gyro.y,gyro.z",
        "time,A.x,A.y,B.z",
        "time,A.x,A.y,A.w",
        "time,A.x,A.y,A.z,force",
        "time,A.x,A.y,A.z\ns,N,N,N",
        "time,x,y,z",
    ],
)
def test_other_columns_are_no_markers(header: str) -> None:
    n = header.split("\n")[0].count(",")
    rows = "".join(f"{k}{',1.5' * n}\n" for k in range(3))
    motion = back(f"{header}\n{rows}".encode())
    assert {channel.kind for channel in motion.skeleton.channels} == {""}
    assert len(motion.skeleton.joints) == n


REFUSED = {
    b"time;a\n0,0;1,5\n0,1;2,5\n": "decimal commas",
    b"frame;a;b\n1;1,5;x\n2;2,5;y\n": "decimal commas",
    b'a,b\n"1,5","2"\n"2,5","3"\n': "line 2: '1,5' has a decimal comma",
    MOTIVE.replace(b",", b";").replace(b".", b","): "has a decimal comma",
    VICON.replace(b",", b";").replace(b".", b","): "has a decimal comma",
    b'time,a\n"0,0","1,5"\n"0,1","2,5"\n': "decimal commas",
    b"time,a\n0,0,1,5\n0,1,2,5\n": "2 names above 4 integers",
    b"time;a\n0;1.234,5\n1;2.234,5\n": "decimal commas",
    b"a,b\r1,2\r3,4\r": "carriage returns",
    b"time,a\r0,1\r1,2\n2,3\n": "line 1: lines end with carriage returns",
    b"time,a\n0,1\r1,2\n2,3\n": "line 2: lines end with carriage returns",
    b"time,a,b\n0,1,2\n# pause\n1,2,3\n2,3,4\n": "line 3: '# pause' is not a number",
    b"0,1,2\n# pause\n1,2,3\n2,3,4\n": "line 2: '# pause' is not a number",
    b"time,a,b\n0,1,2\ntime,a,b\n1,2,3\n2,3,4\n": "line 3: 'time' is not a number",
    b"name,age\nAnn,31\nBob,32\n": "column 'name' is text beside integers",
    b"time,a\n0,1\n1,error\n2,3\n": "line 3: 'error' is not a number",
    b"time,label\n0,a\n1,b\n": "there is no column of numbers besides the times",
    b"Devices\n100\n,,Plate\nFrame,Sub Frame,Fx\n,,N\n1,a,2\n1,b,3\n": "a sub frame is no number",
}


@pytest.mark.parametrize("data", REFUSED)
def test_tables_are_refused_by_name(data: bytes) -> None:
    with pytest.raises(SourceError) as caught:
        FORMATS["csv"].read(data, "table")
    assert REFUSED[data] in str(caught.value)


TRC = (
    "PathFileType\t4\t(X/Y/Z)\ta.trc\nDataRate\tNumFrames\tNumMarkers\tUnits\n100\t2\t2\tmm\n"
    "Frame#\tTime\tA B\t\t\tC\t\t\n\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n\n"
    "1\t0.00\t1.5\t2\t3\t4\t5\t6\n2\t0.01\t1.5\t2\t3\t\t\t\n"
)
STO = (
    "walk\nversion=1\nnRows=2\nnColumns=3\ninDegrees=yes\nendheader\n"
    "time\thip\tknee\n0.0\t1.5\t2\n0.1\t1.5\t2.5\n"
)


@pytest.mark.parametrize(("text", "name"), [(TRC, "trc"), (STO, "sto"), (STO, "mot")])
def test_tables_of_tabs_that_a_spreadsheet_fills_up(text: str, name: str) -> None:
    form = FORMATS[name]
    usual = table_facts(form.read(text.encode(), "table"))
    rows = [line.split("\t") for line in text.splitlines()]
    for width, eol, mark in itertools.product((8, 11), ("\n", "\r\n"), ("", "\ufeff")):
        filled = ["\t".join([*row, *[""] * (width - len(row))]) for row in rows]
        data = (mark + "".join(line + eol for line in filled)).encode()
        motion = form.read(data, "table")
        assert table_facts(motion) == usual and form.write(motion) == data
    with pytest.raises(SourceError, match="has a decimal comma"):
        form.read(text.replace("1.", "1,").replace("0.", "0,").encode(), "table")


def test_a_spreadsheet_may_name_its_separator() -> None:
    take_of_motive = MOTIVE.removeprefix(b"\xef\xbb\xbf")
    usual = table_facts(back(take_of_motive.replace(b", ", b"; ")))
    for mark in (b"", b"\xef\xbb\xbf"):
        assert table_facts(back(mark + b"sep=;\r\n" + take_of_motive.replace(b",", b";"))) == usual
    assert table_facts(back(b"sep=,\r\n" + VICON)) == table_facts(back(VICON))
    assert table_facts(back(b"sep=;\r\n" + COLUMNS)) == table_facts(back(COLUMNS))


@pytest.mark.parametrize("data", [MOTIVE, VICON])
def test_semicolons_between_numbers_with_points(data: bytes) -> None:
    assert table_facts(back(data.replace(b",", b";"))) == table_facts(
        back(data.replace(b", ", b"; "))
    )


def test_a_folder_takes_tables_with_text_whose_rows_are_frames() -> None:
    assert is_motion(b"time,x,label\n0,1,a\n1,2,b\n")
    assert not is_motion(b"name,age\nAnn,31\nBob,32\n")


def test_grids_of_several_rows_a_frame_change_between_frames() -> None:
    rng = np.random.default_rng(1)
    lines = ["Devices", "2000", ",,Amplifier", "Frame,Sub Frame,EMG", ",,V"]
    for k in range(20 * 150):
        value = f"{rng.normal() / 10**5:.2E}" if k > 1031 else f"{rng.normal():.6f}"
        lines.append(f"{k // 20 + 1},{k % 20},{value}")
    motion = back(("\n".join(lines) + "\n").encode())
    assert motion.signals[1].values.shape == (3000, 1)


def test_names_may_have_line_breaks() -> None:
    """Spreadsheets print wrapped column names with line breaks."""
    motion = back(b'"time","x\r\n(mm)",y\r\n0,1.5,2\r\n1,2.5,3\r\n')
    assert [joint.name for joint in motion.skeleton.joints] == ["x  (mm)", "y"]
    assert motion.frame_rate == 1
    data = MOTIVE.replace(b",Name,", b',"Name",').replace(b"Take Name,", b'"Take\nName",')
    assert b'"Take\n' in data and table_facts(back(data)) == table_facts(back(MOTIVE))


def test_fewer_names_than_columns_are_said() -> None:
    motion = back(b"time,a,b\n0,1,2,5.5\n1,2,3,5.5\n")
    assert [joint.name for joint in motion.skeleton.joints] == [f"column {k}" for k in range(1, 5)]
    assert motion.metadata["source-note"] == (
        "line 1 has 3 names for 4 columns: no column is named"
    )


@pytest.mark.parametrize("second", ["Ann:LASI", ""])
def test_markers_of_one_name_or_none_are_apart(second: str) -> None:
    motion = back(
        f"Trajectories\n100\n,,Ann:LASI,,,{second},,\nFrame,Sub Frame,X,Y,Z,X,Y,Z\n"
        f",,mm,mm,mm,mm,mm,mm\n1,0,1,2,3,4,5,6\n2,0,1,2,3,4,5,6\n".encode()
    )
    names = [joint.name for joint in motion.skeleton.joints]
    assert names == ["Ann:LASI", second or "column 6"]
    assert mcz.positions(motion)[0].tolist() == [[1, 2, 3], [4, 5, 6]]


def test_the_times_of_motive_are_where_their_name_is() -> None:
    lines = [line.split(b",") for line in take(5).split(b"\r\n")]
    for cells in lines[5:-1]:
        cells[1], cells[2] = cells[2], cells[1]
    moved = back(b"\r\n".join(map(b",".join, lines)))
    assert table_facts(moved) == table_facts(back(take(5)))
    assert moved.frame_rate == 120


def test_blanks_around_cells_of_motive() -> None:
    assert table_facts(back(take(5).replace(b",", b", "))) == table_facts(back(take(5)))
