"""The contract of every source format: exact bytes, damage is refused, numbers can change."""

from __future__ import annotations

import io
import pickle
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import mcz
from mcz.sources import FORMATS, likely_formats
from mcz.sources.text.source import join_table_notes
from tests.formats.c3d_files import c3d_files, make_c3d
from tests.formats.csv_files import column_files, motive_files, vicon_files
from tests.formats.mvnx_files import mvnx_files
from tests.formats.saved_arrays import archives, arrays, save_npz
from tests.formats.tab_files import storage_files, trc_files
from tests.formats.text_files import AMC, ASF, ASF_OF_ALL_KINDS, BVH, amc_texts, bvh_texts
from tools.vectors.build.array_files import floats, npy, plain_npz
from tools.vectors.build.mvnx_files import MvnxFile
from tools.vectors.build.pickle_files import joblib_file
from tools.vectors.build.table_files import (
    COLUMNS,
    DEVICES,
    EULER,
    FORCES,
    MARKERS,
    MOTIVE,
    ODD_SECTIONS,
    QUATERNIONS,
    VICON,
)

SKELETON = FORMATS["asf"].read(ASF, "small")
MVNX = MvnxFile(n_frames=3).text()
C3D = make_c3d(2, 1, 1, size=2, tail=b"\1").build()


@dataclass(frozen=True)
class Case:
    """A format: small files of it, files at random, and what its reader wants beside bytes."""

    format: str
    small: tuple[bytes, ...]
    any: st.SearchStrategy[bytes]
    beside: tuple[object, ...] = ()
    step: int = 1  # between the places where a small file is cut

    def read(self, data: bytes) -> Any:
        return FORMATS[self.format].read(data, "clip", *self.beside)

    def back(self, data: bytes) -> Any:
        """The motion of the file, which is written as the same bytes."""
        decoded = self.read(data)
        assert FORMATS[self.format].write(decoded) == data
        return decoded

    def back_or_refused(self, data: bytes) -> Any:
        """The same, or None for what is refused in one line."""
        try:
            decoded = self.read(data)
        except (mcz.SourceError, mcz.LimitError) as error:
            assert "\n" not in str(error)
            return None
        assert FORMATS[self.format].write(decoded) == data
        return decoded


def build_file(file: Any) -> bytes:
    data: bytes = file.build()
    return data


def saved_array(array: Any) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, array)
    return buffer.getvalue()


def pickled(array: Any, protocol: int = 4) -> bytes:
    return pickle.dumps({"walk": array, "fps": 30}, protocol)


STRUCTURES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5) | arrays(),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(st.text(max_size=3), inner, max_size=4)
        | st.tuples(inner, inner)
    ),
    max_leaves=8,
)
PICKLES = (pickled(floats(4, 3)), pickled(floats(4, 3), 5), joblib_file({"a": floats(4, 2)}))


TABLES = (MOTIVE, EULER, VICON, DEVICES, ODD_SECTIONS, COLUMNS)
CASES = {
    "bvh": Case("bvh", (BVH,), bvh_texts()),
    "amc": Case("amc", (AMC,), amc_texts(), (SKELETON,)),
    "amc alone": Case("amc", (AMC,), amc_texts(), (None,)),
    "asf": Case("asf", (ASF, ASF_OF_ALL_KINDS.encode()), st.just(ASF)),
    "c3d": Case("c3d", (C3D,), c3d_files().map(build_file)),
    "trc": Case("trc", (MARKERS,), trc_files(), step=5),
    "sto": Case("sto", (QUATERNIONS,), storage_files(), step=5),
    "mot": Case("mot", (FORCES,), storage_files(), step=5),
    "csv": Case("csv", TABLES, motive_files() | vicon_files() | column_files(), step=17),
    "mvnx": Case("mvnx", (MVNX,), mvnx_files(), step=29),
    "npy": Case("npy", (npy(floats(4, 3)),), arrays().map(saved_array)),
    "pickle": Case("pickle", PICKLES, st.builds(pickled, STRUCTURES, st.integers(0, 5)), step=3),
    "npz": Case("npz", (plain_npz({"a": floats(3, 2)}), save_npz(a=floats(2, 2))), archives()),
}
REFUSING = (
    "c3d",
    "npy",
    "pickle",
    "asf",
)  # formats of which a file at random may say what cannot be
CLIPS = [name for name in CASES if name != "asf"]
SMALL = [(name, data) for name in CLIPS for data in CASES[name].small]

each_format = pytest.mark.parametrize("case", CASES.values(), ids=CASES)
each_clip = pytest.mark.parametrize(
    ("case", "data"), [(CASES[name], data) for name, data in SMALL], ids=[name for name, _ in SMALL]
)


@each_format
@given(data=st.data())
def test_any_file_comes_back(case: Case, data: st.DataObject) -> None:
    file = data.draw(case.any)
    if case.format in REFUSING:
        case.back_or_refused(file)
    else:
        case.back(file)


@each_format
@given(data=st.data())
def test_what_is_damaged_is_read_exactly_or_refused(case: Case, data: st.DataObject) -> None:
    """Cut off, changed in some bytes, or with other bytes in the place of some."""
    file = data.draw(case.any | st.sampled_from(case.small))
    case.back_or_refused(file[: data.draw(st.integers(0, len(file)))])
    at = data.draw(st.integers(0, len(file) - 1))
    bit = data.draw(st.integers(0, 7))
    case.back_or_refused(file[:at] + bytes((file[at] ^ 1 << bit,)) + file[at + 1 :])
    noise = data.draw(st.binary(max_size=30))
    case.back_or_refused(file[:at] + noise + file[at + len(noise) :])


