"""mcz.render: what is on the picture, what a film takes, and what there is nothing to draw of."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import mcz
from mcz import Channel, Joint, MczError, Motion, MotionError, OptionError, Signal, Skeleton
from mcz.model import extras
from mcz.show.pictures import bodies, canvases
from mcz.show.pictures.bodies import MIDDLE, body_of, remove_false_bones
from mcz.show.pictures.canvases import THEMES, rgb
from mcz.show.pictures.capsules import VIEWS, Shapes, Viewport, capsules
from mcz.show.pictures.rendering import film_frames
from mcz.show.pictures.stages import stage_of
from tests.commands import run
from tests.motions import motions, smooth

pytest.importorskip("matplotlib")
Image = pytest.importorskip("PIL.Image")
SMALL = (120, 120)


@pytest.fixture(scope="module")
def walk(samples: Path) -> Motion:
    return mcz.read(samples / "walk.bvh")


def pixels(path: Path) -> np.ndarray:
    with Image.open(path) as image:
        return np.asarray(image.convert("RGB")).astype(int)


def near(picture: np.ndarray, color: str, reach: int = 40) -> np.ndarray:
    """Mask of the pixels with about this color."""
    return (np.abs(picture - np.array(rgb(color)) * 255).max(axis=2) < reach).nonzero()


@pytest.mark.parametrize("theme", THEMES)
@pytest.mark.parametrize("view", ["front", "three-quarter"])
def test_left_and_right_are_where_they_belong(
    walk: Motion, tmp_path: Path, theme: str, view: str
) -> None:
    """From the front the left of the figure is on the right of the picture."""
    path = tmp_path / "a.png"
    mcz.render(walk, path, view=view, theme=theme, size=(200, 240))
    picture = pixels(path)
    assert picture.shape == (240, 200, 3)
    left, right = near(picture, THEMES[theme].left), near(picture, THEMES[theme].right)
    assert min(len(left[0]), len(right[0])) > 100
    figure = slice(20, 215)  # without what is written
    inside = [
        columns[(figure.start < rows) & (rows < figure.stop)] for rows, columns in (left, right)
    ]
    assert inside[0].mean() > inside[1].mean() + 5


def test_the_floor_is_below_the_feet_and_all_is_seen(walk: Motion) -> None:
    track = bodies.track_of(walk, np.arange(0, 240, 8), "cm", None)
    for view in VIEWS:
        stage = stage_of(track, THEMES["light"], view, Viewport(10, 20, 300, 200), None, 15.0)
        for number, (_, nodes) in enumerate(track):
            seen, _ = stage.camera_of(number).project(nodes[track.body.drawn_nodes])
            assert ((seen > (10, 20)) & (seen < (310, 220))).all()
            assert nodes[track.body.drawn_nodes, 2].min() > track.floor - 0.05 * track.size
    assert track.unit == "cm"
    assert track.size == pytest.approx(170, rel=0.1)


def set_up_axis(motion: Motion, up: str) -> Motion:
    """Markers whose up axis is another one, and which move as before."""
    order = {"y": [0, 1, 2], "z": [2, 0, 1], "x": [1, 2, 0]}[up[-1]]
    values = motion.values.reshape(len(motion.values), -1, 3)[:, :, order]
    if up.startswith("-"):  # half a turn about another axis
        values = np.where(np.arange(3) == ("xyz".index(up[1]) + 2) % 3, values, -values)
    return replace(
        motion.with_values(values.reshape(len(values), -1)),
        skeleton=replace(motion.skeleton, up_axis=up),
    )


def markers(n_frames: int = 6, n: int = 5) -> Motion:
    joints = tuple(
        Joint(name, channels=tuple(map(Channel, ("tx", "ty", "tz"))))
        for name in ("LANK", "RANK", "LASI", "RASI", "C7")[:n]
    )
    steps = np.arange(n_frames)[:, None] * 0.5
    at = np.array([20, 5, 0, -20, 5, 0, 15, 90, 5, -15, 90, 5, 0, 150, -3.0])[: 3 * n]
    skeleton = Skeleton(joints, unit_cm=1.0, up_axis="y")
    return Motion(skeleton, (Signal(steps + at),), Fraction(50), name="markers")


def test_every_up_axis_gives_the_same_picture(tmp_path: Path) -> None:
    found = []
    for up in ("y", "z", "x", "-x", "-y", "-z"):
        mcz.render(set_up_axis(markers(), up), tmp_path / f"{up}.png", size=SMALL)
        found.append(pixels(tmp_path / f"{up}.png"))
    for other in found[1:]:
        assert (found[0] == other).all()
    mcz.render(set_up_axis(markers(), "z"), tmp_path / "wrong.png", size=SMALL, up="z")
    assert (pixels(tmp_path / "wrong.png") == found[1]).all()


def pieces_drawn(motion: Motion, frame: int = 0) -> int:
    track = bodies.track_of(motion, np.arange(motion.n_frames), None, "y")
    stage = stage_of(track, THEMES["light"], "front", Viewport(0, 0, 100, 100), None, 1.0)
    shadows, figures = Shapes(), Shapes()
    nodes = dict(track)[frame]
    stage.add(shadows, figures, stage.camera_of(frame), nodes)
    return len(shadows.arrays()[0])


def test_a_missing_marker_is_absent() -> None:
    motion = markers()
    values = motion.values.copy()
    values[2, 3:6] = np.nan
    values[3] = np.nan
    holes = motion.with_values(values)
    assert [pieces_drawn(holes, frame) for frame in range(4)] == [5, 5, 4, 0]


def test_bones_of_a_skeleton(walk: Motion) -> None:
    """One to every joint and end site that is somewhere else than its parent; stems are none."""
    skeleton = Skeleton(
        (
            Joint("scene", channels=(Channel("tx"),)),
            Joint("hips", 0, (0.0, 90.0, 0.0), channels=(Channel("tx"), Channel("ty"))),
            Joint("LeftLeg", 1, (10.0, 0.0, 0.0), tails=((0.0, -80.0, 0.0),)),
            Joint("RightLeg", 1, (-10.0, 0.0, 0.0), tails=((0.0, -80.0, 0.0),)),
            Joint("same", 1, (0.0, 0.0, 0.0)),
        )
    )
    body = body_of(skeleton)
    assert len(body.bones) == 6
    shown = remove_false_bones(body, body.places(np.zeros((3, 3))))
    assert len(shown.bones) == 4
    assert 0 not in shown.drawn_nodes
    assert [body.sides[node] == MIDDLE for node in range(5)] == [True, True, False, False, True]


@given(st.integers(0, 40), st.integers(1, 200), st.floats(0.1, 8), st.sampled_from([25, 30, 7.5]))
def test_frames_of_a_film_are_those_of_their_time(
    first: int, count: int, speed: float, fps: float
) -> None:
    found = film_frames(first, first + count, Fraction(120), Fraction(fps), speed)
    times = first + np.arange(len(found)) / fps * speed * 120
    assert np.abs(found - times).max() <= 0.5 + 1e-6
    assert found[0] == first
    assert found[-1] < first + count
    assert times[-1] + speed * 120 / fps > first + count - 1 - 1e-6


def test_a_gif_has_the_frames_and_their_time(walk: Motion, tmp_path: Path) -> None:
    done: list[int] = []
    drawn = mcz.render(
        walk,
        tmp_path / "a.gif",
        frames=(0, 60),
        fps=20,
        size=SMALL,
        progress=lambda at, total, what: done.append(at),
    )
    assert (drawn.n_pictures, drawn.fps, done) == (10, 20, list(range(10)))
    mcz.render(walk, tmp_path / "still.png", frames=(54, 55), size=SMALL, follow=False)
    with Image.open(tmp_path / "a.gif") as film:
        shown = []
        for number in range(film.n_frames):
            film.seek(number)
            shown.append(film.info["duration"])
        assert (sum(shown), len(shown)) == (500, 10)
        last = np.asarray(film.convert("RGB")).astype(int)
    assert len(near(last, THEMES["light"].left)[0]) > 20
    assert len(near(last, THEMES["light"].right)[0]) > 20


def test_a_gif_of_one_pose_is_one_frame(tmp_path: Path) -> None:
    still = smooth(30).with_values(np.zeros((30, 10)))
    mcz.render(replace(still, name=""), tmp_path / "a.gif", size=SMALL, fps=100, speed=0.25)
    with Image.open(tmp_path / "a.gif") as film:  # but for its clock
        assert film.n_frames > 1
        first = np.asarray(film.convert("RGB")).astype(int)
        film.seek(film.n_frames - 1)
        assert (np.asarray(film.convert("RGB")).astype(int)[20:] == first[20:]).mean() > 0.99


@pytest.mark.parametrize("kind", ["mp4", "webm"])
def test_a_video_has_its_frames(walk: Motion, tmp_path: Path, kind: str) -> None:
    av = pytest.importorskip("av")
    drawn = mcz.render(walk, tmp_path / f"a.{kind}", frames=(0, 40), size=(131, 97))
    assert (drawn.width, drawn.height, drawn.n_pictures) == (130, 96, 10)
    with av.open(str(tmp_path / f"a.{kind}")) as film:
        assert film.streams.video[0].average_rate == 30
        shown = [frame.to_ndarray(format="rgb24") for frame in film.decode(video=0)]
    assert len(shown) == 10
    assert shown[0].shape == (96, 130, 3)
    assert len(near(shown[9].astype(int), THEMES["light"].right, 70)[0]) > 10


def test_blocks_are_positions(
    walk: Motion, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A clip of a file is read in blocks, of which each frame is that of the whole."""
    mcz.write(walk, tmp_path / "a.mcz")
    wanted = mcz.positions(walk)
    monkeypatch.setattr(bodies, "BLOCK", 4000)
    with mcz.open(tmp_path / "a.mcz") as file:
        track = bodies.track_of(file.clips["walk"], np.arange(3, 240, 7), None, "y")
        names, shown = file.clips["walk"].joint_names, dict(track)
        sizes = [len(frames) for frames, _ in track.blocks()]
    assert list(shown) == list(range(3, 240, 7))
    assert 1 < max(sizes) < 10
    points = mcz.point_names(walk)
    for joint, name in enumerate(names):
        place = np.array([shown[frame][joint] for frame in shown])[:, [1, 2, 0]]
        np.testing.assert_allclose(place, wanted[3:240:7, points.index(name)], atol=1e-9)


