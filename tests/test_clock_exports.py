"""One clock in every format that motions go to: the times of the source, or a word of the loss."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

import mcz
from mcz import Channel, Joint, Motion, Signal, Skeleton, conversion_losses
from mcz.sources import FORMATS
from mcz.sources.sample import bvh_walk
from tests.clocked_files import motive, trc
from tests.commands import Call
from tests.glb import Glb

MARKER = (Joint("a", channels=tuple(map(Channel, ("tx", "ty", "tz")))),)
GAP = np.array([*range(124, 127), *range(130, 136)])


def markers(n: int, rate: Fraction | None = Fraction(100), **facts: object) -> Motion:
    values = np.random.default_rng(5).normal(size=(n, 3))
    skeleton = Skeleton(MARKER, unit_cm=0.1, up_axis="z", angle_unit="")
    return Motion(skeleton, (Signal(values),), rate, name="a", **facts)  # type: ignore[arg-type]


def irregular() -> Motion:
    times = np.array([0.5, 0.511, 0.519, 0.531, 1.25])[:, None]
    signal = Signal(times, name="time", role="times", channels=(Channel("", "time", "s"),))
    motion = markers(5)
    return replace(motion, signals=(*motion.signals, signal))


SOURCES: dict[str, Callable[[], Motion]] = {
    "first frame": lambda: markers(9, frame_numbers=np.arange(101, 110)),
    "gap": lambda: markers(9, frame_numbers=GAP),
    "gap at 120": lambda: markers(9, Fraction(120), frame_numbers=GAP),
    "gap at 59.94": lambda: markers(9, Fraction(60000, 1001), frame_numbers=GAP),
    "start": lambda: markers(9, first_time=1.2345),
    "start and gap": lambda: markers(9, first_time=1.2, frame_numbers=GAP),
    "decimated": lambda: markers(
        5, Fraction(50), frame_numbers=np.arange(101, 111, 2), number_step=2
    ),
    "before 0": lambda: markers(9, first_time=-0.25),
    "late": lambda: markers(9, frame_numbers=GAP + 10**6),
    "irregular": irregular,
}


def again(motion: Motion, to: str, tmp_path: Path) -> Motion:
    path = tmp_path / f"b.{to}"
    path.write_bytes(FORMATS[to].write(mcz.convert(motion, to)))
    return mcz.read(path)


@pytest.mark.parametrize("to", ["trc", "sto", "mot"])
@pytest.mark.parametrize("source", SOURCES)
def test_tables_have_the_times(source: str, to: str, tmp_path: Path) -> None:
    motion = SOURCES[source]()
    made = again(motion, to, tmp_path)
    assert np.abs(made.times - motion.times).max() < 1e-9
    if motion.frame_rate is not None and source != "irregular":
        assert made.frame_rate is not None
        assert abs(made.frame_rate / motion.frame_rate - 1) < 1e-8  # TRC prints 6 decimals of it
    assert not [text for text in conversion_losses(motion, to) if "time" in text]


@pytest.mark.parametrize("to", ["trc", "sto", "mot"])
def test_times_of_a_calendar_are_printed(to: str, tmp_path: Path) -> None:
    motion = markers(9, first_time=1700000000.123)
    assert np.abs(again(motion, to, tmp_path).times - motion.times).max() < 5e-7  # a binary64


@pytest.mark.parametrize("to", ["trc", "sto", "mot"])
@pytest.mark.parametrize(("rate", "places"), [("120", 3), ("59.94", 3), ("59.94", 6), ("250", 2)])
def test_times_that_were_rounded_are_printed_as_meant(
    rate: str, places: int, to: str, tmp_path: Path
) -> None:
    times = np.round((GAP - 1) / float(rate), places)
    (tmp_path / "a.trc").write_bytes(trc(GAP, rate, places, times=times))
    motion = mcz.read(tmp_path / "a.trc")
    meant = (GAP - 1) / float(rate)
    assert np.abs(motion.times - meant).max() < 1e-9
    assert np.abs(again(motion, to, tmp_path).times - meant).max() < 1e-9


def test_numbers_of_a_trc_are_the_source_s(tmp_path: Path) -> None:
    made = again(SOURCES["gap"](), "trc", tmp_path)
    assert made.frame_numbers is not None and made.frame_numbers.tolist() == GAP.tolist()
    text = (tmp_path / "b.trc").read_text()
    assert "\n124\t1.230000\t" in text and "\n130\t1.290000\t" in text


C3D = {
    "first frame": [],
    "gap": ["left out: a gap in time of 0.04 s: C3D has frame after frame"],
    "start": ["left out: the time of the first frame, 1.2345 s: C3D begins at 1.23 s"],
    "before 0": ["left out: the time of the first frame, -0.25 s: C3D begins at 0 s"],
    "irregular": ["left out: a gap in time of 0.719 s: C3D has frame after frame"],
}


@pytest.mark.parametrize("source", C3D)
def test_a_c3d_has_the_time_of_its_first_frame(source: str, tmp_path: Path) -> None:
    motion = SOURCES[source]()
    made = again(motion, "c3d", tmp_path)
    said = [
        text
        for text in conversion_losses(motion, "c3d")
        if "time" in text and "numbers" not in text
    ]
    assert said == C3D[source]
    if not any("first frame" in text for text in said):
        assert abs(made.times[0] - motion.times[0]) < 1e-9
    if not said:
        assert np.abs(made.times - motion.times).max() < 1e-9


def test_times_without_a_rate_are_lost_in_a_c3d() -> None:
    motion = replace(irregular(), frame_rate=None)
    assert "left out: times, which C3D cannot state without a frame rate" in conversion_losses(
        motion, "c3d"
    )
    assert mcz.convert(motion, "c3d").frame_rate is None


def test_numbers_that_count_from_0_begin_a_c3d_at_their_time(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_bytes(motive(range(100, 110)))
    motion = mcz.read(tmp_path / "a.csv")
    made = again(motion, "c3d", tmp_path)
    assert made.frame_numbers is not None
    assert (motion.times[0], made.times[0], made.frame_numbers[0]) == (1.0, 1.0, 101)
    assert any(
        "they begin with 101, as the times say" in text for text in conversion_losses(motion, "c3d")
    )


@pytest.mark.parametrize(("to", "first"), [("bvh", "0"), ("amc", "0.01")])
def test_skeletons_say_what_they_lose(to: str, first: str) -> None:
    motion = bvh_walk().cut(0, 9)
    motion = replace(motion, source=None, frame_rate=Fraction(100), first_time=1.23)
    motion = replace(motion, frame_numbers=np.arange(2, 11))
    said = [text for text in conversion_losses(motion, to) if "first frame" in text]
    assert said == [
        f"left out: the time of the first frame, 1.23 s: {to.upper()} begins at {first} s"
    ]
    gap = replace(motion, frame_numbers=GAP, first_time=None)
    lost = [text for text in conversion_losses(gap, to) if "gap" in text]
    assert lost == (
        ["left out: a gap in time of 0.04 s: BVH has frame after frame"] if to == "bvh" else []
    )
    if to == "amc":
        assert "left out: the frame rate, 100 a second" in conversion_losses(gap, to)
    plain = replace(motion, frame_numbers=None, first_time=None)
    assert not [text for text in conversion_losses(plain, to) if " time" in text]


@pytest.mark.parametrize("source", SOURCES)
def test_a_glb_keeps_gaps_and_states_its_start(source: str) -> None:
    motion = SOURCES[source]()
    found = Glb(mcz.to_glb(motion, key_error_mm=0).data)
    animation = found.document["animations"][0]
    inputs = {s["input"] for s in animation["samplers"]}
    keys = max((found.accessor(number).ravel() for number in inputs), key=len)
    start = found.document["asset"]["extras"]["startTime"]
    assert start == pytest.approx(motion.times[0], abs=1e-12)
    wanted = (motion.times - motion.times[0]).astype(np.float32)
    assert np.abs(keys - wanted).max() <= np.spacing(wanted).max()


@pytest.mark.parametrize("source", SOURCES)
def test_usd_has_the_times_as_codes(source: str) -> None:
    motion = SOURCES[source]()
    text = mcz.to_usda(motion).data.decode()
    rate = float(re.search(r"timeCodesPerSecond = (\S+)", text)[1])  # type: ignore[index]
    samples = text[text.index("timeSamples") :]
    codes = [float(code) for code in re.findall(r"^ +(\S+): \(", samples, re.M)]
    assert np.abs(np.array(codes) / rate - motion.times).max() < 1e-8
    first, last = (re.search(rf"{end}TimeCode = (\S+)", text) for end in ("start", "end"))
    assert first is not None and last is not None
    assert (float(first[1]), float(last[1])) == (codes[0], codes[-1])


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("source", SOURCES)
def test_rerun_has_the_times(source: str, tmp_path: Path) -> None:
    rerun = pytest.importorskip("rerun")
    from rerun.chunk import RrdReader

    analog = Signal(
        np.arange(72.0).reshape(-1, 1),
        name="analog",
        role="analog",
        samples_per_frame=8,
        channels=(Channel("", "f", "N"),),
    )
    motion = SOURCES[source]()
    analog = replace(analog, values=analog.values[: 8 * motion.n_frames], stored=None)
    motion = replace(motion, signals=(*motion.signals, analog))
    recording = rerun.RecordingStream("test", recording_id="a")
    recording.save(tmp_path / "a.rrd")
    mcz.to_rerun(motion, recording)
    recording.disconnect()
    times: dict[str, list[float]] = {}
    for chunk in RrdReader(tmp_path / "a.rrd").stream():
        rows = chunk.to_record_batch().to_pydict()
        times.setdefault(str(chunk.entity_path), []).extend(
            time.total_seconds() for time in rows.get("time", ())
        )
    assert np.abs(np.sort(times["/a/points/a"]) - motion.times).max() < 1e-6
    samples = mcz.times(motion, signal="analog")
    assert np.abs(np.sort(times["/a/analog/f"]) - np.sort(samples)).max() < 1e-6


PROGRAM = """
import { readFileSync } from "node:fs";
import { readAnnex } from "./tools/js/annex-node.js";
import { fromBytes, open, setAnnex } from "./tools/js/mcz.js";
import { openMcz } from "./tools/viewer/src/engine/mcz-file.js";
import { timeOf } from "./tools/viewer/src/ui/times.js";