@each_format
def test_every_prefix_is_read_exactly_or_refused(case: Case) -> None:
    for file in case.small:
        for size in range(0, len(file), case.step):
            found = case.back_or_refused(file[:size])
            assert found is None or case.format not in ("npy", "npz", "pickle")


@pytest.mark.parametrize("name", ["c3d", "npy", "npz", "pickle"])
def test_every_flipped_bit_is_read_exactly_or_refused(name: str) -> None:
    case = CASES[name]
    for file in case.small[:1]:
        bits = [b for b in range(0, 8 * len(file), 3) if file[b // 8] or b < 240]
        for bit in bits:
            changed = bytearray(file)
            changed[bit // 8] ^= 1 << bit % 8
            case.back_or_refused(bytes(changed))


@each_clip
@pytest.mark.parametrize("effort", ["fast", "best"])
def test_a_clip_is_stored_and_restored(case: Case, data: bytes, effort: str) -> None:
    motion, target = case.back(data), io.BytesIO()
    mcz.write(motion, target, codec=effort)
    with mcz.open(target.getvalue()) as file:
        clip = file.only_clip()
        assert clip.source_bytes() == data
        assert clip.source is not None and clip.source.format == motion.source.format
        again = clip.motion()
    assert again.skeleton.joints == motion.skeleton.joints
    for mine, theirs in zip(motion.signals, again.signals, strict=True):
        assert np.array_equal(mine.masked(), theirs.masked(), equal_nan=True)


@each_clip
def test_content_tells_the_format(case: Case, data: bytes) -> None:
    assert case.read(data).source.format in (*likely_formats(data), case.format)
    assert case.format in (*likely_formats(data), "csv", "mot")


def tokens(data: bytes) -> list[bytes]:
    return re.split(rb"[\s,;]+", data)


@pytest.mark.parametrize("name", ["bvh", "amc", "amc alone"])
@given(data=st.data())
def test_a_changed_value_changes_only_its_token(name: str, data: st.DataObject) -> None:
    """A lossy codec changes tokens the same way; the value is read from the written file."""
    case = CASES[name]
    file = data.draw(case.any)
    motion = case.back(file)
    signal = motion.signals[0]
    cells = np.flatnonzero(np.ones(signal.values.shape) if signal.mask is None else signal.mask)
    if not len(cells):
        return
    cell = data.draw(st.sampled_from(cells.tolist()))
    values = signal.values.copy()
    values.flat[cell] = 3.0 if values.flat[cell] != 3.0 else 4.0
    changed = FORMATS[case.format].write(motion.with_values(values))
    assert sum(a != b for a, b in zip(tokens(file), tokens(changed), strict=True)) == 1
    wanted = motion.with_values(values).values
    assert np.array_equal(case.read(changed).values, wanted, equal_nan=True)


@each_clip
def test_a_shifted_clip_is_of_the_same_format(case: Case, data: bytes) -> None:
    """All numbers change, and the layout, names and gaps stay."""
    motion = case.back(data)
    if not motion.values.size:
        return
    written = FORMATS[case.format].write(motion.with_values(motion.values + 1))
    again = case.read(written)
    first = motion.skeleton.joints[0].name == "time"  # which is printed with a digit
    wanted = motion.values[:, first:] + 1
    np.testing.assert_allclose(again.values[:, first:], wanted, rtol=0, atol=1e-4)
    assert again.skeleton.joints == motion.skeleton.joints
    assert [s.name for s in again.signals] == [s.name for s in motion.signals]


def damage_source(source: mcz.Source, data: st.DataObject) -> Iterator[mcz.Source]:
    noise = data.draw(st.binary(max_size=40))
    for key in ("template", "detail"):
        good: bytes = getattr(source, key)
        at = data.draw(st.integers(0, len(good)))
        for bad in (noise, good[:at], good + noise, good[:at] + noise + good[at + len(noise) :]):
            yield replace(source, **{key: bad})
    yield replace(source, notes=join_table_notes([(0, 3, noise)]))


@each_clip
@given(choice=st.data())
def test_hostile_templates_are_refused_or_written(
    case: Case, data: bytes, choice: st.DataObject
) -> None:
    motion = case.read(data)
    sources = damage_source(motion.source, choice)
    while True:
        try:
            source = next(sources, None)
            if source is None:
                return
            FORMATS[case.format].write(replace(motion, source=source))
        except mcz.MczError as error:
            assert "\n" not in str(error)
            if isinstance(error, mcz.FormatError) and "notes" in str(error):
                return


TEXTS = [name for name in CASES if name not in ("c3d", "npy", "npz", "pickle")]


@pytest.mark.parametrize("name", TEXTS)
@pytest.mark.parametrize("eol", [b"\n", b"\r\n"])
@pytest.mark.parametrize("mark", [b"", b"\xef\xbb\xbf"])
def test_line_ends_and_marks_change_nothing(name: str, eol: bytes, mark: bytes) -> None:
    case = CASES[name]
    usual = re.sub(rb"\r?\n", b"\n", case.small[0].removeprefix(b"\xef\xbb\xbf"))
    found = case.back(mark + usual.replace(b"\n", eol))
    plain = case.read(usual)
    if name == "asf":
        assert replace(found, source=None) == replace(plain, source=None)
        return
    assert found.skeleton.joints == plain.skeleton.joints
    assert np.array_equal(found.values, plain.values, equal_nan=True)


@pytest.mark.parametrize("name", TEXTS)
@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be", "utf-32"])
def test_wide_text_is_refused_by_its_name(name: str, encoding: str) -> None:
    data = CASES[name].small[0].decode("utf-8-sig").encode(encoding)
    with pytest.raises(mcz.SourceError, match=f"the text is {encoding[:6].upper()}.*save it as"):
        CASES[name].read(data)
