"""mcz.plot: the numbers are those of mcz diff and mcz info, and pages hold no markup of files."""

from __future__ import annotations

import base64
import hashlib
import io
import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import mcz
from mcz import MczError, Motion, MotionError, OptionError, plot
from mcz.files.reading.report import info
from mcz.files.reading.sizes import byte_shares, layout
from mcz.kinematics.metrics.diff_document import joint_errors
from mcz.show.pictures.channel_charts import density
from mcz.show.pictures.charts import MOST_POINTS, STYLE, ChartPage, Sheet, number, thin_line
from mcz.show.pictures.error_charts import errors_between
from mcz.show.pictures.plotting import KINDS
from tests.commands import run
from tests.motions import motions, smooth
from tests.test_render import HOSTILE

pytest.importorskip("matplotlib")
Image = pytest.importorskip("PIL.Image")
SIZE = (360, 240)


@pytest.fixture(scope="module")
def walk(samples: Path) -> Motion:
    return mcz.read(samples / "walk.bvh", unit="cm")


@pytest.fixture(scope="module")
def lossy(walk: Motion, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("lossy") / "walk.mcz"
    mcz.write(walk, path, "mrdwt", T_g=2.0)
    return path


class Tags(HTMLParser):
    """The tags of a page, their attributes, and its text."""

    def __init__(self, data: bytes) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.text = ""
        self.feed(data.decode("utf-8"))

    def handle_starttag(self, tag: str, attrs: Any) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_data(self, data: str) -> None:
        self.text += data

    def of(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.tags if name == tag]


def test_a_table_is_drawn_from_its_first_column_behind_the_times(tmp_path: Path) -> None:
    path = tmp_path / "forces.sto"
    path.write_text("f\nnRows=3\nnColumns=3\nendheader\ntime\tfx\tfy\n0\t1\t2\n1\t3\t4\n2\t5\t6\n")
    assert mcz.plot(mcz.read(path), tmp_path / "a.png", size=SIZE).title == "forces: fx, channels"


def test_errors_are_those_of_diff(walk: Motion, lossy: Path, tmp_path: Path) -> None:
    with mcz.open(lossy) as file:
        clip = file.only_clip()
        decoded = clip.motion()
        plotted = mcz.plot(walk, tmp_path / "a.png", other=clip, size=SIZE)
    comparison, wanted = errors_between(walk, decoded), mcz.compare(walk, decoded)
    assert wanted.mean_position_error_cm is not None
    assert wanted.max_position_error_cm is not None
    assert (comparison.unit, (comparison.frame, comparison.place)) == ("mm", wanted.where)
    assert comparison.mean == pytest.approx(10 * wanted.mean_position_error_cm, rel=1e-12)
    assert np.nanmean(comparison.means) == pytest.approx(comparison.mean, rel=1e-9)
    assert np.nanmax(comparison.greatest) == pytest.approx(comparison.most, rel=1e-9)
    assert np.nanargmax(comparison.greatest) == comparison.frame
    (rows,) = plotted.tables
    for row, each in zip(rows[1:], wanted.by_joint, strict=True):
        mean, most = each.mean_position_error, each.max_position_error
        assert mean is not None and most is not None
        assert row == (each.joint, number(10 * mean), number(10 * most), str(each.frame))
    with Image.open(tmp_path / "a.png") as image:
        assert image.width > SIZE[0]


def test_errors_of_other_skeletons_are_those_of_diff(samples: Path, walk: Motion) -> None:
    other = mcz.read(samples / "walk.amc")
    found, wanted = errors_between(other, walk), joint_errors(other, walk)
    assert wanted.mean is not None and wanted.greatest is not None and wanted.unit_cm is not None
    assert [name for name, *_ in found.joints] == list(wanted.joints)
    assert found.mean == pytest.approx(wanted.mean * wanted.unit_cm * 10, rel=1e-12)
    assert (found.frame, found.place) == (wanted.frame, wanted.joint)
    assert np.nanmean(found.means) == pytest.approx(found.mean, rel=1e-9)
    assert np.nanmax(found.greatest) == pytest.approx(found.most, rel=1e-9)


@settings(max_examples=10)
@given(st.data())
def test_errors_of_any_numbers(data: st.DataObject) -> None:
    one = data.draw(motions())
    values = np.where(np.abs(one.values) < 1e9, one.values, 0.5)
    values[data.draw(st.integers(0, 12)) :: 5] = np.nan
    original = one.with_values(values)
    other = original.with_values(values + data.draw(st.floats(-50, 50)))
    try:
        found = errors_between(original, other)
    except MotionError:
        assert mcz.compare(original, other).mean_position_error is None
        return
    wanted = mcz.compare(original, other)
    assert found.mean == pytest.approx((wanted.mean_position_error or 0) * 25, rel=1e-9)
    known = found.greatest[np.isfinite(found.greatest)]
    assert known.max() == pytest.approx(found.most, rel=1e-9)


@pytest.mark.parametrize("codec", ["fast", "mrdwt"])
def test_bytes_are_those_of_info(samples: Path, tmp_path: Path, codec: str) -> None:
    """All streams are the payload, and each is what the layout says."""
    mcz.encode(samples / "walk.c3d", tmp_path / "a.mcz", codec=codec)
    with mcz.open(tmp_path / "a.mcz") as file:
        clip = file.only_clip()
        shares = byte_shares(clip)
        assert sum(share.n_bytes for share in shares) == info(file)["clips"][0]["payload_bytes"]
        laid: dict[tuple[str, int, int | None], int] = {}
        kinds = re.compile(
            r"(?:(?:notes|mask) of )?group (\d+) \((.*)\)(?:, stored resolution (\d+))?"
        )
        signal = ""
        for _, size, text in layout(file):
            if text.startswith("stream table, signal "):
                signal = clip.signals[int(text.split()[3].rstrip(","))].name
            elif match := kinds.fullmatch(text):
                of = None if " of " in text[:9] else int(match[3] or 0)
                key = signal, int(match[1]), of
                laid[key] = laid.get(key, 0) + size
        own = {(s.signal, s.group, s.resolution): s.n_bytes for s in shares if s.group is not None}
        assert own == laid
        (rows,) = mcz.plot(clip, tmp_path / "a.svg", "bytes", size=SIZE).tables
    assert sum(int(row[-2].replace(",", "")) for row in rows[1:]) == sum(s.n_bytes for s in shares)


def test_rate_and_distortion_are_those_of_diff(walk: Motion, tmp_path: Path) -> None:
    short = replace(walk, signals=(walk.signals[0].cut(0, 40),), source=None)
    (rows,) = mcz.plot(
        short, tmp_path / "a.svg", "rate-distortion", codecs=["qbc"], size=SIZE
    ).tables
    assert rows[0] == ("codec", "setting", "bytes", "mean mm", "greatest mm")
    sizes = [int(row[2].replace(",", "")) for row in rows[1:]]
    assert sizes == sorted(sizes, reverse=True)
    name, setting = rows[2][1].split("=")
    out = io.BytesIO()
    mcz.write(short, out, "qbc", **{name: float(setting)})  # type: ignore[arg-type]
    with mcz.open(out.getvalue()) as file:
        clip = info(file)["clips"][0]
        assert sizes[1] == clip["payload_bytes"] + clip["overhead_bytes"]
        decoded = mcz.compare(short, file.only_clip().motion())
    assert decoded.mean_position_error_cm is not None
    assert rows[2][3] == number(10 * decoded.mean_position_error_cm)


def test_channels_and_their_units(walk: Motion, samples: Path, tmp_path: Path) -> None:
    (rows,) = mcz.plot(walk, tmp_path / "a.png", joint="LeftFoot", size=SIZE).tables
    values = walk.values[:, list(walk.skeleton.columns(walk.skeleton.find("LeftFoot")))]
    assert [row[1] for row in rows[1:]] == ["degrees"] * 3
    assert rows[1][2:5] == tuple(
        map(number, (values[:, 0].min(), values[:, 0].mean(), values[:, 0].max()))
    )
    (rows,) = mcz.plot(mcz.read(samples / "walk.c3d"), tmp_path / "b.svg", size=SIZE).tables
    assert {row[1] for row in rows[1:]} == {"mm"}
    acclaim = mcz.read(samples / "walk.amc")
    (rows,) = mcz.plot(acclaim, tmp_path / "c.svg", frames=(10, 50), size=SIZE).tables
    assert "units of 5.644 cm" in {row[1] for row in rows[1:]}


@pytest.mark.parametrize("n", [8, 9, 600, 1023, 1024])
def test_the_spectrum_has_all_the_power(n: int) -> None:
    """One window's spectrum has the power of the detrended signal under that window."""
    time = np.arange(n)
    column = np.random.default_rng(n).normal(size=n) * 3
    at, power = density(column + 5 - 0.25 * time, 120.0)
    np.testing.assert_allclose(at, np.fft.rfftfreq(n, 1 / 120))
    window = 0.5 - 0.5 * np.cos(2 * np.pi * time / n)
    rest = (column - np.polyval(np.polyfit(time, column, 1), time)) * window
    assert power.sum() * at[1] == pytest.approx((rest**2).sum() / (window**2).sum(), rel=1e-9)


def test_a_sine_is_at_its_frequency(tmp_path: Path) -> None:
    motion = smooth(1200)
    values = motion.values.copy()
    values[:, 0] = 3 * np.sin(np.arange(1200) / 120 * 2 * np.pi * 5.0)
    values[40:60, 0] = np.nan
    (rows,) = mcz.plot(motion.with_values(values), tmp_path / "a.svg", "spectrum", size=SIZE).tables
    assert float(rows[1][2]) == pytest.approx(5.0, abs=0.15)
    at, power = density(3 * np.sin(np.arange(4000) / 120 * 2 * np.pi * 5.0), 120.0)
    assert power.sum() * at[1] == pytest.approx(4.5, rel=1e-3)  # its mean square
    assert rows[-1][:2] == ("speed", "units of 2.5 cm a second")


@given(
    st.lists(st.one_of(st.floats(-9, 9), st.just(np.nan)), min_size=1, max_size=40),
    st.integers(1, 400),
)
def test_a_thinned_line_has_its_ends(pieces: list[float], times: int) -> None:
    y = np.repeat(np.array(pieces), times)
    x, found = thin_line(np.arange(len(y), dtype=float), y)
    assert len(found) <= MOST_POINTS + 2
    assert (np.diff(x) >= 0).all()
    if np.isfinite(y).any():
        assert (np.nanmin(found), np.nanmax(found)) == (np.nanmin(y), np.nanmax(y))


def hostile(motion: Motion) -> Motion:
    joints = tuple(replace(j, name=f"{HOSTILE}{n}") for n, j in enumerate(motion.skeleton.joints))
    return replace(motion, name=HOSTILE, skeleton=replace(motion.skeleton, joints=joints))


def test_a_page_holds_all_and_no_markup_of_names(tmp_path: Path) -> None:
    motion = hostile(smooth(30))
    other = motion.with_values(motion.values + 0.25)
    mcz.plot(motion, tmp_path / "a.html", other=other, size=SIZE)
    data = (tmp_path / "a.html").read_bytes()
    found = Tags(data)
    known = {"html", "head", "meta", "title", "style", "body", "main", "h1", "h2", "figure", "div"}
    known |= {
        "picture",
        "source",
        "img",
        "p",
        "table",
        "thead",
        "tbody",
        "tr",
        "th",
        "td",
        "ul",
        "li",
    }
    assert {tag for tag, _ in found.tags} <= known
    names = {name for _, attributes in found.tags for name in attributes}
    assert not {name for name in names if name.startswith("on") or name == "style"}
    policies = [m["content"] for m in found.of("meta") if m.get("http-equiv")]
    digest = base64.b64encode(hashlib.sha256(STYLE.encode()).digest()).decode()
    (policy,) = policies
    assert policy is not None
    rules = dict(rule.strip().split(" ", 1) for rule in policy.split(";"))
    assert rules.pop("style-src") == f"'sha256-{digest}'"
    assert rules.pop("img-src") == "data:"
    assert set(rules.values()) == {"'none'"} and "default-src" in rules
    assert f"<style>{STYLE}</style>".encode() in data
    pictures = [found.of("img")[0]["src"], found.of("source")[0]["srcset"]]
    assert pictures[0] != pictures[1]
    for uri in pictures:
        assert uri is not None
        tree = ElementTree.fromstring(
            base64.b64decode(uri.removeprefix("data:image/svg+xml;base64,"))
        )
        assert not [e for e in tree.iter() if e.tag.endswith("script")]
    assert "<script>alert(1)</script>" in found.text  # as text, in a cell
    assert "\x1b" not in found.text and "\u202e" not in found.text


def test_pages_escape_every_text() -> None:
    found = ChartPage(HOSTILE, [HOSTILE])
    found.add_picture(HOSTILE, '"><script>', '"><script>')
    for number_ in range(4):
        found.add_table(Sheet(f"{HOSTILE}{number_}", [[HOSTILE], [HOSTILE]], "r", HOSTILE))
    tags = Tags(found.html())
    assert not tags.of("script")
    assert [a["href"] for a in tags.of("a")] == ["#part1", "#part2", "#part3", "#part4"]
    (image,) = tags.of("img")
    assert image["src"] == '"><script>'


def test_hostile_names_are_drawn(tmp_path: Path) -> None:
    motion = hostile(smooth(30))
    mcz.write(motion, tmp_path / "a.mcz", "mrdwt")
    with mcz.open(tmp_path / "a.mcz") as file:
        for what in ("channels", "bytes"):
            mcz.plot(file.only_clip(), tmp_path / f"{what}.svg", what, size=SIZE)
            tree = ElementTree.parse(tmp_path / f"{what}.svg")
            assert not [e for e in tree.iter() if e.tag.endswith("script")]


@settings(max_examples=4)
@given(motions(), st.sampled_from(["channels", "spectrum", "error"]))
def test_any_numbers_are_plotted_or_refused(
    tmp_path_factory: Any, motion: Motion, what: str
) -> None:
    path = tmp_path_factory.mktemp("any") / "a.png"
    other = motion if what == "error" else None
    try:
        mcz.plot(motion, path, what, other=other, size=SIZE)
    except MczError:
        assert not path.exists()
    else:
        assert path.stat().st_size > 1000


@pytest.mark.parametrize(
    ("name", "what", "options", "text"),
    [
        ("a.gif", None, {}, "by its suffix"),
        ("a.png", "none", {}, "one of channels"),
        ("a.png", "error", {}, "the two that are compared"),
        ("a.png", "bytes", {}, "a plot of bytes needs an .mcz"),
        ("a.png", "bytes", {"joint": "hips"}, "shows all joints, so"),
        ("a.png", None, {"size": (9, 9)}, "64 to 4096"),
        ("a.png", None, {"theme": "x"}, "light, dark"),
        ("a.png", None, {"frames": (3, 99)}, "12 frames, not 3:99"),
        ("a.png", "rate-distortion", {"codecs": ["raw"]}, "no parameter that varies its rate"),
    ],
)
def test_options_are_checked(
    tmp_path: Path, name: str, what: str | None, options: Any, text: str
) -> None:
    with pytest.raises(OptionError, match=text):
        plot(smooth(12), tmp_path / name, what, **options)
    with pytest.raises(OptionError, match="of one motion"):
        plot(smooth(12), tmp_path / name, "channels", other=smooth(12))
    assert not list(tmp_path.iterdir())
    assert set(KINDS) == {"channels", "spectrum", "error", "bytes", "rate-distortion"}


@pytest.mark.parametrize("what", ["channels", "spectrum"])
def test_what_has_nothing_is_refused(tmp_path: Path, what: str) -> None:
    with pytest.raises(MotionError, match="has no channels"):
        plot(smooth(20), tmp_path / "a.png", what, joint="fixed")
    with pytest.raises(MotionError, match="no joint 'elbow'"):
        plot(smooth(20), tmp_path / "a.png", what, joint="elbow")


def test_the_command(
    samples: Path, lossy: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def call(*words: object) -> tuple[int, str, str]:
        return run(*words), *capsys.readouterr()

    out = ("-o", tmp_path / "a.png", "--size", "360x240", "--force")
    code, printed, _ = call("plot", samples / "walk.bvh", lossy, "--unit", "cm", *out, "--json")
    document = json.loads(printed)
    assert (code, document["what"], document["path"]) == (0, "error", str(tmp_path / "a.png"))
    words = ("diff", samples / "walk.bvh", lossy, "--unit", "cm", "--by-joint", "--json")
    wanted = json.loads(call(*words)[1])["clips"][0]
    mean, most = (wanted[f"{which}_position_error_cm"] for which in ("mean", "max"))
    assert f"mean {number(10 * mean)} mm, greatest {number(10 * most)} mm" in document["title"]
    for row, each in zip(document["tables"][0][1:], wanted["by_joint"], strict=True):
        assert row[1] == number(10 * each["mean_position_error_cm"])
    code, printed, _ = call("plot", lossy, "--what", "bytes", *out)
    assert (code, "bytes of payload, codec mrdwt" in printed) == (0, True)
    assert call("plot", lossy, *out[:-1])[0] == 2  # it exists
    assert call("plot", lossy, "--joint", "none", *out)[0] == 1
    assert call("plot", lossy, "--codecs", "x", "--what", "rate-distortion", *out)[0] == 2
