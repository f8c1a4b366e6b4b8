"""Small players in notebooks: what is in them, however long and odd a motion is."""

from __future__ import annotations

import base64
import html
import json
import re
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import mcz
from mcz import Channel, FormatError, Joint, Motion, Signal, Skeleton
from mcz.model.numbers import Grid, GridKind
from mcz.show.viewing import player as drawn_module
from mcz.show.viewing.player import MOST_BYTES, lines_of
from tests.motions import motions, smooth

MARKER = tuple(Channel(kind) for kind in ("tx", "ty", "tz"))


def document_of(text: str) -> dict[str, Any]:
    """Document of a player: one frame without network access."""
    frame = re.fullmatch(
        r'<iframe srcdoc="([^"<>]*)" sandbox="allow-scripts" [^<>]*></iframe>', text
    )
    assert frame, text[:300]
    page = html.unescape(frame[1])
    assert "default-src 'none'" in page
    assert "http:" not in page and "https:" not in page
    (data,) = re.findall(r"const D = (.*);\n", page)
    assert "<" not in data
    document: dict[str, Any] = json.loads(data)
    return document


def places_of(document: dict[str, Any]) -> np.ndarray:
    """The coordinates that a player draws, NaN where missing."""
    words = np.frombuffer(base64.b64decode(document["positions"]), "<i2").astype(float)
    words[words == -32768] = np.nan
    return (words * document["step"]).reshape(document["frames"], len(document["sides"]), 3)


def cloud(values: np.ndarray, rate: int | None = 100, mask: np.ndarray | None = None) -> Motion:
    """Markers at ``values``, (n_frames, n_markers, 3)."""
    joints = tuple(Joint(f"m{i}", channels=MARKER) for i in range(values.shape[1]))
    flat = values.reshape(len(values), -1)
    signal = Signal(flat, (Grid(GridKind.BINARY64),) * flat.shape[1], mask=mask)
    rate_ = None if rate is None else Fraction(rate)
    return Motion(Skeleton(joints), (signal,), rate_, name="cloud")


def test_a_motion_and_its_clip_show_the_same(samples: Path, tmp_path: Path) -> None:
    for name in ("walk.bvh", "walk.amc", "walk.c3d"):
        motion = mcz.read(samples / name)
        mcz.write(motion, tmp_path / "a.mcz", force=True)
        with mcz.open(tmp_path / "a.mcz") as file:
            (clip,) = file
            assert clip._repr_html_() == motion._repr_html_()
            assert "iframe" not in repr(clip)
        document = document_of(motion._repr_html_())
        every = document["every"]
        wanted = mcz.positions(motion)[::every]
        found = places_of(document)
        assert len(found) == len(wanted)
        shift = (wanted - found).reshape(-1, 3)
        assert np.nanmax(np.abs(shift - np.nanmedian(shift, axis=0))) <= 2 * document["step"]


def test_a_figure_has_sides_and_bones(samples: Path) -> None:
    motion = mcz.read(samples / "walk.bvh")
    document = document_of(motion._repr_html_())
    names = mcz.point_names(motion)
    sides = dict(zip(names, document["sides"], strict=True))
    assert (sides["LeftHand"], sides["RightHand"], sides["Head"]) == (1, 2, 0)
    bones = {(names[a], names[b]) for a, b in document["bones"]}
    assert ("Head", "Head end") in bones
    assert len(bones) == len(names) - 1
    assert document["rate"] * document["every"] == pytest.approx(120)
    assert "'walk': 240 frames at 120 Hz; one frame in 4 is drawn" in document["caption"]


def test_bones_of_acclaim_go_from_end_to_end(samples: Path) -> None:
    motion = mcz.read(samples / "walk.amc")
    names = mcz.point_names(motion)
    bones = {(names[a], names[b]) for a, b in lines_of(motion.skeleton)}
    assert ("root", "lhipjoint") in bones
    assert ("lfemur", "ltibia") in bones


@given(motion=motions())
def test_any_motion_is_shown_or_told_of(motion: Motion) -> None:
    text = motion._repr_html_()
    assert len(text) <= MOST_BYTES
    if text.startswith("<pre>"):
        assert not re.search("<(?!/?pre>)", text)
    else:
        document = document_of(text)
        assert document["frames"] <= motion.n_frames
        assert np.isfinite([document[key] for key in ("step", "floor", "radius", "rate")]).all()


