"""A cluster as the engine: the same bytes; nothing lost with a machine, nothing twice."""

from __future__ import annotations

import os
import pickle
import shutil
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import mcz
from mcz import MczError
from mcz.files import dask
from mcz.files.dask import map_clips, pack, skeletons_beside, verify
from tests.commands import run


@pytest.fixture(scope="module")
def folder(samples: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("root")
    for place in ("amc", "asf", "bvh", "copy", "more"):
        (root / place).mkdir()
    shutil.copy(samples / "walk.amc", root / "amc")
    shutil.copy(samples / "walk.asf", root / "asf")
    for place in ("bvh", "copy"):
        shutil.copy(samples / "walk.bvh", root / place)
    shutil.copy(samples / "walk.c3d", root / "walk.c3d")
    shutil.copy(samples / "walk.bvh", root / "walk.bvh")
    (root / "more/broken.bvh").write_bytes(b"HIERARCHY\nROOT")
    (root / "more/read me.txt").write_bytes(b"hello\n")
    return root


@pytest.fixture(scope="module")
def expected_pack(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Any]]:
    """One process's archive of the folder, and its report."""
    target = tmp_path_factory.mktemp("packed") / "all.mcz"
    return target, report_rows(mcz.pack(folder, target))


def report_rows(report: mcz.Report) -> list[Any]:
    return [(o.path, o.result, o.size, o.message, o.notes) for o in report.outcomes]


# Without a cluster ---------------------------------------------------------------


class Client:
    """A small stand-in for ``distributed.Client``; each task runs twice, as if lost once."""

    scheduler = SimpleNamespace(address="here")

    def __init__(self) -> None:
        self.keys: set[str] = set()

    def nthreads(self) -> dict[str, int]:
        return {"worker": 2}

    def submit(self, function: Callable[..., Any], *words: Any, key: str, retries: int) -> Any:
        assert key not in self.keys
        self.keys.add(key)
        message = pickle.dumps((function, words))
        again, given = pickle.loads(message)
        again(*given)
        answer = pickle.loads(pickle.dumps(function(*words)))
        nothing = lambda: None  # noqa: E731
        return SimpleNamespace(result=lambda: answer, release=nothing, cancel=nothing)


def test_pack_has_the_bytes_of_one_process(
    folder: Path, expected_pack: tuple[Path, list[Any]], tmp_path: Path
) -> None:
    pytest.importorskip("distributed")
    report = pack(folder, tmp_path / "all.mcz", Client())
    assert report_rows(report) == expected_pack[1]
    assert (tmp_path / "all.mcz").read_bytes() == expected_pack[0].read_bytes()


def test_clips_are_read_in_order(expected_pack: tuple[Path, list[Any]]) -> None:
    pytest.importorskip("distributed")
    assert verify(expected_pack[0], Client()) == []
    lengths = map_clips(expected_pack[0], lambda clip: (clip.name, clip.n_frames), Client())
    with mcz.open(expected_pack[0]) as file:
        assert lengths == [(clip.name, clip.n_frames) for clip in file]
    some = map_clips(expected_pack[0], lambda clip: clip.name, Client(), where="name == 'amc/walk'")
    assert some == ["amc/walk"]
    with pytest.raises(ZeroDivisionError):
        map_clips(expected_pack[0], lambda clip: 1 / 0, Client())
    with (
        expected_pack[0].open("rb") as stream,
        pytest.raises(mcz.OptionError, match="cannot|can open"),
    ):
        map_clips(stream, lambda clip: 1, Client())


def test_a_cluster_without_workers_is_an_error(folder: Path, tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    client = Client()
    client.nthreads = dict  # type: ignore[method-assign,assignment]
    with pytest.raises(mcz.WorkerError, match="has no worker"):
        pack(folder, tmp_path / "all.mcz", client)
    assert list(tmp_path.iterdir()) == []


def test_no_dask_is_said(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "distributed", None)
    with pytest.raises(mcz.OptionError, match=r"pip install 'mcz\[dask\]'"):
        pack(folder, tmp_path / "all.mcz", "tcp://127.0.0.1:1")


def test_which_skeletons_go_along() -> None:
    skeletons = ["07.asf", "a/07.asf", "a/ASF/07.asf", "a/b/07.asf", "asf/x.asf"]
    assert skeletons_beside("a/b/07.amc", skeletons) == ("a/ASF/07.asf", "a/b/07.asf")
    assert skeletons_beside("a/07.amc", skeletons) == ("a/07.asf", "asf/x.asf")
    assert skeletons_beside("07.amc", skeletons) == ("07.asf",)
    assert skeletons_beside("a/07.bvh", skeletons) == ()


def test_sources_from_a_store(
    folder: Path, expected_pack: tuple[Path, list[Any]], tmp_path: Path
) -> None:
    pytest.importorskip("distributed")
    import fsspec

    store = fsspec.filesystem("memory")
    store.put(str(folder), "/takes", recursive=True)
    try:
        report = pack("memory://takes", "memory://out/all.mcz", Client())
        assert store.cat_file("/out/all.mcz") == expected_pack[0].read_bytes()
        failed = [o.message for o in report.failures]
        assert len(failed) == 1
        assert failed[0].startswith("memory://takes/more/broken.bvh: ")
        with pytest.raises(mcz.ExistsError):
            pack("memory://takes", "memory://out/all.mcz", Client())
        with pytest.raises(mcz.OptionError, match="the folder contains no file"):
            pack("memory://nothing", tmp_path / "x.mcz", Client())
    finally:
        store.rm("/takes", recursive=True)
        store.rm("/out", recursive=True)


# With one ------------------------------------------------------------------------

on_a_cluster = pytest.mark.filterwarnings("default")


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    """Two processes of one thread, with a scheduler."""
    distributed = pytest.importorskip("distributed")
    options = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None}
    with distributed.LocalCluster(processes=True, host="127.0.0.1", **options) as cluster:
        yield cluster


