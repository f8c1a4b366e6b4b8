"""Recovery data: the field, the code, and files that are protected, damaged and restored."""

from __future__ import annotations

import errno
import io
import zlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import mcz
from mcz.container import recovery as recovery_blocks
from mcz.container.recovery import Shape, build_packet, protected_shapes, read_packet, shape_for
from mcz.container.recovery.code import (
    divide,
    encode_blocks,
    log_weights,
    logarithms,
    multiply,
    recover_blocks,
    run_length,
)
from mcz.container.source import ByteSource
from mcz.sources.sample import write_samples
from tests.amounts import amount
from tests.clocked_files import bvh

SHARED = [HealthCheck.function_scoped_fixture]
ELEMENTS = st.integers(0, 65535)
TINY = bvh("1.5", "2.25")


@given(ELEMENTS, ELEMENTS, ELEMENTS)
def test_the_field_is_one(a: int, b: int, c: int) -> None:
    assert multiply(a, b) == multiply(b, a) == by_hand(a, b)
    assert multiply(a, multiply(b, c)) == multiply(multiply(a, b), c)
    assert multiply(a, b ^ c) == multiply(a, b) ^ multiply(a, c)
    assert multiply(a, 1) == a
    if b:
        assert multiply(divide(a, b), b) == a


def by_hand(a: int, b: int) -> int:
    product = 0
    for bit in range(16):
        if b >> bit & 1:
            product ^= a << bit
    for bit in range(31, 15, -1):
        if product >> bit & 1:
            product ^= 0x1100B << (bit - 16)
    return product


