"""BVH, AMC and ASF files of every layout, made for tests."""

from __future__ import annotations

from hypothesis import strategies as st

BVH = b"""HIERARCHY
ROOT Hips
{
  OFFSET 0 0 0
  CHANNELS 3 Xposition Yposition Zposition
  JOINT left arm
  {
    OFFSET 1.5 -2e-1 0
    CHANNELS 1 Zrotation
    End Site
    {
      OFFSET 0 1 0
    }
  }
}
MOTION
Frames: 3
Frame Time: .0083333
1.00 2.00 3.00 -4.00
1.10 2.10 3.10 -4.10
1.20 2.20 3.20 -4.20
"""
CHANNELS = (
    "Xposition",
    "Yposition",
    "Zposition",
    "Zrotation",
    "Xrotation",
    "yrotation",
    "Xscale",
    "Bend",
)
JOINT_NAMES = ("Hips", "left arm", "Bein#1", "naïve", "{}"[:0], "a\tb", "End", "ROOT")
BVH_TOKENS = st.one_of(
    st.floats(allow_nan=False, allow_infinity=False, width=32).map(lambda x: f"{x:.4f}"),
    st.floats(-1e3, 1e3).map(lambda x: f"{x:.6g}"),
    st.sampled_from(
        ["0", "-0", "-0.0", ".5", "1e-5", "1E+003", "nan", "+7", "0001", "1.", "-1.#IND"]
    ),
    st.floats().map(repr),
)


@st.composite
def hierarchies(draw: st.DrawFn) -> tuple[str, int]:
    """A HIERARCHY section and its number of channels."""
    eol = st.sampled_from(["\n", "\r\n", " \n", "\t\r\n"])
    lines, total, depth = ["HIERARCHY"], 0, 0
    for _ in range(draw(st.integers(1, 4))):
        close = draw(st.integers(0, depth))
        lines += ["}"] * close
        depth -= close
        channels = draw(st.lists(st.sampled_from(CHANNELS), max_size=6))
        total += len(channels)
        lines += [
            f"{'JOINT' if depth else 'ROOT'} {draw(st.sampled_from(JOINT_NAMES))}",
            "{",
            f"OFFSET {draw(st.sampled_from(['0 0 0', '1e-3 -2.5 3', '0.0 10 .5']))}",
            " ".join(["CHANNELS", str(len(channels)), *channels]),
        ]
        depth += 1
        for _ in range(draw(st.integers(0, 2))):
            lines += ["End Site", "{", "OFFSET 0 1 0", "}"]
    lines += ["}"] * depth
    return "".join(line + draw(eol) for line in lines), total


@st.composite
def bvh_texts(draw: st.DrawFn) -> bytes:
    """A BVH file of any layout."""
    head, n_channels = draw(hierarchies())
    n_rows = draw(st.integers(0, 6))
    gap = st.sampled_from([" ", "\t", "  ", " \t"])
    usual, end = draw(gap), draw(st.sampled_from(["\n", "\r\n", " \n", " "]))
    irregular = draw(st.booleans())
    body = ""
    for _ in range(n_rows if n_channels else 0):
        body += (
            draw(st.sampled_from(["", "", "  ", "\n", "# a comment 1 2\n"])) if irregular else ""
        )
        row = [draw(BVH_TOKENS) for _ in range(n_channels)]
        gaps = [draw(gap) if irregular else usual for _ in row]
        body += "".join(
            g * (k > 0) + token for k, (g, token) in enumerate(zip(gaps, row, strict=True))
        )
        body += draw(st.sampled_from(["\n", "\r\n", " \n", " "])) if irregular else end
    if draw(st.booleans()):
        body = body.rstrip()
    count = draw(st.sampled_from([str(n_rows), str(n_rows + 1), "007", "many"]))
    time = draw(st.sampled_from(["0.008333", ".0083333", "0", "1", "0.04", "1e-2", "x"]))
    motion = f"MOTION\nFrames: {count}\r\nFrame Time:\t{time}\n"
    return (head + motion + body).encode()


ASF = b""":version 1.10
:name small
:units
  length 0.45
  angle deg
:root
  order TX TY TZ RX RY RZ
  axis XYZ
  position 0 0 0
  orientation 0 0 0
:bonedata
  begin
    id 1
    name back
    direction 0 1 0
    length 2
    axis 0 0 30 XYZ
    dof rx ry rz
  end
  begin
    id 2
    name toe
    direction 0 0 1
    length 1
    axis 0 0 0 XYZ
    dof rx
  end
:hierarchy
  begin
    root back toe
  end
"""
AMC = b"""#!OML:ASF small.asf
:FULLY-SPECIFIED
:DEGREES
1
root 1 2 3 4 5 6
toe -0.5
back 7 8e-005 9
2
root 1.5 2 3 4 5 6
toe -0.25
back 7 8 -1.5e-014
"""
BONES = {"root": 6, "back": 3, "toe": 1}
AMC_TOKENS = st.one_of(
    st.floats(-1e3, 1e3).map(lambda x: f"{x:.6g}"),
    st.sampled_from(["0", "-0", "1e-014", "nan", "12.50", "+3"]),
    st.floats().map(repr),
)


@st.composite
def amc_texts(draw: st.DrawFn) -> bytes:
    """An AMC file of any layout."""
    irregular = draw(st.booleans())
    usual = draw(st.sampled_from(["\n", "\r\n"]))
    ends = st.sampled_from(["\n", "\r\n", " \n", "\n\n", "\n# 5\n", "\t\r\n"])
    lines = ["#!OML:ASF x.asf", ":FULLY-SPECIFIED", ":DEGREES"]
    number = draw(st.integers(-2, 1000))
    order = draw(st.permutations(list(BONES)))
    for _ in range(draw(st.integers(1, 6))):
        lines.append(draw(st.sampled_from(["{}", "{}", "{:03d}", " {} "])).format(number))
        number += draw(st.sampled_from([1, 1, 1, 10, -3]))
        for bone in order:
            if irregular and draw(st.integers(0, 3)) == 0:
                continue
            gap = draw(st.sampled_from([" ", "  ", "\t"])) if irregular else " "
            lines.append(gap.join([bone, *(draw(AMC_TOKENS) for _ in range(BONES[bone]))]))
    text = "".join(line + (draw(ends) if irregular else usual) for line in lines)
    return (text.rstrip() if draw(st.booleans()) else text).encode()


ASF_OF_ALL_KINDS = """# a comment
:hierarchy
  begin
    root a
    a toe
    root b
  end
:bonedata
  begin
     id 1
     name toe
     direction 0 0 1
     length 0.5
     axis 0 0 20   zyx
     DOF RX tz l bend
     limits (-inf inf)
            (-70.0 70.0)
  end
  begin
     name a
     length 2
     direction 0.5 -1e-1 0
     axis 90 -1.13533e-015 20   XYZ
  end
  begin
     name b
     direction 1 0 0
     length 1
     dof
  end
:root
   axis XYZ
   position 1 2 3
   order RX RY RZ TX TY TZ
   orientation 0 -0 90
:units
  mass 1.0
  angle rad
  length 0.45
:name somebody
:documentation
  root is not a keyword here
"""