@given(
    n_frames=st.integers(1, 3000),
    n_points=st.integers(1, 60),
    rate=st.sampled_from([None, 24, 30, 120, 1000]),
)
def test_no_motion_makes_it_large(n_frames: int, n_points: int, rate: int | None) -> None:
    values = np.random.default_rng(n_frames).normal(size=(n_frames, n_points, 3))
    text = cloud(values, rate)._repr_html_()
    assert len(text) <= MOST_BYTES
    document = document_of(text)
    assert document["frames"] == -(-n_frames // document["every"])
    step = document["every"]
    assert step == 1 or step <= (rate or 30) // 30 or len(text) > 0.45 * MOST_BYTES


def test_gaps_are_missing() -> None:
    values = np.arange(36.0).reshape(6, 2, 3)
    mask = np.ones((6, 6), bool)
    mask[2, 3:] = False
    values[4, 0, 1] = np.inf
    values[5, 0, 1] = 1e200
    document = document_of(cloud(values, 10, mask)._repr_html_())
    missing = np.isnan(places_of(document)).all(axis=2)
    assert [tuple(where) for where in np.argwhere(missing)] == [(2, 1), (4, 0), (5, 0)]
    assert document["bones"] == []
    nothing = document_of(cloud(np.full((3, 2, 3), np.nan))._repr_html_())
    assert np.isnan(places_of(nothing)).all()


def test_without_a_frame_or_a_point_it_is_told() -> None:
    nothing = smooth(0)
    assert nothing._repr_html_() == f"<pre>{html.escape(repr(nothing))}</pre>"
    flat = Skeleton((Joint("</pre><b>", channels=(Channel("", "x"),)),))
    motion = Motion(flat, (Signal(np.zeros((5, 1)), (Grid(GridKind.FIXED, 1),)),))
    text = motion._repr_html_()
    assert text.startswith("<pre>")
    assert text.count("\n") == 1
    assert "<b>" not in text
    many = cloud(np.zeros((1, drawn_module.MOST_POINTS + 1, 3)))
    assert "4,097 points" in many._repr_html_()


def test_of_a_long_clip_a_part_is_decoded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mcz.write(smooth(900), tmp_path / "a.mcz", segment_frames=50)
    monkeypatch.setattr(drawn_module, "MOST_READ", 100)
    with mcz.open(tmp_path / "a.mcz") as file:
        clip = file["smooth"]
        asked: list[Any] = []
        read = type(clip).read
        monkeypatch.setattr(
            type(clip), "read", lambda self, frames: asked.append(frames) or read(self, frames)
        )
        document = document_of(clip._repr_html_())
    assert asked == [(0, 100)]
    assert document["total"] == 900
    assert "frames 0 to 99 are shown; one frame in 4 is drawn" in document["caption"]


def test_a_damaged_clip_is_told(tmp_path: Path) -> None:
    mcz.write(smooth(50), tmp_path / "a.mcz")
    data = bytearray((tmp_path / "a.mcz").read_bytes())
    with mcz.open(bytes(data)) as file:
        row = file["smooth"].signals[0].rows[0]
    data[row.offset + 40] ^= 255
    with mcz.open(bytes(data)) as file:
        clip = file["smooth"]
        with pytest.raises(FormatError):
            clip.read()
        assert clip._repr_html_().startswith("<pre>&lt;Clip &#x27;smooth&#x27;")


def test_the_script_is_small() -> None:
    text = (Path(drawn_module.__file__).with_name("player.html")).read_text("utf-8")
    assert len(text) < 6000
    motion = replace(smooth(50), name="</script>\u2028")
    assert "script" in document_of(motion._repr_html_())["caption"]


def test_the_player_has_the_times_of_frames(samples: Path) -> None:
    motion = replace(mcz.read(samples / "walk.c3d").cut(0, 40), source=None)
    numbers = np.array([*range(101, 121), *range(300, 320)])
    document = document_of(replace(motion, frame_numbers=numbers)._repr_html_())
    shown = document["times"]
    assert shown == [round((n - 1) / 120, 3) for n in numbers[:: document["every"]]]
    assert document_of(replace(motion, frame_rate=None)._repr_html_())["times"] is None