def words(blocks: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(blocks).view("<u2").astype(np.int64)


@settings(max_examples=30, deadline=None)
@given(st.integers(1, 40), st.integers(1, 20), st.integers(0, 2**32))
def test_blocks_are_those_of_the_formula(n: int, m: int, seed: int) -> None:
    random = np.random.default_rng(seed)
    data = random.integers(-(2**63), 2**63 - 1, (n, 2))
    found = words(encode_blocks(lambda a, b: data[a:b], n, m, 2))
    exp, _ = logarithms()
    size = run_length(m)
    weights = log_weights(np.arange(n), size)
    own = words(data)
    for i in range(m):
        row = np.zeros(own.shape[1], np.int64)
        for j in range(n):
            factor = divide(int(exp[weights[j]]), i ^ (size + j))
            row ^= np.array([multiply(factor, int(word)) for word in own[j]])
        np.testing.assert_array_equal(found[i], row)


@settings(max_examples=amount(60, 20), deadline=None)
@given(st.integers(1, 60), st.integers(1, 20), st.data())
def test_any_lost_blocks_come_back(n: int, m: int, data: st.DataObject) -> None:
    random = np.random.default_rng(data.draw(st.integers(0, 2**32)))
    blocks = random.integers(-(2**63), 2**63 - 1, (n, 3))
    recovery = encode_blocks(lambda a, b: blocks[a:b], n, m, 3)
    lost = sorted(data.draw(st.sets(st.integers(0, n - 1), min_size=1, max_size=min(n, m))))
    order = st.permutations(range(m))
    rows = data.draw(order)[: len(lost)]
    there = blocks.copy()
    there[lost] = 0
    rest = (recovery ^ encode_blocks(lambda a, b: there[a:b], n, m, 3))[rows]
    np.testing.assert_array_equal(recover_blocks(rest, lost, rows, m), blocks[lost])


# Files ---------------------------------------------------------------------------


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """An archive with recovery data, and more clips behind these, which have some of their own."""
    folder = tmp_path_factory.mktemp("recovery")
    (folder / "takes").mkdir()
    write_samples(folder / "takes")
    mcz.pack(folder / "takes", folder / "a.mcz", codec="fast", rate=120)
    (protection,) = mcz.protect(folder / "a.mcz", 0.1)
    text = (folder / "takes" / "walk.bvh").read_bytes()
    (folder / "more.bvh").write_bytes(text.replace(b"Time: ", b"Time:  "))
    mcz.append([folder / "more.bvh"], folder / "a.mcz")
    assert mcz.verify(folder / "a.mcz") == []
    assert protection.n_recovery >= 4
    return (folder / "a.mcz").read_bytes()


@pytest.fixture(scope="module")
def shapes(archive: bytes) -> list[Shape]:
    with mcz.open(archive) as file:
        return protected_shapes(file.container)


def restore_file(bad: bytes, folder: Path) -> tuple[mcz.Repair, bytes]:
    (folder / "bad.mcz").write_bytes(bad)
    (folder / "out.mcz").unlink(missing_ok=True)
    report = mcz.repair(folder / "bad.mcz", folder / "out.mcz")
    return report, (folder / "out.mcz").read_bytes()


def test_what_follows_a_protected_file_is_protected(archive: bytes, shapes: list[Shape]) -> None:
    first, second = shapes
    assert (first.start, first.stop, second.stop) == (0, second.start, len(archive))
    for shape in shapes:
        assert {kind for kind, _, _ in shape.packets()} == {0, 1}
        assert sum(size for b in range(shape.n_blocks) for _, size in shape.pieces(b)) == shape.size


@settings(max_examples=amount(80, 20), deadline=None, suppress_health_check=SHARED)
@given(st.data())
def test_bad_bytes_wherever_they_lie(
    archive: bytes, shapes: list[Shape], tmp_path: Path, data: st.DataObject
) -> None:
    """Repair corrects one bad byte per recovery block, anywhere, packets included."""
    bad = bytearray(archive)
    for shape in shapes:
        most = shape.n_recovery
        places = st.integers(shape.start, shape.stop - 1)
        for at in data.draw(st.sets(places, min_size=1, max_size=most)):
            bad[at] ^= data.draw(st.integers(1, 255))
    report, found = restore_file(bytes(bad), tmp_path)
    assert report.restored
    assert found == archive


@settings(max_examples=amount(80, 20), deadline=None, suppress_health_check=SHARED)
@given(st.data())
def test_a_burst_wherever_it_lies(
    archive: bytes, shapes: list[Shape], tmp_path: Path, data: st.DataObject
) -> None:
    shape = data.draw(st.sampled_from(shapes))
    at = data.draw(st.integers(shape.start, shape.stop - shape.burst))
    fill = data.draw(st.sampled_from([b"\0", b"\xff", b"\x89RCV"]))
    burst = (fill * shape.burst)[: shape.burst]
    report, found = restore_file(archive[:at] + burst + archive[at + shape.burst :], tmp_path)
    assert report.restored
    assert found == archive


def test_bad_blocks_are_solved_by_columns(
    archive: bytes, shapes: list[Shape], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same bytes, whatever fits in memory at once; one burst crosses the end of a RECV."""
    monkeypatch.setattr(recovery_blocks, "AT_ONCE", 1 << 11)
    shape = shapes[0]
    for at in (100, shape.stop - shape.burst):
        bad = archive[:at] + bytes(shape.burst) + archive[at + shape.burst :]
        report, found = restore_file(bad, tmp_path)
        assert report.restored
        assert found == archive


@settings(max_examples=30, deadline=None, suppress_health_check=SHARED)
@given(st.data())
def test_what_is_cut_off_or_put_in(
    archive: bytes, shapes: list[Shape], tmp_path: Path, data: st.DataObject
) -> None:
    """A lost beginning, a lost end, bytes taken out of the middle, bytes put in."""
    first, last = shapes[0], shapes[-1]
    kind = data.draw(st.sampled_from(["head", "tail", "gap", "more"]))
    if kind == "head":
        bad = archive[data.draw(st.integers(1, first.burst)) :]
    elif kind == "tail":
        bad = archive[: -data.draw(st.integers(1, last.burst))]
    else:
        at = data.draw(st.integers(0, first.chunk_offset))
        size = data.draw(st.integers(1, first.burst - first.block_size))
        bad = archive[:at] + (b"" if kind == "gap" else b"?" * size)
        bad += archive[at + size if kind == "gap" else at :]
    report, found = restore_file(bad, tmp_path)
    assert report.restored, kind
    assert found == archive


def test_beyond_it_what_is_whole_is_saved(
    archive: bytes, shapes: list[Shape], tmp_path: Path
) -> None:
    shape = shapes[0]
    size = (shape.n_recovery + 1) * shape.block_size
    report, _ = restore_file(archive[:1000] + bytes(size) + archive[1000 + size :], tmp_path)
    assert not report.restored
    assert report.recovery is not None
    assert not report.recovery.possible
    assert report.recovery.bad_blocks > shape.n_recovery
    assert "blocks are bad" in report.damage[0]
    assert report.lost
    assert mcz.verify(tmp_path / "out.mcz") == []


def test_verify_finds_recovery_data_that_are_none(archive: bytes, shapes: list[Shape]) -> None:
    """Everything but the numbers in it is right, checksums too: repair would trust them."""
    shape = shapes[1]
    kind, index, at = next(p for p in shape.packets() if p[0] == 1)
    source = ByteSource(io.BytesIO(archive))
    key, packet = read_packet(source, at) or (None, None)
    assert key is not None
    assert packet is not None
    wrong = build_packet(key, kind, index, bytes(len(packet.body)))
    bad = bytearray(archive)
    bad[at : at + len(wrong)] = wrong
    chunk = bad[shape.chunk_offset : shape.chunk_offset + shape.chunk_size - 4]
    crc = zlib.crc32(bytes(chunk)).to_bytes(4, "little")
    where = shape.chunk_offset + shape.chunk_size - 4
    bad[where : where + 4] = crc
    (problem,) = mcz.verify(bytes(bad))
    assert "does not match the protected bytes" in problem.message
    assert mcz.verify(bytes(bad), quick=True) == []


@settings(max_examples=amount(60, 20), deadline=None, suppress_health_check=SHARED)
@given(st.data())
def test_any_damage_is_repaired_or_salvaged_or_refused(
    archive: bytes, tmp_path: Path, data: st.DataObject
) -> None:
    bad = bytearray(archive)
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(bad) - 1))
        size = data.draw(st.integers(0, len(bad) // 3))
        bad[at : at + size] = data.draw(st.sampled_from([b"", bytes(size), b"RECV" * size]))
        if not bad:
            break
    try:
        report, found = restore_file(bytes(bad), tmp_path)
    except mcz.MczError:
        return
    assert found == archive or not report.restored
    assert mcz.verify(tmp_path / "out.mcz") == []


def test_rewriting_in_place_protects_anew(archive: bytes, tmp_path: Path) -> None:
    path = tmp_path / "a.mcz"
    path.write_bytes(archive)
    report = mcz.delete_clips(path, "more")
    assert report.left_out == []
    assert report.size == path.stat().st_size
    with mcz.open(path) as file:
        (shape,) = protected_shapes(file.container)
    assert shape.stop == path.stat().st_size
    assert mcz.verify(path) == []
    report = mcz.reorder_clips(path, by="-name", output=tmp_path / "b.mcz")
    assert "recovery data" in report.left_out[0]
    mcz.set_metadata(path, {"walk": {"subject": "05"}})
    mcz.set_rate(path, 100, ["walk"], force=True)
    with mcz.open(path) as file:
        assert protected_shapes(file.container)[-1].stop == path.stat().st_size
    assert mcz.verify(path) == []


def test_what_protected_files_are_merged_to_is_protected(archive: bytes, tmp_path: Path) -> None:
    a, b, bare = (tmp_path / f"{name}.mcz" for name in ("a", "b", "bare"))
    a.write_bytes(archive)
    b.write_bytes(archive)
    mcz.protect(b, 0.2, rebuild=True)
    mcz.extract(a, bare, frames=(0, 9), copies=False)
    report = mcz.merge([a, b], tmp_path / "c.mcz", rename=True)
    assert report.left_out == []
    assert report.size == (tmp_path / "c.mcz").stat().st_size
    with mcz.open(tmp_path / "c.mcz") as file:
        (shape,) = protected_shapes(file.container)
    assert (shape.start, shape.stop) == (0, report.size)
    assert shape.n_recovery >= 0.2 * shape.n_blocks  # the greatest share of all
    assert mcz.verify(tmp_path / "c.mcz") == []
    report = mcz.merge([bare, b], tmp_path / "d.mcz", rename=True)
    assert [text.split(":")[0] for text in report.left_out] == [str(b)]
    report = mcz.append([b], a, rename=True)  # which protects what is added
    assert report.left_out == []
    with mcz.open(a) as file:
        assert protected_shapes(file.container)[-1].stop == a.stat().st_size


def test_protecting_twice_does_nothing(archive: bytes, tmp_path: Path) -> None:
    path = tmp_path / "a.mcz"
    path.write_bytes(archive)
    assert len(mcz.protect(path)) == 2
    assert path.read_bytes() == archive
    for wrong in (0, -1, 2, float("nan")):
        with pytest.raises(mcz.OptionError, match="redundancy"):
            mcz.protect(path, wrong)


@pytest.mark.parametrize("rebuild", [False, True])
def test_bad_bytes_are_not_protected_as_good_ones(
    archive: bytes, tmp_path: Path, rebuild: bool
) -> None:
    bad = bytearray(archive)
    bad[archive.index(b"DATA") + 40] ^= 1
    path = tmp_path / "a.mcz"
    path.write_bytes(bad)
    with pytest.raises(mcz.FormatError, match="damaged, so it was not protected; 1 fault: crc of"):
        mcz.protect(path, rebuild=rebuild)
    assert path.read_bytes() == bad


def test_all_of_a_file_is_protected_anew(archive: bytes, tmp_path: Path) -> None:
    """A lost tail that takes all that was appended costs nothing then."""
    path = tmp_path / "a.mcz"
    path.write_bytes(archive)
    mcz.set_metadata(path, {"walk": {"subject": "05"}})
    (protection,) = mcz.protect(path, 0.1, rebuild=True)
    whole = path.read_bytes()
    assert (protection.start, protection.stop) == (0, len(whole))
    report, found = restore_file(whole[: -protection.burst], tmp_path)
    assert report.restored
    assert found == whole
    with mcz.open(path) as file:
        assert file.clips["walk"].metadata["subject"] == "05"
        assert len(file) == 4


def test_a_full_disk_costs_no_recovery_data(
    archive: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A rewritten file gets its recovery data before it gets its name."""

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    path = tmp_path / "a.mcz"
    path.write_bytes(archive)
    monkeypatch.setattr("mcz.files.editing.appending.write_recovery", full)
    for rewrite in (
        lambda: mcz.protect(path, 0.1, rebuild=True),
        lambda: mcz.delete_clips(path, "more"),
    ):
        with pytest.raises(mcz.AccessError, match="No space"):
            rewrite()
        assert path.read_bytes() == archive
        assert [entry.name for entry in tmp_path.iterdir()] == ["a.mcz"]


@pytest.mark.parametrize("size", [1, 300, 5000, 100_000, 10**6, 10**9, 10**12])
def test_shapes_of_any_size(size: int) -> None:
    for redundancy in (0.001, 0.05, 0.5, 1.0):
        shape = shape_for(0, size, 32, redundancy)
        assert shape.n_recovery >= 4
        assert shape.n_recovery >= redundancy * shape.n_blocks
        assert shape.section_size % 8 == 0
        assert (shape.n_sections - 1) * shape.section_size < 8 * shape.n_blocks
        if size > 10**6:
            assert shape.burst > redundancy * size - 1.01 * shape.block_size
            assert shape.chunk_size < 1.1 * redundancy * size + size / 500


def test_large_blocks_are_worked_on_by_columns(monkeypatch: pytest.MonkeyPatch) -> None:
    shape = shape_for(0, 100_000, 32, 0.1)
    data = np.random.default_rng(1).integers(0, 255, shape.n_blocks * shape.block_size, np.uint8)
    blocks = data.reshape(shape.n_blocks, -1)

    def read(block: int) -> bytes:
        return blocks[block].tobytes()

    wanted = list(recovery_blocks.encode_packets(shape, read)[1])
    monkeypatch.setattr(recovery_blocks, "AT_ONCE", 1 << 12)
    monkeypatch.setattr(recovery_blocks, "IN_MEMORY", 1 << 10)
    assert list(recovery_blocks.encode_packets(shape, read)[1]) == wanted


VECTORS = Path(__file__).parent.parent / "conformance" / "vectors"
DAMAGED = [
    path
    for path in sorted((VECTORS / "invalid" / "recovery").glob("*-*.mcz"))
    if path.stem.endswith(("-hole", "-tail", "-head"))
]


@pytest.mark.parametrize("damaged", DAMAGED, ids=lambda path: path.stem)
def test_the_vectors_are_repaired(damaged: Path, tmp_path: Path) -> None:
    sound = VECTORS / "valid" / "recovery" / f"{damaged.stem.rpartition('-')[0]}.mcz"
    report, data = restore_file(damaged.read_bytes(), tmp_path)
    assert (report.restored, data) == (True, sound.read_bytes())


# What lies behind, and what is not its own -----------------------------------------


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> tuple[bytes, bytes]:
    """A small file, protected and as it was."""
    folder = tmp_path_factory.mktemp("small")
    (folder / "a.bvh").write_text(TINY)
    mcz.encode(folder / "a.bvh", folder / "a.mcz")
    plain = (folder / "a.mcz").read_bytes()
    mcz.protect(folder / "a.mcz", 0.2)
    return (folder / "a.mcz").read_bytes(), plain


def file_contents(data: bytes) -> set[tuple[str, bytes]]:
    """Contents of a file, by name."""
    with mcz.open(data) as file:
        decoded = {(clip.name, clip.read().tobytes()) for clip in file}
        return decoded | {(name, one.read()) for name, one in file.attachments.items()}


def test_one_byte_more_is_left_out(small: tuple[bytes, bytes], tmp_path: Path) -> None:
    report, data = restore_file(small[0] + b"?", tmp_path)
    assert (report.restored, report.lost, data) == (True, [], small[0])
    assert any("1 bytes after its end" in line for line in report.damage)


@settings(max_examples=amount(60, 20), deadline=None, suppress_health_check=SHARED)
@given(st.data())
def test_protection_makes_no_tail_worse(
    small: tuple[bytes, bytes], archive: bytes, tmp_path: Path, data: st.DataObject
) -> None:
    """Junk, zeros, chunks of this and of other files, halves of them: what stays is no less."""
    pieces = [small[0], small[1], archive[:5000], archive[-9000:]]
    piece = data.draw(st.sampled_from([b"\0" * 4000, *pieces]))
    start = data.draw(st.integers(0, len(piece) - 1))
    tail = (
        data.draw(st.binary(max_size=50)) + piece[start : start + data.draw(st.integers(1, 4000))]
    )
    kept = []
    for file in small:
        try:
            _, found = restore_file(file + tail, tmp_path)
        except mcz.FormatError:
            kept.append(set())
            continue
        assert mcz.verify(found) == []
        kept.append(file_contents(found))
    assert kept[1] <= kept[0]


def test_other_files_have_recovery_data_too(
    small: tuple[bytes, bytes], archive: bytes, tmp_path: Path
) -> None:
    """Repair does not extract a protected file that is attached or appended."""
    takes = tmp_path / "takes"
    takes.mkdir()
    (takes / "walk.bvh").write_text(TINY.replace("1.5", "2.5"))
    (takes / "inner.mcz").write_bytes(small[0])
    mcz.pack(takes, tmp_path / "outer.mcz", keep_all=True, copies=False)
    outer = (tmp_path / "outer.mcz").read_bytes()
    report, data = restore_file(outer + b"?", tmp_path)
    assert (report.restored, report.lost, file_contents(data)) == (False, [], file_contents(outer))
    for first, second in ((small[0], archive), (archive, small[0])):
        _, data = restore_file(first + second, tmp_path)
        assert file_contents(data) >= file_contents(first) | file_contents(second)


def test_what_can_be_restored_is_though_more_was_lost(
    archive: bytes, shapes: list[Shape], tmp_path: Path
) -> None:
    """The first part comes back by its recovery data, of the other one what is whole."""
    first, second = shapes
    bad = bytearray(archive)
    bad[200 : 200 + first.burst] = bytes(first.burst)
    bad[second.start + 20 : second.start + 8000] = bytes(7980)
    report, data = restore_file(bytes(bad), tmp_path)
    assert not report.restored
    with mcz.open(archive) as file, mcz.open(data) as reader:
        whole = {name for name in file.clips if name != "more"}
        assert whole <= set(reader.clips)
        for name in whole:
            np.testing.assert_array_equal(reader.clips[name].read(), file.clips[name].read())


def test_a_full_disk_of_temporary_files(
    small: tuple[bytes, bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Full(io.BytesIO):
        def write(self, data: object) -> int:
            raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(recovery_blocks, "IN_MEMORY", 0)
    monkeypatch.setattr(recovery_blocks.tempfile, "TemporaryFile", Full)
    path = tmp_path / "a.mcz"
    path.write_bytes(small[1])
    with pytest.raises(mcz.AccessError, match="No space left on device; recovery data take"):
        mcz.protect(path)
    assert path.read_bytes() == small[1]
    assert [p.name for p in tmp_path.iterdir()] == ["a.mcz"]