@pytest.mark.cluster
@on_a_cluster
def test_a_cluster_packs_and_verifies(
    cluster: Any, folder: Path, expected_pack: tuple[Path, list[Any]], tmp_path: Path
) -> None:
    target = tmp_path / "all.mcz"
    words = ["pack", str(folder), str(target), "--scheduler", cluster.scheduler_address]
    assert run(*words) == 1  # broken.bvh
    assert target.read_bytes() == expected_pack[0].read_bytes()
    assert verify(target, cluster.scheduler_address) == []
    assert map_clips(target, lambda clip: clip.n_frames, cluster.scheduler_address)


def slow(state: Any, ask: Any) -> Any:
    """Encode slowly, so that a worker can be killed in the middle."""
    from mcz.files.dask import encode_remotely

    time.sleep(0.3)
    return encode_remotely(state, ask)


@pytest.mark.cluster
@on_a_cluster
def test_a_worker_that_is_killed_takes_no_clip_along(
    cluster: Any, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from distributed import Client as RealClient

    root = tmp_path / "root"
    root.mkdir()
    text = (folder / "walk.bvh").read_bytes()
    for number in range(24):  # no two are the same
        (root / f"{number:02}.bvh").write_bytes(text + b"\n" * number)
    mcz.pack(root, tmp_path / "one.mcz")
    monkeypatch.setattr(dask, "encode_remotely", slow)
    killed: list[int] = []

    def kill_one(done: int, total: int, what: str) -> None:
        if done == 6:
            pid = next(iter(client.run(os.getpid).values()))
            os.kill(pid, 9)
            killed.append(pid)

    with RealClient(cluster.scheduler_address) as client:
        report = pack(root, tmp_path / "two.mcz", client, progress=kill_one)
    assert killed
    assert [o.result for o in report.outcomes] == ["parsed"] * 24
    assert (tmp_path / "two.mcz").read_bytes() == (tmp_path / "one.mcz").read_bytes()


def fatal(state: Any, ask: Any) -> Any:
    if ask.encoder.name == "walk.c3d":
        os._exit(1)
    from mcz.files.dask import encode_remotely

    return encode_remotely(state, ask)


@pytest.mark.cluster
@on_a_cluster
def test_a_file_that_ends_its_workers_is_reported(
    cluster: Any, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dask, "encode_remotely", fatal)
    report = pack(folder, tmp_path / "all.mcz", cluster.scheduler_address)
    failed = {o.path: o.message for o in report.failures}
    assert set(failed) == {"walk.c3d", "more/broken.bvh"}
    assert "machines that worked on it were lost" in failed["walk.c3d"]
    assert mcz.verify(tmp_path / "all.mcz") == []


@pytest.mark.cluster
@on_a_cluster
def test_an_object_store(
    cluster: Any,
    folder: Path,
    expected_pack: tuple[Path, list[Any]],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """An S3 server on this machine, which the test starts: sources and target lie in it."""
    pytest.importorskip("s3fs")
    server = pytest.importorskip("moto.server").ThreadedMotoServer(ip_address="127.0.0.1", port=0)
    server.start()
    try:
        host, port = server.get_host_and_port()
        settings = {
            "AWS_ACCESS_KEY_ID": "test",
            "AWS_SECRET_ACCESS_KEY": "test",
            "AWS_ENDPOINT_URL": f"http://{host}:{port}",
            "AWS_DEFAULT_REGION": "us-east-1",
        }
        for name, value in settings.items():
            monkeypatch.setenv(name, value)
        import fsspec
        from distributed import Client as RealClient

        store = fsspec.filesystem("s3")
        store.mkdir("takes")
        for path in folder.rglob("*"):
            if path.is_file():
                store.pipe_file(f"takes/in/{path.relative_to(folder)}", path.read_bytes())
        with RealClient(cluster.scheduler_address) as client:
            client.run(configure, settings)
            report = pack("s3://takes/in", "s3://takes/all.mcz", client)
            assert [o.path for o in report.failures] == ["more/broken.bvh"]
            assert store.cat_file("takes/all.mcz") == expected_pack[0].read_bytes()
            assert verify("s3://takes/all.mcz", client) == []
            names = map_clips("s3://takes/all.mcz", lambda clip: clip.name, client)
            with mcz.open(expected_pack[0]) as file:
                assert names == list(file.clips)
            check_interrupted_pack(client, store)
    finally:
        server.stop()


def configure(settings: dict[str, str]) -> None:
    os.environ.update(settings)


def check_interrupted_pack(client: Any, store: Any) -> None:
    """A pack that is given up leaves nothing in the store."""

    def stop(done: int, total: int, what: str) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        pack("s3://takes/in", "s3://takes/half.mcz", client, progress=stop)
    store.invalidate_cache()
    assert not store.exists("takes/half.mcz")


def test_what_machines_were_lost_with_is_asked_for_again() -> None:
    pytest.importorskip("distributed")
    keys: list[str] = []

    def result() -> Any:
        if len(keys) < wanted:
            raise OSError("timed out")
        return True, "fine"

    def submit(*words: Any, key: str, retries: int) -> Any:
        keys.append(key)
        return SimpleNamespace(result=result, release=lambda: None)

    client = SimpleNamespace(submit=submit)
    wanted = 3
    assert dask.Task(client, "key", b"", 1).answer() == "fine"
    assert len(set(keys)) == 3
    keys.clear()
    wanted = 4
    with pytest.raises(MczError, match="the cluster is lost: timed out"):
        dask.Task(client, "key", b"", 1).answer()
