"""Fixtures: the built simulator, a small listing, the command `foldcar`."""

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from foldcar.errors import FoldcarError
from foldcar.simulation.carsim import Carsim, CarsimLimits
from foldcar.simulation.engines import MUJOCO, find_carsim
from forked_foldcar import HANGS_S, original
from live_car import write_free_course
from under_coverage import save_coverage_once

save_coverage_once()

PROJECT = Path(__file__).resolve().parents[2]
STEP_PYRAMIDS = PROJECT / "scenarios" / "step_pyramids.scenic"


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


@pytest.fixture
def listing_data() -> dict[str, Any]:
    """A listing of two widths in three step-pyramid environments; tests may change it."""
    return {
        "experiments": {"1": {"veh_id": 1, "env_id": 1, "params": {"timeout": 120, "environments": 3}}},
        "vehicles": {"1": {"type": "W_B_W", "params": [{"common": {"width": [95, 245]}}]}},
        "environments": {"1": {"scenic_filename": str(STEP_PYRAMIDS), "seed": 42}},
    }


@pytest.fixture
def write_listing(tmp_path: Path) -> Callable[[Any], Path]:
    """A function that writes a listing (JSON data or text) to a file and returns its path."""

    def write(content: Any) -> Path:
        file = tmp_path / "listing.json"
        file.write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")
        return file

    return write


@pytest.fixture
def foldcar(tmp_path: Path) -> Callable[..., "subprocess.CompletedProcess[str]"]:
    """A function that runs `foldcar` in a temporary folder, with ``env`` and ``input``, in a copy of a process."""

    def run(*words: str | Path, **options: Any) -> "subprocess.CompletedProcess[str]":
        return original().run([*map(str, words)], tmp_path, **options)

    return run


@pytest.fixture
def new_foldcar(tmp_path: Path) -> Callable[..., "subprocess.CompletedProcess[str]"]:
    """A function that runs `foldcar` in a temporary folder, in a new Python."""

    def run(*words: str | Path, **options: Any) -> "subprocess.CompletedProcess[str]":
        command = [sys.executable, "-c", "from foldcar.cli import main; main()", *map(str, words)]
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=HANGS_S, **options)

    return run


@pytest.fixture
def store(tmp_path: Path) -> Path:
    """A store of this version with runs, records and trials, s.db in the test's folder, and the trials' logs."""
    from foldcar.store.migrations import VERSION
    from old_stores import old_store

    return old_store(VERSION, tmp_path / "s.db")


@pytest.fixture
def free_course(tmp_path: Path) -> Path:
    """The listing l.json of two widths on a course without obstacles, in the test's folder."""
    return write_free_course(tmp_path)