setAnnex(readAnnex);
const all = [];
for (const path of process.argv.slice(1)) {
  const file = await open(fromBytes(new Uint8Array(readFileSync(path))));
  const clip = await file.clip(0);
  const shown = await openMcz({ bytes: new Uint8Array(readFileSync(path)) });
  const facts = await shown.clip(0);
  const told = { ...facts, ...facts.clock };
  const seen = Array.from({ length: facts.nFrames }, (_, f) => timeOf(told, f));
  all.push([[...await clip.times()], seen]);
}
console.log(JSON.stringify(all));
"""


@pytest.mark.skipif(shutil.which("node") is None, reason="there is no node")
def test_the_second_decoder_and_the_viewer_have_the_times(tmp_path: Path) -> None:
    paths, wanted = [], []
    for number, make in enumerate(SOURCES.values()):
        motion = make()
        mcz.write(motion, tmp_path / f"{number}.mcz")
        for to in ("trc", "sto"):
            path = tmp_path / f"{number}.{to}"
            path.write_bytes(FORMATS[to].write(mcz.convert(motion, to)))
            for rate in (None, 75):
                options = {} if rate is None else {"rate": rate}
                mcz.encode(path, tmp_path / f"{number}-{to}-{rate}.mcz", **options)
    for path in sorted(tmp_path.glob("*.mcz")):
        with mcz.open(path) as file:
            wanted.append(file.only_clip().times)
            paths.append(path)
    root = Path(mcz.__file__).parent.parent
    done = subprocess.run(
        ["node", "--input-type=module", "-e", PROGRAM, *map(str, paths)],
        cwd=root,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    for path, found, ours in zip(paths, json.loads(done.stdout), wanted, strict=True):
        for times in found:
            assert np.abs(np.array(times) - ours).max() < 1e-9, path.name


@pytest.mark.parametrize("name", ["walk.bvh", "fps.npz", "time.npz"])
def test_cuts_say_that_they_begin_at_0(
    name: str, samples: Path, tmp_path: Path, call: Call
) -> None:
    arrays = {"positions": np.zeros((40, 2, 3)), "fps": np.array(100)}
    np.savez(tmp_path / "fps.npz", **arrays)
    np.savez(tmp_path / "time.npz", **arrays, time=np.arange(40) / 100)
    (tmp_path / "walk.bvh").write_bytes((samples / "walk.bvh").read_bytes())
    mcz.encode(tmp_path / name, tmp_path / "a.mcz")
    assert (
        "begins at" not in call("decode", tmp_path / "a.mcz", "-o", tmp_path / f"whole-{name}")[2]
    )
    mcz.extract(tmp_path / "a.mcz", tmp_path / "b.mcz", frames=(12, 24))
    told = name != "time.npz"
    for arguments in (
        ("decode", tmp_path / "a.mcz", "--frames", "12:24", "-o", tmp_path / name, "--force"),
        ("decode", tmp_path / "b.mcz", "-o", tmp_path / name, "--force"),
        ("unpack", tmp_path / "b.mcz", tmp_path / "all"),
    ):
        code, out, err = call(*arguments)
        assert code == 0
        assert ("left out: the time of the first frame, 0.1" in out + err) == told
    assert (mcz.read(tmp_path / name).times[0] == 0) == told
