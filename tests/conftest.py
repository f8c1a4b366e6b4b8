"""Hypothesis profiles, markers and the fixtures that several test files share."""

from __future__ import annotations

import gc
import os
import shutil
import signal
from collections.abc import Generator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from tests.commands import Call, Result, run

# No deadlines: the first call of a compiled function takes seconds, later ones microseconds.
settings.register_profile("dev", max_examples=30, deadline=None)
settings.register_profile(
    "ci",
    max_examples=25,
    deadline=None,
    derandomize=True,  # a build must not fail by luck
    print_blob=True,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.register_profile("full", max_examples=1000, deadline=None, print_blob=True)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "dev"))

DATA = os.environ.get("MCZ_DATA", "")
# No test builds the page of mcz view: this one does nothing, but has a place for files.
os.environ["MCZ_VIEWER_PAGE"] = str(Path(__file__).with_name("viewing") / "page.html")

# A shell's background jobs ignore interrupts, and so would the commands that tests interrupt.
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if "real" in item.keywords and not DATA:
            item.add_marker(pytest.mark.skip(reason="MCZ_DATA is not set"))
        if {"long", "cluster"} & set(item.keywords) and not os.environ.get("MCZ_LONG"):
            item.add_marker(pytest.mark.skip(reason="MCZ_LONG is not set"))


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Thousands of tests are held for good: no collection of garbage looks through them."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()
        gc.freeze()


@pytest.fixture(scope="session")
def data() -> Path:
    """The folder of real motion files; only tests marked ``real`` may ask for it."""
    return Path(DATA)


@pytest.fixture(scope="session")
def samples(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with walk.asf, .amc, .bvh and .c3d; tests read it and never write into it."""
    from mcz.sources.sample import write_samples

    folder = tmp_path_factory.mktemp("samples")
    write_samples(folder)
    return folder


@pytest.fixture
def folder(samples: Path, tmp_path: Path) -> Path:
    """A folder of one's own with the sample files."""
    shutil.copytree(samples, tmp_path, dirs_exist_ok=True)
    return tmp_path


@pytest.fixture
def call(capsys: pytest.CaptureFixture[str]) -> Call:
    """``mcz`` with these arguments, in this process."""
    return lambda *arguments: Result(run(*arguments), *capsys.readouterr())