def test_a_sheet_has_its_poses(walk: Motion, tmp_path: Path) -> None:
    drawn = mcz.render(walk, tmp_path / "a.png", sheet=5)
    picture = pixels(tmp_path / "a.png")
    assert drawn.n_pictures == 5
    assert picture.shape == (drawn.height, drawn.width, 3)
    columns = np.unique(near(picture, THEMES["light"].left)[1] // 220)
    assert len(columns) == drawn.width // 220  # a figure in every column
    assert mcz.render(walk, tmp_path / "b.svg", sheet=2, size=(300, 300)).width == 300


HOSTILE = '</title><script>alert(1)</script>&"$\\frac{1}{0}$ -- ]]> \u202e\x1b\u65e5'


def test_names_are_no_markup(tmp_path: Path) -> None:
    motion = replace(smooth(5), name=HOSTILE)
    for sheet in (None, 2):
        path = tmp_path / f"{sheet}.svg"
        mcz.render(motion, path, sheet=sheet)
        again = tmp_path / "again.svg"
        mcz.render(motion, again, sheet=sheet, force=True)
        assert path.read_bytes() == again.read_bytes()
        tree = ElementTree.parse(path)
        names = {element.tag.rpartition("}")[2] for element in tree.iter()}
        assert "script" not in names
        assert "\x1b" not in path.read_text("utf-8")


@settings(max_examples=6)
@given(motions())
def test_any_numbers_are_drawn_or_refused(tmp_path_factory: Any, motion: Motion) -> None:
    path = tmp_path_factory.mktemp("any") / "a.png"
    try:
        mcz.render(motion, path, size=SMALL)
    except MczError:
        assert not path.exists()
    else:
        assert pixels(path).shape == (120, 120, 3)


def broken() -> Iterator[tuple[Motion, str]]:
    motion = smooth(8)
    yield smooth(0), "none of these frames"
    yield motion.with_values(np.full((8, 10), np.nan)), "no position is known"
    yield motion.with_values(np.full((8, 10), 1e300)), "no position is known"
    yield Motion(Skeleton(()), (Signal(np.zeros((5, 0))),)), "no joint"
    plain = Skeleton((Joint("a", channels=(Channel("", "x"),)),))
    yield Motion(plain, (Signal(np.zeros((5, 1))),)), "plain scalars"


def test_nothing_to_draw_is_said(tmp_path: Path) -> None:
    for motion, text in broken():
        for name in ("a.png", "a.gif"):
            with pytest.raises(MotionError, match=text):
                mcz.render(motion, tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_a_frame_far_away_spoils_nothing(tmp_path: Path) -> None:
    motion = smooth(9)
    values = motion.values.copy()
    values[4], values[5], values[6] = np.nan, 1e300, 1e9
    mcz.render(motion.with_values(values), tmp_path / "a.gif", size=SMALL, fps=120)
    with Image.open(tmp_path / "a.gif") as film:
        film.seek(film.n_frames - 1)
        last = np.asarray(film.convert("RGB")).astype(int)
    assert len(near(last, THEMES["light"].middle, 60)[0]) > 20


@pytest.mark.parametrize(
    ("name", "options", "text"),
    [
        ("a.jpg", {}, "by its suffix"),
        ("a.png", {"view": "below"}, "three-quarter"),
        ("a.png", {"theme": "red"}, "light, dark"),
        ("a.png", {"size": (10, 500)}, "64 to 4096"),
        ("a.png", {"sheet": 0}, "1 to 400"),
        ("a.png", {"sheet": 400, "size": (300, 300)}, "too small"),
        ("a.gif", {"sheet": 3}, "not a film"),
        ("a.gif", {"fps": 0}, "it must be above 0 and at most"),
        ("a.gif", {"speed": float("nan")}, "above 0"),
        ("a.gif", {"speed": 1e-12}, "the limit is 1,000,000"),
        ("a.png", {"frames": (5, 99)}, "8 frames, not 5:99"),
        ("a.png", {"unit": "mile"}, "must be one of"),
    ],
)
def test_options_are_checked(tmp_path: Path, name: str, options: Any, text: str) -> None:
    motion = replace(smooth(8), skeleton=replace(smooth(8).skeleton, unit_cm=None))
    with pytest.raises(OptionError, match=text):
        mcz.render(motion, tmp_path / name, **options)
    assert not list(tmp_path.iterdir())


def test_what_is_missing_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def none(name: str) -> Any:
        raise ImportError(name)

    monkeypatch.setattr(extras, "import_module", none)
    for name, extra in {"a.mp4": "render", "a.gif": "plot", "a.png": "plot"}.items():
        with pytest.raises(OptionError, match=rf"mcz\[{extra}\]"):
            mcz.render(smooth(8), tmp_path / name)
    with pytest.raises(OptionError, match=r"av \(PyAV\).*mcz\[render\]"):
        canvases.import_library("av")


def test_capsules_hold_their_circles() -> None:
    rng = np.random.default_rng(1)
    a, b = rng.normal(size=(2, 50, 2))
    ra, rb = rng.uniform(0.05, 1.5, size=(2, 50))
    corners = capsules(a, b, ra, rb)
    apart = [np.linalg.norm(corners - center[:, None], axis=2) for center in (a, b)]
    assert (np.minimum(apart[0] - ra[:, None], apart[1] - rb[:, None]) < 1e-9).all()
    assert (
        np.maximum(ra, rb)[:, None] + np.linalg.norm(b - a, axis=1)[:, None] + 1e-9 >= apart[0]
    ).all()


def test_the_command(samples: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def call(*words: object) -> tuple[int, str, str]:
        return int(run("render", *map(str, words))), *capsys.readouterr()

    out = tmp_path / "a.png"
    words = (samples / "walk.amc", "-o", out, "--size", "200x100", "--view", "side")
    code, printed, said = call(*words, "--json")
    document = json.loads(printed)
    assert (code, document["width"], document["height"]) == (0, 200, 100)
    assert document["bytes"] == out.stat().st_size
    assert "its up axis is unknown; y is assumed; set the up axis (--up)" in said
    assert "frame rate" not in said  # of a still
    code, printed, _ = call(samples / "walk.bvh", "-o", "memory://a.png", "--size", "64")
    assert (code, "64 x 64 pixels" in printed) == (0, True)  # a store has nothing on the disk
    assert call(*words)[0] == 2  # it exists
    assert call(*words, "--force", "--up", "y", "--frames", "7:8")[2] == ""
    film = (samples / "walk.amc", "-o", tmp_path / "a.gif", "--frames", ":9")
    assert "frame rate is unknown: 120 a second assumed" in call(*film, "--size", "64")[2]
    assert call(samples / "walk.bvh", "-o", tmp_path / "a.gif", "--size", "big", "--force")[0] == 2
    assert call(samples / "walk.bvh", "-o", samples / "walk.bvh", "--force")[0] == 2
    assert call(tmp_path / "none.bvh", "-o", tmp_path / "b.png")[0] == 1
    mcz.pack(samples, tmp_path / "all.mcz")
    code, _, said = call(tmp_path / "all.mcz", "-o", tmp_path / "b.png")
    assert (code, "choose one" in said) == (2, True)
    words = (tmp_path / "all.mcz", "--clip", "walk.c3d", "--sheet", 3, "--theme", "dark")
    assert call(*words, "-o", tmp_path / "b.svg")[0] == 0
