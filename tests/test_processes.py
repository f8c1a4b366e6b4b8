"""Files that outlive the process: pickled, forked, shared by threads, read while they grow."""

from __future__ import annotations

import io
import multiprocessing
import os
import pickle
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mcz
from mcz.container.source import lock
from mcz.files.writing.atomic import replacing
from tests.commands import run
from tests.motions import smooth


@pytest.fixture
def path(tmp_path: Path) -> Path:
    target = tmp_path / "smooth.mcz"
    mcz.write(smooth(400), target, segment_frames=20)
    return target


def test_a_clip_is_pickled_and_opens_its_file_anew(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(path.parent)
    with mcz.open(path.name, max_decoded=10**6, unverified=True) as file:
        data = pickle.dumps((file, list(file.clips.values())))
    monkeypatch.chdir("/")
    file, (clip,) = pickle.loads(data)
    with file:
        np.testing.assert_array_equal(clip.read(), smooth(400).values)
        assert clip.container is file.container
        assert file.container.max_decoded == 10**6
        assert file.container.reads_parts
    with pytest.raises(mcz.OptionError, match="is closed"):
        clip.read()


def test_bytes_are_pickled_and_streams_are_not(path: Path) -> None:
    with mcz.open(path.read_bytes()) as file:
        again = pickle.loads(pickle.dumps(file))
        np.testing.assert_array_equal(again.only_clip().read(), smooth(400).values)
    with (
        mcz.open(io.BytesIO(path.read_bytes())) as file,
        pytest.raises(mcz.OptionError, match="cannot be pickled"),
    ):
        pickle.dumps(file)


def test_a_clip_that_is_gone_says_so(path: Path) -> None:
    with mcz.open(path) as file:
        data = pickle.dumps(file.only_clip())
    mcz.write(replace(smooth(5), name="other"), path, force=True)
    with pytest.raises(mcz.OptionError, match="clip 'smooth' no longer exists"):
        pickle.loads(data)


def _reads(clip: mcz.Clip, start: int) -> bool:
    whole = smooth(400).values
    spans = [(at % 380, at % 380 + 20) for at in range(start, start + 1400, 7)]
    return all(np.array_equal(clip.read(span), whole[slice(*span)]) for span in spans)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system does not fork")
def test_forked_processes_read_one_file(path: Path) -> None:
    context: Any = multiprocessing.get_context("fork")
    with mcz.open(path) as file:
        clip = file.only_clip()
        reading = [context.Process(target=_exit_if_wrong, args=(clip, at)) for at in range(4)]
        for process in reading:
            process.start()  # a fork: it inherits the open file, nothing is pickled
        assert _reads(clip, 4)
        for process in reading:
            process.join()
        assert [process.exitcode for process in reading] == [0] * 4


def _exit_if_wrong(clip: mcz.Clip, start: int) -> None:
    os._exit(0 if _reads(clip, start) else 1)


def test_threads_read_one_file(path: Path) -> None:
    with mcz.open(path) as file, ThreadPoolExecutor(4) as pool:
        assert all(pool.map(lambda at: _reads(file.only_clip(), at), range(4)))


def test_what_a_killed_writer_left_is_taken_away(tmp_path: Path) -> None:
    program = (
        "import os, signal, sys; from mcz.files.writing.atomic import replacing\n"
        "with replacing(sys.argv[1], force=True) as stream:\n"
        "    stream.write(b'half'); stream.flush(); os.kill(os.getpid(), signal.SIGKILL)"
    )
    target = tmp_path / "walk.mcz"
    subprocess.run([sys.executable, "-c", program, str(target)], check=False)
    (left,) = tmp_path.iterdir()
    assert left.read_bytes() == b"half"
    (tmp_path / ".walk.bvh.abcdefgh.part").write_bytes(b"of another name")
    with replacing(target, force=False) as stream:
        assert not left.exists()
        (mine,) = tmp_path.glob(".walk.mcz.*.part")
        with replacing(target, force=True) as other:  # a second writer at the same time
            other.write(b"second")
        assert mine.exists()
        stream.write(b"first")
        target.unlink()
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        ".walk.bvh.abcdefgh.part",
        "walk.mcz",
    ]
    assert target.read_bytes() == b"first"


def test_a_reader_sees_the_last_end_while_another_process_appends(
    path: Path, samples: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    whole = path.read_bytes()
    mcz.append([samples / "walk.bvh"], path)
    more = path.read_bytes()[len(whole) :]
    path.write_bytes(whole)
    with path.open("r+b", buffering=0) as appending:
        assert lock(appending)
        appending.seek(len(whole))
        for piece in (more[:1], more[1:90], more[90:-20]):
            appending.write(piece)
            with mcz.open(path) as file:
                assert file.grows
                assert list(file.clips) == ["smooth"]
                assert np.array_equal(file.only_clip().read(), smooth(400).values)
        assert run("list", path) == 0
        assert "another process is appending" in capsys.readouterr().err
    with pytest.raises(mcz.TruncatedError):  # now nobody is at it
        mcz.open(path)
    path.write_bytes(whole)
    with mcz.open(path) as file:
        assert not file.grows
