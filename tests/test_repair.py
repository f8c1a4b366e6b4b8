"""Damaged files: what is whole in them is told, read, and written as a sound file."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import mcz
from mcz.container import payloads
from mcz.container.chunks import HEADER
from mcz.model.schema import build, parse
from mcz.sources.sample import write_samples
from tests.commands import run
from tests.formats.c3d_files import make_c3d
from tests.formats.test_c3d_recording import integers, reals, with_analog
from tests.kinds import Values, body_of, chunks_of, count_kept_values, values_of
from tests.repair import flip_bit, join_parts, memory_below, parts_of, replace_payload


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory, samples: Path) -> bytes:
    """Two lossless clips with an ASF, markers, a lossy clip in segments, and an attachment."""
    folder = tmp_path_factory.mktemp("takes")
    for name in ("walk.asf", "walk.amc", "walk.c3d"):
        (folder / name).write_bytes((samples / name).read_bytes())
    (folder / "copy.c3d").write_bytes((samples / "walk.c3d").read_bytes())
    (folder / "notes.txt").write_bytes(b"taken on a Sunday\n" * 99)
    target = tmp_path_factory.mktemp("archive") / "takes.mcz"
    mcz.pack(folder, target, params={"segment_frames": 60}, keep_all=True, copies=False)
    mcz.append([samples / "walk.bvh"], target, codec="mrdwt", params={"segment_frames": 50})
    return target.read_bytes()


def check(repaired: bytes, whole: Values) -> int:
    """Every value of ``repaired`` is as it was; returns how many frames of motions there are."""
    assert mcz.verify(repaired) == []
    count_kept_values(repaired, whole)
    with mcz.open(repaired) as file:
        motions = [c for c in file if c.signals[0].name == "motion"]
    return sum(clip.n_frames for clip in motions)


def repair_file(damaged: bytes, folder: Path) -> tuple[mcz.Repair, bytes]:
    report = mcz.repair(damaged, folder / "out.mcz", force=True)
    return report, (folder / "out.mcz").read_bytes()


def test_runs_of_frames_keep_names_numbers_and_sources(
    archive: bytes, samples: Path, tmp_path: Path
) -> None:
    with mcz.open(archive) as file:
        row = file.clips["walk"].signals[0].rows[1]
        assert file.clips["walk"].source is not None
        path = file.clips["walk"].source.path
    damaged = bytearray(archive)
    damaged[row.offset + row.size // 2] ^= 1
    report, data = repair_file(bytes(damaged), tmp_path)
    assert report.runs == {"walk": [(0, 60), (120, 240)]}
    assert len(report.lost) == 1
    assert "60 of 240 frames" in report.lost[0]
    with mcz.open(data) as file:
        clip = file.clips["walk.120-240"]
        assert clip.frame_numbers.tolist() == list(range(121, 241))
        assert clip.source is not None
        assert clip.source.path == path.replace("walk", "walk.120-240")
        stored = file.clips["walk.0-60"].source_bytes()
    text = (samples / path).read_bytes()
    assert text.startswith(stored)  # of 60 frames


@pytest.mark.parametrize("cut", [0.7, 0.99])
def test_a_file_that_was_cut_short(archive: bytes, tmp_path: Path, cut: float) -> None:
    whole = values_of(archive)
    report, data = repair_file(archive[: int(cut * len(archive))], tmp_path)
    assert check(data, whole) > 100
    assert report.lost


def test_junk_at_the_end_costs_nothing(archive: bytes, tmp_path: Path) -> None:
    report, data = repair_file(archive + b"junk" * 5, tmp_path)
    assert report.lost == []
    with mcz.open(data) as file, mcz.open(archive) as before:
        assert list(file.clips) == list(before.clips)
        assert list(file.attachments) == list(before.attachments) == ["notes.txt"]
        assert file.aliases == before.aliases


def test_nothing_whole_is_an_error(archive: bytes, tmp_path: Path) -> None:
    with pytest.raises(mcz.FormatError):
        mcz.repair(archive[:40], tmp_path / "out.mcz")
    assert not (tmp_path / "out.mcz").exists()


def test_commands_say_what_is_whole(
    archive: bytes, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, out = tmp_path / "takes.mcz", tmp_path / "out"
    path.write_bytes(archive[: int(0.97 * len(archive))])
    asked = {
        "list": ["list", str(path)],
        "info": ["info", str(path)],
        "unpack": ["unpack", str(path), str(out), "--force"],
        "decode": ["decode", str(path), "--clip", "walk", "-o", str(out / "walk"), "--force"],
        "extract": ["extract", str(path), str(out / "x.mcz"), "--clip", "walk", "--force"],
    }
    out.mkdir()
    for name, arguments in asked.items():
        assert run(*arguments) == 1, name
        assert "--salvage" in capsys.readouterr().err, name
        assert run(*arguments, "--salvage") in (0, 4), name
        capsys.readouterr()
    assert run("repair", path, "-o", out / "r.mcz", "--json") == 4
    shown = json.loads(capsys.readouterr().out)
    assert shown["clips"]
    assert shown["lost"]
    assert run("verify", out / "r.mcz") == 0


def test_unpack_writes_no_damaged_file(archive: bytes, tmp_path: Path) -> None:
    with mcz.open(archive) as file:
        row = file.clips["walk"].signals[0].rows[0]
        assert file.clips["walk"].source is not None
        path = file.clips["walk"].source.path
    damaged = bytearray(archive)
    damaged[row.offset + 40] ^= 1
    (tmp_path / "d.mcz").write_bytes(damaged)
    report = mcz.unpack(tmp_path / "d.mcz", tmp_path / "out", salvage=True)
    assert {o.path for o in report.outcomes if o.result == "damaged"} == {path}
    whole = report.count("restored") + report.count("lossy")
    assert whole == len(report.outcomes) - 1
    assert not (tmp_path / "out" / path).exists()


def test_a_lost_template_costs_no_value(tmp_path: Path) -> None:
    """Not even of words that only the template gave a meaning, which are words then."""
    data = force(tmp_path)
    whole = values_of(data)
    (chunk,) = (row for row in chunks_of(data) if row[0] == "SRCE")
    report, repaired_data = repair_file(flip_bit(data, body_of(*chunk), 4), tmp_path)
    assert check(repaired_data, whole) == 60
    assert report.runs == {"force": [(0, 60)]}
    assert any("its source file" in line for line in report.lost)
    with mcz.open(repaired_data) as file:
        clip = file.clips["force"]
        assert clip.source is None
        assert "lost" in clip.metadata["source-note"]
        assert not any(c.unit for c in clip.signals[-1].channels or ())
    (tmp_path / "d.mcz").write_bytes(flip_bit(data, body_of(*chunk), 4))
    assert run("repair", tmp_path / "d.mcz", "-o", tmp_path / "r.mcz") == 4
    with mcz.open(tmp_path / "d.mcz", salvage=True) as file:
        assert file.clips["force"].read(signal="analog").shape == (120, 2)
        assert any("as they were stored" in line for line in file.damage)


def force(folder: Path) -> bytes:
    """Points and two analog channels at twice the rate, whose template has scales and units."""
    file = make_c3d(60, 4, 2, 2, size=2)
    scales, units = reals(file, [0.5, 2.0]), file.texts([b"N", b"V"])
    with_analog(file, SCALE=scales, OFFSET=integers(file, [1000, 0]), UNITS=units)
    (folder / "force.c3d").write_bytes(file.build())
    mcz.encode(folder / "force.c3d", folder / "force.mcz")
    return (folder / "force.mcz").read_bytes()


def test_a_signal_that_is_lost_takes_no_other_along(samples: Path, tmp_path: Path) -> None:
    mcz.encode(samples / "walk.c3d", tmp_path / "a.mcz", params={"segment_frames": 60})
    data = (tmp_path / "a.mcz").read_bytes()
    whole = values_of(data)
    with mcz.open(data) as file:
        motion, residuals = file.clips["walk"].signals
        places = motion.rows[1].offset + 30, residuals.rows[3].offset + 20
    bad = bytearray(data)
    for at in places:
        bad[at] ^= 1
    report, repaired_data = repair_file(bytes(bad), tmp_path)
    lost = 60 * (motion.layout.n_channels + residuals.layout.n_channels)
    assert (
        count_kept_values(repaired_data, whole)
        == sum(v.size for v in whole["walk"].values()) - lost
    )
    assert report.runs == {"walk": [(0, 60), (60, 120), (120, 180), (180, 240)]}
    assert report.lost == [
        "clip 'walk', signal 'motion': 60 of 240 frames",
        "clip 'walk', signal 'residuals': 60 of 240 frames",
    ]
    with mcz.open(repaired_data) as file:
        names = {clip.name: [signal.name for signal in clip.signals] for clip in file}
        assert file.clips["walk.120-180"].source is not None
        assert file.clips["walk.180-240"].source is None
    assert names == {
        "walk.0-60": ["motion", "residuals"],
        "walk.60-120.residuals": ["residuals"],
        "walk.120-180": ["motion", "residuals"],
        "walk.180-240": ["motion"],
    }


def test_what_cannot_be_decoded_here_needs_its_end(tmp_path: Path) -> None:
    """Clips of an unknown codec are kept with their CEND; without it their hashes are lost."""
    data = with_unknown_codec(tmp_path)
    report, repaired_data = repair_file(data + b"junk", tmp_path)
    assert (report.clips, report.lost) == (["walk"], [])
    (end,) = (row for row in chunks_of(data) if row[0] == "CEND")
    report, repaired_data = repair_file(flip_bit(data, body_of(*end), 1), tmp_path)
    assert report.clips == []
    assert report.skeletons
    assert any("codec 1048576" in line and "CEND" in line for line in report.lost)
    assert mcz.verify(repaired_data) == []


def with_unknown_codec(folder: Path) -> bytes:
    write_samples(folder)
    mcz.encode(folder / "walk.bvh", folder / "u.mcz", codec="raw")
    parts = parts_of((folder / "u.mcz").read_bytes())
    which = next(i for i, (piece, _) in enumerate(parts) if piece.type == b"CLIP")
    fields = parse(payloads.Clip, parts[which][1], "CLIP")
    signals = [replace(signal, codec=1 << 20) for signal in fields.signals]
    payload = build(replace(fields, signals=signals), "CLIP")
    return join_parts(replace_payload(parts, which, payload))


@pytest.mark.parametrize("indexed", [True, False])
@pytest.mark.parametrize("removed", [True, False])
def test_no_clip_gets_frames_of_the_next_one(
    samples: Path, tmp_path: Path, removed: bool, indexed: bool
) -> None:
    """Bytes are lost from the middle of one clip to that of the next, which has as many frames."""
    takes = tmp_path / "takes"
    takes.mkdir()
    text = (samples / "walk.bvh").read_bytes()
    lines = text.splitlines(keepends=True)
    first = next(n for n, line in enumerate(lines) if line.startswith(b"Frame Time:")) + 1
    (takes / "a.bvh").write_bytes(text)
    (takes / "b.bvh").write_bytes(b"".join([*lines[:first], *reversed(lines[first:])]))
    mcz.pack(takes, tmp_path / "x.mcz", params={"segment_frames": 40}, copies=False)
    data = (tmp_path / "x.mcz").read_bytes()
    whole = values_of(data)
    with mcz.open(data) as file:
        start = file.clips["a"].signals[0].rows[3].offset - HEADER.size
        stop = file.clips["b"].signals[0].rows[2].offset - HEADER.size + 5
    hole = b"" if removed else bytes(stop - start)
    bad = data[:start] + hole + data[stop:] if indexed else data[:start] + hole + data[stop:-240]
    report, repaired_data = repair_file(bad, tmp_path)
    assert count_kept_values(repaired_data, whole) == 120 * 96
    assert report.runs == {"a": [(0, 120)]}
    for name, signals in values_of(bad, salvage=True).items():
        values = signals["motion"]
        valid = ~np.isnan(values)
        assert (values[valid] == whole[name]["motion"][: len(values)][valid]).all()


def test_a_lost_head_and_alias_are_in_the_index(archive: bytes, tmp_path: Path) -> None:
    with mcz.open(archive) as file:
        aliases = dict(file.aliases)
    chunks = [row for row in chunks_of(archive) if row[0] in ("HEAD", "ALIA")]
    assert len(chunks) >= 2
    bad = bytearray(archive)
    for row in chunks:
        bad[body_of(*row)] ^= 6
    report, repaired_data = repair_file(bytes(bad), tmp_path)
    assert report.lost == []
    with mcz.open(repaired_data) as file:
        assert file.aliases == aliases


def test_a_lost_skeleton_costs_names_alone(tmp_path: Path) -> None:
    """Values with a valid hash survive without names and source if no source restores the names."""
    (tmp_path / "t.csv").write_text("a,b\n" + "".join(f"{n},{n / 8}\n" for n in range(90)))
    mcz.encode(tmp_path / "t.csv", tmp_path / "t.mcz", rate=10)
    data = (tmp_path / "t.mcz").read_bytes()
    whole = values_of(data)
    (skeleton,) = (row for row in chunks_of(data) if row[0] == "SKEL")
    report, repaired_data = repair_file(flip_bit(data, body_of(*skeleton), 0), tmp_path)
    assert count_kept_values(repaired_data, whole) == 180
    assert any("its skeleton is lost" in line for line in report.lost)
    with mcz.open(repaired_data) as file:
        assert file.clips["t"].source is None


# A file that lost its skeleton, and whose clip says that it has 2^31 channels and more.
MANY_CHANNELS = bytes.fromhex(
    "894d435a0d0a1a0a4845414400002e2d05000000000000000100010000efe40f9b534b454c000089902100000000"
    "005a0000046469616c010001000000000001046469616c000100020100026e300100026e311af07abe434c495000"
    "00c42e540000000000000001000477617665005891850bf691288598c6ce963e904efb090001000001066d6f7469"
    "6f6e000101000001818080800809000014010017080800ff00ff00000300f03f0203010000050201020000030301"
    "020301f2b710ca444154410000eadf1100000000000000000009000001010558219e2abb140000a2b24010764345"
    "4e4400007aeb2400000000000000090000010ef7f0152209dbd7dbcb9dc575075bbed8e3e2ade788fec66a9712c1"
    "602efb54e90be15d494e4458010006e94b0000000000000000586365480642c6606f579f8889addcdf266ab4ce38"
    "766e9add04bfdf8a8a0c0c0c8ce8a28c2ce58965a90c9c0c8c8c61218c2c2a0c8c8d0d0d0d1c8c0c0c228c0c8c02"
    "8240190620070049b9989c00000000345ab3e51b010000000000005f00000000000000895a434d0d0a1a0a"
)


def test_channels_without_a_skeleton_take_no_memory() -> None:
    with memory_below(2**22), mcz.open(MANY_CHANNELS, salvage=True) as file:
        assert file.damage


SHARED = [HealthCheck.function_scoped_fixture]
SMALL = [
    path
    for path in sorted((Path(__file__).parent.parent / "conformance/vectors/valid").rglob("*.mcz"))
    if path.stat().st_size < 1500
]


@settings(suppress_health_check=SHARED)
@given(st.data())
def test_any_mutant_is_repaired_or_refused(tmp_path: Path, data: st.DataObject) -> None:
    """Bits, holes, bytes put in or cut out, also behind checksums that are made right again."""
    vector = data.draw(st.sampled_from(SMALL)).read_bytes()
    parts = parts_of(vector)
    if parts and data.draw(st.booleans()):
        which = data.draw(st.integers(0, len(parts) - 1))
        payload = bytearray(parts[which][1])
        if payload:
            payload[data.draw(st.integers(0, len(payload) - 1))] ^= data.draw(st.integers(1, 255))
            vector = join_parts(replace_payload(parts, which, bytes(payload)))
    at, size = data.draw(st.integers(0, len(vector) - 1)), data.draw(st.integers(0, 300))
    put = data.draw(st.sampled_from([b"", bytes(size), vector[:size], b"?" * (size % 50)]))
    mutant = vector[:at] + put + vector[at + data.draw(st.sampled_from([0, 1, size])) :]
    try:
        mcz.repair(mutant, tmp_path / "out.mcz", force=True)
    except mcz.MczError:
        return
    assert [p for p in mcz.verify(tmp_path / "out.mcz") if p.heading != "Codecs"] == []


def test_what_breaks_a_rule_is_left_out(tmp_path: Path) -> None:
    """A quality record that says nothing, its checksum right: all but the record is written."""
    write_samples(tmp_path)
    mcz.encode(tmp_path / "walk.bvh", tmp_path / "q.mcz", codec="mrdwt")
    data = (tmp_path / "q.mcz").read_bytes()
    whole, parts = values_of(data), parts_of(data)
    which = next(i for i, (piece, _) in enumerate(parts) if piece.type == b"QUAL")
    bad = join_parts(replace_payload(parts, which, b"\x05\xff"))
    report, repaired_data = repair_file(bad, tmp_path)
    assert check(repaired_data, whole) == 240
    assert any("break a rule" in line for line in report.lost)


def test_extracts_of_damaged_files_end_with_4_or_1(samples: Path, tmp_path: Path) -> None:
    """The damage is said; a clip whose end is lost is refused, and nothing is written."""
    takes = tmp_path / "takes"
    takes.mkdir()
    text = (samples / "walk.bvh").read_bytes()
    (takes / "a.bvh").write_bytes(text)
    (takes / "b.bvh").write_bytes(text.replace(b"Time: ", b"Time:  "))
    mcz.pack(takes, tmp_path / "x.mcz", copies=False)
    data = (tmp_path / "x.mcz").read_bytes()
    end = next(row for row in chunks_of(data) if row[0] == "CEND")
    (tmp_path / "d.mcz").write_bytes(flip_bit(data, body_of(*end), 2))
    for name, code in (("b", 4), ("a", 1)):
        for more in ([], ["--frames", "0:10"]):
            out = tmp_path / f"{name}{len(more)}.mcz"
            arguments = ["extract", str(tmp_path / "d.mcz"), str(out), "--clip", name, *more]
            assert run(*arguments, "--salvage") == code
            assert out.exists() == (code == 4)
