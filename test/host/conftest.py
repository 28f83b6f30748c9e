"""Fixtures: the built simulator, a small listing, the command `foldcar`."""

import gc
import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

# One thread of linear algebra, as in the command, before numpy is imported; processes of the tests inherit it.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from browser import close_browser
from foldcar.cli import GARBAGE_THRESHOLD
from foldcar.errors import FoldcarError
from foldcar.installation import keep_caches_in_checkout
from foldcar.scenes import fixed_hash
from foldcar.simulation.carsim import Carsim, CarsimLimits
from foldcar.simulation.engines import MUJOCO, find_carsim
from forked_foldcar import HANGS_S, original
from live_car import write_free_course
from study_car import listing_of
from under_coverage import save_coverage_once

save_coverage_once()
keep_caches_in_checkout()
gc.set_threshold(GARBAGE_THRESHOLD)
# Starting a second process for the samples of each test would take long; its own test does it.
fixed_hash.draws_here = True

PROJECT = Path(__file__).resolve().parents[2]
STEP_PYRAMIDS = PROJECT / "scenarios" / "step_pyramids.scenic"


def pytest_collection_finish() -> None:
    """Leave what all tests have imported out of the collections of garbage."""
    gc.freeze()


def pytest_unconfigure() -> None:
    """End the browser in which tests have opened pages."""
    close_browser()


@pytest.fixture(scope="session")
def carsim_binary() -> Path:
    """The simulator that `make test` builds; the test fails if it is missing."""
    try:
        return find_carsim()
    except FoldcarError as error:
        pytest.fail(str(error))


@pytest.fixture(scope="session")
def native() -> Carsim:
    """The simulator with MuJoCo."""
    return Carsim(engine=MUJOCO)


@pytest.fixture(scope="session")
def carsim_limits(carsim_binary: Path) -> CarsimLimits:
    """The limits and rules of that simulator."""
    return Carsim(carsim_binary).limits()


def two_widths() -> dict[str, Any]:
    """A listing of two widths in three step-pyramid environments."""
    return listing_of(STEP_PYRAMIDS, {"width": [95, 245]}, timeout=120, environments=3)


@pytest.fixture
def listing_data() -> dict[str, Any]:
    """That listing; tests may change it."""
    return two_widths()


@pytest.fixture
def write_listing(tmp_path: Path) -> Callable[[Any], Path]:
    """A function that writes a listing (JSON data or text) to a file and returns its path."""

    def write(content: Any) -> Path:
        file = tmp_path / "listing.json"
        file.write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")
        return file

    return write


@pytest.fixture
def listing(write_listing: Callable[[Any], Path], listing_data: dict[str, Any]) -> Path:
    """The file of that listing, as it is."""
    return write_listing(listing_data)


@pytest.fixture
def foldcar(tmp_path: Path) -> Callable[..., "subprocess.CompletedProcess[str]"]:
    """A function that runs `foldcar` in a temporary folder, with ``env`` and ``input``, in a copy of a process."""

    def run(*words: str | Path, **options: Any) -> "subprocess.CompletedProcess[str]":
        return original().run([*map(str, words)], tmp_path, **options)

    return run


@pytest.fixture
def refused(foldcar: Callable[..., "subprocess.CompletedProcess[str]"]) -> Callable[..., str]:
    """A function that runs `foldcar`, which must refuse in one line and print nothing else; returns that line."""

    def run(*words: str | Path, **options: Any) -> str:
        done = foldcar(*words, **options)
        start, end = "foldcar: error: ", "\n"
        assert (done.returncode, done.stderr.count("\n")) == (2, 1), done.stderr
        assert done.stderr.startswith(start) and done.stderr.endswith(end), done.stderr
        # A session of trials has told of the car by then.
        assert words[0] == "log" or not done.stdout
        return done.stderr[len(start) : -len(end)]

    return run


@pytest.fixture
def new_foldcar(tmp_path: Path) -> Callable[..., "subprocess.CompletedProcess[str]"]:
    """A function that runs `foldcar` in a temporary folder, in a new Python."""

    def run(*words: str | Path, **options: Any) -> "subprocess.CompletedProcess[str]":
        command = [sys.executable, "-c", "from foldcar.__main__ import main; main()", *map(str, words)]
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=HANGS_S, **options)

    return run


@pytest.fixture
def store(tmp_path: Path) -> Path:
    """A store with a row in every table, s.db in the test's folder, and the trials' logs."""
    from full_store import full_store

    return full_store(tmp_path / "s.db")


@pytest.fixture
def start(carsim_binary: Path, tmp_path: Path) -> Iterator[Callable[..., Any]]:
    """A function that starts cars of `carsim link` with the test's folder, which are stopped after the test."""
    from link_client import Car, write_car_files

    cars: list[Car] = []
    write_car_files(tmp_path)

    def begin(*options: str) -> Car:
        cars.append(Car(carsim_binary, tmp_path, *(options if "--tcp" in options else ("--pty", *options))))
        return cars[-1]

    yield begin
    for car in cars:
        if car.process.poll() is None:
            assert car.end() == 0


@pytest.fixture
def free_course(tmp_path: Path) -> Path:
    """The listing l.json of two widths on a course without obstacles, in the test's folder."""
    return write_free_course(tmp_path)
